//! What QEMU's mps2-an386 has of the rig's board: a serial line, a clock that
//! counts instructions, and the measure of the stack.
#![no_std]

pub mod clock;
pub mod stack;
pub mod uart;

/// A panic must not be linked: this calls what does not exist. The linker then
/// says which one is.
#[cfg(target_os = "none")]
#[panic_handler]
fn panic(_: &core::panic::PanicInfo<'_>) -> ! {
    unsafe extern "C" {
        fn a_panic_is_linked() -> !;
    }
    // SAFETY: never runs; a program with it does not link.
    unsafe { a_panic_is_linked() }
}
