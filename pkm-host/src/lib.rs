//! What an engineer runs beside the controller: `pkm-host`.
//!
//! Data flows one way, as in a compiler, and a room imports from rooms above it in this list alone:
//!
//! 1. [`error`], [`pose`], [`progress`]: failures; poses as plain numbers; how far a computation is
//! 2. [`files`]: machine, job, table, CSV and G-code, from bytes to checked values; [`tracker`]: from its points to deflections; [`loads`]: from a
//!    load cell's log to the load of each reading
//! 3. [`fit`], [`diagnose`], [`geometry`], [`plan`], [`fem`], [`hil`], [`replay`]: each computes, none from another's results
//! 4. [`report`]: from a finished result to pages, charts and generated source
//! 5. [`cli`]: the commands

pub mod cli;
pub mod diagnose;
pub mod error;
pub mod fem;
pub mod files;
pub mod fit;
pub mod geometry;
pub mod hil;
pub mod loads;
pub mod plan;
pub mod pose;
pub mod progress;
pub mod replay;
pub mod report;
pub mod tracker;
