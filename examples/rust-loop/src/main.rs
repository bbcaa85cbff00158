//! The exported law controls the exported model in your own loop; `identified.rs` was written by `codegen`.

#[allow(dead_code)]
mod identified;

use identified::{CHANNELS, LAW, LOOK_AHEAD, model, state};
use model_core::{Input, step};

fn main() {
    let model = model();
    // The rig is the model itself here; your program reads a converter instead.
    let mut rig = state(&model);
    let mut law = LAW.start::<_, LOOK_AHEAD>(state(&model));
    let channels = [0.0; CHANNELS.len()];
    let mut reading = None;
    let mut mean = 0.0;
    for k in 0..6000 {
        let decision = LAW.step(&model, &mut law, reading, &channels);
        let command = if decision.on { 1.0 } else { 0.0 };
        let now = step(&model, &mut rig, &Input { command, channels: &channels }).measured;
        reading = Some(now);
        if k >= 3000 {
            mean += now / 3000.0;
        }
    }
    println!("mean {mean:.3}, reference {:.3}", LAW.reference);
}
