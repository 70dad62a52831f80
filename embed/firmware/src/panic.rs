//! For images that report to QEMU: a panic is a failure.

#[panic_handler]
fn panic(_: &core::panic::PanicInfo<'_>) -> ! {
    crate::semihosting::end(false)
}
