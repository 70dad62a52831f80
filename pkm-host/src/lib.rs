//! What an engineer runs beside the controller: `pkm-host`.
//!
//! Data flows one way: [`source`] (bytes) → [`machine_file`], [`dataset`], [`table_file`] (checked) → [`fit`]
//! (model) → [`export`] (result) → `report` (the design of all pages). [`commands`] puts them together.

pub mod commands;
pub mod compensate;
pub mod dataset;
pub mod diagnose;
pub mod error;
pub mod export;
pub mod fem;
pub mod fit;
pub mod gcode;
pub mod hil;
pub mod holds;
pub mod ik;
pub mod machine_file;
pub mod map;
pub mod output;
pub mod path;
pub mod place;
pub mod plan;
pub mod plot;
pub mod pose;
mod progress;
pub mod reach;
pub mod readings;
mod report;
pub mod solid;
pub mod source;
pub mod table_file;
pub mod table_numbers;
mod toml_error;
