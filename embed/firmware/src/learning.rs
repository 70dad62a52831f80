//! What the cyclic firmware learns from readings of the tip, and compensates with it.
//!
//! The task owns the estimator, since it has the table in service; `main` asks it, and keeps its state in the board's two [`slots`].

use core::cell::Cell;
use core::sync::atomic::Ordering::Relaxed;

use cortex_m::asm::wfi;
use critical_section::Mutex;
use pkm_core::compensator::{Compensator, CompensatorSettings, Reading};
use pkm_core::estimation::{Estimator, Refusal, state_bytes};
use pkm_core::{CorrectionTable, Machine, Scalar};
use pkm_protocol::{Answer, Arithmetic, Code, Demand, Learned, Probe};

use crate::board::Flash;
use crate::learned::SETTINGS;
use crate::slots::{NotSaved, restore, save};
use crate::{ABORTED, MAIN_SILENT, PERIOD_HZ, coefficients};

const AMPLITUDES: usize = SETTINGS.amplitudes.len();
const PERIOD_S: f64 = 1.0 / PERIOD_HZ as f64;

type Learner = Estimator<f64, AMPLITUDES>;

/// For a load that is computed, not measured.
const COMPENSATION: CompensatorSettings =
    CompensatorSettings { period_s: PERIOD_S, gain: 1.0, stuck_s: 0.0, ..CompensatorSettings::DEFAULT };

/// The task's side: what it knows, and what it compensates with that.
#[derive(Clone, Copy)]
pub struct Task {
    learner: Learner,
    /// What it knows, narrowed.
    single: Estimator<f32, AMPLITUDES>,
    of_double: Compensator<f64, 3>,
    of_single: Compensator<f32, 3>,
    /// The latest demand, at whose place the offset goes back when there is none any more.
    latest: Option<Demand>,
    offset_m: [f64; 3],
    compensated: u32,
}

/// From `main` to the task.
#[derive(Clone, Copy)]
enum Question {
    Probe(Probe),
    State,
}

/// From the task to `main`.
#[derive(Clone, Copy)]
struct Known {
    refused: Option<Refusal>,
    learner: Learner,
    offset_m: [f64; 3],
    compensated: u32,
}

/// What the task begins with.
static FIRST: Mutex<Cell<Option<Task>>> = Mutex::new(Cell::new(None));
static ASKED: Mutex<Cell<Option<Question>>> = Mutex::new(Cell::new(None));
static KNOWN: Mutex<Cell<Option<Known>>> = Mutex::new(Cell::new(None));

/// Tables in service, in either arithmetic.
pub struct Tables<'a> {
    pub single: CorrectionTable<'a, f32>,
    pub double: CorrectionTable<'a, f64>,
}

/// The task's part of a period: compensates the demand, learns what `main` asks it to, and tells what it knows. A reading takes as long as
/// a cycle, in `f64`.
pub fn work(task: &mut Option<Task>, tables: &Tables<'_>, demand: Option<Demand>) {
    let asked = critical_section::with(|cs| {
        if let Some(first) = FIRST.borrow(cs).take() {
            *task = Some(first);
        }
        ASKED.borrow(cs).take()
    });
    let Some(task) = task else { return };
    task.compensate(tables, demand);
    let refused = match asked {
        None => return,
        Some(Question::Probe(probe)) => task.learn(&tables.double, &probe).err(),
        Some(Question::State) => None,
    };
    let Task { learner, offset_m, compensated, .. } = *task;
    let known = Known { refused, learner, offset_m, compensated };
    critical_section::with(|cs| KNOWN.borrow(cs).set(Some(known)));
}

impl Task {
    /// With what was saved, if it is whole; and its sequence number then.
    fn new(flash: &Flash) -> Option<(Self, Option<u32>)> {
        let mut task = Self {
            learner: Estimator::new(&SETTINGS).ok()?,
            single: Estimator::new(&SETTINGS).ok()?,
            of_double: Compensator::new(&COMPENSATION).ok()?,
            of_single: Compensator::new(&COMPENSATION).ok()?,
            latest: None,
            offset_m: [0.0; 3],
            compensated: 0,
        };
        let saved = restore(flash, machine(), &mut task.learner).ok();
        task.narrow();
        Some((task, saved))
    }

    fn learn(&mut self, table: &CorrectionTable<'_, f64>, probe: &Probe) -> Result<(), Refusal> {
        let learned = self.learner.learn(&coefficients::MACHINE_F64, Some(table), &probe.touch, &probe.readings());
        self.narrow();
        learned.map(drop)
    }

    fn narrow(&mut self) {
        let mut state = [0; state_bytes(AMPLITUDES)];
        // both are of the same settings
        let _ = self.learner.save(machine(), 0, &mut state).and_then(|()| self.single.restore(machine(), &state));
    }

    /// Without a demand the offset goes back to none. Each arithmetic has a compensator of its own: the offset of one is gone before that
    /// of the other comes, or it would leap.
    fn compensate(&mut self, tables: &Tables<'_>, demand: Option<Demand>) {
        let (at, enabled) = match (demand, self.latest) {
            (Some(next), Some(last)) if next.arithmetic != last.arithmetic && self.offset_m != [0.0; 3] => {
                (last, false)
            }
            (Some(next), _) => (next, true),
            (None, Some(last)) => (last, false),
            (None, None) => return,
        };
        self.latest = Some(at);
        if enabled {
            self.compensated = self.compensated.wrapping_add(1);
            self.learner.follow(PERIOD_S);
            self.single.follow(PERIOD_S as f32);
        }
        self.offset_m = match at.arithmetic {
            Arithmetic::F32 => {
                update(&mut self.of_single, &self.single, (&tables.single, &coefficients::MACHINE_F32), &at, enabled)
            }
            Arithmetic::F64 => {
                update(&mut self.of_double, &self.learner, (&tables.double, &coefficients::MACHINE_F64), &at, enabled)
            }
        };
    }
}

/// A period of the compensation, in the arithmetic of the demand.
fn update<T: Scalar>(
    compensator: &mut Compensator<T, 3>,
    learned: &Estimator<T, AMPLITUDES>,
    (table, machine): (&CorrectionTable<'_, T>, &Machine<T>),
    demand: &Demand,
    enabled: bool,
) -> [f64; 3] {
    let (pose, wrench, tip_m) = demand.inputs();
    let reading = Reading { enabled, wrench, rise: T::ZERO.into() };
    compensator.update_learned(table, machine, learned, (&pose, tip_m), &reading).joints.map(T::to_f64).into()
}

/// `None` when the host gives up.
fn ask(question: Question) -> Option<Known> {
    critical_section::with(|cs| {
        KNOWN.borrow(cs).set(None);
        ASKED.borrow(cs).set(Some(question));
    });
    loop {
        if let Some(known) = critical_section::with(|cs| KNOWN.borrow(cs).take()) {
            return Some(known);
        }
        if ABORTED.load(Relaxed) {
            return None;
        }
        MAIN_SILENT.store(0, Relaxed);
        wfi();
    }
}

/// `main`'s side.
pub struct Learning {
    flash: Flash,
    /// Sequence number of the state that stands in the flash.
    saved: Option<u32>,
}

impl Learning {
    /// Goes on from the newest state that is whole; without one from the settings.
    pub fn begin() -> Self {
        let flash = Flash;
        let Some((task, saved)) = Task::new(&flash) else { return Self { flash, saved: None } };
        critical_section::with(|cs| FIRST.borrow(cs).set(Some(task)));
        Self { flash, saved }
    }

    /// Takes a reading in, and tells what is known then.
    pub fn probe(&self, probe: Probe) -> Answer<'static, f64> {
        self.known(ask(Question::Probe(probe)))
    }

    /// Tells what is known.
    pub fn state(&self) -> Answer<'static, f64> {
        self.known(ask(Question::State))
    }

    /// Keeps what is known.
    pub fn save(&mut self) -> Answer<'static, f64> {
        let Some(known) = ask(Question::State) else { return Answer::Error(Code::Aborted) };
        match save(&mut self.flash, machine(), &known.learner) {
            Ok(sequence) => {
                self.saved = Some(sequence);
                self.known(Some(known))
            }
            Err(NotSaved) => Answer::Error(Code::NotSaved),
        }
    }

    fn known(&self, known: Option<Known>) -> Answer<'static, f64> {
        let Some(Known { refused, learner, offset_m, compensated }) = known else {
            return Answer::Error(Code::Aborted);
        };
        let mut state = [0; state_bytes(AMPLITUDES)];
        let written = learner.save(machine(), 0, &mut state).ok();
        let learned = written.and_then(|()| Learned::new(&learner, &state, refused, self.saved));
        let learned = learned.map(|learned| Learned { offset_m, compensated, ..learned });
        learned.map_or(Answer::Error(Code::Range), Answer::Learned)
    }
}

/// The checksum that a state goes with.
const fn machine() -> u64 {
    const { coefficients::PARAMETERS.checksum() }
}
