//! What differs between boards, and what of the processor is reached without `unsafe` through no crate.
//!
//! A board is one file with `NAME`, `CORE_HZ`, `UART_INTERRUPT`, `set_up`, `receive`, `try_send`, `start_watchdog` and `feed_watchdog`, a `Flash` for
//! what is learned, and its memory file in `build.rs`.
//! This module is the only place with blocks of `unsafe`: each register and each linker symbol is wrapped here. A board says where in memory
//! something lies.

#![allow(unsafe_code)]

#[cfg_attr(not(feature = "stm32f405"), path = "mps2.rs")]
#[cfg_attr(feature = "stm32f405", path = "stm32f405.rs")]
mod chip;

use core::mem::MaybeUninit;

use cortex_m::Peripherals;
use cortex_m::interrupt::InterruptNumber;
use cortex_m::peripheral::scb::SystemHandler;
use cortex_m::peripheral::syst::SystClkSource;
use cortex_m::peripheral::{MPU, NVIC};
use cortex_m_rt::{ExceptionFrame, exception};
use pkm_protocol::Fault;

pub use chip::{CORE_HZ, Flash, NAME, feed_watchdog, try_send};

/// The board starts again when nobody feeds its watchdog for so long.
const WATCHDOG_MS: u32 = 100;

/// The processor has another clock than [`CORE_HZ`]: neither period nor baud rate would be right.
pub struct ClockFailed;

/// What came over the serial line.
pub enum Received {
    /// A byte.
    Byte(u8),
    /// At least one was lost or damaged before the next.
    Lost,
}

/// A register of a peripheral, 32 bits wide.
#[derive(Clone, Copy)]
struct Register(u32);

impl Register {
    fn read(self) -> u32 {
        // SAFETY: the boards' files name aligned peripheral registers only, whose reads touch no memory of the program
        unsafe { (self.0 as *const u32).read_volatile() }
    }

    fn write(self, value: u32) {
        // SAFETY: as above; none of them starts a transfer to memory
        unsafe { (self.0 as *mut u32).write_volatile(value) }
    }
}

#[derive(Clone, Copy)]
struct Uart;

// SAFETY: the number is one of the board's interrupts and never changes
unsafe impl InterruptNumber for Uart {
    fn number(self) -> u16 {
        chip::UART_INTERRUPT
    }
}

/// Starts the serial line, and a tick every `period_ticks` of [`CORE_HZ`].
///
/// The tick interrupts everything, the serial line the cyclic task (PendSV), and that the rest.
///
/// # Errors
/// The clock; then nothing has started.
pub fn start(mut peripherals: Peripherals, period_ticks: u32) -> Result<(), ClockFailed> {
    chip::set_up()?;
    guard_stack(&peripherals.MPU);
    chip::start_watchdog();
    // SAFETY: no critical section relies on priorities
    unsafe {
        peripherals.SCB.set_priority(SystemHandler::SysTick, 0x00);
        peripherals.NVIC.set_priority(Uart, 0x40);
        peripherals.SCB.set_priority(SystemHandler::PendSV, 0x80);
        NVIC::unmask(Uart);
    }
    let tick = &mut peripherals.SYST;
    tick.set_clock_source(SystClkSource::Core);
    tick.set_reload(period_ticks - 1);
    tick.clear_current();
    tick.enable_interrupt();
    tick.enable_counter();
    Ok(())
}

/// More than any function takes from the stack at once.
const GUARD_BYTES: u32 = 2048;

/// Where the guard ends, above the statics.
fn guard_end() -> u32 {
    (&raw const _stack_end as u32).next_multiple_of(GUARD_BYTES) + GUARD_BYTES
}

/// Below the stack nothing can be read or written: a stack that is too deep is a fault, not another value of a static.
fn guard_stack(mpu: &MPU) {
    // SAFETY: the region has its own size's alignment, lies between statics and stack, and nobody uses it
    unsafe {
        mpu.rnr.write(0);
        mpu.rbar.write(guard_end() - GUARD_BYTES);
        // nothing executed, no access, 2^11 bytes, on
        mpu.rasr.write(1 << 28 | (GUARD_BYTES.ilog2() - 1) << 1 | 1);
        // all other memory as without regions
        mpu.ctrl.write(0b101);
    }
    cortex_m::asm::dsb();
    cortex_m::asm::isb();
}

/// A word that outlives a reset, and its complement. Nothing clears it when the program starts.
#[unsafe(link_section = ".uninit.LEFT")]
static mut LEFT: MaybeUninit<[u32; 2]> = MaybeUninit::uninit();

/// Leaves a word for the program's next start.
pub fn leave(word: u32) {
    // SAFETY: the only places with it are here and below, and a later start is the only one to read it
    unsafe { (&raw mut LEFT).write_volatile(MaybeUninit::new([word, !word])) };
}

/// The word that was left before the start; after power-up there is none.
pub fn left() -> Option<u32> {
    // SAFETY: two words of RAM, whatever they hold
    let [word, complement] = unsafe { (&raw const LEFT).cast::<[u32; 2]>().read_volatile() };
    (complement == !word).then_some(word)
}

/// The first end of a watchdog's time, on boards where that is an interrupt; the second starts the board again. What was left as the
/// reason stays.
#[exception]
unsafe fn NonMaskableInt() -> ! {
    crate::stand_still()
}

#[exception]
unsafe fn HardFault(_: &ExceptionFrame) -> ! {
    const FAULT_STATUS: Register = Register(0xe000_ed28);
    // the lowest byte: memory that the MPU denied
    crate::stop(if FAULT_STATUS.read() & 0xff != 0 { Fault::Stack } else { Fault::Exception })
}

/// All interrupts of the board: the serial line's is the only one that is on.
#[exception]
unsafe fn DefaultHandler(_: i16) {
    while let Some(received) = chip::receive() {
        crate::received(received);
    }
}

unsafe extern "C" {
    static _stack_end: u32;
    static _stack_start: u32;
}

/// Memory for the stack in bytes above its guard, and the most that was in use so far: what lost its paint.
pub fn stack_bytes() -> (u32, u32) {
    let (low, high) = (guard_end() as *const u32, &raw const _stack_start);
    let mut place = low;
    // SAFETY: the words from the guard to the linker's symbol are RAM, and the bound is checked before each read
    while place < high && unsafe { place.read_volatile() } == cortex_m_rt::STACK_PAINT_VALUE {
        place = place.wrapping_add(1);
    }
    (high as u32 - low as u32, high as u32 - place as u32)
}
