//! Measurement of the stack depth: the unused stack is filled with a pattern at the start; overwritten words were
//! used.

use core::ptr::addr_of;

const PAINT: u32 = 0xA5A5_5A5A;
/// Bytes below the caller's frame without the pattern.
const MARGIN: usize = 64;

unsafe extern "C" {
    /// End of static memory, `.uninit` included.
    static __sheap: u32;
    static _stack_start: u32;
}

/// Fills the unused stack with the pattern. Call it first in `main`.
#[inline(never)]
pub fn paint() {
    let top = cortex_m::register::msp::read() as usize - MARGIN;
    let mut at = addr_of!(__sheap) as usize;
    while at < top {
        // SAFETY: there is no data between the end of static memory and the stack in use, because there is no heap.
        unsafe { (at as *mut u32).write_volatile(PAINT) };
        at += 4;
    }
}

/// The largest depth of the stack since it was filled, bytes.
#[must_use]
pub fn deepest() -> u32 {
    let top = addr_of!(_stack_start) as usize;
    let mut at = addr_of!(__sheap) as usize;
    // SAFETY: reading RAM.
    while at < top && unsafe { (at as *const u32).read_volatile() } == PAINT {
        at += 4;
    }
    (top - at) as u32
}
