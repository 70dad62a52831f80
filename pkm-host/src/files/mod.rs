//! Files that the program reads: from bytes to checked values, with file, line and column of what is wrong.

pub mod csv;
pub mod dataset;
pub mod elements;
pub mod gcode;
pub mod head;
pub mod import;
pub mod job;
pub mod job_program;
pub mod limits;
pub mod machine;
pub mod machine_edit;
mod machine_raw;
pub mod measured;
pub mod path;
pub mod points;
pub mod readings;
pub mod reflectors;
pub mod results;
pub mod solid;
pub mod source;
pub mod table;
pub mod table_numbers;
pub(crate) mod toml_error;
pub mod tool_path;
pub mod tools;
pub mod unloaded;
mod wrist;
