//! STM32F405, which QEMU has as netduinoplus2: 168 MHz from the internal oscillator, USART1 on PA9 and PA10.
//!
//! Run in QEMU only, which has neither clocks nor pins; those lines follow the reference manual RM0090.

use super::{ClockFailed, Received, Register, WATCHDOG_MS};

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
