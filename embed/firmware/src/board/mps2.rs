//! Arm MPS2 with the images AN386 (Cortex-M4F) and AN500 (Cortex-M7), as QEMU has them. Its CMSDK UART 0.

use core::mem::MaybeUninit;

use pkm_core::estimation::Slot;

use super::{ClockFailed, Received, Register, WATCHDOG_MS};
use crate::slots::{self, NotSaved, SLOT_BYTES};

pub const NAME: &str = "mps2";
/// Of SysTick.
pub const CORE_HZ: u32 = 25_000_000;
/// Received data of UART 0.
pub const UART_INTERRUPT: u16 = 0;

const BAUD: u32 = 115_200;
const UART: u32 = 0x4000_4000;
const DATA: Register = Register(UART);
/// Bit 0: transmitter full, 1: received, 3: received byte lost (cleared by writing it).
const STATE: Register = Register(UART + 0x4);
/// Bit 0: transmit, 1: receive, 3: interrupt on receipt.
const CONTROL: Register = Register(UART + 0x8);
/// Write 1 to clear; bit 1: received.
const INTERRUPT: Register = Register(UART + 0xc);
const DIVISOR: Register = Register(UART + 0x10);

/// The clock is the board's own.
pub fn set_up() -> Result<(), ClockFailed> {
    DIVISOR.write(CORE_HZ / BAUD);
    CONTROL.write(0b1011);
    Ok(())
}

const WATCHDOG: u32 = 0x4000_8000;
const WATCHDOG_LOAD: Register = Register(WATCHDOG);
/// Bit 0: count, and NMI at the first end; 1: reset at the second.
const WATCHDOG_CONTROL: Register = Register(WATCHDOG + 0x8);
const WATCHDOG_CLEAR: Register = Register(WATCHDOG + 0xc);
const WATCHDOG_LOCK: Register = Register(WATCHDOG + 0xc00);

pub fn start_watchdog() {
    WATCHDOG_LOCK.write(0x1acc_e551);
    WATCHDOG_LOAD.write(CORE_HZ / 1000 * WATCHDOG_MS);
    WATCHDOG_CONTROL.write(0b11);
}

/// Any write begins anew.
pub fn feed_watchdog() {
    WATCHDOG_CLEAR.write(1);
}

pub fn receive() -> Option<Received> {
    INTERRUPT.write(0b10);
    let state = STATE.read();
    if state & 0b1000 != 0 {
        STATE.write(0b1000);
        return Some(Received::Lost);
    }
    (state & 0b10 != 0).then(|| Received::Byte(DATA.read() as u8))
}

/// False when there is no room yet.
pub fn try_send(byte: u8) -> bool {
    let has_room = STATE.read() & 1 == 0;
    if has_room {
        DATA.write(byte.into());
    }
    has_room
}

/// The board has no flash: RAM that a reset leaves as it is. Power-up does not.
pub struct Flash;

const SLOT_WORDS: usize = SLOT_BYTES / 4;

#[unsafe(link_section = ".uninit.SLOTS")]
static mut SLOTS: MaybeUninit<[[u32; SLOT_WORDS]; 2]> = MaybeUninit::uninit();

impl Flash {
    /// A word of a slot, which has to have it.
    fn register(slot: Slot, at: usize) -> Register {
        assert!(at < SLOT_BYTES);
        Register((&raw const SLOTS) as u32 + (slot as usize * SLOT_BYTES + at) as u32)
    }
}

impl slots::Flash for Flash {
    fn erase(&mut self, slot: Slot) -> Result<(), NotSaved> {
        (0..SLOT_WORDS).for_each(|word| Self::register(slot, 4 * word).write(u32::MAX));
        Ok(())
    }

    fn write(&mut self, slot: Slot, at: usize, word: u32) -> Result<(), NotSaved> {
        let register = Self::register(slot, at);
        // as in a flash, bits are cleared alone
        register.write(register.read() & word);
        Ok(())
    }

    fn word(&self, slot: Slot, at: usize) -> u32 {
        Self::register(slot, at).read()
    }
}
