//! What differs between boards, and what of the processor is reached without `unsafe` through no crate.
//!
//! A board is one file with `NAME`, `CORE_HZ`, `UART_INTERRUPT`, `set_up`, `receive` and `send`, and its memory file in `build.rs`.
//! This module is the only place with `unsafe`: each register and each linker symbol is wrapped here.

#![allow(unsafe_code)]

#[cfg_attr(not(feature = "stm32f405"), path = "mps2.rs")]
#[cfg_attr(feature = "stm32f405", path = "stm32f405.rs")]
mod chip;

use cortex_m::Peripherals;
use cortex_m::interrupt::InterruptNumber;
use cortex_m::peripheral::NVIC;
use cortex_m::peripheral::scb::SystemHandler;
use cortex_m::peripheral::syst::SystClkSource;
use cortex_m_rt::exception;

pub use chip::{CORE_HZ, NAME, send};

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
pub fn start(mut peripherals: Peripherals, period_ticks: u32) {
    chip::set_up();
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

/// Memory for the stack in bytes, and the most that was in use so far: what lost its paint.
pub fn stack_bytes() -> (u32, u32) {
    let (low, high) = (&raw const _stack_end, &raw const _stack_start);
    let mut place = low;
    // SAFETY: the words between the two symbols of the linker are RAM, and the bound is checked before each read
    while place < high && unsafe { place.read_volatile() } == cortex_m_rt::STACK_PAINT_VALUE {
        place = place.wrapping_add(1);
    }
    (high as u32 - low as u32, high as u32 - place as u32)
}
