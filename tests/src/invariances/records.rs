//! Rigs drawn at random, and their records.

use crate::strangers::bundled_cases;
use host_fit::data::DataSet;
use rand::RngExt;
use rand_chacha::ChaCha8Rng;
use std::fmt;

/// A first or second order with dead time at a level; the time constant may depend on the command.
#[derive(Clone, Copy, Debug)]
pub(super) struct Rig {
    /// Time constants with the command on and off, samples.
    on: f64,
    off: f64,
    /// A second time constant, samples; 0 for none.
    second: f64,
    dead_time: usize,
    /// Standard deviation of the noise; the gain is 1.
    noise: f64,
}

/// Records that are changed.
#[derive(Clone, Debug)]
pub(super) struct Base {
    /// Origin of the records, in words.
    pub(super) words: String,
    /// Standard deviation of the noise, y.
    pub(super) noise: f64,
    pub(super) parts: Vec<Part>,
}

/// A record before it is written.
#[derive(Clone, Debug)]
pub(super) struct Part {
    pub(super) name: String,
    pub(super) held_out: bool,
    pub(super) period_s: f64,
    pub(super) u: Vec<f64>,
    pub(super) y: Vec<f64>,
}

impl Part {
    /// The mean of y before the command first changes, because a single sample has its noise.
    pub(super) fn level_at_rest(&self) -> f64 {
        let changes = self.u.windows(2).position(|pair| pair[0] != pair[1]);
        let rest = self.y.get(..=changes.unwrap_or(0)).unwrap_or(&self.y);
        rest.iter().sum::<f64>() / rest.len().max(1) as f64
    }
}

impl fmt::Display for Rig {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self {
            on,
            off,
            second,
            dead_time,
            noise,
        } = self;
        write!(
            f,
            "time constants {on:.1} on, {off:.1} off, {second:.1}, dead time {dead_time}, noise {noise:.4}"
        )
    }
}

/// An approximately normal number: a sum of twelve uniform numbers.
pub(super) fn normal(random: &mut ChaCha8Rng) -> f64 {
    (0..12).map(|_| random.random::<f64>()).sum::<f64>() - 6.0
}

impl Rig {
    /// The response to `u`, at rest at 0 before it, with noise.
    fn run(&self, u: &[f64], random: &mut ChaCha8Rng) -> Vec<f64> {
        let (mut x, mut z) = (0.0, 0.0);
        let mut y = Vec::with_capacity(u.len());
        for k in 0..u.len() {
            y.push(z + self.noise * normal(random));
            let now = k.checked_sub(self.dead_time).and_then(|i| u.get(i));
            let now = now.copied().unwrap_or(0.0);
            let time = if now > 0.5 { self.on } else { self.off };
            x += (now - x) * -(-1.0 / time).exp_m1();
            z += match self.second > 0.0 {
                true => (x - z) * -(-1.0 / self.second).exp_m1(),
                false => x - z,
            };
        }
        y
    }
}

/// A rig and three records of it, the last for validation, 1 ms per sample.
pub(super) fn draw(random: &mut ChaCha8Rng) -> Base {
    let off = random.random_range(20.0..70.0);
    let linear = random.random_bool(0.5);
    let second = random.random_bool(0.3);
    let rig = Rig {
        off,
        on: if linear {
            off
        } else {
            off * random.random_range(0.5..1.0)
        },
        second: if second {
            random.random_range(0.15..0.4) * off
        } else {
            0.0
        },
        dead_time: random.random_range(3..30),
        noise: random.random_range(0.003..0.02),
    };
    let parts = ["first", "second", "third"].map(|name| {
        let samples = random.random_range(700..1100);
        let mut u = vec![0.0; 20];
        let mut level = 1.0;
        while u.len() < samples {
            let time = off * random.random_range(0.3..4.0);
            u.extend(std::iter::repeat_n(level, time as usize + 2));
            level = 1.0 - level;
        }
        u.truncate(samples);
        Part {
            name: name.to_owned(),
            held_out: name == "third",
            period_s: 0.001,
            y: rig.run(&u, random),
            u,
        }
    });
    Base {
        words: rig.to_string(),
        noise: rig.noise,
        parts: parts.into(),
    }
}

/// The records from other loggers that begin at rest, with an on/off command; one set per case.
pub(super) fn strangers() -> Vec<Base> {
    const SETS: [&str; 5] = [
        "bump-test",
        "heat-cool-cycle",
        "hotend-bang",
        "normally-open",
        "thermostat",
    ];
    let cases = bundled_cases().unwrap_or_default();
    let cases = cases.iter().filter(|case| SETS.contains(&&*case.set));
    let base = |case: &crate::strangers::Case| {
        let mut parts = Vec::new();
        for (files, held_out) in [(&case.files, false), (&case.validate, true)] {
            for file in files {
                let record = DataSet::load(file).ok()?.records.into_iter().next()?;
                parts.push(Part {
                    name: record.name,
                    held_out,
                    period_s: record.sample_period_s,
                    u: record.u,
                    y: record.y,
                });
            }
        }
        let y = &parts.first()?.y;
        let bends = y.windows(3).map(|y| (y[0] - 2.0 * y[1] + y[2]).abs());
        let mut bends: Vec<f64> = bends.collect();
        bends.sort_by(f64::total_cmp);
        // A slope does not contribute. For normal noise the standard deviation of second differences is √6 times
        // that of a sample, and their median 0.674 of it.
        let noise = bends.get(bends.len() / 2)? / (0.674 * 6f64.sqrt());
        Some(Base {
            words: format!("{} {}", case.set, case.name),
            noise,
            parts,
        })
    };
    cases.filter_map(base).collect()
}
