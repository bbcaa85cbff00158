//! The loop on QEMU's mps2-an386 with a rig on the host behind its second serial line, instead of converter and
//! pins.
//!
//! The rig is the sample clock, like the converter of a real board. For every sample it sends four bytes:
//! [`PRESSED`] or 0 for the reset button, and 12 bits each of sensor and channel. It receives one byte, 1 for an
//! open valve. In each sample period the line to the host transmits as much as a line of 115 200 baud would,
//! even if the samples are faster.
#![no_std]
#![no_main]

use board::stack;
use core::cell::Cell;
use core::convert::Infallible;
use cortex_m_rt::entry;
use embedded_hal::digital::{ErrorType, OutputPin};
use firmware::link::desk::Desk;
use firmware::rig::{Clock, Rig, Sensor};
use firmware::{on_board, start};
use qemu_mps2::uart::{Line, ToRig};
use wire::Outbox;

/// Flag for the rig's reset button.
const PRESSED: u8 = 1;

/// A sample from the rig.
#[derive(Clone, Copy, Default)]
struct Converted {
    counts: u16,
    channel: u16,
    periods: u32,
}

struct Converter<'a>(&'a Cell<Converted>);

impl Sensor for Converter<'_> {
    fn counts(&mut self) -> f32 {
        f32::from(self.0.get().counts)
    }
    fn channel(&mut self) -> f32 {
        f32::from(self.0.get().channel)
    }
}

impl Clock for Converter<'_> {
    fn periods(&self) -> u32 {
        self.0.get().periods
    }
}

/// A pin whose state is sent to the rig.
struct Pin<'a>(&'a Cell<bool>);

impl ErrorType for Pin<'_> {
    type Error = Infallible;
}

impl OutputPin for Pin<'_> {
    fn set_low(&mut self) -> Result<(), Infallible> {
        self.0.set(false);
        Ok(())
    }
    fn set_high(&mut self) -> Result<(), Infallible> {
        self.0.set(true);
        Ok(())
    }
}

#[entry]
fn main() -> ! {
    stack::paint();
    let Some(core) = cortex_m::Peripherals::take() else {
        loop {
            cortex_m::asm::wfi();
        }
    };
    let (mut line, mut to_rig) = (Line::new(core.ITM), ToRig::new(core.FPB));
    let mut controller = on_board::controller();
    start::latch(&mut controller, on_board::self_test(), false);
    let (converted, valve, lamp) = <(Cell<Converted>, Cell<bool>, Cell<bool>)>::default();
    let (sensor, clock) = (Converter(&converted), Converter(&converted));
    let mut rig = Rig::new(controller, sensor, clock, Pin(&valve), Pin(&lamp));
    let mut desk = Desk::new(on_board::BOARD);
    let mut outbox = Outbox::new();
    loop {
        to_rig.send(&[valve.get().into()]);
        // A real line would deliver about a hundred bytes in a long period; here they arrive while the board waits
        // for the rig.
        let [button, low, mixed, high] = core::array::from_fn(|_| {
            to_rig.wait_beside(|| {
                if let Some(byte) = line.receive() {
                    desk.receive(byte, rig.controller(), &mut outbox);
                }
            })
        });
        if button == PRESSED {
            cortex_m::peripheral::SCB::sys_reset();
        }
        converted.set(Converted {
            counts: u16::from_le_bytes([low, mixed & 0xF]),
            channel: u16::from(mixed >> 4) | u16::from(high) << 4,
            periods: converted.get().periods.wrapping_add(1),
        });
        desk.before(rig.controller(), &mut outbox);
        let tick = rig.sample();
        desk.after(&tick, rig.controller(), &mut outbox);
        while let Some(byte) = line.receive() {
            desk.receive(byte, rig.controller(), &mut outbox);
        }
        line.work(&mut outbox, on_board::PERIOD_US);
    }
}
