//! A proof by the linker: the panic handler calls a function that does not exist, so a program that links
//! cannot panic.

unsafe extern "C" {
    fn a_panic_is_reachable() -> !;
}

#[panic_handler]
fn panic(_: &core::panic::PanicInfo) -> ! {
    // SAFETY: never runs: a program in which it could does not link.
    unsafe { a_panic_is_reachable() }
}
