//! `hil`: firmware that runs the core, compared with the host reply by reply.

use std::path::PathBuf;

use pkm_core::Machine;
use pkm_core::tables::reference;

use super::bar::bar;
use super::say;
use super::session::{Output, Session};
use crate::error::{Failure, Result};
use crate::files::source::{self, Source};
use crate::files::table::TableFile;
use crate::hil::{self, Campaign, HostModel, Target};
use crate::report::hil as report;

/// Drives firmware that runs the core (pkm-fw's `cyclic`) and compares every bit with the host.
#[derive(clap::Args)]
pub(crate) struct Args {
    /// Serial port of the board, such as /dev/ttyACM0.
    #[arg(long, value_name = "PORT", required_unless_present = "qemu", conflicts_with = "qemu")]
    port: Option<String>,
    /// Bits a second of the port.
    #[arg(long, default_value_t = 115_200, requires = "port")]
    baud: u32,
    /// Start QEMU with the firmware.
    #[arg(long)]
    qemu: bool,
    /// The firmware for QEMU.
    #[arg(long, value_name = "ELF", requires = "qemu", default_value = hil::DEFAULT_ELF)]
    elf: PathBuf,
    /// QEMU's machine.
    #[arg(long, value_name = "NAME", requires = "qemu", default_value = "mps2-an386")]
    board: String,
    /// Poses to draw: half of them computed in f32, half in f64.
    #[arg(long, default_value_t = 2000)]
    poses: u64,
    /// Poses a command: more than one makes sweeps from pose to pose, answered by a checksum of all results, for long runs.
    #[arg(long, default_value_t = 1, value_parser = clap::value_parser!(u32).range(1..=1000))]
    steps: u32,
    /// Random seed; default: random, printed.
    #[arg(long)]
    seed: Option<u64>,
    /// coefficients.json of the firmware's table; default: the reference machine's.
    #[arg(long, value_name = "JSON")]
    table: Option<PathBuf>,
    /// Send the table to firmware that has another one for the same machine. It is in service until the firmware starts again.
    #[arg(long)]
    send_table: bool,
    /// Folder for hil.json.
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,
}

pub(crate) fn run(args: &Args, session: &mut Session) -> Result<Output> {
    let target = match &args.port {
        Some(name) => Target::Port { name: name.clone(), baud: args.baud },
        None => Target::Qemu { board: args.board.clone(), elf: args.elf.clone() },
    };
    let seed = args.seed.unwrap_or_else(|| fastrand::u64(..));
    let file = session.machine()?;
    let (pose_box, numbers, single);
    let host = match &args.table {
        None => {
            if session.machine_path().is_some() {
                return Err(Failure::usage("give --table as well: the firmware of a machine has its table"));
            }
            pose_box = file.pose_box;
            HostModel {
                checksums: [file.parameters.checksum(), reference::TABLE_F64.checksum()],
                double: (file.machine, reference::TABLE_F64),
                single: (reference::MACHINE_F32, reference::TABLE_F32),
            }
        }
        Some(path) => {
            let table = TableFile::parse(&Source::read(path)?)?;
            pose_box = table.extent;
            numbers = table.numbers();
            single = numbers.narrowed();
            let double = numbers.table()?;
            let narrow = Machine::<f32>::new(&file.parameters).map_err(|e| Failure::other(e.to_string()))?;
            HostModel {
                checksums: [file.parameters.checksum(), double.checksum()],
                double: (file.machine, double),
                single: (narrow, single.table()?),
            }
        }
    };
    let campaign = Campaign { seed, poses: args.poses, steps: args.steps, pose_box, send_table: args.send_table };
    let outcome = hil::run(&target, &campaign, &host, &bar())?;
    let (mut text, json) = (report::text(&outcome, &campaign), report::document(&outcome, &campaign));
    if let Some(failure) = outcome.failure() {
        say(&text);
        return Err(failure);
    }
    text.push_str("every reply as on the host, to the last bit\n");
    if let Some(out) = &args.out {
        let inputs = [session.machine_path(), args.table.as_deref()];
        text.push_str(&source::write_all(out, &[("hil.json", source::json(&json))], &inputs)?);
    }
    session.output(text, &json)
}
