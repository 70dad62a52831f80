//! The cyclic firmware compensates with temperatures and with a weight, with the host's bits, and a table that is exchanged brings the
//! weight's reference along.

use std::path::Path;

use pkm_core::compensator::{CarriedWeight, Compensator, CompensatorSettings, Reading, Weight};
use pkm_core::estimation::Estimator;
use pkm_core::nalgebra::Vector3;
use pkm_core::tables::reference::{MACHINE_F32, MACHINE_F64, PARAMETERS, TABLE_F32, TABLE_F64};
use pkm_core::{CorrectionTable, Machine, Model, Pose, Scalar, Wrench};
use pkm_host::files::source::Source;
use pkm_host::files::table::TableFile;
use pkm_protocol::{
    Answer, Arithmetic, Carried, Checksum, Command, Demand, Learned, MAX_NUMBERS, OffsetFault, Piece, TableNumbers,
};

use crate::guards::{Board, STANDSTILL};
use crate::hil::OTHER_TABLE;
use crate::learning::{COMPARED_PERIODS, DEMAND, learned, parsed, renewed};
use crate::line::Line;
use crate::{Outcome, root};

/// Zeroed away from the demand, so that the weight asks for an offset.
pub const CARRIED: Carried = Carried {
    weight: Weight { force_n: Vector3::new(785.0, 20.0, -30.0), centre_m: Vector3::new(0.01, 0.02, 0.1) },
    zeroed_at: Pose { theta_rad: -0.2, sigma_rad: 0.1, z0_m: 0.52 },
    tip_m: Vector3::new(0.0, 0.0, 0.3),
};
/// The sensor of limb 2 is lost. The reference machine does not grow: what growth does is asked of `faults`.
const WARM: Demand = Demand { rises_k: [Some(2.5), None, Some(-1.25), Some(0.75)], ..DEMAND };
/// The weight alone: its offset does not depend on the periods before.
const UNLOADED: Demand = Demand { wrench_at_tip: Wrench::ZERO, ..DEMAND };
/// More than the offset takes to its target.
const SETTLED: u32 = 100;
const ATTEMPTS: usize = 10;

pub fn run(name: &str, elf: &Path) -> Outcome {
    let mut board = Board::start(name, elf)?;
    for arithmetic in [Arithmetic::F32, Arithmetic::F64] {
        let demand = Demand { arithmetic, ..WARM };
        let fault = Some(OffsetFault::TemperatureLost);
        followed(&mut board, &demand, |found| {
            let [with, without] = match arithmetic {
                Arithmetic::F32 => both(found.compensated, &demand, &MACHINE_F32, &TABLE_F32)?,
                Arithmetic::F64 => both(found.compensated, &demand, &MACHINE_F64, &TABLE_F64)?,
            };
            if found.offset_m == with && found.fault == fault && with != without {
                return Ok(());
            }
            Err(format!("{found:?}, the host's offset is {with:?}, without a weight {without:?}"))
        })?;
        exchanged(&mut board, arithmetic)?;
    }
    println!(
        "temperatures, one of them lost, and a weight: offsets of the host's bits; an exchanged table brings its reference"
    );
    Ok(())
}

/// Offsets with the weight, and without it.
fn both<T: Scalar>(
    periods: u32,
    demand: &Demand,
    machine: &Machine<T>,
    table: &CorrectionTable<'_, T>,
) -> Result<[[f64; 3]; 2], String> {
    let carried = Some(CARRIED.carried(machine, table).map_err(|e| e.to_string())?);
    Ok([offset_after(periods, demand, machine, table, carried)?, offset_after(periods, demand, machine, table, None)?])
}

/// The offset of the screws after some periods with a demand, as the firmware computes it that has learned nothing.
fn offset_after<T: Scalar>(
    periods: u32,
    demand: &Demand,
    machine: &Machine<T>,
    table: &CorrectionTable<'_, T>,
    carried: Option<CarriedWeight<T, 3>>,
) -> Result<[f64; 3], String> {
    // of a load that is computed
    let settings = CompensatorSettings { gain: 1.0, stuck_s: 0.0, ..CompensatorSettings::DEFAULT };
    let mut compensator = Compensator::<T, 3>::new(&settings).map_err(|e| e.to_string())?;
    compensator.set_weight(carried);
    let mut estimator = Estimator::<T, 6>::new(&learned::SETTINGS).map_err(|e| e.to_string())?;
    let (pose, wrench, tip_m) = demand.inputs();
    let reading = Reading { enabled: true, wrench, rise: demand.rise() };
    let model = Model::new(machine, table);
    for _ in 0..periods {
        estimator.follow(T::from_f64(settings.period_s));
        compensator.update(&model.with_learned(&estimator), &pose, tip_m, &reading);
    }
    Ok(compensator.joints().map(T::to_f64).into())
}

/// Starts the board, gives it the weight and the demand, and judges what it says as long as it has the demand.
fn followed(board: &mut Board, demand: &Demand, judge: impl Fn(&Learned) -> Outcome) -> Outcome {
    for _ in 0..ATTEMPTS {
        board.restart("a restart", &STANDSTILL)?;
        carry(&mut board.line, TABLE_F64.checksum())?;
        let mut judged = false;
        while let Some(found) = renewed(&mut board.line, *demand)? {
            if found.compensated >= COMPARED_PERIODS {
                break;
            }
            judge(&found)?;
            judged = true;
        }
        if judged {
            return Ok(());
        }
    }
    Err("the demand is always dropped".into())
}

fn carry(line: &mut Line, table: u64) -> Outcome {
    let reply = line.request(Command::Weight(CARRIED))?;
    match parsed(&reply)? {
        Answer::Carried(Checksum(of)) if of == table => Ok(()),
        other => Err(format!("not the weight with the table {table:016x}: {other:?}")),
    }
}

/// A table of the same machine that is not the image's.
pub fn other_table() -> Result<TableFile, String> {
    let source = Source::read(&root().join(OTHER_TABLE));
    source.and_then(|source| TableFile::parse(&source)).map_err(|e| e.to_string())
}

/// The table is exchanged while the weight is compensated: the offset ends where the reference of the new table puts it.
fn exchanged(board: &mut Board, arithmetic: Arithmetic) -> Outcome {
    let numbers = other_table()?.numbers();
    let narrow = numbers.narrowed();
    let (double, single) = (numbers.table().map_err(|e| e.to_string())?, narrow.table().map_err(|e| e.to_string())?);
    let demand = Demand { arithmetic, ..UNLOADED };
    let [before, after, stale] = match arithmetic {
        Arithmetic::F32 => ends(&demand, &MACHINE_F32, [&TABLE_F32, &single])?,
        Arithmetic::F64 => ends(&demand, &MACHINE_F64, [&TABLE_F64, &double])?,
    };
    if before == after || after == stale {
        return Err(format!("the tables do not differ enough: {before:?}, {after:?}, {stale:?}"));
    }
    for _ in 0..ATTEMPTS {
        board.restart("a restart", &STANDSTILL)?;
        carry(&mut board.line, TABLE_F64.checksum())?;
        transfer(&mut board.line, &double)?;
        // all at once, before the demand is dropped
        board.line.send_all(&[Command::Cycle(demand), Command::Swap])?;
        board.line.hears("a cycle", r#""status":"ok""#)?;
        board.line.hears("a swap", &format!(r#"{{"swapped":"{:016x}"}}"#, double.checksum()))?;
        while let Some(found) = renewed(&mut board.line, demand)? {
            if found.compensated < SETTLED {
                continue;
            }
            // the weight that comes now has its reference by the new table, too
            carry(&mut board.line, double.checksum())?;
            let same = found.offset_m == after && found.fault.is_none();
            return if same {
                Ok(())
            } else {
                Err(format!("{found:?}, on the host {after:?}, by the old table {stale:?}"))
            };
        }
    }
    Err("the demand is always dropped".into())
}

/// Where the offset ends with the first table, with the second, and with the second by the reference of the first.
fn ends<T: Scalar>(
    demand: &Demand,
    machine: &Machine<T>,
    [first, second]: [&CorrectionTable<'_, T>; 2],
) -> Result<[[f64; 3]; 3], String> {
    let [of_first, of_second] = [first, second].map(|table| CARRIED.carried(machine, table).map_err(|e| e.to_string()));
    let (of_first, of_second) = (Some(of_first?), Some(of_second?));
    Ok([
        offset_after(2 * SETTLED, demand, machine, first, of_first)?,
        offset_after(2 * SETTLED, demand, machine, second, of_second)?,
        offset_after(2 * SETTLED, demand, machine, second, of_first)?,
    ])
}

/// Has a table come, up to its exchange.
pub fn transfer(line: &mut Line, table: &CorrectionTable<'_, f64>) -> Outcome {
    let numbers: Vec<f64> = table.numbers().collect();
    let pieces = (0..)
        .step_by(MAX_NUMBERS)
        .zip(numbers.chunks(MAX_NUMBERS))
        .filter_map(|(first, piece)| Some(Command::Numbers(Piece { first, numbers: TableNumbers::new(piece)? })));
    for command in [Command::Table(table.header(PARAMETERS.checksum()))].into_iter().chain(pieces) {
        let reply = line.request(command)?;
        if !matches!(parsed(&reply)?, Answer::Received(_)) {
            return Err(format!("a table that comes: {reply}"));
        }
    }
    Ok(())
}
