//! How an image tells QEMU that it is done.

use cortex_m_semihosting::debug;

/// Ends QEMU with status 0 or 1.
pub fn end(fine: bool) -> ! {
    debug::exit(if fine { debug::EXIT_SUCCESS } else { debug::EXIT_FAILURE });
    loop {
        cortex_m::asm::wfi();
    }
}
