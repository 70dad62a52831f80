//! What an engineer runs beside the controller: `pkm-host`.
//!
//! Data flows one way, as in a compiler, and a room imports from rooms above it in this list alone:
//!
//! 1. [`error`], [`pose`]: failures; poses as plain numbers; [`files`]: machine, job, table, CSV and G-code, from bytes to checked
//!    values; [`loads`]: from a load cell's log to the load of each reading. A crate of their own, `pkm-files`
//! 2. [`progress`]: how far a computation is; [`page`]: what all reports are made of
//! 3. [`tracker`]: from its points to deflections
//! 4. [`fit`], [`diagnose`], [`geometry`], [`plan`], [`fem`], [`replay`], [`hil`]: each computes, and uses those before it at the most
//! 5. [`report`]: from a finished result to pages and pictures
//! 6. [`cli`]: the commands

// fails where standard error cannot be written, and ends the work with it
#![deny(clippy::print_stderr)]

pub mod cli;
pub mod diagnose;
pub mod fem;
pub mod fit;
pub mod geometry;
pub mod hil;
pub mod page;
pub mod plan;
pub mod progress;
pub mod replay;
pub mod report;
pub mod tracker;

pub use pkm_files::{self as files, error, loads, pose};
