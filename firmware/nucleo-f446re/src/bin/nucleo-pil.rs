//! The processor in the loop: answers the host's lockstep requests over the ST-LINK's serial port. The valve stays
//! closed.
#![no_std]
#![no_main]

use board::lockstep::Measured;
use board::stack;
use cortex_m_rt::entry;
use firmware::link::lockstep::Server;
use nucleo_f446re::cycles::Cycles;
use nucleo_f446re::uart::Uart;
use nucleo_f446re::{clocks, valve};
use stm32f4xx_hal::pac::{CorePeripherals, Peripherals};
use stm32f4xx_hal::prelude::*;

#[entry]
fn main() -> ! {
    stack::paint();
    if let (Some(core), Some(chip)) = (CorePeripherals::take(), Peripherals::take()) {
        let mut rcc = chip.RCC.constrain();
        let (a, b) = (chip.GPIOA.split(&mut rcc), chip.GPIOB.split(&mut rcc));
        let _valve = valve::shut(b.pb10);
        clocks::start(&rcc, &chip.FLASH);
        let mut uart = Uart::new(chip.USART2, a.pa2, a.pa3, &mut rcc);
        let cases = Measured::new(Cycles::new(core.DCB, core.DWT));
        // The server is in static memory, so that the stack measurement covers calls only.
        if let Some(server) = cortex_m::singleton!(: Server<Measured<Cycles>> = Server::new(cases))
        {
            loop {
                uart.work();
                if let Some(byte) = uart.receive() {
                    let _ = uart.outbox.offer(server.receive(byte));
                }
            }
        }
    }
    loop {
        cortex_m::asm::wfi();
    }
}
