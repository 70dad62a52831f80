//! What an engineer runs beside the controller: `pkm-host`.
//!
//! Data flows one way. A module imports from lines above its own alone, and a page's text and pictures (`report` inside of
//! a module) from that module and from what stands above it:
//!
//! 1. [`error`], [`output`], `progress`: failures, what a command prints, bars
//! 2. [`pose`], [`path`], [`holds`]: poses, moves and ways to hold a tool, as plain numbers
//! 3. [`source`], [`plot`]: bytes in and out of files, charts
//! 4. `toml_error`, `report`: TOML in words, the design of all pages
//! 5. [`solid`]: what limbs and platforms are made of
//! 6. [`machine_file`]: the machine, checked
//! 7. [`dataset`]: CSV of poses and stiffness, checked
//! 8. [`reach`]: which way a tool is held, or by how much there is none
//! 9. [`readings`], [`gcode`], [`plan`]: measured data; programs; poses to measure at
//! 10. [`table_numbers`]: a table as the core borrows it
//! 11. [`fit`]: from stiffness to a table
//! 12. [`table_file`]: a table with where it comes from, as `coefficients.json`
//! 13. [`export`]: `coefficients.rs`, and `report` in [`fit`], which quotes its head
//! 14. [`ik`], [`compensate`], [`fem`], [`map`], [`place`], [`hil`], [`diagnose`]: each a command's work, none of another's
//! 15. [`commands`]: puts them together

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
