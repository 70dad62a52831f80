//! The commands of `pkm-host`.

pub mod commands;
pub mod output;
pub(crate) mod progress;
