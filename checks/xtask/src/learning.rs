//! The cyclic firmware learns from readings with the bits of `pkm-host replay`, goes on where it was after a restart, and compensates with
//! what it knows.

use std::path::Path;

use pkm_core::compensator::{Compensator, CompensatorSettings, Reading};
use pkm_core::estimation::{Alarm, Estimator, MAX_AMPLITUDES, state_bytes};
use pkm_core::nalgebra::Vector3;
use pkm_core::tables::reference::{MACHINE_F32, MACHINE_F64, PARAMETERS, TABLE_F32, TABLE_F64};
use pkm_core::thermal::DECLARED_TEMPERATURE_C;
use pkm_core::{CorrectionTable, Machine, Model, Pose, Scalar, Wrench};
use pkm_host::files::learn::Learn;
use pkm_host::files::log::Entry;
use pkm_host::replay::{Step, replay};
use pkm_protocol::{Answer, Arithmetic, Checksum, Code, Command, Counters, Demand, Learned, Probe, Refusal, Reply};

use crate::guards::{Board, STANDSTILL};
use crate::image::place;
use crate::line::Line;
use crate::{Outcome, carried};

#[path = "../../../embed/firmware/src/learned.rs"]
pub mod learned;

const AMPLITUDES: usize = learned::SETTINGS.amplitudes.len();
const READINGS: u32 = 40;
/// A state is saved after so many readings, and again after the second number.
const SAVED_AFTER: [usize; 2] = [15, 25];
/// The readings after the second save are lost with it.
const DAMAGED_AFTER: usize = 30;

pub fn run(name: &str, elf: &Path) -> Outcome {
    let amplitudes = learned::SETTINGS.amplitudes.to_vec();
    let learn = || Learn { amplitudes: amplitudes.clone(), model_share: learned::SETTINGS.model_share };
    let host = |log: &[Entry]| replay(&MACHINE_F64, Some(&TABLE_F64), learn(), log).map_err(|e| e.to_string());
    let mut log = Vec::new();
    for n in 1..=READINGS {
        let (mut touch, readings) = pkm_faults::reading(&MACHINE_F64, &TABLE_F64, n).ok_or("no reading")?;
        if n % 10 == 0 {
            // refused: the clock runs backwards
            touch.time_s = 1;
        }
        log.push(Entry { line: n.into(), touch, temperature_c: DECLARED_TEMPERATURE_C, readings: readings.to_vec() });
    }
    let mut board = Board::start(name, elf)?;
    let mut saved = Vec::new();
    for (n, (entry, step)) in log.iter().zip(host(&log)?.steps).enumerate().take(DAMAGED_AFTER) {
        same(&probe(&mut board.line, entry)?, entry, &step)?;
        if SAVED_AFTER.contains(&(n + 1)) {
            let state = learned_of(&board.line.request(Command::Save)?)?;
            board.restart("a restart", &STANDSTILL)?;
            expect_state(&mut board.line, &state, Some(saved.len() as u32 + 1))?;
            saved.push(state);
        }
    }
    // the newer state is damaged: the older one is read, and what came after it is learned anew
    let [first, _] = &saved[..] else { return Err("two states are not saved".into()) };
    let (slots, _) = place(elf, "cyclic::board::chip::SLOTS::")?;
    board.debugger.stop()?;
    let end = state_bytes(amplitudes.len());
    board.debugger.put(slots + (state_bytes(MAX_AMPLITUDES) + end - 8) as u32, &[0xff; 8])?;
    board.debugger.go()?;
    board.restart("a restart", &STANDSTILL)?;
    expect_state(&mut board.line, first, Some(1))?;
    let rest: Vec<Entry> = log
        .into_iter()
        .enumerate()
        .filter(|(n, _)| !(SAVED_AFTER[0]..DAMAGED_AFTER).contains(n))
        .map(|(_, entry)| entry)
        .collect();
    let twin = host(&rest)?;
    for (entry, step) in rest.iter().zip(&twin.steps).skip(SAVED_AFTER[0]) {
        same(&probe(&mut board.line, entry)?, entry, step)?;
    }
    let last = learned_of(&board.line.request(Command::Learned)?)?;
    let told =
        |(n, alarm): &(usize, Alarm)| (*n, Some((alarm.change.to_bits(), alarm.probability.to_bits(), alarm.readings)));
    let expected: Vec<_> = twin.standing().iter().map(told).collect();
    let alarms = last
        .alarms
        .map(|alarm| alarm.map(|alarm| (alarm.change.to_bits(), alarm.probability.to_bits(), alarm.readings)));
    let found: Vec<_> = (0..).zip(alarms).filter(|(_, alarm)| alarm.is_some()).collect();
    if found != expected || !matches!(found[..], [(1, _)]) {
        return Err(format!("the alarms are {:?}, the host's {:?}", last.alarms, twin.standing()));
    }
    compensates(&mut board, &rest)?;
    forgets(&mut board)?;
    println!(
        "{READINGS} readings learned, bits and alarm as of replay; restarts, the same state; a damaged one, the state before; another \
         table, nothing"
    );
    Ok(())
}

/// What the task compensates is compared up to so many periods.
pub const COMPARED_PERIODS: u32 = 1000;
const ATTEMPTS: usize = 10;

/// The load of a demand in which what was learned is compensated.
pub const DEMAND: Demand = Demand {
    arithmetic: Arithmetic::F64,
    pose: Pose { theta_rad: 0.1, sigma_rad: -0.05, z0_m: 0.53 },
    wrench_at_tip: Wrench { force_n: Vector3::new(300.0, 0.0, -900.0), moment_nm: Vector3::new(0.0, 0.0, 5.0) },
    tip_m: Vector3::new(0.0, 0.0, 0.3),
    rises_k: [Some(0.0); 4],
};

/// What the task compensates with what it knows, against the host after as many periods.
fn compensates(board: &mut Board, log: &[Entry]) -> Outcome {
    let model = PARAMETERS.checksum() ^ TABLE_F64.checksum();
    let mut twin = Estimator::<f64, AMPLITUDES>::new(&learned::SETTINGS).map_err(|e| e.to_string())?;
    for Entry { touch, readings, .. } in log {
        // what is refused is refused on the board, too
        twin.learn(&MACHINE_F64, Some(&TABLE_F64), touch, readings).ok();
    }
    let mut state = [0; state_bytes(AMPLITUDES)];
    twin.save(model, 0, &mut state).map_err(|e| e.to_string())?;
    let mut single = Estimator::<f32, AMPLITUDES>::new(&learned::SETTINGS).map_err(|e| e.to_string())?;
    single.restore(model, &state).map_err(|e| e.to_string())?;
    if learned_of(&board.line.request(Command::Save)?)?.state != Checksum::over(&state) {
        return Err("the state is another one than the host's".into());
    }
    for arithmetic in [Arithmetic::F32, Arithmetic::F64] {
        let demand = Demand { arithmetic, ..DEMAND };
        let mut compared = 0;
        for _ in 0..ATTEMPTS {
            board.restart("a restart", &STANDSTILL)?;
            while let Some(found) = renewed(&mut board.line, demand)? {
                if found.compensated >= COMPARED_PERIODS {
                    break;
                }
                let [with, without] = match arithmetic {
                    Arithmetic::F32 => offsets(found.compensated, single, &demand, &MACHINE_F32, &TABLE_F32)?,
                    Arithmetic::F64 => offsets(found.compensated, twin, &demand, &MACHINE_F64, &TABLE_F64)?,
                };
                // in f32 an offset has steps of 0.06 µm, and what is used follows slowly
                let told_apart = arithmetic == Arithmetic::F32 || with != without;
                if found.compensated == 0 || found.fault.is_some() || found.offset_m != with || !told_apart {
                    return Err(format!("{found:?}, the host's offset is {with:?}, without learning {without:?}"));
                }
                compared += 1;
            }
            if compared > 0 {
                break;
            }
        }
        if compared == 0 {
            return Err(format!("{arithmetic:?}: the demand is always dropped"));
        }
    }
    save_is_refused(&mut board.line)
}

/// Sends the demand again, as a host does that wants the task to go on with it, and has the board say what it compensates. `None` when
/// the task has dropped a demand since the start: the board's time runs ahead of this computer's.
pub fn renewed(line: &mut Line, demand: Demand) -> Result<Option<Learned>, String> {
    line.send_all(&[Command::Cycle(demand), Command::Learned, Command::Status])?;
    line.hears("a cycle", r#""status":"ok""#)?;
    let found = learned_of(&line.receive()?)?;
    let dropped = counters_of(&line.receive()?)?.dropped_demands;
    Ok((dropped == 0).then_some(found))
}

/// What was learned beyond one table is not taken for what is beyond another, which may have it: neither at once nor after a restart, by
/// which the image's table is in service again.
fn forgets(board: &mut Board) -> Outcome {
    let readings =
        |board: &mut Board| -> Result<u32, String> { Ok(learned_of(&board.line.request(Command::Learned)?)?.readings) };
    board.restart("a restart", &STANDSTILL)?;
    let known = readings(board)?;
    let other = carried::other_table()?.numbers();
    carried::transfer(&mut board.line, &other.table().map_err(|e| e.to_string())?)?;
    board.line.request(Command::Swap)?;
    let swapped = readings(board)?;
    learned_of(&board.line.request(Command::Save)?)?;
    board.restart("a restart", &STANDSTILL)?;
    match (known, swapped, readings(board)?) {
        (1.., 0, 0) => Ok(()),
        found => Err(format!("readings known before another table comes, with it, and after a restart: {found:?}")),
    }
}

/// A flash that is erased may hold the task up: not while it has a demand.
fn save_is_refused(line: &mut Line) -> Outcome {
    line.send_all(&[Command::Cycle(DEMAND), Command::Save])?;
    line.receive()?;
    let reply = line.receive()?;
    match parsed(&reply)? {
        Answer::Error(Code::Busy) => Ok(()),
        other => Err(format!("a save while the task has a demand: {other:?}")),
    }
}

/// The offset of the screws after some periods with what was learned, and without it.
fn offsets<T: Scalar>(
    periods: u32,
    mut learned: Estimator<T, AMPLITUDES>,
    demand: &Demand,
    machine: &Machine<T>,
    table: &CorrectionTable<'_, T>,
) -> Result<[[f64; 3]; 2], String> {
    // of a load that is computed
    let settings = CompensatorSettings { gain: 1.0, stuck_s: 0.0, ..CompensatorSettings::DEFAULT };
    let mut with = Compensator::<T, 3>::new(&settings).map_err(|e| e.to_string())?;
    let mut without = with;
    let (pose, wrench, tip_m) = demand.inputs();
    let reading = Reading { enabled: true, wrench, rise: demand.rise() };
    let model = Model::new(machine, table);
    for _ in 0..periods {
        learned.follow(T::from_f64(settings.period_s));
        with.update(&model.with_learned(&learned), &pose, tip_m, &reading);
        without.update(&model, &pose, tip_m, &reading);
    }
    Ok([with, without].map(|compensator| compensator.joints().map(T::to_f64).into()))
}

pub fn parsed(reply: &str) -> Result<Answer<'_, f64>, String> {
    Reply::parse(reply.as_bytes()).map(|reply| reply.answer).ok_or_else(|| format!("not a reply: {reply}"))
}

pub fn learned_of(reply: &str) -> Result<Learned, String> {
    match parsed(reply)? {
        Answer::Learned(learned) => Ok(learned),
        _ => Err(format!("not what is learned: {reply}")),
    }
}

pub fn counters_of(reply: &str) -> Result<Counters, String> {
    match parsed(reply)? {
        Answer::Status(counters) => Ok(counters),
        _ => Err(format!("not a status: {reply}")),
    }
}

fn probe(line: &mut Line, entry: &Entry) -> Result<Learned, String> {
    let [u, v, w] = entry.readings[..] else { return Err("a reading has three components".into()) };
    let probe = Probe {
        touch: entry.touch,
        read_m: [u, v, w].map(|reading| reading.read),
        deviation_m: [u, v, w].map(|reading| reading.deviation),
    };
    learned_of(&line.request(Command::Probe(probe))?)
}

/// What a board says after a reading, and what the host says.
fn same(found: &Learned, entry: &Entry, step: &Step) -> Outcome {
    let bits = |numbers: &mut dyn Iterator<Item = f64>| numbers.map(f64::to_bits).collect::<Vec<_>>();
    let values = bits(&mut found.values.as_slice().iter().copied());
    let deviations = bits(&mut found.deviations.as_slice().iter().copied());
    let refused = step.outcome.err().map(Refusal::from);
    if values == bits(&mut step.values.iter().map(|(value, _)| *value))
        && deviations == bits(&mut step.values.iter().map(|(_, deviation)| *deviation))
        && found.refused == refused
    {
        return Ok(());
    }
    Err(format!("reading {}: {found:?}, on the host {refused:?} {:?}", entry.line, step.values))
}

/// The state after a start is that which was saved.
fn expect_state(line: &mut Line, state: &Learned, saved: Option<u32>) -> Outcome {
    let found = learned_of(&line.request(Command::Learned)?)?;
    let expected = Learned { refused: None, saved, ..*state };
    if found == expected { Ok(()) } else { Err(format!("after the start {found:?}, saved was {expected:?}")) }
}
