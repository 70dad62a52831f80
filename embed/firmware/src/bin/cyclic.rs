//! Reference firmware: the core in a cyclic task of 1 kHz, and a serial line (`pkm-protocol`) to drive and watch it.
//!
//! * SysTick begins a period. If the task still runs, that is an overrun: it is counted and the period has no run, nor has the next, which is `main`'s.
//! * PendSV is the task. It takes the latest demand and computes [`CorrectionTable::cycle`](pkm_core::CorrectionTable::cycle).
//! * The serial line's interrupt keeps the bytes that come.
//! * `main` reads lines and answers. To `cycle` it answers with the first run that had the demand; `sweep` is one demand after another.
//!
//! A table that comes over the line is put into service between two runs. `main` fills and checks one of two [`Tables`]; references to them change hands, so that the task
//! never waits for `main` and no table is written while it is used, see `service`. After a start the table of the image is in service.
//!
//! The task also compensates each demand, as a controller would in every period, with its temperatures and with the weight that `weight` tells: `learned` tells the offset. From `probe` it learns what has changed
//! in the machine, and compensates with that; what it knows is kept over a restart, see `learning`.
//!
//! What ends it: a demand that nothing follows for [`DEMAND_PERIODS`] is dropped. The task feeds the watchdog while `main` shows
//! signs of life; a panic, an exception or a stack that meets its guard stop everything, and the watchdog starts the board again, without a demand
//! and with the reason in `status`. A board with the wrong clock or a damaged memory stands still.
//!
//! `pkm-host hil` is the other end. Logs (features `log-*`) of QEMU's semihosting go to its standard output: give the serial line
//! another place then, such as `-serial pty`. The machine and its table are the `coefficients.rs` that `build.rs` was given; the board is a
//! feature, see `board`.

#![no_std]
#![no_main]
#![deny(unsafe_code)]

#[path = "../board/mod.rs"]
mod board;
#[allow(dead_code)]
mod coefficients {
    include!(concat!(env!("OUT_DIR"), "/coefficients.rs"));
}

#[path = "../compensation.rs"]
mod compensation;
#[path = "../learned.rs"]
mod learned;
#[path = "../learning.rs"]
mod learning;
#[path = "../service.rs"]
mod service;
#[path = "../slots.rs"]
mod slots;

use core::cell::{Cell, RefCell};
use core::sync::atomic::{AtomicBool, AtomicU32, Ordering::Relaxed};

use cortex_m::Peripherals;
use cortex_m::asm::wfi;
use cortex_m::peripheral::{SCB, SYST};
use cortex_m::singleton;
use cortex_m_rt::{entry, exception};
use critical_section::Mutex;
#[cfg(feature = "log-rtt")]
use defmt_rtt as _;
#[cfg(feature = "log-semihosting")]
use defmt_semihosting as _;
use heapless::Deque;
use pkm_core::correction::TableWatch;
use pkm_core::self_test::{SelfTestMemory, self_test_f32, self_test_f64};
use pkm_core::{Cycle, CycleError, FiveAxis, Scalar};
use pkm_protocol::{
    ABORT, Answer, Arithmetic, Checksum, Code, Command, Counters, CycleReply, Demand, Fault, Hello, Lines, MAX_COMMAND,
    MAX_REPLY, Refused, Reply, Request, SweepReply, VERSION,
};
use serde::Serialize;

use board::Received;
use learning::{Learning, Task};
use service::{BEFORE, NEXT, Next, Service, Tables};

macro_rules! log {
    ($($part:tt)*) => {
        #[cfg(feature = "log")]
        defmt::info!($($part)*);
    };
}

const PERIOD_HZ: u32 = 1000;
const PERIOD_TICKS: u32 = board::CORE_HZ / PERIOD_HZ;
/// Periods that the task goes on with a demand. The host of a machine that moves sends one in every period.
const DEMAND_PERIODS: u32 = PERIOD_HZ;
/// Periods that the serial line may take for a byte, and `main` for anything.
const PATIENCE_PERIODS: u32 = 2 * PERIOD_HZ;
/// Bytes that may wait for `main`.
const INPUT_BYTES: usize = 4096;

/// What one run of the task gave.
#[derive(Clone, Copy)]
struct Run {
    result: Computed,
    ticks: u32,
    overrun: bool,
}

// no heap to put the larger one on
#[allow(clippy::large_enum_variant)]
#[derive(Clone, Copy)]
enum Computed {
    F32(Result<Cycle<f32>, CycleError>),
    F64(Result<Cycle<f64>, CycleError>),
}

static PERIODS: AtomicU32 = AtomicU32::new(0);
static CYCLES: AtomicU32 = AtomicU32::new(0);
static OVERRUNS: AtomicU32 = AtomicU32::new(0);
static WORST_TICKS: AtomicU32 = AtomicU32::new(0);
static RUNNING: AtomicBool = AtomicBool::new(false);
/// The task has a demand.
static WORKING: AtomicBool = AtomicBool::new(false);
static LATE: AtomicBool = AtomicBool::new(false);
static LOST_REPLIES: AtomicU32 = AtomicU32::new(0);
static DROPPED_DEMANDS: AtomicU32 = AtomicU32::new(0);
/// Asked for by the host; told to `main` by the task.
static ABORT_ASKED: AtomicBool = AtomicBool::new(false);
static ABORTED: AtomicBool = AtomicBool::new(false);
/// Periods since `main` was seen at work.
static MAIN_SILENT: AtomicU32 = AtomicU32::new(0);
/// The latest, for the task's next run.
static DEMAND: Mutex<Cell<Option<Demand>>> = Mutex::new(Cell::new(None));
/// The latest.
static RUN: Mutex<Cell<Option<Run>>> = Mutex::new(Cell::new(None));
static INPUT: Mutex<RefCell<Deque<u8, INPUT_BYTES>>> = Mutex::new(RefCell::new(Deque::new()));

/// Ticks since the start; wraps.
fn ticks() -> u32 {
    loop {
        let periods = PERIODS.load(Relaxed);
        let in_period = PERIOD_TICKS - 1 - SYST::get_current();
        // a period that has begun and is not counted yet would be lost
        if periods == PERIODS.load(Relaxed) && !SCB::is_pendst_pending() {
            return periods.wrapping_mul(PERIOD_TICKS).wrapping_add(in_period);
        }
    }
}

#[exception]
fn SysTick() {
    PERIODS.fetch_add(1, Relaxed);
    MAIN_SILENT.fetch_add(1, Relaxed);
    // a run that waits has lost its period as well
    if RUNNING.load(Relaxed) || SCB::is_pendsv_pending() {
        OVERRUNS.fetch_add(1, Relaxed);
        LATE.store(true, Relaxed);
    } else if LATE.swap(false, Relaxed) {
        // the period is `main`'s: a late run that ends just before a tick, again and again, would leave it no time at all
        OVERRUNS.fetch_add(1, Relaxed);
    } else {
        SCB::set_pendsv();
    }
}

#[exception]
fn PendSV() {
    static mut WORKING_ON: Option<Demand> = None;
    static mut DEMANDED_AT: u32 = 0;
    static mut IN_SERVICE: Option<&'static mut Tables> = None;
    static mut LEARNED: Option<Task> = None;
    static mut WATCHES: [TableWatch; 2] =
        [TableWatch::new(coefficients::TABLE_F32.checksum()), TableWatch::new(coefficients::TABLE_F64.checksum())];
    if MAIN_SILENT.load(Relaxed) < PATIENCE_PERIODS {
        board::feed_watchdog();
    }
    LATE.store(false, Relaxed);
    RUNNING.store(true, Relaxed);
    let begun = ticks();
    let Next { tables, weighed } = critical_section::with(|cs| NEXT.borrow(cs).take());
    if let Some(tables) = tables {
        if let (Some(single), Some(double)) = (tables.f32.watch(), tables.f64.watch()) {
            *WATCHES = [single, double];
        }
        if let Some(task) = LEARNED {
            task.forget(&learned::SETTINGS);
        }
        let before = IN_SERVICE.replace(tables);
        critical_section::with(|cs| BEFORE.borrow(cs).set(Some(before)));
    }
    if let Some(demand) = critical_section::with(|cs| DEMAND.borrow(cs).take()) {
        (*WORKING_ON, *DEMANDED_AT) = (Some(demand), PERIODS.load(Relaxed));
    }
    let abort = ABORT_ASKED.swap(false, Relaxed);
    // periods and not runs: an overrun must not prolong it
    let ended = PERIODS.load(Relaxed).wrapping_sub(*DEMANDED_AT) >= DEMAND_PERIODS;
    if WORKING_ON.is_some() && (abort || ended) {
        *WORKING_ON = None;
        DROPPED_DEMANDS.fetch_add(1, Relaxed);
    }
    if abort {
        ABORTED.store(true, Relaxed);
    }
    WORKING.store(WORKING_ON.is_some(), Relaxed);
    let tables = Tables::in_service(IN_SERVICE.as_deref());
    let [single, double] = WATCHES;
    if single.look(&tables.single).and(double.look(&tables.double)).is_err() {
        stop(Fault::SelfTest);
    }
    if let Some(demand) = WORKING_ON {
        let result = match demand.arithmetic {
            Arithmetic::F32 => Computed::F32(demand.cycle(&coefficients::MACHINE_F32, &tables.single)),
            Arithmetic::F64 => Computed::F64(demand.cycle(&coefficients::MACHINE_F64, &tables.double)),
        };
        let ticks = ticks().wrapping_sub(begun);
        let run = Run { result, ticks, overrun: LATE.load(Relaxed) };
        critical_section::with(|cs| RUN.borrow(cs).set(Some(run)));
        CYCLES.fetch_add(1, Relaxed);
        WORST_TICKS.fetch_max(ticks, Relaxed);
    }
    learning::work(LEARNED, &tables, weighed, *WORKING_ON);
    RUNNING.store(false, Relaxed);
}

/// Keeps what came. Where bytes are lost their line gets one that no command has.
fn received(what: Received) {
    static LOSING: AtomicBool = AtomicBool::new(false);
    const NO_COMMAND_HAS: u8 = 0xff;
    if matches!(what, Received::Byte(ABORT)) {
        ABORT_ASKED.store(true, Relaxed);
        return;
    }
    critical_section::with(|cs| {
        let mut input = INPUT.borrow_ref_mut(cs);
        let room = INPUT_BYTES - input.len();
        let byte = match what {
            // up to the end of the line, and that when there is room
            Received::Byte(b'\n') if room > 1 => {
                LOSING.store(false, Relaxed);
                b'\n'
            }
            _ if LOSING.load(Relaxed) || room == 0 => return,
            Received::Byte(byte) if room > 1 => byte,
            _ => {
                LOSING.store(true, Relaxed);
                NO_COMMAND_HAS
            }
        };
        let _ = input.push_back(byte);
    });
}

fn send<T: Scalar + Serialize>(id: Option<u32>, answer: Answer<'_, T>) {
    let mut buffer = [0; MAX_REPLY];
    let reply = Reply { v: VERSION, id, answer };
    for byte in reply.write(&mut buffer).unwrap_or_default() {
        let begun = PERIODS.load(Relaxed);
        while !board::try_send(*byte) {
            if PERIODS.load(Relaxed).wrapping_sub(begun) > PATIENCE_PERIODS {
                LOST_REPLIES.fetch_add(1, Relaxed);
                return;
            }
        }
        MAIN_SILENT.store(0, Relaxed);
    }
}

/// The first run that has this demand: runs interrupt `main`, so that any that ends from now on began from now on. `None` when the
/// host gives up.
fn run_of(demand: Demand) -> Option<Run> {
    critical_section::with(|cs| {
        RUN.borrow(cs).set(None);
        DEMAND.borrow(cs).set(Some(demand));
    });
    loop {
        if let Some(run) = critical_section::with(|cs| RUN.borrow(cs).take()) {
            return Some(run);
        }
        if ABORTED.load(Relaxed) {
            return None;
        }
        MAIN_SILENT.store(0, Relaxed);
        wfi();
    }
}

fn answer(request: &Request, service: &mut Service, bad_lines: u32, last_fault: Option<Fault>) {
    let id = Some(request.id);
    ABORTED.store(false, Relaxed);
    match request.command {
        Command::Table(header) => send(id, service.fill(|spare| spare.begin(&header))),
        Command::Numbers(piece) => send(id, service.fill(|spare| spare.take(&piece))),
        Command::Swap => send(id, service.swap()),
        Command::Weight(carried) => send(id, service.carry(&carried)),
        Command::Probe(probe) => send(id, service.learning.probe(service.table, probe)),
        Command::Learned => send(id, service.learning.state(service.table)),
        // a memory that is erased may stop the processor for long
        Command::Save if WORKING.load(Relaxed) => send::<f64>(id, Answer::Error(Code::Busy)),
        Command::Save => send(id, service.learning.save(service.table)),
        Command::Hello => {
            let travel = coefficients::PARAMETERS.travel;
            let hello = Hello {
                firmware: concat!(env!("CARGO_PKG_NAME"), " ", env!("CARGO_PKG_VERSION")),
                board: board::NAME,
                machine: Checksum(const { coefficients::PARAMETERS.checksum() }),
                table: Checksum(service.table),
                period_s: 1.0 / f64::from(PERIOD_HZ),
                ticks_hz: board::CORE_HZ,
                travel_min_m: travel.min_m,
                travel_max_m: travel.max_m,
                max_command_bytes: MAX_COMMAND as u32,
                input_bytes: INPUT_BYTES as u32,
                stack_bytes: board::stack_bytes().0,
            };
            send::<f64>(id, Answer::Hello(hello));
        }
        Command::Status => {
            // looking through a large memory takes many periods: before the counters, which are of one moment
            let (_, stack_used_bytes) = board::stack_bytes();
            let counters = critical_section::with(|_| Counters {
                cycles: CYCLES.load(Relaxed),
                overruns: OVERRUNS.load(Relaxed),
                worst_ticks: WORST_TICKS.load(Relaxed),
                stack_used_bytes,
                bad_lines,
                lost_replies: LOST_REPLIES.load(Relaxed),
                dropped_demands: DROPPED_DEMANDS.load(Relaxed),
                last_fault,
            });
            send::<f64>(id, Answer::Status(counters));
        }
        Command::Cycle(demand) => {
            let Some(Run { result, ticks, overrun }) = run_of(demand) else {
                return send::<f64>(id, Answer::Error(Code::Aborted));
            };
            if overrun {
                log!("a run of {} ticks did not end within its period", ticks);
            }
            match result {
                Computed::F32(result) => send(id, Answer::Cycle(CycleReply::new(&result, ticks, overrun))),
                Computed::F64(result) => send(id, Answer::Cycle(CycleReply::new(&result, ticks, overrun))),
            }
        }
        Command::Sweep(sweep) => {
            let mut reply = SweepReply::default();
            for demand in sweep.demands() {
                let Some(Run { result, ticks, overrun }) = run_of(demand) else {
                    return send::<f64>(id, Answer::Error(Code::Aborted));
                };
                match result {
                    Computed::F32(result) => reply.add(&CycleReply::new(&result, ticks, overrun)),
                    Computed::F64(result) => reply.add(&CycleReply::new(&result, ticks, overrun)),
                }
            }
            send::<f64>(id, Answer::Sweep(reply));
        }
    }
}

/// Whether the processor computes as it should, and machine, wrist and table are in memory as they were built.
fn is_intact() -> bool {
    static F32: FiveAxis<'static, f32> =
        FiveAxis { machine: &coefficients::MACHINE_F32, wrist: &coefficients::WRIST_F32 };
    static F64: FiveAxis<'static, f64> =
        FiveAxis { machine: &coefficients::MACHINE_F64, wrist: &coefficients::WRIST_F64 };
    let built_f32 = const { F32.checksums(&coefficients::TABLE_F32) };
    let built_f64 = const { F64.checksums(&coefficients::TABLE_F64) };
    self_test_f32(&mut SelfTestMemory::new()).is_ok()
        && self_test_f64(&mut SelfTestMemory::new()).is_ok()
        && F32.verify(&coefficients::TABLE_F32, &built_f32).is_ok()
        && F64.verify(&coefficients::TABLE_F64, &built_f64).is_ok()
}

/// What a word of the last start says.
fn fault(word: u32) -> Option<Fault> {
    [Fault::Restart, Fault::Panic, Fault::Exception, Fault::Stack, Fault::SelfTest]
        .into_iter()
        .find(|f| *f as u32 == word)
}

#[entry]
fn main() -> ! {
    let last_fault = board::left().and_then(fault);
    // as long as nothing better is known
    board::leave(Fault::Restart as u32);
    if !is_intact() {
        stop(Fault::SelfTest);
    }
    if let Some(peripherals) = Peripherals::take()
        && board::start(peripherals, PERIOD_TICKS).is_err()
    {
        stop(Fault::Exception);
    }
    log!("{} at {} Hz, period {} ticks", board::NAME, board::CORE_HZ, PERIOD_TICKS);
    let mut service = Service {
        table: const { coefficients::TABLE_F64.checksum() },
        spare: [singleton!(: Tables = Tables::new()), singleton!(: Tables = Tables::new())],
        copy: singleton!(: Tables = Tables::new()),
        carried: None,
        learning: Learning::begin(),
    };
    let mut lines = Lines::new();
    let mut bad_lines = 0_u32;
    loop {
        MAIN_SILENT.store(0, Relaxed);
        let Some(byte) = critical_section::with(|cs| INPUT.borrow_ref_mut(cs).pop_front()) else {
            wfi();
            continue;
        };
        match lines.push(byte) {
            None => {}
            Some(Ok(request)) => answer(&request, &mut service, bad_lines, last_fault),
            Some(Err(Refused { id, code })) => {
                bad_lines = bad_lines.wrapping_add(1);
                log!("bad line {}", bad_lines);
                send::<f64>(id, Answer::Error(code));
            }
        }
    }
}

/// Stands still: the host sees silence, and a machine must not go on. The watchdog, where it runs, starts the board again.
fn stop(why: Fault) -> ! {
    // the task must not run on either
    cortex_m::interrupt::disable();
    board::leave(why as u32);
    log!("stopped: {}", why as u32);
    stand_still()
}

fn stand_still() -> ! {
    loop {
        cortex_m::asm::nop();
    }
}

#[panic_handler]
fn panic(_: &core::panic::PanicInfo<'_>) -> ! {
    stop(Fault::Panic)
}
