//! USART2 at 115 200 baud, 8N1: the serial port that the ST-LINK shows on USB.

use crate::clocks::APB1;
use firmware::queue::Queue;
use stm32f4xx_hal::gpio::{Input, PA2, PA3};
use stm32f4xx_hal::interrupt;
use stm32f4xx_hal::pac::{Interrupt, NVIC, USART2};
use stm32f4xx_hal::rcc::{Enable, Rcc, Reset};

const BAUD: u32 = 115_200;

/// What was received while the loop was busy.
static RECEIVED: Queue<128> = Queue::new();

/// The serial line. Nothing here waits: bytes go out one at a time, when there
/// is room, from [`Uart::work`].
pub struct Uart {
    registers: USART2,
    sending: Queue<512>,
}

impl Uart {
    /// Turns sender, receiver and its interrupt on.
    #[must_use]
    pub fn new(registers: USART2, tx: PA2<Input>, rx: PA3<Input>, rcc: &mut Rcc) -> Self {
        let _ = (tx.into_alternate::<7>(), rx.into_alternate::<7>());
        USART2::enable(rcc);
        USART2::reset(rcc);
        // SAFETY: the divisor fits its 16 bits; the interrupt only touches the
        // receiver and its queue.
        unsafe {
            registers
                .brr()
                .write(|w| w.bits(((APB1 + BAUD / 2) / BAUD) as _));
            NVIC::unmask(Interrupt::USART2);
        }
        registers.cr1().write(|w| {
            w.ue().set_bit().te().set_bit().re().set_bit();
            w.rxneie().set_bit()
        });
        Self {
            registers,
            sending: Queue::new(),
        }
    }

    /// A byte, if one has come.
    #[inline]
    pub fn receive(&mut self) -> Option<u8> {
        RECEIVED.take()
    }

    /// Gives `bytes` to be sent; what does not fit is lost.
    pub fn send(&mut self, bytes: &[u8]) {
        for byte in bytes {
            self.sending.put(*byte);
        }
    }

    /// Sends a byte if there is one and the line is free; call it often.
    #[inline]
    pub fn work(&mut self) {
        if self.registers.sr().read().txe().bit_is_set()
            && let Some(byte) = self.sending.take()
        {
            self.registers.dr().write(|w| w.dr().set(byte.into()));
        }
    }
}

#[interrupt]
fn USART2() {
    // SAFETY: reading status and data of the receiver, which nothing else does.
    let registers = unsafe { &*USART2::ptr() };
    // In this order the two clear an overrun, too.
    if registers.sr().read().rxne().bit_is_set() {
        RECEIVED.put(registers.dr().read().dr().bits() as u8);
    } else {
        let _ = registers.dr().read();
    }
}
