//! Counts the instructions of one step of Table II's model in model-core, in hand-written C and in
//! the exported C, in one run. Sends nine numbers over the serial line and stops.
#![no_std]
#![no_main]

use board::lockstep::Stopwatch;
use cortex_m_rt::entry;
use identified::full;
use model_core::self_test::command;
use model_core::{Input, step};
use qemu_mps2::clock::Ticks;
use qemu_mps2::uart::Line;

const STEPS: u32 = 20_000;

unsafe extern "C" {
    fn peer_step(command: i32) -> f32;
    fn model_step(command: f32, channels: *const f32) -> f32;
    fn model_reset();
}

#[inline(never)]
fn own_step(state: &mut full::IdentifiedState, on: bool) -> f32 {
    let input = Input {
        command: if on { 1.0 } else { 0.0 },
        channels: &[],
    };
    step(&full::model(), state, &input).measured
}

#[entry]
fn main() -> ! {
    if let Some(core) = cortex_m::Peripherals::take() {
        let mut uart = Line::new(core.ITM);
        let mut ticks = Ticks::new(core.SYST);
        let mut state = full::state(&full::model());
        let (mut own, mut peer, mut apart) = (0_u32, 0_u32, 0.0_f32);
        let (mut own_most, mut peer_most) = (0, 0);
        let (mut exported, mut exported_most, mut differ) = (0_u32, 0, 0_u32);
        // SAFETY: the state of the exported model is private, and the model is called from here
        // only.
        unsafe { model_reset() };
        for k in 0..STEPS {
            let on = command(k);
            let (ours, taken) = ticks.measure(|| own_step(&mut state, on));
            own += taken;
            own_most = taken.max(own_most);
            // SAFETY: the state of the model in C by hand is private, and the model is called from
            // here only.
            let (theirs, taken) = ticks.measure(|| unsafe { peer_step(on.into()) });
            peer += taken;
            peer_most = taken.max(peer_most);
            let command = if on { 1.0 } else { 0.0 };
            // SAFETY: as above; the model has no channels to read.
            let step = || unsafe { model_step(command, core::ptr::null()) };
            let (written, taken) = ticks.measure(step);
            exported += taken;
            exported_most = taken.max(exported_most);
            differ += u32::from(written.to_bits() != ours.to_bits());
            let distance = if ours > theirs {
                ours - theirs
            } else {
                theirs - ours
            };
            apart = if distance > apart { distance } else { apart };
        }
        let apart = (apart * 1e9) as u32;
        let sums = [STEPS, own, peer, exported];
        let most = [own_most, peer_most, exported_most];
        for word in sums.into_iter().chain(most).chain([apart, differ]) {
            uart.send(&word.to_le_bytes());
        }
    }
    loop {
        cortex_m::asm::wfi();
    }
}
