//! Reference firmware: the core in a cyclic task of 1 kHz, and a serial line (`pkm-protocol`) to drive and watch it.
//!
//! * SysTick begins a period. If the task still runs, that is an overrun: it is counted and the period has no run.
//! * PendSV is the task. It takes the latest demand and computes [`CorrectionTable::cycle`](pkm_core::CorrectionTable::cycle).
//! * The serial line's interrupt keeps the bytes that come.
//! * `main` reads lines and answers. To `cycle` it answers with the first run that had the demand; `sweep` is one demand after another.
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

use core::cell::{Cell, RefCell};
use core::sync::atomic::{AtomicBool, AtomicU32, Ordering::Relaxed};

use cortex_m::Peripherals;
use cortex_m::asm::wfi;
use cortex_m::peripheral::{SCB, SYST};
use cortex_m_rt::{entry, exception};
use critical_section::Mutex;
#[cfg(feature = "log-rtt")]
use defmt_rtt as _;
#[cfg(feature = "log-semihosting")]
use defmt_semihosting as _;
use heapless::Deque;
use pkm_core::{Cycle, CycleError, FiveAxis, Scalar};
use pkm_protocol::{
    Answer, Arithmetic, Checksum, Command, Counters, CycleReply, Demand, Hello, Lines, MAX_COMMAND, MAX_REPLY, Refused,
    Reply, Request, SweepReply, VERSION,
};
use serde::Serialize;

use board::Received;

macro_rules! log {
    ($($part:tt)*) => {
        #[cfg(feature = "log")]
        defmt::info!($($part)*);
    };
}

const PERIOD_HZ: u32 = 1000;
const PERIOD_TICKS: u32 = board::CORE_HZ / PERIOD_HZ;
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
static LATE: AtomicBool = AtomicBool::new(false);
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
    if RUNNING.load(Relaxed) {
        OVERRUNS.fetch_add(1, Relaxed);
        LATE.store(true, Relaxed);
    } else {
        SCB::set_pendsv();
    }
}

#[exception]
fn PendSV() {
    static mut WORKING_ON: Option<Demand> = None;
    LATE.store(false, Relaxed);
    RUNNING.store(true, Relaxed);
    let begun = ticks();
    if let Some(demand) = critical_section::with(|cs| DEMAND.borrow(cs).take()) {
        *WORKING_ON = Some(demand);
    }
    if let Some(demand) = WORKING_ON {
        let result = match demand.arithmetic {
            Arithmetic::F32 => Computed::F32(demand.cycle(&coefficients::MACHINE_F32, &coefficients::TABLE_F32)),
            Arithmetic::F64 => Computed::F64(demand.cycle(&coefficients::MACHINE_F64, &coefficients::TABLE_F64)),
        };
        let ticks = ticks().wrapping_sub(begun);
        let run = Run { result, ticks, overrun: LATE.load(Relaxed) };
        critical_section::with(|cs| RUN.borrow(cs).set(Some(run)));
        CYCLES.fetch_add(1, Relaxed);
        WORST_TICKS.fetch_max(ticks, Relaxed);
    }
    RUNNING.store(false, Relaxed);
}

/// Keeps what came. Where bytes are lost their line gets one that no command has.
fn received(what: Received) {
    static LOSING: AtomicBool = AtomicBool::new(false);
    const NO_COMMAND_HAS: u8 = 0xff;
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
        board::send(*byte);
    }
}

/// The first run that has this demand: runs interrupt `main`, so that any that ends from now on began from now on.
fn run_of(demand: Demand) -> Run {
    critical_section::with(|cs| {
        RUN.borrow(cs).set(None);
        DEMAND.borrow(cs).set(Some(demand));
    });
    loop {
        if let Some(run) = critical_section::with(|cs| RUN.borrow(cs).take()) {
            return run;
        }
        wfi();
    }
}

fn answer(request: &Request, bad_lines: u32) {
    let id = Some(request.id);
    match request.command {
        Command::Hello => {
            let travel = coefficients::PARAMETERS.travel;
            let hello = Hello {
                firmware: concat!(env!("CARGO_PKG_NAME"), " ", env!("CARGO_PKG_VERSION")),
                board: board::NAME,
                machine: Checksum(const { coefficients::PARAMETERS.checksum() }),
                table: Checksum(const { coefficients::TABLE_F64.checksum() }),
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
            let counters = Counters {
                cycles: CYCLES.load(Relaxed),
                overruns: OVERRUNS.load(Relaxed),
                worst_ticks: WORST_TICKS.load(Relaxed),
                stack_used_bytes: board::stack_bytes().1,
                bad_lines,
            };
            send::<f64>(id, Answer::Status(counters));
        }
        Command::Cycle(demand) => {
            let Run { result, ticks, overrun } = run_of(demand);
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
                let Run { result, ticks, overrun } = run_of(demand);
                match result {
                    Computed::F32(result) => reply.add(&CycleReply::new(&result, ticks, overrun)),
                    Computed::F64(result) => reply.add(&CycleReply::new(&result, ticks, overrun)),
                }
            }
            send::<f64>(id, Answer::Sweep(reply));
        }
    }
}

/// Whether machine, wrist and table are in memory as they were built.
fn is_intact() -> bool {
    static F32: FiveAxis<'static, f32> =
        FiveAxis { machine: &coefficients::MACHINE_F32, wrist: &coefficients::WRIST_F32 };
    static F64: FiveAxis<'static, f64> =
        FiveAxis { machine: &coefficients::MACHINE_F64, wrist: &coefficients::WRIST_F64 };
    let built_f32 = const { F32.checksums(&coefficients::TABLE_F32) };
    let built_f64 = const { F64.checksums(&coefficients::TABLE_F64) };
    F32.verify(&coefficients::TABLE_F32, &built_f32).is_ok() && F64.verify(&coefficients::TABLE_F64, &built_f64).is_ok()
}

#[entry]
fn main() -> ! {
    assert!(is_intact(), "machine, wrist or table is damaged");
    if let Some(peripherals) = Peripherals::take() {
        board::start(peripherals, PERIOD_TICKS);
    }
    log!("{} at {} Hz, period {} ticks", board::NAME, board::CORE_HZ, PERIOD_TICKS);
    let mut lines = Lines::new();
    let mut bad_lines = 0_u32;
    loop {
        let Some(byte) = critical_section::with(|cs| INPUT.borrow_ref_mut(cs).pop_front()) else {
            wfi();
            continue;
        };
        match lines.push(byte) {
            None => {}
            Some(Ok(request)) => answer(&request, bad_lines),
            Some(Err(Refused { id, code })) => {
                bad_lines = bad_lines.wrapping_add(1);
                log!("bad line {}", bad_lines);
                send::<f64>(id, Answer::Error(code));
            }
        }
    }
}

/// Stands still: the host sees silence, and a machine must not go on.
#[panic_handler]
fn panic(_: &core::panic::PanicInfo<'_>) -> ! {
    // the task must not run on either
    cortex_m::interrupt::disable();
    log!("panic");
    loop {
        cortex_m::asm::bkpt();
    }
}
