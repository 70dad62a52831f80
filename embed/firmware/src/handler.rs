//! For images that must not panic: one that could does not link.

#[panic_handler]
fn panic(_: &core::panic::PanicInfo<'_>) -> ! {
    unsafe extern "C" {
        fn a_panic_is_reachable() -> !;
    }
    // SAFETY: never runs, since an image with this call does not link
    unsafe { a_panic_is_reachable() }
}
