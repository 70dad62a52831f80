//! What an engineer runs beside the controller: `pkm-host`.
//!
//! Data flows one way. A module imports from lines above its own alone, and a page's text and pictures (`report` inside of
//! a module) from that module and from what stands above it:
//!
//! 1. [`error`], [`output`], `progress`: failures, what a command prints, bars
//! 2. [`pose`], [`path`], [`holds`]: poses, moves and ways to hold a tool, as plain numbers
//! 3. [`source`]: bytes in and out of files
//! 4. `toml_error`: TOML in words
//! 5. [`plot`], `report`: charts, the design of all pages
//! 6. [`solid`]: what limbs and platforms are made of
//! 7. [`machine_file`]: the machine, checked
//! 8. [`dataset`]: CSV of poses and stiffness, checked
//! 9. [`reach`]: which way a tool is held, or by how much there is none
//! 10. [`readings`], [`gcode`], [`plan`]: measured data; programs; poses to measure at
//! 11. [`table_numbers`]: a table as the core borrows it
//! 12. [`fit`]: from stiffness to a table
//! 13. [`table_file`]: `coefficients.json`
//! 14. [`export`]: `coefficients.rs`, and `report` in [`fit`], which quotes its head
//! 15. [`ik`], [`compensate`], [`fem`], [`map`], [`place`], [`hil`], [`diagnose`]: each a command's work, none of another's
//! 16. [`commands`]: puts them together

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
