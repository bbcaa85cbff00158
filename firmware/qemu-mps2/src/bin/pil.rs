//! The processor in the loop: answers the host's lockstep requests.
#![no_std]
#![no_main]

use board::lockstep::Measured;
use board::stack;
use cortex_m_rt::entry;
use firmware::link::lockstep::Server;
use qemu_mps2::clock::Ticks;
use qemu_mps2::uart::Line;

#[entry]
fn main() -> ! {
    stack::paint();
    if let Some(core) = cortex_m::Peripherals::take() {
        let mut uart = Line::new(core.ITM);
        let cases = Measured::new(Ticks::new(core.SYST));
        // The server is in static memory, because the stack measurement covers calls only.
        if let Some(server) = cortex_m::singleton!(: Server<Measured<Ticks>> = Server::new(cases)) {
            loop {
                if let Some(byte) = uart.receive() {
                    uart.send(server.receive(byte));
                }
            }
        }
    }
    loop {
        cortex_m::asm::wfi();
    }
}
