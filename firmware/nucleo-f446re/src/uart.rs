//! USART2 at 115 200 baud, 8N1: the serial port that the ST-LINK provides over USB.

use crate::clocks::APB1;
use core::cell::Cell;
use critical_section::Mutex;
use heapless::spsc::{Consumer, Producer, Queue};
use stm32f4xx_hal::gpio::{Input, PA2, PA3};
use stm32f4xx_hal::interrupt;
use stm32f4xx_hal::pac::{Interrupt, NVIC, USART2};
use stm32f4xx_hal::rcc::{Enable, Rcc, Reset};
use wire::Outbox;

const BAUD: u32 = 115_200;

/// Bytes received during one sample period must be buffered until its end: 115 at 10 ms, plus a margin.
const WAITING: usize = if firmware::on_board::PERIOD_US > 10_000 {
    2048
} else {
    256
};

/// The interrupt's end of the receive queue; handed over once.
static RECEIVED: Mutex<Cell<Option<Producer<'static, u8>>>> = Mutex::new(Cell::new(None));

/// The serial line. No call waits: [`Uart::work`] sends one byte at a time if the line is free.
pub struct Uart {
    registers: USART2,
    received: Option<Consumer<'static, u8>>,
    /// Bytes to send.
    pub outbox: Outbox,
}

impl Uart {
    /// Turns sender, receiver and its interrupt on.
    #[must_use]
    pub fn new(registers: USART2, tx: PA2<Input>, rx: PA3<Input>, rcc: &mut Rcc) -> Self {
        let _ = (tx.into_alternate::<7>(), rx.into_alternate::<7>());
        USART2::enable(rcc);
        USART2::reset(rcc);
        // A second call gives `None`, because there is one line.
        let queue = cortex_m::singleton!(: Queue<u8, WAITING> = Queue::new());
        let received = queue.map(|queue| {
            let (producer, consumer) = queue.split();
            critical_section::with(|section| RECEIVED.borrow(section).set(Some(producer)));
            consumer
        });
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
            received,
            outbox: Outbox::new(),
        }
    }

    /// A received byte, if any.
    #[inline]
    pub fn receive(&mut self) -> Option<u8> {
        self.received.as_mut()?.dequeue()
    }

    /// Sends a byte if there is one and the line is free; must be called often.
    #[inline]
    pub fn work(&mut self) {
        if self.registers.sr().read().txe().bit_is_set()
            && let Some(byte) = self.outbox.pop()
        {
            self.registers.dr().write(|w| w.dr().set(byte.into()));
        }
    }
}

#[interrupt]
fn USART2() {
    // SAFETY: reading status and data of the receiver, which nothing else does.
    let registers = unsafe { &*USART2::ptr() };
    // Reading in this order also clears an overrun.
    if registers.sr().read().rxne().bit_is_set() {
        let byte = registers.dr().read().dr().bits() as u8;
        critical_section::with(|section| {
            let slot = RECEIVED.borrow(section);
            if let Some(mut producer) = slot.take() {
                // A byte that does not fit is lost, and its command is then invalid.
                let _ = producer.enqueue(byte);
                slot.set(Some(producer));
            }
        });
    } else {
        let _ = registers.dr().read();
    }
}
