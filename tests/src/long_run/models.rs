//! The model in single precision against double precision over many steps.

use anyhow::Result;
use host_fit::model::Model;
use host_fit::simulate::HostState;
use model_core::model::{Input, step};
use rand::{RngExt as _, SeedableRng as _};
use rand_chacha::ChaCha8Rng;

/// Parts of a run, of equal length.
const PARTS: usize = 10;

/// Difference of a model in single and double precision.
#[derive(Clone, Debug)]
pub struct Difference {
    /// Largest |y| in double precision.
    pub largest: f64,
    /// Largest difference in each part of the run, y.
    pub parts: [f64; PARTS],
    /// Root mean square of the difference in each part, y.
    pub rms: [f64; PARTS],
    /// Geometric mean of the difference in each part, y. Rare decisions that differ by rounding hardly change it.
    pub typical: [f64; PARTS],
}

/// Added to each difference before its logarithm is taken, y.
const LEAST: f64 = 1e-12;

/// Runs `model` for `steps` samples of a random command in both precisions.
///
/// # Errors
/// A number that is not finite.
pub fn compare(model: &Model, steps: u64, seed: u64) -> Result<Difference> {
    let memory = model.memory();
    let (single, double) = (model.prepare::<f32>(), model.prepare::<f64>());
    let mut state32: HostState<f32> = memory.at_rest(&single);
    let mut state64: HostState<f64> = memory.at_rest(&double);
    let (channels32, channels64) = (memory.references::<f32>(), memory.references::<f64>());
    let mut random = ChaCha8Rng::seed_from_u64(seed);
    let (mut open, mut left) = (false, 0_u32);
    let mut difference = Difference {
        largest: 0.0,
        parts: [0.0; PARTS],
        rms: [0.0; PARTS],
        typical: [0.0; PARTS],
    };
    let part = (steps / PARTS as u64).max(1);
    for k in 0..part * PARTS as u64 {
        if left == 0 {
            open = !open;
            left = random.random_range(4..600);
        }
        left -= 1;
        let command = f32::from(u8::from(open));
        let input = Input {
            command,
            channels: &channels32[..],
        };
        let a = f64::from(step(&single, &mut state32, &input).measured);
        let input = Input {
            command: f64::from(command),
            channels: &channels64[..],
        };
        let b = step(&double, &mut state64, &input).measured;
        anyhow::ensure!(
            a.is_finite() && b.is_finite(),
            "step {k}: {a} in single, {b} in double precision"
        );
        let at = (k / part) as usize;
        difference.largest = difference.largest.max(b.abs());
        difference.parts[at] = difference.parts[at].max((a - b).abs());
        difference.typical[at] += ((a - b).abs() + LEAST).ln() / part as f64;
        difference.rms[at] += (a - b).powi(2) / part as f64;
    }
    difference.rms = difference.rms.map(f64::sqrt);
    difference.typical = difference.typical.map(f64::exp);
    Ok(difference)
}
