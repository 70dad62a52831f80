//! The reader and the inference on simulated readings, and the figures of docs/measured-machine.md on the real ones.

mod inference;
mod published;
mod reader;
mod simulated;
