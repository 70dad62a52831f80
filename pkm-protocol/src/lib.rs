//! Line protocol between a controller that runs `pkm-core` and a host: JSON, a command a line, a reply a line.
//!
//! ```text
//! {"v":1,"id":1,"cmd":"hello"}
//! {"v":1,"id":2,"cmd":"status"}
//! {"v":1,"id":3,"cmd":"cycle","arithmetic":"f64","theta_rad":0.1,"sigma_rad":-0.05,"z0_m":0.53,
//!  "force_n":[0,0,-400],"moment_nm":[0,0,5],"tip_m":[0,0,0.3]}
//! {"v":1,"id":4,"cmd":"sweep","to":[0.2,0.1,0.55],"steps":1000,"arithmetic":"f64", …as for cycle}
//! ```
//!
//! (each on one line). `sweep` goes in a straight line from the pose to `to` = [θ, σ, Z0], a step a period, and sums up the results
//! and a checksum of all their bits. `v` is [`VERSION`], `id` any `u32`, which the reply repeats:
//!
//! ```text
//! {"v":1,"id":3,"answer":{"cycle":{"status":"ok","ticks":7312,"overrun":false,"numbers":{"q_m":[…],…}}}}
//! {"v":1,"id":4,"answer":{"sweep":{"ok":1000,"outside_box":0,"refused":0,"overruns":0,"worst_ticks":7312,"results":"93b1c5a0e4d2f786"}}}
//! {"v":1,"id":null,"answer":{"error":"syntax"}}
//! ```
//!
//! A command has exactly its own fields. Numbers are JSON's, as the shortest decimal that reads back to the same bits; those of a
//! reply are of the arithmetic that was asked for. A bad line gets an error with a [`Code`] and changes nothing. Blank lines get no
//! reply. [`Lines`] finds the next line after anything.

#![no_std]
#![forbid(unsafe_code)]
#![warn(clippy::unwrap_used, clippy::expect_used, clippy::indexing_slicing)]

mod reply;
mod request;

pub use reply::{Answer, Checksum, Compensated, Counters, CycleReply, Hello, Numbers, Reply, Status, SweepReply};
pub use request::{Arithmetic, Code, Command, Demand, Lines, Refused, Request, Sweep};

/// Of this protocol.
pub const VERSION: u32 = 1;
/// Longest command in bytes without its line feed: every number with 17 digits and room for spaces.
pub const MAX_COMMAND: usize = 768;
/// Most steps of a sweep.
pub const MAX_STEPS: u32 = 10_000;
/// No reply is longer, line feed included.
pub const MAX_REPLY: usize = 1536;
