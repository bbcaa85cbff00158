//! The loop on QEMU's mps2-an386, with a flow simulated by the model itself, a measured channel at its reference,
//! and faults that are injected over the serial line.
//!
//! Lines: `arm`, `disarm`, `status`; for fault injection a digit: `0` a healthy sensor, `1` NaN, `2` at the rail,
//! `3` stuck, `4` away from the model, `c` a channel of NaN, `5` a sample that takes longer than a period, `6` a
//! loop that hangs, `7` and `8` a restart with a damaged coefficient and a damaged reference trajectory, `9` a
//! restart without damage.
#![no_std]
#![no_main]

use board::stack;
use core::convert::Infallible;
use core::mem::MaybeUninit;
use core::ptr::{addr_of, addr_of_mut};
use cortex_m_rt::{entry, exception};
use embedded_hal::digital::{ErrorType, OutputPin};
use firmware::link::desk::Desk;
use firmware::on_board::SETTINGS;
use firmware::rig::{Clock, Rig, Sensor};
use firmware::{on_board, start};
use identified::on_board as model;
use model_core::model::Averaging;
use model_core::recursion::Bilinear;
use model_core::{Input, Parts, step};
use qemu_mps2::clock::Ticks;
use qemu_mps2::uart::Line;
use qemu_mps2::watchdog::{Watchdog, restarted};
use wire::Outbox;

/// SysTick ticks per sample, at 25 MHz.
const TICKS_PER_SAMPLE: u32 = 25 * on_board::PERIOD_US;
/// Two and a half sample periods, in loops of `cortex_m::asm::delay` with two instructions of 32 ns
/// each.
const TWO_AND_A_HALF_PERIODS: u32 = TICKS_PER_SAMPLE / 2 * 5 * 40 / 64;
/// Watchdog timeout in its ticks, at 25 MHz.
const PATIENCE: u32 = 25 * on_board::PATIENCE_US;

/// Damage to apply at the next start; RAM survives a restart.
#[unsafe(link_section = ".uninit.damage")]
static mut DAMAGE: MaybeUninit<u32> = MaybeUninit::uninit();
const COEFFICIENT: u32 = 0xDA_0001;
const TRAJECTORY: u32 = 0xDA_0002;

/// The flow simulated by the model, and the injected sensor fault.
struct Played {
    model: model::Identified,
    state: model::IdentifiedState,
    open: bool,
    illness: u8,
    /// The last reading before the sensor was stuck.
    held: f32,
    flicker: bool,
}

impl Sensor for Played {
    fn counts(&mut self) -> f32 {
        let input = Input {
            command: if self.open { 1.0 } else { 0.0 },
            channels: &model::REFERENCES,
        };
        let y = step(&self.model, &mut self.state, &input).measured;
        self.flicker = !self.flicker;
        let noise = if self.flicker { 1.0 } else { 0.0 };
        let healthy = SETTINGS.calibration.counts(y) + noise;
        if self.illness != b'3' {
            self.held = healthy;
        }
        match self.illness {
            b'1' => f32::NAN,
            b'2' => 4095.0,
            b'3' => self.held,
            b'4' => 3900.0 + noise,
            _ => healthy,
        }
    }
    fn channel(&mut self) -> f32 {
        match &SETTINGS.channel {
            Some(channel) if self.illness != b'c' => channel.calibration.counts(channel.reference),
            _ => f32::NAN,
        }
    }
}

/// Counter of sample periods.
struct Samples(core::cell::Cell<u32>);

impl Clock for &Samples {
    fn periods(&self) -> u32 {
        self.0.get()
    }
}

/// A pin without hardware: QEMU has no valve.
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
    let by_watchdog = restarted();
    let (mut uart, mut outbox) = (Line::new(core.ITM), Outbox::new());
    let mut ticks = Ticks::new(core.SYST);
    let identified = model::model();
    let mut controller = on_board::controller();
    start::latch(&mut controller, self_test(identified), by_watchdog);
    let sensor = Played {
        model: identified,
        state: model::state(&identified),
        open: false,
        illness: b'0',
        held: 0.0,
        flicker: false,
    };
    let samples = Samples(core::cell::Cell::new(0));
    let mut rig = Rig::new(controller, sensor, &samples, Pin, Pin);
    let mut desk = Desk::new(on_board::BOARD);
    let mut watchdog = Watchdog::start(core.TPIU, PATIENCE);
    ticks.begin();
    loop {
        let periods = ticks.wait(TICKS_PER_SAMPLE);
        samples.0.set(samples.0.get().wrapping_add(periods));
        rig.sensor().open = rig.controller().is_open();
        desk.before(rig.controller(), &mut outbox);
        let tick = rig.sample();
        watchdog.feed();
        desk.after(&tick, rig.controller(), &mut outbox);
        uart.work(&mut outbox, on_board::PERIOD_US);
        while let Some(byte) = uart.receive() {
            match byte {
                // While frames arrive, such a byte is data and does not inject a fault.
                _ if desk.frames_come() => {
                    desk.receive(byte, rig.controller(), &mut outbox);
                }
                b'0'..=b'4' | b'c' => rig.sensor().illness = byte,
                b'5' => cortex_m::asm::delay(TWO_AND_A_HALF_PERIODS),
                b'6' => loop {
                    cortex_m::asm::nop();
                },
                b'7' => restart(COEFFICIENT),
                b'8' => restart(TRAJECTORY),
                b'9' => restart(0),
                _ => desk.receive(byte, rig.controller(), &mut outbox),
            }
        }
    }
}

/// The watchdog's timeout.
#[exception]
unsafe fn NonMaskableInt() -> ! {
    cortex_m::peripheral::SCB::sys_reset()
}

/// The self-test with the injected damage.
fn self_test(model: model::Identified) -> Result<(), start::Failure> {
    // SAFETY: the word is in RAM, any bits are a valid u32, and nothing runs concurrently.
    let damage = unsafe { addr_of!(DAMAGE).cast::<u32>().read_volatile() };
    let (state, references) = (model::state(&model), &model::REFERENCES);
    let mut golden = model::GOLDEN;
    match damage {
        COEFFICIENT => {
            start::self_test(&Damaged(model), state, references, model::CHECKSUM, &golden)
        }
        TRAJECTORY => {
            if let Some(last) = golden.expected.last_mut() {
                *last ^= 1;
            }
            start::self_test(&model, state, references, model::CHECKSUM, &golden)
        }
        _ => on_board::self_test(),
    }
}

/// The model with a changed constant.
struct Damaged<M>(M);

impl<M: Parts<f32>> Parts<f32> for Damaged<M> {
    type Delay = M::Delay;
    type Effects = M::Effects;
    fn recursion(&self) -> Bilinear<'_, f32> {
        let recursion = self.0.recursion();
        Bilinear {
            constant: recursion.constant + 1e-6,
            ..recursion
        }
    }
    fn delay(&self) -> &M::Delay {
        self.0.delay()
    }
    fn effects(&self) -> &M::Effects {
        self.0.effects()
    }
    fn averaging(&self) -> Averaging {
        self.0.averaging()
    }
}

/// A restart by command, which does not count as the watchdog's.
fn restart(damage: u32) {
    let _ = restarted();
    // SAFETY: as in `self_test`.
    unsafe { addr_of_mut!(DAMAGE).cast::<u32>().write_volatile(damage) };
    cortex_m::peripheral::SCB::sys_reset();
}
