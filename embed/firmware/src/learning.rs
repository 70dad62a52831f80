//! What the cyclic firmware learns from readings of the tip.
//!
//! The task owns the estimator, since it has the table in service; `main` asks it, and keeps its state in the board's two [`slots`].

use core::cell::Cell;
use core::sync::atomic::Ordering::Relaxed;

use cortex_m::asm::wfi;
use critical_section::Mutex;
use pkm_core::CorrectionTable;
use pkm_core::estimation::{Estimator, Refusal, state_bytes};
use pkm_protocol::{Answer, Code, Learned, Probe};

use crate::board::Flash;
use crate::learned::SETTINGS;
use crate::slots::{NotSaved, restore, save};
use crate::{ABORTED, MAIN_SILENT, coefficients};

const AMPLITUDES: usize = SETTINGS.amplitudes.len();

/// What the task knows.
pub type Learner = Estimator<f64, AMPLITUDES>;

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
}

/// What the task begins with.
static FIRST: Mutex<Cell<Option<Learner>>> = Mutex::new(Cell::new(None));
static ASKED: Mutex<Cell<Option<Question>>> = Mutex::new(Cell::new(None));
static KNOWN: Mutex<Cell<Option<Known>>> = Mutex::new(Cell::new(None));

/// The task's part of a period: learns what `main` asks it to, and tells what it knows. A reading takes as long as a cycle, in `f64`.
pub fn work(learner: &mut Option<Learner>, table: &CorrectionTable<'_, f64>) {
    let asked = critical_section::with(|cs| {
        if let Some(first) = FIRST.borrow(cs).take() {
            *learner = Some(first);
        }
        ASKED.borrow(cs).take()
    });
    let (Some(asked), Some(learner)) = (asked, learner) else { return };
    let refused = match asked {
        Question::Probe(probe) => {
            learner.learn(&coefficients::MACHINE_F64, Some(table), &probe.touch, &probe.readings()).err()
        }
        Question::State => None,
    };
    critical_section::with(|cs| KNOWN.borrow(cs).set(Some(Known { refused, learner: *learner })));
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
        let mut saved = None;
        if let Ok(mut learner) = Learner::new(&SETTINGS) {
            saved = restore(&flash, machine(), &mut learner).ok();
            critical_section::with(|cs| FIRST.borrow(cs).set(Some(learner)));
        }
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
        let Some(Known { refused, learner }) = known else { return Answer::Error(Code::Aborted) };
        let mut state = [0; state_bytes(AMPLITUDES)];
        let written = learner.save(machine(), 0, &mut state).ok();
        let learned = written.and_then(|()| Learned::new(&learner, &state, refused, self.saved));
        learned.map_or(Answer::Error(Code::Range), Answer::Learned)
    }
}

/// The checksum that a state goes with.
const fn machine() -> u64 {
    const { coefficients::PARAMETERS.checksum() }
}
