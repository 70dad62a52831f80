//! Files that `pkm-host` reads and writes: from bytes to checked values, with file, line and column of what is wrong, and back, whole or
//! not at all. A crate of its own, since nothing of it is computed with for long: it is built quickly, and for fuzzing alone.

pub mod clock;
pub mod csv;
pub mod cutting;
pub mod dataset;
pub mod elements;
pub mod error;
pub mod gcode;
pub mod head;
pub mod import;
pub mod job;
pub mod job_program;
pub mod learn;
pub mod limits;
pub mod load_log;
pub mod loads;
pub mod log;
pub mod machine;
pub mod machine_edit;
mod machine_raw;
pub mod measured;
pub mod path;
pub mod points;
pub mod pose;
pub mod readings;
pub mod reflectors;
pub mod results;
pub mod solid;
pub mod source;
pub mod table;
pub mod table_numbers;
mod toml_error;
pub mod tool_path;
pub mod tools;
pub mod unloaded;
pub mod verified;
mod wrist;
