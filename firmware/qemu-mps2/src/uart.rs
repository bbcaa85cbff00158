//! CMSDK APB UART 0 of the mps2 boards, polled.

const BASE: usize = 0x4000_4000;
const DATA: *mut u32 = BASE as *mut u32;
const STATE: *mut u32 = (BASE + 4) as *mut u32;
const CONTROL: *mut u32 = (BASE + 8) as *mut u32;
const DIVIDER: *mut u32 = (BASE + 16) as *mut u32;
const SEND_FULL: u32 = 1;
const RECEIVED: u32 = 2;

/// The serial line. One owner: it is made from a token that exists once.
pub struct Uart(());

impl Uart {
    /// Turns sender and receiver on. `_core` is consumed to show that there is
    /// one owner.
    #[must_use]
    pub fn new(_core: cortex_m::peripheral::ITM) -> Self {
        // SAFETY: registers of UART 0, which nothing else touches.
        unsafe {
            DIVIDER.write_volatile(16);
            CONTROL.write_volatile(0b11);
        }
        Self(())
    }

    /// A byte, if one has come.
    #[inline]
    pub fn receive(&mut self) -> Option<u8> {
        // SAFETY: as in `new`.
        unsafe {
            if STATE.read_volatile() & RECEIVED == 0 {
                return None;
            }
            Some(DATA.read_volatile() as u8)
        }
    }

    /// Sends all of `bytes`.
    pub fn send(&mut self, bytes: &[u8]) {
        for byte in bytes {
            // SAFETY: as in `new`.
            unsafe {
                while STATE.read_volatile() & SEND_FULL != 0 {}
                DATA.write_volatile(u32::from(*byte));
            }
        }
    }
}
