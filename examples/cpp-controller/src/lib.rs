//! What `powerball generate --c-header` wrote, and nothing more: no `std`, no allocator.
#![no_std]

// `check` puts it there.
include!("../generated/my_arm.rs");

/// Generated code does not panic; a library without `std` must say what would happen.
#[panic_handler]
fn panic(_: &core::panic::PanicInfo<'_>) -> ! {
    loop {}
}
