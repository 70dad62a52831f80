//! A panic that can be reached, under the handler of `no_panic.rs`: this must not link. By it `cargo xtask no-panic` tests its own test.

#![no_std]
#![no_main]

use core::hint::black_box;

use cortex_m as _;
use cortex_m_rt::entry;

#[path = "../handler.rs"]
mod handler;

#[entry]
fn main() -> ! {
    black_box([0_u8; 4][black_box(5)]);
    loop {
        cortex_m::asm::wfi();
    }
}
