//! The loop on QEMU's mps2-an386, with a flow that the model itself plays and
//! a sensor whose illnesses are switched on over the serial line.
//!
//! Lines: `arm`, `disarm`, `status`; and for the fault-injection run a digit:
//! `0` a healthy sensor, `1` no number, `2` at the rail, `3` stuck, `4` away
//! from the model, `5` one sample too late.
#![no_std]
#![no_main]

use core::convert::Infallible;
use cortex_m_rt::entry;
use embedded_hal::digital::{ErrorType, OutputPin};
use firmware::cases::SETTINGS;
use firmware::console::{Command, Console, Line};
use firmware::controller::{Controller, Mode};
use firmware::fault::Fault;
use firmware::law::{Direct, Relay};
use firmware::rig::{Clock, Rig, Sensor};
use identified::on_board as model;
use model_core::self_test::checksum;
use model_core::{Input, step};
use qemu_mps2::clock::Ticks;
use qemu_mps2::stack;
use qemu_mps2::uart::Uart;

/// SysTick ticks in a sample of 1 ms.
const TICKS_PER_SAMPLE: u32 = 25_000;

/// The flow, played by the model, and the sensor's illness.
struct Played {
    model: model::Identified,
    state: model::IdentifiedState,
    open: bool,
    illness: u8,
    flicker: bool,
}

impl Sensor for Played {
    fn counts(&mut self) -> f32 {
        let input = Input {
            command: if self.open { 1.0 } else { 0.0 },
            channels: &[],
        };
        let y = step(&self.model, &mut self.state, &input).measured;
        self.flicker = !self.flicker;
        let noise = if self.flicker { 1.0 } else { 0.0 };
        let healthy = SETTINGS.calibration.zero + y / SETTINGS.calibration.per_count + noise;
        match self.illness {
            b'1' => f32::NAN,
            b'2' => 4095.0,
            b'3' => 1000.0,
            b'4' => 3900.0 + noise,
            _ => healthy,
        }
    }
}

/// Counts samples; one can be skipped.
struct Samples(core::cell::Cell<u32>);

impl Clock for &Samples {
    fn periods(&self) -> u32 {
        self.0.get()
    }
}

/// A pin that nothing is wired to; QEMU has no valve.
struct Pin;

impl ErrorType for Pin {
    type Error = Infallible;
}

impl OutputPin for Pin {
    fn set_low(&mut self) -> Result<(), Infallible> {
        Ok(())
    }
    fn set_high(&mut self) -> Result<(), Infallible> {
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
    let mut uart = Uart::new(core.ITM);
    let mut ticks = Ticks::new(core.SYST);
    let identified = model::model();
    let law = Relay::new(
        identified,
        model::state(&identified),
        Direct,
        firmware::cases::RELAY,
    );
    let mut controller = Controller::new(SETTINGS, law);
    let sound = checksum(&identified) == model::CHECKSUM
        && model::GOLDEN.holds(&identified, model::state(&identified), &model::REFERENCES);
    if !sound {
        controller.latch(Fault::SelfTest);
    }
    let sensor = Played {
        model: identified,
        state: model::state(&identified),
        open: false,
        illness: b'0',
        flicker: false,
    };
    let samples = Samples(core::cell::Cell::new(0));
    let mut rig = Rig::new(controller, sensor, &samples, Pin, Pin);
    let mut console = Console::new();
    loop {
        ticks.wait(TICKS_PER_SAMPLE);
        samples.0.set(samples.0.get().wrapping_add(1));
        let tick = rig.sample();
        let mut open = tick.open;
        rig.sensor().open = open;
        while let Some(byte) = uart.receive() {
            if let b'0'..=b'4' = byte {
                rig.sensor().illness = byte;
            } else if byte == b'5' {
                samples.0.set(samples.0.get().wrapping_add(1));
            } else if let Some(command) = console.receive(byte) {
                let controller = rig.controller();
                match command {
                    Command::Arm => controller.arm(),
                    Command::Disarm => controller.disarm(),
                    Command::Status => {}
                    Command::Unknown => uart.send(b"? "),
                }
                // What the valve will be after this sample.
                open &= controller.mode() == Mode::Armed;
                let line = Line::status(
                    controller.mode(),
                    controller.friction(),
                    open,
                    controller.samples(),
                );
                uart.send(line.bytes());
            }
        }
    }
}
