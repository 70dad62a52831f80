//! A controller's log through the controller's own estimator, reading by reading, and a fit and a diagnosis of the same readings beside it.

mod batch;
mod design;
mod diagnosed;

use pkm_core::estimation::{Alarm, AmplitudeSettings, Estimator, EstimatorSettings, MAX_AMPLITUDES, Refusal, Touch};
use pkm_core::{CorrectionTable, Deflection, Domain, Machine, Wrench};

use crate::error::{Failure, Result};
use crate::files::learn::{Learn, limb_compliances_m_per_n};
use crate::files::log::Entry;
use crate::pose::PoseBox;
pub use design::{Ask, Proposal};
pub use diagnosed::LogDiagnosis;

/// Readings of the fit beside the estimator: the last ones that were taken in.
pub const BATCH: usize = 200;

/// A value with its standard deviation.
pub type Value = (f64, f64);

/// What a reading did.
pub struct Step {
    /// Line of the log.
    pub line: u64,
    /// When, s.
    pub time_s: u32,
    /// χ² over the number of components, or why it was refused.
    pub outcome: std::result::Result<f64, Refusal>,
    /// Whether it was taken in outside the table's box, where what the table says is extrapolated.
    pub outside_box: bool,
    /// Whether any amplitude counts as unknown again from here on.
    pub changed: bool,
    /// Of the amplitudes, after it.
    pub values: Vec<Value>,
    /// What of their changes since acceptance is compensated from then on, as soon as the rate lets it.
    pub compensated: Vec<f64>,
    /// Alarms that stand after it, each with the number of its amplitude from 0.
    pub alarms: Vec<(usize, Alarm)>,
}

/// What came of a log.
pub struct Replay {
    /// What was learned.
    pub learn: Learn,
    /// Of every reading.
    pub steps: Vec<Step>,
    /// A fit of the last [`BATCH`] readings that were taken in; `None` if there was none.
    pub batch: Option<Vec<Value>>,
    /// How old it all is at the end of the log.
    pub age: Age,
    /// Of each compliance: what a change that is worth an alarm would move the tip by, over what it yields without one, as root mean
    /// squares over some of the log. 0 of others.
    pub alarm_ratios: Vec<f64>,
    /// What each limb yields along itself in the middle of the log's poses; `None` where the machine cannot take it.
    pub limbs_m_per_n: Option<[f64; 3]>,
    /// Where to probe next, if that was asked.
    pub next: Vec<Proposal>,
    /// A diagnosis of the last readings, if that was asked.
    pub diagnosed: Option<LogDiagnosis>,
}

/// How old what was learned is at a log's last row, taken in or not; or at the last reading that was taken in, where the clock has
/// run backwards since.
#[derive(Clone, Debug, Default)]
pub struct Age {
    /// Since the first reading that was taken in, and so since acceptance, s.
    pub since_first_s: u32,
    /// Since the last one, s.
    pub since_last_s: u32,
    /// Standard deviations of the amplitudes by then, with the drift that the settings allow.
    pub deviations: Vec<f64>,
}

impl Replay {
    /// Alarms that stand at the end.
    pub fn standing(&self) -> &[(usize, Alarm)] {
        self.steps.last().map_or(&[], |step| &step.alarms)
    }

    /// Alarms that no reading before had, with the step that has raised each.
    pub fn raised(&self) -> impl Iterator<Item = (&Step, &(usize, Alarm))> {
        let mut before: &[(usize, Alarm)] = &[];
        self.steps.iter().flat_map(move |step| {
            let had = std::mem::replace(&mut before, &step.alarms);
            let is_new = move |(n, _): &&(usize, Alarm)| had.iter().all(|(other, _)| other != n);
            step.alarms.iter().filter(is_new).map(move |alarm| (step, alarm))
        })
    }
}

/// Runs a log through the core's estimator.
///
/// # Errors
/// Settings that the core refuses, or a temperature.
pub fn replay(
    machine: &Machine<f64>,
    table: Option<&CorrectionTable<'_, f64>>,
    learn: Learn,
    log: &[Entry],
) -> Result<Replay> {
    replay_and_propose(machine, table, learn, log, None)
}

/// Runs a log through the core's estimator, and says where to probe next.
///
/// # Errors
/// Settings that the core refuses, or a temperature.
pub fn replay_and_propose(
    machine: &Machine<f64>,
    table: Option<&CorrectionTable<'_, f64>>,
    learn: Learn,
    log: &[Entry],
    ask: Option<Ask>,
) -> Result<Replay> {
    match learn.amplitudes.len() {
        1 => with::<1>(machine, table, learn, log, ask),
        2 => with::<2>(machine, table, learn, log, ask),
        3 => with::<3>(machine, table, learn, log, ask),
        4 => with::<4>(machine, table, learn, log, ask),
        5 => with::<5>(machine, table, learn, log, ask),
        6 => with::<6>(machine, table, learn, log, ask),
        7 => with::<7>(machine, table, learn, log, ask),
        MAX_AMPLITUDES => with::<MAX_AMPLITUDES>(machine, table, learn, log, ask),
        other => Err(Failure::input(format!("expected 1 to {MAX_AMPLITUDES} amplitudes, found {other}"))),
    }
}

/// Displacement of A that machine and table predict; none where there is none.
fn loaded(
    machine: &Machine<f64>,
    table: Option<&CorrectionTable<'_, f64>>,
    touch: &Touch<f64>,
) -> Option<Deflection<f64>> {
    machine.deflection(table, &touch.pose, &touch.wrench.moved_to_a(touch.tip_m), &Wrench::ZERO).ok()
}

/// See [`Replay::alarm_ratios`].
fn alarm_ratios(
    machine: &Machine<f64>,
    table: Option<&CorrectionTable<'_, f64>>,
    amplitudes: &[AmplitudeSettings],
    log: &[Entry],
) -> Vec<f64> {
    let ratio = |own: &AmplitudeSettings| {
        let (mut moved, mut yields) = (0.0, 0.0);
        for touch in log.iter().step_by(log.len().div_ceil(BATCH).max(1)).map(|entry| &entry.touch) {
            let wrench = touch.wrench.moved_to_a(touch.tip_m);
            let Ok([shown]) = machine.sensitivities(&touch.pose, &wrench, &[own.amplitude]) else { continue };
            let Some(predicted) = loaded(machine, table, touch) else { continue };
            let square = |d: Deflection<f64>| d.seen_at(touch.tip_m).translation_m.norm_squared();
            moved += square(shown) * own.alarm.powi(2);
            yields += square(predicted);
        }
        if own.amplitude.place().is_some() && yields > 0.0 { (moved / yields).sqrt() } else { 0.0 }
    };
    amplitudes.iter().map(ratio).collect()
}

fn with<const N: usize>(
    machine: &Machine<f64>,
    table: Option<&CorrectionTable<'_, f64>>,
    learn: Learn,
    log: &[Entry],
    ask: Option<Ask>,
) -> Result<Replay> {
    let refused = |e: &dyn std::fmt::Display| Failure::input(e.to_string());
    let amplitudes = learn.amplitudes.as_slice().try_into().map_err(|e| refused(&e))?;
    let settings = EstimatorSettings::<N> { amplitudes, model_share: learn.model_share };
    let mut estimator = Estimator::<f64, N>::new(&settings).map_err(|e| refused(&e))?;
    let alarm_ratios = alarm_ratios(machine, table, &learn.amplitudes, log);
    let middle = PoseBox::of(log.iter().map(|entry| &entry.touch.pose)).middle_pose();
    let limbs_m_per_n = limb_compliances_m_per_n(machine, &middle).ok();
    let (steps, batch, age, next, diagnosed) = (Vec::new(), None, Age::default(), Vec::new(), None);
    let mut replay = Replay { learn, steps, batch, age, alarm_ratios, limbs_m_per_n, next, diagnosed };
    for entry in log {
        let Entry { line, touch, temperature_c, readings } = entry;
        let machine = machine.at_temperature(*temperature_c).map_err(|e| refused(&e).at_line(*line))?;
        let learned = estimator.learn(&machine, table, touch, readings);
        replay.steps.push(Step {
            line: *line,
            time_s: touch.time_s,
            outcome: learned.map(|learned| learned.chi_squared / readings.len() as f64),
            outside_box: learned.is_ok_and(|learned| learned.domain == Some(Domain::Outside)),
            changed: learned.is_ok_and(|learned| learned.changed.contains(&true)),
            values: estimator.values().to_vec(),
            compensated: estimator.targets().to_vec(),
            alarms: (0..).zip(estimator.alarms()).filter_map(|(n, alarm)| Some((n, alarm?))).collect(),
        });
    }
    let now_s = log.last().map_or(0, |entry| entry.touch.time_s.max(estimator.time_s()));
    replay.age = Age {
        since_first_s: now_s - estimator.began_s(),
        since_last_s: now_s - estimator.time_s(),
        deviations: estimator.deviations_at(now_s).to_vec(),
    };
    let taken = log.iter().zip(&replay.steps).filter(|(_, step)| step.outcome.is_ok()).map(|(entry, _)| entry);
    let taken: Vec<&Entry> = taken.collect();
    let last = &taken[taken.len().saturating_sub(BATCH)..];
    replay.batch = batch::fit(machine, table, &settings, last);
    if let Some(ask) = ask {
        replay.next = design::propose(machine, table, (&estimator, &settings), &ask, log);
    }
    Ok(replay)
}
