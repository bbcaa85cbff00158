//! CMSDK APB UARTs of the mps2 boards, polled.

use wire::Outbox;

const SEND_FULL: u32 = 1;
const RECEIVED: u32 = 2;
/// Duration of a byte at 115 200 baud, 8N1, in units of 1/11 520 µs.
const A_BYTE: u32 = 1_000_000;
const BYTES_A_SECOND: u32 = 11_520;

/// The serial line to operator and host.
pub type Line = Uart<0x4000_4000>;
/// The line to the simulated rig, in place of converter and pins.
pub type ToRig = Uart<0x4000_5000>;

/// A serial line. Exclusive: each is made from a token that exists once.
pub struct Uart<const BASE: usize> {
    /// Transmission credit, in units of 1/11 520 µs.
    credit: u32,
}

impl Line {
    /// Enables sender and receiver. `_core` is consumed to guarantee exclusive ownership.
    #[must_use]
    pub fn new(_core: cortex_m::peripheral::ITM) -> Self {
        Self::on()
    }
}

impl ToRig {
    /// Enables sender and receiver. `_core` is consumed to guarantee exclusive ownership.
    #[must_use]
    pub fn new(_core: cortex_m::peripheral::FPB) -> Self {
        Self::on()
    }
}

impl<const BASE: usize> Uart<BASE> {
    const DATA: *mut u32 = BASE as *mut u32;
    const STATE: *mut u32 = (BASE + 4) as *mut u32;
    const CONTROL: *mut u32 = (BASE + 8) as *mut u32;
    const DIVIDER: *mut u32 = (BASE + 16) as *mut u32;

    fn on() -> Self {
        // SAFETY: registers of this UART, which nothing else touches.
        unsafe {
            Self::DIVIDER.write_volatile(16);
            Self::CONTROL.write_volatile(0b11);
        }
        Self { credit: 0 }
    }

    /// A received byte, if any.
    #[inline]
    pub fn receive(&mut self) -> Option<u8> {
        // SAFETY: as in `on`.
        unsafe {
            if Self::STATE.read_volatile() & RECEIVED == 0 {
                return None;
            }
            Some(Self::DATA.read_volatile() as u8)
        }
    }

    /// Waits for a byte.
    pub fn wait(&mut self) -> u8 {
        self.wait_beside(|| {})
    }

    /// Waits for a byte and calls `meanwhile` repeatedly.
    #[inline]
    pub fn wait_beside(&mut self, mut meanwhile: impl FnMut()) -> u8 {
        loop {
            if let Some(byte) = self.receive() {
                return byte;
            }
            meanwhile();
        }
    }

    /// Sends all of `bytes`; waits while the line is full.
    pub fn send(&mut self, bytes: &[u8]) {
        for byte in bytes {
            while !self.offer(*byte) {}
        }
    }

    fn offer(&mut self, byte: u8) -> bool {
        // SAFETY: as in `on`.
        unsafe {
            let free = Self::STATE.read_volatile() & SEND_FULL == 0;
            if free {
                Self::DATA.write_volatile(u32::from(byte));
            }
            free
        }
    }

    /// Sends as much as a real line would transmit in `period` µs; QEMU's line is infinitely fast. Unsent
    /// bytes stay in the outbox.
    pub fn work(&mut self, outbox: &mut Outbox, period: u32) {
        // Unused credit expires, except one byte for a line that is never idle.
        self.credit = self.credit.min(A_BYTE) + period * BYTES_A_SECOND;
        while self.credit >= A_BYTE {
            // SAFETY: as in `on`.
            if unsafe { Self::STATE.read_volatile() } & SEND_FULL != 0 {
                return;
            }
            let Some(byte) = outbox.pop() else {
                return;
            };
            self.offer(byte);
            self.credit -= A_BYTE;
        }
    }
}
