//! The core against independent code. One program, so that a change of the core is built against once.

mod compensation;
mod compensator;
mod contact;
mod correction;
mod effects;
mod elements;
mod errors;
mod estimation;
mod firmware_compensation;
mod five_axis;
mod integrity;
mod kinematics;
mod machine;
mod probe_gain;
mod slots;
mod stiffness;
mod switched_on;
mod uncertainty;
mod weight;
