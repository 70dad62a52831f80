//! Finds what a forward model lacks, from readings. It knows no machine: a client gives [`Observations`] and a
//! [`ForwardModel`], and words for what is found. The method is in docs/theory.md, Diagnosis.
//!
//! [`gross`] errors out → [`Noise`] → [`Whitener`] → [`Problem`] (fits with priors) → [`Levels`] (errors that readings have in common) →
//! [`search`](search::search) (screen, full fits, acceptance) → [`judge`](verdict::judge) →
//! [`validation`] (errors on poses left out), [`residuals`], [`design`] (what to measure next). Before anything is read: [`campaign`]. [`Rules`] has every number
//! that decides.

pub mod campaign;
mod class;
pub mod design;
mod extend;
mod fit;
pub mod gross;
pub mod levels;
mod model;
mod noise;
mod observations;
pub mod places;
pub mod residuals;
mod rules;
pub mod screening;
pub mod search;
mod solve;
pub mod student;
pub mod validation;
pub mod verdict;
mod whitening;
mod zeros;

pub use extend::{columns, extended};
pub use fit::{Fit, product};
pub use levels::Levels;
pub use model::{Candidate, CommonErrors, ForwardModel, Kind, Parameter, Prior, Role, Unknown};
pub use noise::{Noise, NoiseSource, UnknownNoise};
pub use observations::{Channel, Covariance, Observations, Reading};
pub use rules::{Rules, SEED};
pub use search::Search;
pub use solve::{CommonGroup, Problem};
pub use whitening::{Entry, Whitener};
