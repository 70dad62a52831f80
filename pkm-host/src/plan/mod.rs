//! Where to measure, where to put the workpiece, how stiff the machine is where, and how to move the tool.

pub mod compensate;
pub mod cutting;
pub mod feed;
pub mod inverse_all;
pub mod map;
pub mod model;
pub mod place;
pub mod play;
pub mod poses;
pub mod reach;
pub mod track;
