//! The loop on the Nucleo-F446RE, with operator and host at the ST-LINK's serial
//! port.
#![no_std]
#![no_main]

use board::stack;
use cortex_m_rt::{entry, exception};
use firmware::link::desk::Desk;
use firmware::rig::Rig;
use firmware::{on_board, start};
use nucleo_f446re::sampler::{Periods, Sampler, periods};
use nucleo_f446re::uart::Uart;
use nucleo_f446re::{clocks, valve};
use stm32f4xx_hal::pac::{CorePeripherals, Peripherals};
use stm32f4xx_hal::prelude::*;
use stm32f4xx_hal::watchdog::IndependentWatchdog;

/// Watchdog timeout; its own clock may be wrong by 50 %.
const PATIENCE_MS: u32 = on_board::PATIENCE_US.div_ceil(1000);

#[entry]
fn main() -> ! {
    stack::paint();
    let (Some(_), Some(chip)) = (CorePeripherals::take(), Peripherals::take()) else {
        stopped();
    };
    let by_watchdog = clocks::restarted_by_watchdog(&chip.RCC);
    let mut rcc = chip.RCC.constrain();
    let (a, b) = (chip.GPIOA.split(&mut rcc), chip.GPIOB.split(&mut rcc));
    let valve = valve::shut(b.pb10);
    clocks::start(&rcc, &chip.FLASH);
    let button = chip.GPIOC.split(&mut rcc).pc13;

    let mut controller = on_board::controller();
    start::latch(&mut controller, on_board::self_test(), by_watchdog);

    let mut uart = Uart::new(chip.USART2, a.pa2, a.pa3, &mut rcc);
    let mut watchdog = IndependentWatchdog::new(chip.IWDG);
    watchdog.start(PATIENCE_MS.millis());
    let sampler = Sampler::start(
        chip.ADC1,
        &chip.ADC_COMMON,
        (a.pa0.into_analog(), a.pa1.into_analog()),
        chip.TIM2,
        on_board::PERIOD_US,
        &mut rcc,
    );
    let lamp = a.pa5.into_push_pull_output();
    let mut rig = Rig::new(controller, sampler, Periods, valve, lamp);
    let mut desk = Desk::new(on_board::BOARD);
    let mut sampled = periods();
    loop {
        // Without samples the watchdog is not fed: a stopped converter ends in a restart.
        while periods() == sampled {
            uart.work();
        }
        sampled = periods();
        desk.before(rig.controller(), &mut uart.outbox);
        let tick = rig.sample();
        watchdog.feed();
        if button.is_low() {
            rig.controller().disarm();
        }
        desk.after(&tick, rig.controller(), &mut uart.outbox);
        while let Some(byte) = uart.receive() {
            desk.receive(byte, rig.controller(), &mut uart.outbox);
        }
    }
}

#[exception]
unsafe fn HardFault(_frame: &cortex_m_rt::ExceptionFrame) -> ! {
    stopped();
}

#[exception]
unsafe fn DefaultHandler(_irqn: i16) {
    stopped();
}

/// Keeps the valves closed until the watchdog, if running, restarts the board.
fn stopped() -> ! {
    loop {
        valve::emergency();
    }
}
