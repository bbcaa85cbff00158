//! Shared code of the programs for Cortex-M boards: a panic handler that fails to link, logs, stack
//! measurement, and the lockstep program's measurements.
#![no_std]

pub mod lockstep;
#[cfg(any(feature = "rtt", feature = "semihosting"))]
mod log;
pub mod stack;

/// Panic-freedom proof: the handler calls a missing symbol, so that a program with a panic does not link; the
/// linker names it.
#[cfg(target_os = "none")]
#[panic_handler]
fn panic(_: &core::panic::PanicInfo<'_>) -> ! {
    unsafe extern "C" {
        fn a_panic_is_linked() -> !;
    }
    // SAFETY: this is never executed, because a program that contains it does not link.
    unsafe { a_panic_is_linked() }
}
