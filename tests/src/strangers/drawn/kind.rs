//! The kinds of records from other loggers.

use super::plant::{Last, Plant};
use super::{chance, logarithmic, normal};
use rand::RngExt;
use rand_chacha::ChaCha8Rng;

/// Columns of a file.
#[derive(Clone, Debug)]
pub(super) struct Record {
    pub(super) u: Vec<f64>,
    pub(super) y: Vec<f64>,
    /// Another measured channel with its name.
    pub(super) channel: Option<(&'static str, Vec<f64>)>,
}

impl Record {
    pub(super) fn is_switched(&self) -> bool {
        self.u.iter().all(|u| *u == 0.0 || *u == 1.0)
    }
}

/// Records of a rig and the right answer for them.
#[derive(Clone, Debug)]
pub(super) struct Drawn {
    pub(super) period_s: f64,
    pub(super) records: Vec<Record>,
    /// Value that the interval of `delay` must contain, samples; `None` if the command has no measurable edges.
    pub(super) dead_time: Option<f64>,
    /// The channel that drives y as well.
    pub(super) input: Option<&'static str>,
    /// Whether y contains a disturbance that no effect describes. The verdicts "unexplained" and, without a name,
    /// "partly-explained" are then also right.
    pub(super) disturbed: bool,
    /// Further options of `import`.
    pub(super) import: Vec<String>,
    /// The rig in words.
    pub(super) truth: String,
}

/// A kind, with its name in the table and in words.
pub(super) struct Kind {
    pub(super) name: &'static str,
    pub(super) what: &'static str,
    pub(super) draw: fn(&mut ChaCha8Rng) -> Drawn,
}

const fn kind(name: &'static str, what: &'static str, draw: fn(&mut ChaCha8Rng) -> Drawn) -> Kind {
    Kind { name, what, draw }
}

/// The kinds of sets, in the order in which they are drawn.
pub(super) const KINDS: &[Kind] = &[
    kind("one-pulse", "one step or one pulse", one_pulse),
    kind("second-order", "two lags in series", |rng| of_lags(rng, 2)),
    kind("third-order", "three lags in series", |rng| of_lags(rng, 3)),
    kind("valve-open", "at rest with the command on", valve_open),
    kind("mid-run", "begins in mid-run", mid_run),
    kind("thermostat", "switched by a thermostat", thermostat),
    kind("graded", "a command of many levels", graded),
    kind("quantised", "a coarse converter", quantised),
    kind("two-records", "two records", |rng| several(rng, 2, 0.0)),
    kind("zeros-apart", "three records with zeros apart", |rng| {
        several(rng, 3, 3.0)
    }),
    kind(
        "binary-sequence",
        "a pseudo-random binary sequence",
        binary_sequence,
    ),
    kind("held-out", "the tail of one run is held out", held_out),
    kind("coloured", "noise with memory", coloured),
    kind("outliers", "heavy-tailed noise", outliers),
    kind(
        "measured-input",
        "another input that is measured",
        measured_input,
    ),
    kind(
        "unrelated-channel",
        "a channel that has nothing to do with y",
        unrelated_channel,
    ),
    kind("spikes", "single wrong readings", spikes),
    kind("drift", "a drifting environment", drift),
    kind("ringing", "a response that rings", ringing),
    kind("integrating", "a tank that integrates", integrating),
    kind(
        "own-row",
        "a reading of the same moment as the command",
        own_row,
    ),
];

/// A rig before its records are drawn.
struct Rig {
    period_s: f64,
    plant: Plant,
    /// Standard deviation of the noise.
    noise: f64,
    samples: usize,
}

impl Rig {
    fn draw(rng: &mut ChaCha8Rng) -> Self {
        let periods = [0.005, 0.02, 0.1, 0.5, 1.0, 2.0, 10.0, 30.0];
        let sign = if chance(rng, 0.75) { 1.0 } else { -1.0 };
        let gain = sign * logarithmic(rng, 0.03, 300.0);
        let level = match chance(rng, 0.5) {
            true => 0.0,
            false => gain * rng.random_range(-8.0..8.0),
        };
        Self {
            period_s: periods[rng.random_range(0..periods.len())],
            plant: Plant {
                lags: vec![rng.random_range(15.0..90.0)],
                last: Last::Nothing,
                dead_time: f64::from(rng.random_range(0..350)) / 10.0,
                gain,
                level,
                before: 0.0,
            },
            noise: gain.abs() * rng.random_range(0.002..0.01),
            samples: rng.random_range(500..1500),
        }
    }

    /// A random rig, with a second lag in two of five cases.
    fn draw_any_order(rng: &mut ChaCha8Rng) -> Self {
        let mut rig = Self::draw(rng);
        if chance(rng, 0.4) {
            rig.add_lag(rng);
        }
        rig
    }

    fn add_lag(&mut self, rng: &mut ChaCha8Rng) {
        self.plant
            .lags
            .push(self.plant.lags[0] * rng.random_range(0.1..0.7));
    }

    /// A switched command that begins with `first`: first a rest, then pieces of 0.3 to 1.7 times `mean` time
    /// constants.
    fn switched(&self, rng: &mut ChaCha8Rng, first: f64, mean: f64) -> Vec<f64> {
        let mut u = vec![first; rng.random_range(20..100)];
        let mut now = first;
        while u.len() < self.samples {
            now = 1.0 - now;
            let length = rng.random_range(0.3..1.7) * mean * self.plant.lags[0];
            u.extend(std::iter::repeat_n(now, length as usize + 5));
        }
        u.truncate(self.samples);
        u
    }

    fn white(&self, y: Vec<f64>, rng: &mut ChaCha8Rng) -> Vec<f64> {
        y.into_iter()
            .map(|y| y + self.noise * normal(rng))
            .collect()
    }

    /// The record of this command with white noise.
    fn record(&self, u: Vec<f64>, rng: &mut ChaCha8Rng) -> Record {
        let y = self.white(self.plant.answer(&u), rng);
        Record {
            u,
            y,
            channel: None,
        }
    }

    fn of(&self, records: Vec<Record>) -> Drawn {
        let plant = &self.plant;
        let lags: Vec<String> = plant.lags.iter().map(|lag| format!("{lag:.1}")).collect();
        let truth = format!(
            "gain {:.4}, lags {} samples, dead time {} samples, level {:.4}, noise {:.4}, a sample each {} s",
            plant.gain,
            lags.join(" + "),
            plant.dead_time,
            plant.level,
            self.noise,
            self.period_s
        );
        Drawn {
            period_s: self.period_s,
            records,
            dead_time: Some(plant.dead_time),
            input: None,
            disturbed: false,
            import: Vec::new(),
            truth,
        }
    }
}

fn one_pulse(rng: &mut ChaCha8Rng) -> Drawn {
    let rig = Rig::draw(rng);
    let rest = rng.random_range(10..200);
    let length = match chance(rng, 0.5) {
        true => rig.samples,
        false => (rng.random_range(1.0..5.0) * rig.plant.lags[0]) as usize + 5,
    };
    let on = |sample| f64::from(u8::from((rest..rest + length).contains(&sample)));
    let u = (0..rig.samples).map(on).collect();
    rig.of(vec![rig.record(u, rng)])
}

fn of_lags(rng: &mut ChaCha8Rng, lags: usize) -> Drawn {
    let mut rig = Rig::draw(rng);
    while rig.plant.lags.len() < lags {
        rig.add_lag(rng);
    }
    let u = rig.switched(rng, 0.0, 3.0);
    rig.of(vec![rig.record(u, rng)])
}

fn valve_open(rng: &mut ChaCha8Rng) -> Drawn {
    let mut rig = Rig::draw(rng);
    rig.plant.before = 1.0;
    let u = rig.switched(rng, 1.0, 3.0);
    rig.of(vec![rig.record(u, rng)])
}

fn mid_run(rng: &mut ChaCha8Rng) -> Drawn {
    let rig = Rig::draw_any_order(rng);
    let u = rig.switched(rng, 0.0, 3.0);
    let mut record = rig.record(u, rng);
    let cut = (rng.random_range(0.5..3.0) * rig.plant.lags[0]) as usize + 40;
    record.u.drain(..cut);
    record.y.drain(..cut);
    rig.of(vec![record])
}

fn thermostat(rng: &mut ChaCha8Rng) -> Drawn {
    let rig = Rig::draw_any_order(rng);
    let hysteresis = rng.random_range(0.02..0.1);
    let (u, y) = (rig.plant).thermostat(rig.samples, hysteresis, rig.noise, rng);
    let channel = None;
    rig.of(vec![Record { u, y, channel }])
}

fn graded(rng: &mut ChaCha8Rng) -> Drawn {
    let rig = Rig::draw(rng);
    let mut u = vec![0.0; 30];
    while u.len() < rig.samples {
        let level = (100.0 * rng.random::<f64>()).round() / 100.0;
        u.extend(std::iter::repeat_n(
            level,
            (1.5 * rig.plant.lags[0]) as usize,
        ));
    }
    u.truncate(rig.samples);
    let mut drawn = rig.of(vec![rig.record(u, rng)]);
    drawn.dead_time = None;
    drawn
}

fn quantised(rng: &mut ChaCha8Rng) -> Drawn {
    let rig = Rig::draw_any_order(rng);
    let u = rig.switched(rng, 0.0, 3.0);
    let mut record = rig.record(u, rng);
    let step = rig.plant.gain.abs() * logarithmic(rng, 0.004, 0.1);
    for y in &mut record.y {
        *y = (*y / step).round() * step;
    }
    rig.of(vec![record])
}

fn several(rng: &mut ChaCha8Rng, count: usize, apart: f64) -> Drawn {
    let mut rig = Rig::draw_any_order(rng);
    let level = rig.plant.level;
    let record = |_| {
        let u = rig.switched(rng, 0.0, 3.0);
        rig.plant.level = level + apart * rig.noise * normal(rng);
        rig.record(u, rng)
    };
    let records = (0..count).map(record).collect();
    rig.of(records)
}

fn binary_sequence(rng: &mut ChaCha8Rng) -> Drawn {
    let rig = Rig::draw(rng);
    let piece = (logarithmic(rng, 0.05, 0.4) * rig.plant.lags[0]).max(2.0) as usize;
    let mut u = vec![0.0; 20];
    while u.len() < rig.samples {
        let now = f64::from(u8::from(chance(rng, 0.5)));
        u.extend(std::iter::repeat_n(now, piece));
    }
    u.truncate(rig.samples);
    rig.of(vec![rig.record(u, rng)])
}

fn held_out(rng: &mut ChaCha8Rng) -> Drawn {
    let rig = Rig::draw_any_order(rng);
    let u = rig.switched(rng, 0.0, 2.0);
    let mut drawn = rig.of(vec![rig.record(u, rng)]);
    let split = rng.random_range(0.55..0.75) * rig.samples as f64 * rig.period_s;
    drawn.import = ["--hold-out-from".to_owned(), format!("{split:.3}")].to_vec();
    drawn
}

fn coloured(rng: &mut ChaCha8Rng) -> Drawn {
    let rig = Rig::draw_any_order(rng);
    let u = rig.switched(rng, 0.0, 3.0);
    // A lag of 2 to 20 samples, always faster than the rig.
    let memory = (-1.0 / logarithmic(rng, 2.0, 20.0f64.min(0.5 * rig.plant.lags[0]))).exp();
    let mut error = normal(rng);
    let y = rig.plant.answer(&u).into_iter().map(|y| {
        error = memory * error + (1.0 - memory * memory).sqrt() * normal(rng);
        y + rig.noise * error
    });
    let (y, channel) = (y.collect(), None);
    rig.of(vec![Record { u, y, channel }])
}

/// Student's t with three degrees of freedom, scaled to the noise's variance.
fn outliers(rng: &mut ChaCha8Rng) -> Drawn {
    let rig = Rig::draw_any_order(rng);
    let u = rig.switched(rng, 0.0, 3.0);
    let y = rig.plant.answer(&u).into_iter().map(|y| {
        let squares: f64 = (0..3).map(|_| normal(rng).powi(2)).sum();
        y + rig.noise * normal(rng) / squares.sqrt()
    });
    let (y, channel) = (y.collect(), None);
    rig.of(vec![Record { u, y, channel }])
}

/// The measured input has a quarter of the command's gain, and its own lag and dead time.
fn measured_input(rng: &mut ChaCha8Rng) -> Drawn {
    let rig = Rig::draw(rng);
    let u = rig.switched(rng, 0.0, 3.0);
    let mut record = rig.record(u, rng);
    let second = Plant {
        lags: vec![rig.plant.lags[0] * rng.random_range(0.7..1.5)],
        last: Last::Nothing,
        dead_time: f64::from(rng.random_range(0..350)) / 10.0,
        gain: 0.25 * rig.plant.gain,
        level: 0.0,
        before: 0.0,
    };
    let fan = rig.switched(rng, 0.0, 4.0);
    for (y, more) in record.y.iter_mut().zip(second.answer(&fan)) {
        *y += more;
    }
    record.channel = Some(("fan", fan));
    let mut drawn = rig.of(vec![record]);
    drawn.truth += &format!(
        "; fan: gain {:.4}, lag {:.1} samples, dead time {} samples",
        second.gain, second.lags[0], second.dead_time
    );
    // No dead time is expected, because the response to an edge of the command often coincides with one to the fan.
    (drawn.dead_time, drawn.input) = (None, Some("fan"));
    drawn
}

fn unrelated_channel(rng: &mut ChaCha8Rng) -> Drawn {
    let rig = Rig::draw(rng);
    let u = rig.switched(rng, 0.0, 3.0);
    let mut record = rig.record(u, rng);
    let period = rng.random_range(50.0..400.0);
    let mut walk = 0.0;
    let values = match rng.random_range(0..4) {
        0 => rig.switched(rng, 0.0, 4.0),
        1 => (0..rig.samples).map(|_| normal(rng)).collect(),
        2 => (0..rig.samples)
            .map(|k| (std::f64::consts::TAU * k as f64 / period).sin())
            .collect(),
        _ => (0..rig.samples)
            .map(|_| {
                walk += normal(rng);
                walk
            })
            .collect(),
    };
    record.channel = Some(("room", values));
    rig.of(vec![record])
}

/// One reading in about 300 is wrong by 0.3 to 1.5 times the gain.
fn spikes(rng: &mut ChaCha8Rng) -> Drawn {
    let rig = Rig::draw_any_order(rng);
    let u = rig.switched(rng, 0.0, 3.0);
    let mut record = rig.record(u, rng);
    for y in &mut record.y {
        if chance(rng, 1.0 / 300.0) {
            let sign = if chance(rng, 0.5) { 1.0 } else { -1.0 };
            *y += sign * rig.plant.gain * rng.random_range(0.3..1.5);
        }
    }
    rig.of(vec![record])
}

/// A random walk behind a lag of 200 samples, 2 to 8 % of the gain.
fn drift(rng: &mut ChaCha8Rng) -> Drawn {
    let mut rig = Rig::draw_any_order(rng);
    rig.samples *= 2;
    let u = rig.switched(rng, 0.0, 3.0);
    let mut record = rig.record(u, rng);
    let (mut walk, mut room) = (0.0, 0.0);
    let air: Vec<f64> = (0..rig.samples)
        .map(|_| {
            walk += normal(rng);
            room += (walk - room) / 200.0;
            room
        })
        .collect();
    let mean = air.iter().sum::<f64>() / air.len() as f64;
    let square = air.iter().map(|a| (a - mean).powi(2)).sum::<f64>() / air.len() as f64;
    let size = rig.plant.gain * rng.random_range(0.02..0.08) / square.sqrt();
    for (y, air) in record.y.iter_mut().zip(air) {
        *y += size * air;
    }
    let mut drawn = rig.of(vec![record]);
    drawn.disturbed = true;
    drawn
}

fn ringing(rng: &mut ChaCha8Rng) -> Drawn {
    let mut rig = Rig::draw(rng);
    let (period, damping) = (rig.plant.lags[0], rng.random_range(0.1..0.5));
    rig.plant.last = Last::Resonance { period, damping };
    let u = rig.switched(rng, 0.0, 3.0);
    rig.plant.lags.clear();
    let mut drawn = rig.of(vec![rig.record(u, rng)]);
    drawn.truth += &format!("; resonance of {period:.1} samples, damping {damping:.2}");
    drawn
}

/// An integrator behind a valve with a lag.
fn integrating(rng: &mut ChaCha8Rng) -> Drawn {
    let mut rig = Rig::draw(rng);
    let u = rig.switched(rng, 0.0, 2.0);
    rig.plant.lags[0] = rng.random_range(5.0..30.0);
    rig.plant.last = Last::Integrator;
    rig.of(vec![rig.record(u, rng)])
}

/// The logger sets the command, waits, and reads: y of a row responds to u of that row.
fn own_row(rng: &mut ChaCha8Rng) -> Drawn {
    let mut rig = Rig::draw(rng);
    let u = rig.switched(rng, 0.0, 2.0);
    rig.plant.lags[0] = logarithmic(rng, 0.1, 2.0);
    rig.plant.dead_time = 0.0;
    let mut record = rig.record(u, rng);
    record.u.rotate_right(1);
    record.u[0] = 0.0;
    rig.of(vec![record])
}
