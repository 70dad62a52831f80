//! From a finished result to what people read: pages, pictures, text, JSON.

pub mod compensate;
pub(crate) mod demo;
pub mod drawing;
pub mod fem;
pub mod fit;
pub mod hil;
pub mod map;
mod paper;
mod path3d;
pub mod place;
pub mod replay;
pub mod stiffness;
pub(crate) mod verify;
pub mod view;

/// Farther than a machine tool yields, m: loads in other units.
const IMPLAUSIBLE_M: f64 = 1e-3;

/// What is said of the greatest displacement of a tip where it is hardly one; `moves` says what does what to it.
fn implausible(moves: &str, most_m: f64) -> Option<String> {
    (most_m > IMPLAUSIBLE_M).then(|| {
        format!(
            "{moves} {:.2} mm, farther than a machine tool yields: are forces in N and moments in N·m?",
            most_m * 1e3
        )
    })
}
