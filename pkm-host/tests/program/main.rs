//! Tests of the program, mostly from outside: what its commands print, write and refuse. One binary, since each links all of it.

mod bad_input;
mod calculix;
mod cli;
mod common;
mod cutting;
mod demo;
mod diagnose;
mod docs;
mod fem;
mod fixtures;
mod gcode;
mod gcode_programs;
mod hil;
mod import;
mod inverse_all;
mod limits;
mod map;
mod path;
mod place;
mod properties;
mod readings;
mod replay;
mod reports;
mod tracker;
mod unloaded;
mod view;
