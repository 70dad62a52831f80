//! STM32F405, which QEMU has as netduinoplus2: 168 MHz from the internal oscillator, USART1 on PA9 and PA10.
//!
//! Run in QEMU only, which has neither clocks nor pins; those lines follow the reference manual RM0090.

use pkm_core::estimation::Slot;

use super::{ClockFailed, Received, Register, WATCHDOG_MS};
use crate::slots::{self, NotSaved, SLOT_BYTES};

pub const NAME: &str = "stm32f405";
pub const CORE_HZ: u32 = 168_000_000;
/// USART1.
pub const UART_INTERRUPT: u16 = 37;

const BAUD: u32 = 115_200;
const USART: u32 = 0x4001_1000;
/// Bits 1-3: parity, frame, noise or overrun error, 5: received, 7: transmitter empty.
const STATUS: Register = Register(USART);
const DATA: Register = Register(USART + 0x4);
const DIVISOR: Register = Register(USART + 0x8);
/// Bit 2: receive, 3: transmit, 5: interrupt on receipt, 13: enable.
const CONTROL: Register = Register(USART + 0xc);

const RCC: u32 = 0x4002_3800;
const GPIO_A: u32 = 0x4002_0000;
const FLASH_ACCESS: Register = Register(0x4002_3c00);

pub fn set_up() -> Result<(), ClockFailed> {
    clock()?;
    // clocks of port A and USART1; PA9, PA10 to alternate function 7
    set(Register(RCC + 0x30), 0, 1);
    set(Register(RCC + 0x44), 0, 1 << 4);
    set(Register(GPIO_A), 0b1111 << 18, 0b1010 << 18);
    set(Register(GPIO_A + 0x24), 0xff << 4, 0x77 << 4);
    // the bus of USART1 has half the core's clock
    DIVISOR.write(CORE_HZ / 2 / BAUD);
    CONTROL.write(1 << 13 | 1 << 5 | 1 << 3 | 1 << 2);
    Ok(())
}

/// 16 MHz / 16 · 336 / 2; buses at a quarter and at half of it; 5 wait states of the flash, caches on.
fn clock() -> Result<(), ClockFailed> {
    let (control, pll, configuration) = (Register(RCC), Register(RCC + 0x4), Register(RCC + 0x8));
    // the internal oscillator is on at reset: a register of zeros is no register but QEMU's, which has no clocks
    if control.read() == 0 {
        return Ok(());
    }
    FLASH_ACCESS.write(0b111 << 8 | 5);
    configuration.write(0b101 << 10 | 0b100 << 13);
    pll.write(7 << 24 | 336 << 6 | 16);
    set(control, 0, 1 << 24);
    wait(|| control.read() & 1 << 25 != 0)?;
    set(configuration, 0b11, 0b10);
    wait(|| configuration.read() & 0b1100 == 0b1000)
}

/// Some milliseconds; the PLL takes 0.3 at most.
fn wait(done: impl Fn() -> bool) -> Result<(), ClockFailed> {
    if (0..100_000).any(|_| done()) { Ok(()) } else { Err(ClockFailed) }
}

/// The independent watchdog, on its own oscillator of some 32 kHz.
const WATCHDOG: u32 = 0x4000_3000;
const WATCHDOG_KEY: Register = Register(WATCHDOG);
const WATCHDOG_PRESCALER: Register = Register(WATCHDOG + 0x4);
const WATCHDOG_RELOAD: Register = Register(WATCHDOG + 0x8);

pub fn start_watchdog() {
    WATCHDOG_KEY.write(0x5555);
    // 32 kHz / 8
    WATCHDOG_PRESCALER.write(1);
    WATCHDOG_RELOAD.write(4 * WATCHDOG_MS);
    feed_watchdog();
    WATCHDOG_KEY.write(0xcccc);
}

pub fn feed_watchdog() {
    WATCHDOG_KEY.write(0xaaaa);
}

fn set(register: Register, clear: u32, set: u32) {
    register.write(register.read() & !clear | set);
}

pub fn receive() -> Option<Received> {
    let status = STATUS.read();
    if status & 0b1111 != 0 {
        // reading the data after the status clears the error
        DATA.read();
        return Some(Received::Lost);
    }
    (status & 1 << 5 != 0).then(|| Received::Byte(DATA.read() as u8))
}

/// False when there is no room yet.
pub fn try_send(byte: u8) -> bool {
    let has_room = STATUS.read() & 1 << 7 != 0;
    if has_room {
        DATA.write(byte.into());
    }
    has_room
}

/// The last two sectors of 128K, which the memory file leaves free.
pub struct Flash;

const SECTORS: [(u32, u32); 2] = [(10, 0x080c_0000), (11, 0x080e_0000)];
const FLASH_KEY: Register = Register(0x4002_3c04);
/// Bit 1: operation failed, 4-7: protection, alignment, size or sequence is wrong (all cleared by writing them), 16: busy.
const FLASH_STATUS: Register = Register(0x4002_3c0c);
const FLASH_ERRORS: u32 = 0b1111_0010;
const FLASH_BUSY: u32 = 1 << 16;
/// Bit 0: write, 1: erase a sector, 3-6: which, 8-9: 2 for words of 32 bits (supply of 2.7 V and more), 16: start, 31: locked.
const FLASH_CONTROL: Register = Register(0x4002_3c10);
const FLASH_WORDS: u32 = 0b10 << 8;
const FLASH_LOCKED: u32 = 1 << 31;

impl Flash {
    fn sector(slot: Slot) -> (u32, u32) {
        match slot {
            Slot::A => SECTORS[0],
            Slot::B => SECTORS[1],
        }
    }

    fn register(slot: Slot, at: usize) -> Register {
        assert!(at < SLOT_BYTES);
        Register(Self::sector(slot).1 + at as u32)
    }

    /// With the flash open, and closed again.
    fn change(work: impl FnOnce()) -> Result<(), NotSaved> {
        if FLASH_CONTROL.read() & FLASH_LOCKED != 0 {
            FLASH_KEY.write(0x4567_0123);
            FLASH_KEY.write(0xcdef_89ab);
        }
        FLASH_STATUS.write(FLASH_ERRORS);
        cortex_m::interrupt::free(|_| work());
        FLASH_CONTROL.write(FLASH_LOCKED);
        if FLASH_STATUS.read() & (FLASH_BUSY | FLASH_ERRORS) == 0 { Ok(()) } else { Err(NotSaved) }
    }
}

/// Erases a sector, which takes a second or two. Lies in RAM: nothing can be read from the flash meanwhile, no instruction either, and nobody
/// else can feed the watchdog.
#[inline(never)]
#[unsafe(link_section = ".data.erase")]
fn erase_sector(sector: u32) {
    FLASH_CONTROL.write(FLASH_WORDS | sector << 3 | 0b10);
    FLASH_CONTROL.write(1 << 16 | FLASH_WORDS | sector << 3 | 0b10);
    // bounded: some ten seconds
    for _ in 0..100_000_000 {
        feed_watchdog();
        if FLASH_STATUS.read() & FLASH_BUSY == 0 {
            break;
        }
    }
}

impl slots::Flash for Flash {
    fn erase(&mut self, slot: Slot) -> Result<(), NotSaved> {
        Self::change(|| erase_sector(Self::sector(slot).0))?;
        // the cache of data may still have what stood there: off, emptied, on
        set(FLASH_ACCESS, 1 << 10, 0);
        set(FLASH_ACCESS, 0, 1 << 12);
        set(FLASH_ACCESS, 1 << 12, 1 << 10);
        Ok(())
    }

    fn write(&mut self, slot: Slot, at: usize, word: u32) -> Result<(), NotSaved> {
        Self::change(|| {
            FLASH_CONTROL.write(FLASH_WORDS | 1);
            Self::register(slot, at).write(word);
            // the processor waits by itself for what it reads next from the flash; some 16 µs
            (0..100_000).any(|_| FLASH_STATUS.read() & FLASH_BUSY == 0);
        })
    }

    fn word(&self, slot: Slot, at: usize) -> u32 {
        Self::register(slot, at).read()
    }
}
