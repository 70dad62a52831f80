//! Line protocol between a controller that runs `pkm-core` and a host: JSON, a command a line, a reply a line.
//!
//! Each line ends with `*` and the CRC-32 (zlib's) of what comes before, as eight hexadecimal digits, which the examples below leave out: a
//! flipped digit would be another pose. `{"v":2,"id":1,"cmd":"hello"}*3bf74608`, say.
//!
//! # Commands
//!
//! ```text
//! {"v":2,"id":1,"cmd":"hello"}
//! {"v":2,"id":2,"cmd":"status"}
//! {"v":2,"id":3,"cmd":"cycle","arithmetic":"f64","theta_rad":0.1,"sigma_rad":-0.05,"z0_m":0.53,"force_n":[0,0,-400],"moment_nm":[0,0,5],"tip_m":[0,0,0.3],"limb_1_rise_k":1.5,"limb_2_rise_k":2,"limb_3_rise_k":1.75,"platforms_rise_k":0.5}
//! {"v":2,"id":4,"cmd":"sweep","to":[0.2,0.1,0.55],"steps":1000,"arithmetic":"f64","theta_rad":0.1,"sigma_rad":-0.05,"z0_m":0.53,"force_n":[0,0,-400],"moment_nm":[0,0,5],"tip_m":[0,0,0.3]}
//! ```
//!
//! `v` is [`VERSION`], `id` any `u32`, which the reply repeats. A command has exactly its own fields, in any order; `arithmetic` is `f32`
//! or `f64`. `cycle` works on a demand and tells the result; the task goes on with it in every period until the next one, for a second at the most:
//! a host that is gone must not leave its load behind. The four temperatures say how much warmer limbs and platforms are than at the zero reading;
//! one that is left out is a sensor without a reading. Without sensors send zeros, from a single one its rise four times. `sweep` goes in a straight line from the pose towards `to` = [θ, σ, Z0], `steps` poses, one a period, and sums up the
//! results and a checksum of all their bits. `to` is the pose that would come after the last: `steps` = 1 is the first pose alone.
//!
//! A table is changed while the task runs:
//!
//! ```text
//! {"v":2,"id":5,"cmd":"table","machine":"0123456789abcdef","table":"fedcba9876543210","terms":9,"factor_form":true}
//! {"v":2,"id":6,"cmd":"numbers","first":0,"numbers":[0,0,0.53,0.26,0.26,0.03]}
//! {"v":2,"id":7,"cmd":"swap"}
//! ```
//!
//! `table` announces it, with the checksums of the table and of the machine that it was fitted for. `numbers` brings up to
//! [`MAX_NUMBERS`] of its numbers (their order: [`CorrectionTable::numbers`](pkm_core::CorrectionTable::numbers)), `first` being the place
//! of the first of them. `swap` checks that the table is whole, has its checksum and lies in memory as it came, and puts it into service at the beginning of
//! a period. Any error leaves the table in service where it is; begin again with `table`. After a start the table of the image is in service.
//!
//! What the machine carries is compensated beyond what it did where the machine was zeroed:
//!
//! ```text
//! {"v":2,"id":11,"cmd":"weight","force_n":[785,0,0],"centre_m":[0,0,0.1],"theta_rad":0,"sigma_rad":0,"z0_m":0.53,"tip_m":[0,0,0.3]}
//! ```
//!
//! `force_n` is the weight along x, y, z of B, platform and tool in one, `centre_m` its centre of mass in A-uvw, the pose is that of the zero, with its tip. A force of zeros is
//! nothing, as after a start. The reference at the zero is of the table in service, and worked out outside of the period; `swap` works out that of its own table, and puts both into service at once. Where there
//! is none the weight, or the table, is refused, and what was before stays.
//!
//! A controller that learns takes readings of the tip under known loads:
//!
//! ```text
//! {"v":2,"id":8,"cmd":"probe","time_s":600,"rise_k":0,"theta_rad":0.1,"sigma_rad":-0.05,"z0_m":0.53,"force_n":[0,0,-400],"moment_nm":[0,0,5],"tip_m":[0,0,0.3],"read_m":[1e-6,0,-4e-6],"deviation_m":[3e-7,3e-7,3e-7]}
//! {"v":2,"id":9,"cmd":"learned"}
//! {"v":2,"id":10,"cmd":"save"}
//! ```
//!
//! `probe` says by what the load has moved the tip along u, v, w, with standard deviations, at `time_s` of a clock that goes on while the
//! controller is off; `rise_k` is how much warmer the machine is than at its zero reading. `learned` asks what is known; `save` keeps it over a restart, and is
//! refused while the task has a demand.
//!
//! # Replies
//!
//! ```text
//! {"v":2,"id":1,"answer":{"hello":{"firmware":"pkm-fw 0.1.0","board":"mps2","machine":"0123456789abcdef","table":"fedcba9876543210","period_s":0.001,"ticks_hz":25000000,"travel_min_m":[0.42,0.42,0.42],"travel_max_m":[0.77,0.77,0.77],"max_command_bytes":768,"input_bytes":4096,"stack_bytes":4180000}}}
//! {"v":2,"id":2,"answer":{"status":{"cycles":1,"overruns":0,"worst_ticks":7312,"stack_used_bytes":9000,"bad_lines":0,"lost_replies":0,"dropped_demands":0,"last_fault":null}}}
//! {"v":2,"id":3,"answer":{"cycle":{"status":"ok","ticks":7312,"overrun":false,"numbers":{"q_m":[0.5,0.5,0.5],"k":[1,2,3,4,5,6,7,8,9,10,11,12,13,14,15,16,17,18,19,20,21],"translation_m":[0,0,-0.00001],"rotation_rad":[0,0,0],"compensated":{"theta_rad":0.1,"sigma_rad":-0.05,"z0_m":0.53001,"q_m":[0.5,0.5,0.5]}}}}}
//! {"v":2,"id":3,"answer":{"cycle":{"status":"unreachable","ticks":312,"overrun":false,"numbers":null}}}
//! {"v":2,"id":4,"answer":{"sweep":{"ok":1000,"outside_box":0,"refused":0,"overruns":0,"worst_ticks":7312,"results":"93b1c5a0e4d2f786"}}}
//! {"v":2,"id":6,"answer":{"received":{"numbers":6,"of":276}}}
//! {"v":2,"id":7,"answer":{"swapped":"fedcba9876543210"}}
//! {"v":2,"id":11,"answer":{"carried":"fedcba9876543210"}}
//! {"v":2,"id":8,"answer":{"learned":{"refused":null,"readings":41,"began_s":1700000000,"time_s":1700086400,"values":[1e-10,2.1e-9],"deviations":[2e-10,1e-10],"alarms":[null,{"change":2.1e-9,"probability":0.999,"readings":41},null,null,null,null,null,null],"state":"0123456789abcdef","saved":3,"offset_m":[1e-6,0,0],"fault":null,"compensated":12}}}
//! {"v":2,"id":null,"answer":{"error":"syntax"}}
//! ```
//!
//! The fields are explained at [`Hello`], [`Counters`], [`CycleReply`], [`Numbers`], [`SweepReply`], [`Received`] and [`Learned`]. `status` is one of
//!
//! ```text
//! ok outside_box out_of_travel unreachable singular not_finite not_positive no_factor_form failed
//! ```
//!
//! (see [`Status`]; numbers come with the first two) and an `error` one of
//!
//! ```text
//! too_long checksum syntax field version command range aborted other_machine table order busy not_saved too_heavy too_far no_reference
//! ```
//!
//! (see [`Code`]), `fault` of `learned` null or one of
//!
//! ```text
//! wrench_not_finite wrench_too_large wrench_stuck temperature_lost outside_box model other
//! ```
//!
//! (see [`OffsetFault`]), `last_fault` of `status` null or one of
//!
//! ```text
//! restart panic exception stack self_test
//! ```
//!
//! (see [`Fault`]). A bad line gets an error and changes nothing that is in service; a refused `table`, `swap` or number drops the table that is on its way. Its `id` is null when the line could not be read as fields of a
//! command, also for a single unknown field or a NaN: wait for each reply, or count lines. Blank lines get no reply. Numbers
//! are JSON's, as the shortest decimal that reads back to the same bits; those of a reply are of the arithmetic that was asked for.
//! [`Lines`] finds the next line after anything.
//!
//! # The line
//!
//! 115,200 baud, 8N1, no flow control; `input_bytes` of `hello` may wait unanswered. By hand, with `cyclic` of `pkm-fw` in QEMU
//! and any TCP client:
//!
//! ```text
//! cd embed/firmware && cargo build --release --bin cyclic
//! qemu-system-arm -M mps2-an500 -nographic -monitor none -icount shift=4,sleep=off -serial tcp:127.0.0.1:5599,server=on,wait=on -kernel target/thumbv7em-none-eabihf/release/cyclic
//! ```
//!
//! Without `-icount` the ticks are the PC's time; with it ticks × 40/16 are instructions. With a larger shift a cycle in f64 on the other boards takes longer than the watchdog waits.

#![no_std]
#![forbid(unsafe_code)]
#![warn(clippy::unwrap_used, clippy::expect_used, clippy::indexing_slicing)]

mod demand;
mod json;
mod learned;
mod line;
mod piece;
mod reply;
mod request;

pub use demand::{Arithmetic, Carried, Demand, Sweep};
pub use learned::{Alarm, Learned, OffsetFault, Probe, Refusal};
pub use line::{crc32, opened, sealed};
pub use piece::{MAX_NUMBERS, Piece, TableNumbers};
pub use reply::{
    Answer, Checksum, Compensated, Counters, CycleReply, Fault, Hello, Numbers, Received, Reply, Status, SweepReply,
};
pub use request::{Code, Command, Lines, Refused, Request};

/// Of this protocol.
pub const VERSION: u32 = 2;
/// Gives up what is worked on: Ctrl-X.
pub const ABORT: u8 = 0x18;
/// Longest command in bytes without its line feed: every number with 17 digits and room for spaces.
pub const MAX_COMMAND: usize = 768;
/// Most steps of a sweep.
pub const MAX_STEPS: u32 = 10_000;
/// No reply is longer, line feed included.
pub const MAX_REPLY: usize = 1536;
