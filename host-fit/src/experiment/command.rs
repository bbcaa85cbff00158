//! On/off commands within the limits of a valve.

use super::{Limits, RULES};
use rand::RngExt;
use rand_chacha::ChaCha8Rng;

/// A command as a sequence of openings.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Openings {
    pub(super) description: String,
    /// Alternating durations, starting closed, s.
    dwells: Vec<f64>,
}

impl Openings {
    /// The command per sample.
    pub(super) fn command(&self, period: f64, samples: usize) -> Vec<f64> {
        let mut u = Vec::with_capacity(samples);
        let mut level = 0.0;
        for dwell in &self.dwells {
            // The length is rounded up, so that no level is shorter than the valve's limit.
            let length = (dwell / period - 1e-6).ceil().max(0.0) as usize;
            u.extend(std::iter::repeat_n(level, length.min(samples - u.len())));
            level = 1.0 - level;
        }
        u.resize(samples, 0.0);
        u
    }

    /// Repeats `dwells` (open first) until the rest at the end.
    fn repeating(description: String, limits: &Limits, dwells: &[f64]) -> Self {
        let mut all = vec![limits.min_off_s];
        let mut at = limits.min_off_s;
        let end = (1.0 - RULES.rest) * limits.duration_s;
        for pair in dwells.chunks(2).cycle() {
            let [on, off] = pair else { break };
            if at + on > end {
                break;
            }
            all.extend([on, off]);
            at += on + off;
        }
        // The last closure lasts to the end.
        all.pop();
        Self {
            description,
            dwells: all,
        }
    }
}

/// `n` values from `low` to `high` in geometric progression.
fn geometric(low: f64, high: f64, n: u32) -> impl Iterator<Item = f64> {
    (0..n).map(move |i| low * (high / low).powf(f64::from(i) / f64::from(n - 1)))
}

/// Square waves, single pulses, pairs with growing pauses, random sequences.
pub(super) fn families(limits: &Limits, rng: &mut ChaCha8Rng) -> Vec<Openings> {
    let Limits {
        min_on_s: on,
        min_off_s: off,
        duration_s: duration,
    } = *limits;
    let mut plans = Vec::new();
    for period in geometric(on + off, RULES.longest_period * duration, RULES.periods) {
        for duty in RULES.duties {
            let (open, closed) = (duty * period, (1.0 - duty) * period);
            if open >= on && closed >= off {
                let name = format!(
                    "a square wave of {:.3} Hz with {:.0} % duty",
                    1.0 / period,
                    100.0 * duty
                );
                plans.push(Openings::repeating(name, limits, &[open, closed]));
            }
        }
    }
    for open in geometric(on, RULES.longest_pulse * duration, RULES.pulses) {
        let name = format!("a single pulse of {open:.3} s");
        plans.push(Openings {
            description: name,
            dwells: vec![off.max(0.05 * duration), open],
        });
    }
    let long = RULES.longest_of_pair * duration;
    let rest = long.max(off);
    let [firsts, seconds, pauses] = RULES.pairs;
    // The range is not empty even if the shortest times are long.
    for first in geometric(on, long.max(1.01 * on), firsts) {
        for second in geometric(on, long.max(1.01 * on), seconds) {
            let dwells: Vec<f64> = geometric(off, rest.max(1.01 * off), pauses)
                .flat_map(|pause| [first, pause, second, rest])
                .collect();
            let name = format!(
                "pairs of pulses of {first:.3} and {second:.3} s with pauses growing from {off:.3} to {rest:.3} s"
            );
            plans.push(Openings::repeating(name, limits, &dwells));
        }
    }
    for i in 0..RULES.sequences {
        let longest = on.max(off) * 2.0_f64.powi(1 + (i % 5) as i32);
        let dwells: Vec<f64> = (0..2 * (duration / (on + off)) as usize + 2)
            .map(|k| {
                let shortest = if k % 2 == 0 { on } else { off };
                rng.random_range(shortest..=shortest.max(longest))
            })
            .collect();
        let name =
            format!("a random on/off sequence with on-times and off-times up to {longest:.3} s");
        plans.push(Openings::repeating(name, limits, &dwells));
    }
    plans
}

/// The plan with some durations changed.
pub(super) fn mutate(plan: &Openings, limits: &Limits, rng: &mut ChaCha8Rng) -> Openings {
    let mut changed = plan.clone();
    let share = rng.random_range(0.05..0.6);
    let size = rng.random_range(0.05..0.8);
    for (k, dwell) in changed.dwells.iter_mut().enumerate() {
        if rng.random_bool(share) {
            let shortest = if k % 2 == 1 {
                limits.min_on_s
            } else {
                limits.min_off_s
            };
            *dwell = (*dwell * f64::exp(rng.random_range(-size..size))).max(shortest);
        }
    }
    // Openings within the final rest are left out; a plan ends with an opening.
    let end = (1.0 - RULES.rest) * limits.duration_s;
    let mut at = 0.0;
    let kept = changed.dwells.iter().take_while(|dwell| {
        at += **dwell;
        at <= end
    });
    let kept = kept.count() / 2 * 2;
    if kept >= 2 {
        changed.dwells.truncate(kept);
    }
    if !changed.description.ends_with("varied") {
        changed.description.push_str(", varied");
    }
    changed
}
