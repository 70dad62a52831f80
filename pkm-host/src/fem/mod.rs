//! The stiffness of a machine that is built in solids, by CalculiX, pose by pose: what the paper takes from a commercial program
//! (its Section 5.1).
//!
//! Machine file → [`Solid`](crate::files::solid::Solid) → [`mesh`], [`deck`] → [`ccx`] → stiffness → [`readings`].

use std::path::Path;

pub use self::cases::{Case, Model, Solved, cases_of, clear, compute, gather};

mod cases;
pub mod ccx;
pub mod deck;
pub mod mesh;
pub mod readings;
pub mod slurm;

/// How a stiffness is computed.
pub struct Settings<'a> {
    /// Changes of the machine file, `key.key=value`.
    pub set: &'a [String],
    /// Size of the elements, relative to the usual.
    pub size: f64,
    /// Poses at a time.
    pub jobs: usize,
    /// The program.
    pub ccx: &'a Path,
    /// Decks and all that CalculiX wrote stay.
    pub keep: bool,
}
