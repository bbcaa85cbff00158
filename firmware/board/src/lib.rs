//! What the programs for Cortex-M boards share: a panic that does not link, logs,
//! the measure of the stack, and the lockstep program's measurements.
#![no_std]

pub mod lockstep;
#[cfg(any(feature = "rtt", feature = "semihosting"))]
mod log;
pub mod stack;

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
