//! The processor in the loop: answers the host's lockstep requests.
#![no_std]
#![no_main]

use cortex_m_rt::entry;
use firmware::cases::Rigs;
use firmware::link::lockstep::{Cases, Report, Server};
use qemu_mps2::clock::Ticks;
use qemu_mps2::stack;
use qemu_mps2::uart::Uart;

/// The cases with their measurements.
struct Measured {
    rigs: Rigs,
    ticks: Ticks,
    report: Report,
}

impl Cases for Measured {
    fn start(&mut self, case: u8) -> bool {
        self.report = Report::default();
        self.rigs.start(case)
    }

    #[inline(never)]
    fn step(&mut self, counts: u16) -> (f32, bool) {
        let rigs = &mut self.rigs;
        let (result, ticks) = self.ticks.measure(|| rigs.step(counts));
        self.report.steps = self.report.steps.wrapping_add(1);
        self.report.ticks = self.report.ticks.wrapping_add(u64::from(ticks));
        self.report.most = self.report.most.max(ticks);
        result
    }

    fn report(&mut self) -> Report {
        Report {
            stack: stack::deepest(),
            ..self.report
        }
    }
}

#[entry]
fn main() -> ! {
    stack::paint();
    let Some(core) = cortex_m::Peripherals::take() else {
        stopped();
    };
    let mut uart = Uart::new(core.ITM);
    let cases = Measured {
        rigs: Rigs::new(),
        ticks: Ticks::new(core.SYST),
        report: Report::default(),
    };
    // In static memory: what the stack is measured for are the calls.
    let Some(server) = cortex_m::singleton!(: Server<Measured> = Server::new(cases)) else {
        stopped();
    };
    loop {
        if let Some(byte) = uart.receive() {
            uart.send(server.receive(byte));
        }
    }
}

fn stopped() -> ! {
    loop {
        cortex_m::asm::wfi();
    }
}
