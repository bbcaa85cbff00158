//! The designed law compared with standard controllers, on plants that differ from its model: `cargo xtask
//! bench-law`.

use closed_loop::{
    Controlled, Controller, Figures, FirstOrder, Gains, OpenLoop, PulseWidth, Relay,
    TrackingController, run,
};
use firmware_sim::bench::{Disturbed, Lost};
use firmware_sim::instrument::{Converter, Noise, NoiseSignal};
use firmware_sim::plant::beyond::{BubbleMemory, PowerLaw};
use firmware_sim::plant::effects::VortexShedding;
use firmware_sim::plant::{BasePlant, FlowDelay, PlantSpec, Rig, SAMPLE_PERIOD_S as PERIOD_S};
use host_fit::design::{TrackRequest, track};
use host_fit::model::{Delay, Model, Track};
use host_fit::ring::Ring;
use model_core::State;
use model_core::control::HoldTimes;
use model_core::effects::StateDependentDelay;
use model_core::history::Reaching as _;
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use std::collections::VecDeque;

const PLANTS: u64 = 8;
/// Seeds from here on were not used for tuning.
const FIRST_SEED: u64 = 900;
const SAMPLES: usize = 12_000;
const JUDGED: usize = 3000;
/// Exponent of [`Unknown::Film`].
const FILM_EXPONENT: f64 = 0.65;
const TIMES: HoldTimes = HoldTimes { on: 10, off: 10 };

/// A run of a controller for a target on a bench.
type Run = fn(&Bench, f64) -> Option<Figures>;

/// Physics of the plant that the law's model does not have.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Unknown {
    Nothing,
    /// An inverse response: the friction first moves in the other direction (a zero in the right half plane).
    Reversal,
    /// A resonance at 25 Hz that the jets excite.
    Resonance,
    /// A bubble that fills slowly; the fuller the bubble, the lower the level.
    Memory,
    /// Reading = full·(friction/full)^[`FILM_EXPONENT`]: King's law with another exponent than the catalogue's.
    Film,
}

impl Unknown {
    fn spec(self, base: BasePlant) -> PlantSpec {
        let mut spec = PlantSpec::new(base, &[]);
        match self {
            Self::Nothing | Self::Reversal => {}
            Self::Resonance => spec.effects.push(
                VortexShedding {
                    frequency: 25.0,
                    damping_ratio: 0.05,
                    gain: 0.2 * base.gain,
                }
                .into(),
            ),
            Self::Memory => spec.beyond.push(
                BubbleMemory {
                    square: 0.3 / base.gain,
                    time: 0.5,
                }
                .into(),
            ),
            Self::Film => spec.beyond.push(
                PowerLaw {
                    exponent: FILM_EXPONENT,
                    full: base.gain,
                }
                .into(),
            ),
        }
        spec
    }
}

/// A rig with an inverse response: minus `depth` times the part of the jet that is younger than `time_s`.
struct Reversing {
    rig: Rig,
    depth: f64,
    time_s: f64,
    /// Commands in transport to the flow, the oldest first.
    coming: VecDeque<bool>,
    followed: f64,
    push: f64,
}

impl Reversing {
    fn new(rig: Rig, depth: f64, time_s: f64, delay_s: f64) -> Self {
        Self {
            rig,
            depth,
            time_s,
            coming: VecDeque::from(vec![false; (delay_s / PERIOD_S).round() as usize]),
            followed: 0.0,
            push: 0.0,
        }
    }
}

impl Controlled for Reversing {
    fn sample_period_s(&self) -> f64 {
        PERIOD_S
    }
    fn step(&mut self, command: bool) -> Option<f64> {
        let clean = Controlled::step(&mut self.rig, command);
        self.coming.push_back(command);
        let jet = f64::from(u8::from(self.coming.pop_front().unwrap_or(command)));
        self.followed += (jet - self.followed) * -(-PERIOD_S / self.time_s).exp_m1();
        self.push = self.depth * (jet - self.followed);
        Some(clean? - self.push)
    }
    fn friction(&self) -> f64 {
        Rig::friction(&self.rig) - self.push
    }
}

/// A plant with noise, and a model with errors: gain +5 %, delays +5 %, time constants −10 %.
struct Bench {
    base: BasePlant,
    unknown: Unknown,
    model: Model,
    /// Low-frequency sensor noise, as a calibration measures it.
    slow_noise: f64,
    seed: u64,
}

impl Bench {
    /// A random plant with its time constants multiplied by `slower`.
    fn draw(seed: u64, slower: f64) -> Self {
        let drawn = BasePlant::draw(&mut ChaCha8Rng::seed_from_u64(seed));
        let base = BasePlant {
            attach_s: slower * drawn.attach_s,
            separate_s: slower * drawn.separate_s,
            ..drawn
        };
        let per_sample = |time_s: f64| (-PERIOD_S / (0.9 * time_s)).exp();
        let (attached, separated) = (per_sample(base.attach_s), per_sample(base.separate_s));
        let (floor, rise, rate) = match base.delay {
            FlowDelay::StateDependent {
                floor_s,
                rise_s,
                rate,
            } => (floor_s, rise_s, rate),
            FlowDelay::Fixed { delay_s } => (delay_s, 0.0, 1.0),
            FlowDelay::Clamped { .. } | FlowDelay::EdgeDependent { .. } => {
                unreachable!("plants are drawn with the exponential law")
            }
        };
        let model = Model {
            a: vec![separated],
            b: vec![1.05 * base.gain * (1.0 - attached)],
            c: vec![attached - separated],
            delay: Delay::of::<StateDependentDelay<f64>>(
                &[1050.0 * floor, 1050.0 * rise, rate],
                vec![1.0],
                false,
            ),
            ..Model::default()
        };
        Self {
            base,
            unknown: Unknown::Nothing,
            model,
            slow_noise: slow_noise(seed),
            seed,
        }
    }

    fn shortest_delay_s(&self) -> f64 {
        match self.base.delay {
            FlowDelay::StateDependent { floor_s, .. } => floor_s,
            FlowDelay::Fixed { delay_s } => delay_s,
            FlowDelay::Clamped { .. } | FlowDelay::EdgeDependent { .. } => {
                unreachable!("plants are drawn with the exponential law")
            }
        }
    }

    /// The figures of a run towards `reference`, evaluated against `goal`.
    fn run(&self, mut controller: impl Controller, reference: f64, goal: f64) -> Figures {
        let rig = Rig::new(&self.unknown.spec(self.base), None).expect("a drawn plant is possible");
        let depth = match self.unknown {
            Unknown::Reversal => 0.3 * self.base.gain,
            _ => 0.0,
        };
        let rig = Reversing::new(rig, depth, 0.02, self.shortest_delay_s());
        let mut flow = Disturbed::new(
            rig,
            Some(Noise::HOT_FILM),
            Some(Converter::TWELVE_BIT),
            Lost::default(),
            self.seed,
        );
        let mut trace = run(
            &mut controller,
            &mut flow,
            std::iter::repeat_n(reference, SAMPLES),
        );
        for sample in &mut trace.samples {
            sample.reference = goal;
            // No controller can correct the curve of its sensor: there the error is that of the reading.
            if self.unknown == Unknown::Film {
                sample.friction = self.base.gain
                    * (sample.friction / self.base.gain)
                        .max(0.0)
                        .powf(FILM_EXPONENT);
            }
        }
        Figures::of(&trace, JUDGED)
    }

    /// A run whose mean friction is `goal`, found by adjusting the reference.
    fn at_mean<C: Controller>(&self, goal: f64, controller: impl Fn() -> C) -> Figures {
        let mut reference = goal;
        let mut best = self.run(controller(), reference, goal);
        for _ in 0..6 {
            if best.offset.abs() < 0.002 {
                break;
            }
            reference -= best.offset;
            let next = self.run(controller(), reference, goal);
            if next.offset.abs() >= best.offset.abs() {
                break;
            }
            best = next;
        }
        best
    }

    fn designed(&self, target: f64, switches_per_s: Option<f64>, least_air: bool) -> Option<Track> {
        let request = TrackRequest {
            switches_per_s,
            least_air,
            slow_noise: Some(self.slow_noise),
            ..TrackRequest::holding(target)
        };
        track(&self.model, &request).ok().map(|design| design.law)
    }

    /// The law for its own reference, without adjustment.
    fn law(&self, goal: f64, switches_per_s: Option<f64>, least_air: bool) -> Option<Figures> {
        let design = self.designed(goal, switches_per_s, least_air)?;
        let prepared = self.model.prepare::<f32>();
        let at_rest = State::at_rest(&prepared, Ring::reaching(300), Ring::reaching(300));
        let law = TrackingController::new(&prepared, design.tracking(), at_rest, Vec::new());
        Some(self.run(law, goal, goal))
    }

    fn relay(&self, goal: f64) -> Figures {
        self.run(Relay::new(TIMES, 0.02), goal, goal)
    }

    /// No controller: a square wave with that many switches per second, or as many as the hold times permit, whose
    /// duty gives the goal on average. No signal with this rate has less ripple, because the flow moves by itself
    /// between two switches and even spacing minimises the ripple.
    fn floor(&self, goal: f64, switches_per_s: f64) -> Figures {
        let at = |frequency: f64| {
            let (mut low, mut high) = (0.0, 1.0);
            let mut best = self.run(
                OpenLoop::square(frequency, 0.5, TIMES, PERIOD_S),
                goal,
                goal,
            );
            for _ in 0..8 {
                let duty = 0.5 * (low + high);
                let figures = self.run(
                    OpenLoop::square(frequency, duty, TIMES, PERIOD_S),
                    goal,
                    goal,
                );
                if figures.offset.abs() < best.offset.abs() {
                    best = figures;
                }
                if figures.offset < 0.0 {
                    low = duty;
                } else {
                    high = duty;
                }
            }
            best
        };
        let rates = (0..12).map(|i| 0.5 * switches_per_s * 0.9_f64.powi(i));
        let mut tried = rates.map(at);
        let first = tried.find(|figures| figures.offset.abs() < 0.01 * goal);
        first.unwrap_or_else(|| at(0.25 * switches_per_s))
    }

    /// The PI gains of a grid with the smallest error on this plant.
    fn tuned(&self, goal: f64, smith: bool) -> Figures {
        let mut best: Option<Figures> = None;
        for proportional in [0.0, 0.2, 0.5, 1.0, 2.0] {
            for integral in [0.5, 1.0, 2.0, 4.0, 8.0, 16.0] {
                let gains = Gains {
                    proportional,
                    integral,
                };
                let figures = self.run(self.pulse_width(gains, smith), goal, goal);
                if best.is_none_or(|b| figures.rms < b.rms) {
                    best = Some(figures);
                }
            }
        }
        best.unwrap_or_else(|| self.run(OpenLoop::steady(), goal, goal))
    }

    fn pulse_width(&self, gains: Gains, smith: bool) -> PulseWidth {
        let controller = PulseWidth::new(gains, 20.0, TIMES, PERIOD_S);
        if !smith {
            return controller;
        }
        let delay_s = self.shortest_delay_s();
        controller.with_smith(FirstOrder {
            gain: self.base.gain,
            time_s: 0.5 * (self.base.attach_s + self.base.separate_s),
            delay_s,
        })
    }
}

/// Noise of a sensor at rest over two seconds, averaged over 64 samples, as in `record --calibrate`.
fn slow_noise(seed: u64) -> f64 {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    // This noise is independent of the noise of the runs.
    rng.set_stream(9);
    let mut noise = NoiseSignal::new(Noise::HOT_FILM, rng);
    let means: Vec<f64> = (0..31)
        .map(|_| (0..64).map(|_| noise.sample()).sum::<f64>() / 64.0)
        .collect();
    let mean = means.iter().sum::<f64>() / 31.0;
    (means.iter().map(|m| (m - mean).powi(2)).sum::<f64>() / 30.0).sqrt()
}

/// Means over the plants.
#[derive(Default)]
struct Row {
    rms: f64,
    mean: f64,
    air: f64,
    switches: f64,
    plants: f64,
}

impl Row {
    fn add(&mut self, figures: &Figures, gain: f64) {
        self.rms += figures.rms;
        self.mean += figures.mean / gain;
        self.air += figures.air;
        self.switches += figures.switches_per_s;
        self.plants += 1.0;
    }
    fn print(&self, name: &str) {
        let n = self.plants.max(1.0);
        println!(
            "| {name:<46} | {:>6.4} | {:>6.3} | {:>6.3} | {:>8.1} |",
            self.rms / n,
            self.mean / n,
            self.air / n,
            self.switches / n
        );
    }
}

fn heading(text: &str) {
    println!("\n{text}\n");
    println!(
        "| {:<46} | {:>6} | {:>6} | {:>6} | {:>8} |",
        "", "rms", "mean", "air", "switches"
    );
    println!(
        "|{:-<48}|{:->8}|{:->8}|{:->8}|{:->10}|",
        "", ":", ":", ":", ":"
    );
}

/// Every controller on every plant, holding a share of steady blowing.
fn hold_closely(benches: &[Bench], level: f64) {
    let rows: [(&str, Run); 11] = [
        ("steady blowing", |b, g| {
            Some(b.run(OpenLoop::steady(), g, g))
        }),
        ("open loop 4 Hz 50 %", |b, g| {
            Some(b.run(OpenLoop::square(4.0, 0.5, TIMES, PERIOD_S), g, g))
        }),
        ("open loop 4 Hz 80 %", |b, g| {
            Some(b.run(OpenLoop::square(4.0, 0.8, TIMES, PERIOD_S), g, g))
        }),
        ("relay, hysteresis +-0.02", |b, g| Some(b.relay(g))),
        ("the same, its reference trimmed", |b, g| {
            Some(b.at_mean(g, || Relay::new(TIMES, 0.02)))
        }),
        ("PI + pulse width 20 Hz", |b, g| Some(b.tuned(g, false))),
        ("Smith predictor PI + pulse width 20 Hz", |b, g| {
            Some(b.tuned(g, true))
        }),
        ("the designed law", |b, g| b.law(g, None, false)),
        ("the designed law at the relay's switches/s", |b, g| {
            b.law(g, Some(b.relay(g).switches_per_s), false)
        }),
        ("  the least ripple at the relay's switches/s", |b, g| {
            Some(b.floor(g, b.relay(g).switches_per_s))
        }),
        ("the designed law at the PI's switches/s", |b, g| {
            b.law(g, Some(b.tuned(g, false).switches_per_s), false)
        }),
    ];
    for (name, figures) in rows {
        let mut row = Row::default();
        for bench in benches {
            if let Some(figures) = figures(bench, level * bench.base.gain) {
                row.add(&figures, bench.base.gain);
            }
        }
        row.print(name);
    }
}

/// The law compared with the best PI on plants with physics that the model lacks, as slow as the paper's.
fn beyond_the_model(level: f64) {
    let kinds = [
        (Unknown::Nothing, "the model's errors alone"),
        (Unknown::Reversal, "inverse response, 0.3 for 20 ms"),
        (Unknown::Resonance, "a resonance at 25 Hz, damping 0.05"),
        (Unknown::Memory, "a memory that saturates"),
        (Unknown::Film, "a film with exponent 0.65: its reading"),
    ];
    heading(&format!(
        "Physics that the model lacks: held at {level} of steady blowing"
    ));
    for (unknown, words) in kinds {
        let [mut law, mut peer, mut equal] = [(); 3].map(|()| Row::default());
        for seed in 0..PLANTS {
            let bench = Bench {
                unknown,
                ..Bench::draw(FIRST_SEED + seed, 6.0)
            };
            let (gain, goal) = (bench.base.gain, level * bench.base.gain);
            let tuned = bench.tuned(goal, false);
            peer.add(&tuned, gain);
            for (row, rate) in [(&mut law, None), (&mut equal, Some(tuned.switches_per_s))] {
                if let Some(figures) = bench.law(goal, rate, false) {
                    row.add(&figures, gain);
                }
            }
        }
        law.print(words);
        equal.print("  the same at the PI's switches/s");
        peer.print("  PI + pulse width 20 Hz, tuned on the plant");
    }
}

/// The law at the mean friction that each controller reaches.
fn air_at_equal_mean(benches: &[Bench]) {
    let contenders: [(&str, Run); 6] = [
        ("open loop 4 Hz 50 %", |b, _| {
            Some(b.run(OpenLoop::square(4.0, 0.5, TIMES, PERIOD_S), 0.0, 0.0))
        }),
        ("open loop 4 Hz 80 %", |b, _| {
            Some(b.run(OpenLoop::square(4.0, 0.8, TIMES, PERIOD_S), 0.0, 0.0))
        }),
        ("relay at 0.5", |b, g| Some(b.relay(0.5 * g))),
        ("relay at 0.8", |b, g| Some(b.relay(0.8 * g))),
        ("PI at 0.5", |b, g| Some(b.tuned(0.5 * g, false))),
        ("PI at 0.8", |b, g| Some(b.tuned(0.8 * g, false))),
    ];
    for slow_to_separate in [true, false] {
        heading(&format!(
            "Air at equal mean friction, {} the slower motion",
            if slow_to_separate {
                "separation"
            } else {
                "attachment"
            }
        ));
        let group = |b: &&Bench| (b.base.separate_s > b.base.attach_s) == slow_to_separate;
        for (name, contender) in contenders {
            let [mut peer, mut law, mut thrifty] = [(); 3].map(|()| Row::default());
            for bench in benches.iter().filter(group) {
                let gain = bench.base.gain;
                let Some(figures) = contender(bench, gain) else {
                    continue;
                };
                let goal = figures.mean;
                let close = bench.law(goal, None, false);
                let least = bench.law(goal, None, true);
                if let (Some(close), Some(least)) = (close, least) {
                    let around = |f: &Figures| Figures {
                        rms: (f.rms.powi(2) - f.offset.powi(2) + (f.mean - goal).powi(2))
                            .max(0.0)
                            .sqrt(),
                        ..*f
                    };
                    peer.add(&around(&figures), gain);
                    law.add(&close, gain);
                    thrifty.add(&least, gain);
                }
            }
            peer.print(name);
            law.print("  the designed law at that mean");
            thrifty.print("  the same with --least-air");
        }
    }
}

fn main() {
    let only_beyond = std::env::args().nth(1).as_deref() == Some("--beyond");
    println!(
        "{PLANTS} continuous-time plants, noisy sensor (white 0.03, coloured 0.035), hold times 10 ms; the law's models \
         are wrong by +5 % in gain, +5 % in delay, -10 % in time constants; mean friction in units of steady blowing, \
         switches per second; the gains of PI are the best of a grid for each plant"
    );
    for level in [0.5, 0.8] {
        beyond_the_model(level);
    }
    if only_beyond {
        return;
    }
    for (slower, words) in [
        (1.0, "Fast flows, 20-150 ms"),
        (6.0, "Flows as slow as the paper's, 0.12-0.9 s"),
    ] {
        let benches: Vec<Bench> = (0..PLANTS)
            .map(|seed| Bench::draw(FIRST_SEED + seed, slower))
            .collect();
        for level in [0.5, 0.8] {
            heading(&format!("{words}: held at {level} of steady blowing"));
            hold_closely(&benches, level);
        }
        println!("\n{words}");
        air_at_equal_mean(&benches);
    }
}
