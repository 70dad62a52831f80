//! Finds what a forward model lacks, from readings. It knows no machine: a client gives [`Observations`] and a
//! [`ForwardModel`], and words for what is found. The method is in docs/theory.md, Diagnosis.
//!
//! [`Observations::check`] → [`gross`] errors out → [`Noise`] → [`Whitener`] → [`Problem`] (fits with priors) → [`Levels`] (errors that readings have in common) →
//! [`search`](search::search) (screen, full fits, acceptance) → [`judge`](verdict::judge) →
//! [`validation`] (errors on poses left out), [`residuals`], [`design`] (what to measure next). Before anything is read: [`campaign`]. [`Rules`] has the thresholds,
//! each with its reason.
//!
//! # A machine of one's own
//!
//! `tests/engine/spring_chain.rs` is a whole client in 150 lines, `tests/engine/places.rs` its blocks. In order:
//! - [`Observations`]: a condition (pose and load) has one prediction in each channel; readings of one condition with one `repeat_of` are repeats, and
//!   those of one `series` share a zero. All numbers count from 0. [`Reading::sigma`] is without the zero; [`Covariance`] can declare both. What comes
//!   from a file goes through [`Observations::check`].
//! - [`ForwardModel`]: unknowns in units of their priors, 0 the declared machine. Declared values and amplitudes of candidates are unknowns of their own:
//!   a candidate of [`Kind::DeclaredValues`] has an amplitude with a [`Prior::LogNormal`] that scales the declared ones, and no declared unknown in it.
//!   At least one value is declared. [`CommonErrors`] are `None` where there are none; their levels ([`Rules::load_error_levels`]) are relative sizes.
//! - [`Noise::estimate`], [`Whitener::new`], [`Problem::new`], [`levels::whiteners`], [`Levels::new`]; then [`search::search`] and [`judge`](verdict::judge)
//!   over candidates, or [`places::infer`] over blocks, whose columns are whitened by [`Problem::whitened`].
//! - Fewer poses or degrees of freedom than [`Rules::min_poses`] and [`Rules::min_dof_of_verdict`], and what a place's probability has to be for it to
//!   be named ([`Rules::min_located_probability`]), are for the client to ask: the engine computes what it is given.

pub mod campaign;
mod class;
pub mod design;
pub mod drift;
mod extend;
mod fit;
pub mod gross;
pub mod levels;
mod model;
mod noise;
mod observations;
pub mod places;
pub mod residuals;
pub mod robust;
pub mod rounding;
mod rules;
pub mod screening;
pub mod search;
mod solve;
pub mod student;
pub mod validation;
pub mod verdict;
mod whitening;
mod zeros;

/// Vectors and matrices in this crate's signatures are its own.
pub use nalgebra;

pub use extend::{columns, extended};
pub use fit::{Fit, product};
pub use levels::Levels;
pub use model::{Candidate, CommonErrors, ForwardModel, Kind, Parameter, Prior, Role, Unknown};
pub use noise::{Noise, NoiseSource, UnknownNoise};
pub use observations::{BadReading, Channel, Covariance, Flaw, Observations, Reading};
pub use rules::{Rules, SEED};
pub use search::Search;
pub use solve::{CommonGroup, Problem};
pub use whitening::{Entry, Whitener};
