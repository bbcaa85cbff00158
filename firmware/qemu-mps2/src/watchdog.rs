//! CMSDK APB watchdog: restarts the board when it is not fed.

use core::mem::MaybeUninit;
use core::ptr::{addr_of, addr_of_mut};

const BASE: usize = 0x4000_8000;
const LOAD: *mut u32 = BASE as *mut u32;
const VALUE: *const u32 = (BASE + 4) as *const u32;
const CONTROL: *mut u32 = (BASE + 8) as *mut u32;
const CLEAR: *mut u32 = (BASE + 0xC) as *mut u32;
const LOCK: *mut u32 = (BASE + 0xC00) as *mut u32;
const KEY: u32 = 0x1ACC_E551;
const COUNT_AND_RESET: u32 = 0b11;
const RUNNING: u32 = 0xD06_D06;

/// QEMU's board keeps no reason for a reset, but its RAM survives one.
#[unsafe(link_section = ".uninit.watchdog")]
static mut MARK: MaybeUninit<u32> = MaybeUninit::uninit();

/// The watchdog. One owner: it is made from a token that exists once.
pub struct Watchdog(());

impl Watchdog {
    /// Starts it: after twice `ticks` (25 MHz) without food the board restarts.
    /// `_core` is consumed to show that there is one owner.
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

    /// Lets it wait anew.
    #[inline]
    pub fn feed(&mut self) {
        // SAFETY: as in `start`.
        unsafe { CLEAR.write_volatile(1) };
    }

    /// Ticks left of the first half of its patience.
    #[must_use]
    pub fn left(&self) -> u32 {
        // SAFETY: reading a register.
        unsafe { VALUE.read_volatile() }
    }
}

/// Whether the watchdog restarted the board; forgets it.
#[must_use]
pub fn restarted() -> bool {
    // SAFETY: the word is in RAM, any bits are a u32, and nothing runs beside.
    let found = unsafe { addr_of!(MARK).cast::<u32>().read_volatile() };
    mark(0);
    found == RUNNING
}

fn mark(word: u32) {
    // SAFETY: as in `restarted`.
    unsafe { addr_of_mut!(MARK).cast::<u32>().write_volatile(word) };
}
