//! What the machine learns while it works: every known load under which the place of the tool is read (a probe, a load cell
//! against a stop, a cut of known force) tells something of what has changed since its table was made.
//!
//! An [`Estimator`] holds up to eight [`Amplitude`]s, their covariance, and what it needs to judge readings. Two calls:
//!
//! - [`Estimator::learn`], where something was read: predicts the deflection by machine and table and takes in what was read
//!   beyond it. A reading that is refused leaves every amplitude as it was.
//! - [`Estimator::follow`], every period: what is used for compensation goes to what is worth compensating of each change since acceptance
//!   ([`Estimator::targets`]), no faster than its rate.
//!
//! [`Model::with_learned`](crate::Model::with_learned) gives it to a compensator, which compensates no more of it than is known.
//!
//! | what | [`Refusal`] |
//! |---|---|
//! | a reading that is not finite, or its deviation not above 0; no component, or more than six | `NotFinite`, `Components` |
//! | time runs backwards | `Backwards` |
//! | a load too small to tell anything | `NotExcited` |
//! | the same numbers five times in a row, or the same in one component that should have moved | `Stuck` |
//! | the tip goes against the deflection that the load makes | `WrongSign` |
//! | further from what is expected than noise ever is | `Unexpected` |
//! | no deflection: a pose out of reach, or a pose, load or temperature that is not finite | `Model` |
//!
//! **Change.** The covariance grows by the drift that is allowed, up to what was unknown at the start: without readings it does
//! not run away. What comes suddenly shows as innovations of one sign: their sum over some sixteen readings, weighted as an
//! amplitude would weight them, is normal of variance 1 while nothing changes. Beyond [`CHANGE_SD`] the amplitudes
//! that explain it, and those that do so nearly as well, count as unknown again, and the next readings tell them apart. Readings that are refused as unexpected count in this sum too, each as
//! three deviations at most: one spike opens nothing, and of five of the same sign the last is taken in with what it opens, if that
//! explains it. If not it is no change, but a broken sensor: all stays as it was, and the sum begins anew.
//!
//! **Alarm.** [`Estimator::alarms`] says of each amplitude whether it has changed since acceptance by more than its settings allow.

mod amplitude;
mod estimator;
mod filter;
mod reading;
mod settings;
mod state;
mod tip;

pub use amplitude::Amplitude;
pub use estimator::{CHANGE_SD, Estimator};
pub use reading::{Alarm, Learned, MAX_COMPONENTS, Refusal, TipEstimate, TipReading, Touch};
pub use settings::{AmplitudeSettings, EstimatorSettings, EstimatorSettingsError, MAX_AMPLITUDES};
pub use state::{Slot, StateError, newest, state_bytes};
