//! A real parallel machine on four belts, diagnosed from readings that its maker published: docs/measured-machine.md.
//!
//! The sled hangs in a vertical frame on two upper belts; two lower belts are pulled while the lengths are read. Where the
//! sled is is not measured: each reading has four lengths and two unknown coordinates, so that two conditions of closure
//! are left of it. Only these go to the statistics of `pkm-diagnosis`, to which this crate is a client like `pkm-host`.
//!
//! [`files`] (the published text files) → [`machine`] (geometry and statics) → [`model`] (conditions, candidates) →
//! [`diagnosis`] (what the model lacks) → [`study`] (all runs, each predicted by fits of the others),
//! [`recursive`] (one by one) → [`report`], [`picture`].

pub mod diagnosis;
pub mod files;
pub mod machine;
pub mod model;
pub mod picture;
pub mod recursive;
pub mod report;
pub mod study;
