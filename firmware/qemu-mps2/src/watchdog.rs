//! CMSDK APB watchdog: restarts the board if it is not fed. Its first timeout raises the board's non-maskable
//! interrupt, which must restart the board; a second timeout would restart it too.

use core::mem::MaybeUninit;
use core::ptr::{addr_of, addr_of_mut};

const BASE: usize = 0x4000_8000;
const LOAD: *mut u32 = BASE as *mut u32;
const CONTROL: *mut u32 = (BASE + 8) as *mut u32;
const CLEAR: *mut u32 = (BASE + 0xC) as *mut u32;
const LOCK: *mut u32 = (BASE + 0xC00) as *mut u32;
const KEY: u32 = 0x1ACC_E551;
const COUNT_AND_RESET: u32 = 0b11;
const RUNNING: u32 = 0xD06_D06;

/// Mark in RAM that survives a restart, since QEMU's board does not store the reason of a reset.
#[unsafe(link_section = ".uninit.watchdog")]
static mut MARK: MaybeUninit<u32> = MaybeUninit::uninit();

/// The watchdog. Exclusive: made from a token that exists once.
pub struct Watchdog(());

impl Watchdog {
    /// Starts the watchdog: without feeding, the non-maskable interrupt comes after `ticks` (25 MHz) and a restart after
    /// twice that. `_core` is consumed to guarantee exclusive ownership.
    #[must_use]
    pub fn start(_core: cortex_m::peripheral::TPIU, ticks: u32) -> Self {
        mark(RUNNING);
        // SAFETY: registers of the watchdog, which nothing else touches.
        unsafe {
            LOCK.write_volatile(KEY);
            LOAD.write_volatile(ticks);
            CONTROL.write_volatile(COUNT_AND_RESET);
        }
        Self(())
    }

    /// Feeds the watchdog.
    #[inline]
    pub fn feed(&mut self) {
        // SAFETY: as in `start`.
        unsafe { CLEAR.write_volatile(1) };
    }
}

/// Whether the watchdog restarted the board; clears the mark.
#[must_use]
pub fn restarted() -> bool {
    // SAFETY: the word is in RAM, any bits are a valid u32, and nothing runs concurrently.
    let found = unsafe { addr_of!(MARK).cast::<u32>().read_volatile() };
    mark(0);
    found == RUNNING
}

fn mark(word: u32) {
    // SAFETY: as in `restarted`.
    unsafe { addr_of_mut!(MARK).cast::<u32>().write_volatile(word) };
}
