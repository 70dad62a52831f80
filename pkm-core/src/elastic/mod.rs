//! What yields between the ground and the moving platform, in terms of the wrenches that limbs transmit.
//!
//! A [`Chain`] is a limb (or two that are coupled) with everything elastic in it; [`Limb`] is where a place of it and its axes
//! are; [`Series`] is elastic between the whole mechanism and the ground or the tool. Neither knows machines, poses or
//! effects: those are built from them.

mod chain;
mod limb;
mod series;

pub(crate) use chain::{ALL, Chain};
pub(crate) use limb::Limb;
pub use limb::LimbFrame;
pub(crate) use series::{Series, motions, soften, stiffen};
