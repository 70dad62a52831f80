//! What the cyclic firmware learns from readings of the tip, and compensates with it.
//!
//! The task owns the estimator, since it has the table in service; `main` asks it, and keeps its state in the board's two [`slots`].

use core::cell::Cell;
use core::sync::atomic::Ordering::Relaxed;

use cortex_m::asm::wfi;
use critical_section::Mutex;
use pkm_core::compensator::Fault;
use pkm_core::estimation::{Refusal, state_bytes};
use pkm_core::{CorrectionTable, Model};
use pkm_protocol::{Answer, Code, Demand, Learned, OffsetFault, Probe};

use crate::board::Flash;
use crate::compensation::{AMPLITUDES, Compensation, Learner, Models, Weighed};
use crate::learned::SETTINGS;
use crate::slots::{NotSaved, restore, save};
use crate::{ABORTED, MAIN_SILENT, PERIOD_HZ, coefficients};

const PERIOD_S: f64 = 1.0 / PERIOD_HZ as f64;

/// The task's side: what it knows, and what it compensates with that.
pub type Task = Compensation;

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
    fault: Option<Fault>,
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

impl Tables<'_> {
    /// With the machine of the image.
    pub fn models(&self) -> Models<'_> {
        let single = Model::new(&coefficients::MACHINE_F32, &self.single);
        Models { single, double: Model::new(&coefficients::MACHINE_F64, &self.double) }
    }
}

/// The task's part of a period: takes the weight over that has come, compensates the demand, learns what `main` asks it to, and tells what it knows. A reading takes as long as
/// a cycle, in `f64`.
pub fn work(task: &mut Option<Task>, tables: &Tables<'_>, weighed: Option<Weighed>, demand: Option<Demand>) {
    let asked = critical_section::with(|cs| {
        if let Some(first) = FIRST.borrow(cs).take() {
            *task = Some(first);
        }
        ASKED.borrow(cs).take()
    });
    let Some(task) = task else { return };
    if let Some(weighed) = &weighed {
        task.carry(weighed);
    }
    task.period(&tables.models(), demand);
    let refused = match asked {
        None => return,
        Some(Question::Probe(probe)) => learn(task, &tables.double, &probe).err(),
        Some(Question::State) => None,
    };
    let Task { learner, offset_m, fault, compensated, .. } = *task;
    let known = Known { refused, learner, offset_m, fault, compensated };
    critical_section::with(|cs| KNOWN.borrow(cs).set(Some(known)));
}

/// With what was saved, if it is whole; and its sequence number then.
fn begin(flash: &Flash) -> Option<(Task, Option<u32>)> {
    let mut task = Task::new(&SETTINGS, PERIOD_S)?;
    let saved = restore(flash, model(const { coefficients::TABLE_F64.checksum() }), &mut task.learner).ok();
    task.narrow();
    Some((task, saved))
}

fn learn(task: &mut Task, table: &CorrectionTable<'_, f64>, probe: &Probe) -> Result<(), Refusal> {
    let learned = task.learner.learn(&coefficients::MACHINE_F64, Some(table), &probe.touch, &probe.readings());
    task.narrow();
    learned.map(drop)
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
        let Some((task, saved)) = begin(&flash) else { return Self { flash, saved: None } };
        critical_section::with(|cs| FIRST.borrow(cs).set(Some(task)));
        Self { flash, saved }
    }

    /// Takes a reading in, and tells what is known then, beyond the table in service.
    pub fn probe(&self, table: u64, probe: Probe) -> Answer<'static, f64> {
        self.known(table, ask(Question::Probe(probe)))
    }

    /// Tells what is known.
    pub fn state(&self, table: u64) -> Answer<'static, f64> {
        self.known(table, ask(Question::State))
    }

    /// Keeps what is known.
    pub fn save(&mut self, table: u64) -> Answer<'static, f64> {
        let Some(known) = ask(Question::State) else { return Answer::Error(Code::Aborted) };
        match save(&mut self.flash, model(table), &known.learner) {
            Ok(sequence) => {
                self.saved = Some(sequence);
                self.known(table, Some(known))
            }
            Err(NotSaved) => Answer::Error(Code::NotSaved),
        }
    }

    fn known(&self, table: u64, known: Option<Known>) -> Answer<'static, f64> {
        let Some(Known { refused, learner, offset_m, fault, compensated }) = known else {
            return Answer::Error(Code::Aborted);
        };
        let mut state = [0; state_bytes(AMPLITUDES)];
        let written = learner.save(model(table), 0, &mut state).ok();
        let learned = written.and_then(|()| Learned::new(&learner, &state, refused, self.saved));
        let learned =
            learned.map(|learned| Learned { offset_m, fault: fault.map(OffsetFault::from), compensated, ..learned });
        learned.map_or(Answer::Error(Code::Range), Answer::Learned)
    }
}

/// What a state goes with: the machine, and the table in service by its checksum.
const fn model(table: u64) -> u64 {
    table ^ const { coefficients::PARAMETERS.checksum() }
}
