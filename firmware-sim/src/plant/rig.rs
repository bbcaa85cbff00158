//! The whole rig: jet, transport, flow and sensor, advanced together.

use thiserror::Error;

use super::altered::Altered;
use super::base::{BasePlant, BasePlantError, FlowDelay};
use super::beyond::Beyond;
use super::character::Character;
use super::effects::{Effect, EffectError};
use super::fault::Fault;
use super::flow::Flow;
use super::free_stream::FreeStream;
use super::jet::Jet;
use super::part::{Moment, Part, Surroundings};
use super::sensor::Sensor;
use super::transport::{ArrivalClock, EdgeTravel, MeanFriction};
use super::{Plant, SHORTEST_PIECE_S, SUBSTEP_S, SUBSTEPS};
use crate::waveform::Cursor;

/// Why a rig cannot be built.
#[derive(Debug, Clone, PartialEq, Error)]
pub enum PlantError {
    /// The flow is impossible.
    #[error(transparent)]
    Base(#[from] BasePlantError),
    /// An effect is impossible.
    #[error(transparent)]
    Effect(#[from] EffectError),
}

/// Specification of a rig.
#[derive(Debug, Clone, PartialEq)]
pub struct PlantSpec {
    /// The flow to which the effects are added.
    pub base: BasePlant,
    /// The kind of flow.
    pub character: Character,
    /// Effects, in any order; they act in physical order.
    pub effects: Vec<Effect>,
    /// Effects with other equations than the catalogue's.
    pub altered: Vec<Altered>,
    /// Physics that the catalogue lacks.
    pub beyond: Vec<Beyond>,
    /// Faults.
    pub faults: Vec<Fault>,
}

impl PlantSpec {
    /// A first-order flow with these effects and no fault.
    pub fn new(base: BasePlant, effects: &[Effect]) -> Self {
        Self {
            base,
            character: Character::FirstOrder,
            effects: effects.to_vec(),
            altered: Vec::new(),
            beyond: Vec::new(),
            faults: Vec::new(),
        }
    }

    /// The delay of the plant: that of a hidden delay law if there is one, otherwise that of the
    /// base plant.
    pub fn delay(&self) -> FlowDelay {
        let parts = self.parts(&Surroundings::default()).into_iter();
        parts.fold(self.base.delay, |law, part| match part {
            Part::Delay(own) => own,
            Part::Jet(_) | Part::Flow(_) | Part::Sensor(_) => law,
        })
    }

    /// All parts in the order of the signals; within a place in the catalogue's order.
    fn parts(&self, surroundings: &Surroundings<'_>) -> Vec<Part> {
        let effects = self
            .effects
            .iter()
            .map(|e| (e.order(), e.part(surroundings)));
        let altered = self
            .altered
            .iter()
            .map(|e| (e.order(), e.part(surroundings)));
        let beyond = self
            .beyond
            .iter()
            .map(|e| (e.order(), e.part(surroundings)));
        let mut all: Vec<_> = effects.chain(altered).chain(beyond).collect();
        all.sort_by_key(|(order, _)| *order);
        all.into_iter().map(|(_, part)| part).collect()
    }
}

/// A rig at 20 kHz inside and 1 kHz outside, without noise. It starts separated, at rest, with a full plenum and a
/// closed valve.
#[derive(Debug, Clone)]
pub struct Rig {
    edges: Option<EdgeTravel>,
    jet: Jet,
    clock: ArrivalClock,
    cursor: Cursor,
    mean: MeanFriction,
    flow: Flow,
    sensor: Sensor,
    command: f64,
    substeps: u64,
}

impl Rig {
    /// Builds the rig; `free_stream` is the tunnel's velocity during the record, constant if `None`.
    ///
    /// # Errors
    /// [`PlantError`] if the base plant or a parameter of an effect is physically impossible.
    pub fn new(spec: &PlantSpec, free_stream: Option<FreeStream>) -> Result<Self, PlantError> {
        spec.base.validate()?;
        spec.character.validate()?;
        for effect in &spec.effects {
            effect.validate()?;
        }
        for altered in &spec.altered {
            altered.validate()?;
        }
        for beyond in &spec.beyond {
            beyond.validate()?;
        }
        let surroundings = Surroundings {
            free_stream: free_stream.as_ref(),
        };
        let mut law = spec.base.delay;
        let (mut jet, mut flow, mut sensor) = (Vec::new(), Vec::new(), Vec::new());
        for part in spec.parts(&surroundings) {
            match part {
                Part::Delay(own) => law = own,
                Part::Jet(part) => jet.push(part),
                Part::Flow(part) => flow.push(part),
                Part::Sensor(part) => sensor.push(part),
            }
        }
        Ok(Self {
            edges: EdgeTravel::new(law),
            jet: Jet::new(jet, &spec.faults),
            clock: ArrivalClock::new(law),
            cursor: Cursor::default(),
            mean: MeanFriction::at_rest(),
            flow: Flow::new(&spec.base, &spec.character, flow),
            sensor: Sensor::new(sensor, &spec.faults),
            command: 0.0,
            substeps: 0,
        })
    }

    /// Time since the start (s).
    pub fn time(&self) -> f64 {
        self.substeps as f64 * SUBSTEP_S
    }

    /// The present friction s of the flow (y), before film and cable.
    pub fn friction(&self) -> f64 {
        self.flow.friction()
    }

    /// Sets the valve's command to `level` (0 closed, 1 open) from now on.
    pub fn command(&mut self, level: f64) {
        self.command_at(self.time(), level);
    }

    fn command_at(&mut self, t: f64, level: f64) {
        self.command = level;
        match &mut self.edges {
            Some(edges) => edges.send(t, level),
            None => self.jet.command(level),
        }
    }

    /// The reading now (y), without noise.
    pub fn read(&mut self) -> f64 {
        self.sensor.read(&Moment {
            t: self.time(),
            command: self.command,
        })
    }

    /// Advances by one sample period with a constant command.
    pub fn advance_sample(&mut self) {
        self.advance_sample_with(&[]);
    }

    /// Advances by one sample period in which the command changes at `(offset, level)`. Offsets are in seconds from
    /// its beginning, ascending, within the period: edges need not fall on samples.
    pub fn advance_sample_with(&mut self, changes: &[(f64, f64)]) {
        let begin = self.time();
        let mut changes = changes
            .iter()
            .map(|(offset, level)| (begin + offset, *level))
            .peekable();
        for _ in 0..SUBSTEPS {
            let start = self.time();
            self.substeps += 1;
            let end = self.time();
            while let Some((t, level)) = changes.next_if(|c| c.0 < end) {
                if self.edges.is_none() && t - start > SHORTEST_PIECE_S {
                    self.jet.advance(t);
                }
                self.command_at(t.max(start), level);
            }
            while let Some((t, level)) = self.edges.as_mut().and_then(|e| e.next_before(end)) {
                self.jet.advance(t);
                self.jet.command(level);
            }
            self.jet.advance(end);
            self.flow_substep(start, end);
        }
    }

    /// Advances flow and film by one sub-step, split at every arriving edge.
    fn flow_substep(&mut self, start: f64, end: f64) {
        let (from, to) = self.clock.stretch(end, &self.mean);
        let (mut t, mut read) = (start, from);
        let mut jet = self.jet.out.at(from, &mut self.cursor);
        let mut area = 0.0;
        self.arrive(jet);
        while let Some((knot, before, after)) = self.jet.out.jump_inside(read, to, &mut self.cursor)
        {
            let arrival = start + (end - start) * (knot - from) / (to - from);
            area += self.piece(arrival - t, jet, before);
            self.arrive(after);
            (t, read, jet) = (arrival, knot, after);
        }
        let last = self.jet.out.before(to, &mut self.cursor);
        area += self.piece(end - t, jet, last);
        // An edge that arrives at this instant already counts for the present reading.
        let now = self.jet.out.at(to, &mut self.cursor);
        self.arrive(now);
        self.mean.push(area, self.flow.friction());
    }

    fn piece(&mut self, dt: f64, j0: f64, j1: f64) -> f64 {
        if dt <= SHORTEST_PIECE_S {
            return 0.0;
        }
        let area = self.flow.advance(dt, j0, j1);
        self.sensor.advance(dt, self.flow.at_the_film());
        area
    }

    fn arrive(&mut self, jet: f64) {
        self.flow.jump(jet);
        self.sensor.jump(self.flow.at_the_film());
    }

    /// Plays a command of one level per sample; the k-th reading is taken when the k-th level has just been set.
    pub fn play(&mut self, levels: &[f64]) -> Vec<f64> {
        levels
            .iter()
            .map(|&level| {
                self.command(level);
                let y = self.read();
                self.advance_sample();
                y
            })
            .collect()
    }
}

impl Plant for Rig {
    fn step(&mut self, command: bool) -> f64 {
        self.command(f64::from(u8::from(command)));
        self.advance_sample();
        self.read()
    }
}

/// Access for the tests of parts.
#[cfg(test)]
pub(crate) mod bench {
    use super::*;
    use crate::plant::RateLaw;

    /// A base plant that attaches in 40 ms and separates in 100 ms, with gain 1.
    pub(crate) fn base(delay: FlowDelay) -> BasePlant {
        BasePlant {
            attach_s: 0.04,
            separate_s: 0.1,
            gain: 1.0,
            delay,
            rate_law: RateLaw::Switched,
        }
    }

    pub(crate) fn rig(delay: FlowDelay, effects: &[Effect]) -> Rig {
        Rig::new(&PlantSpec::new(base(delay), effects), None).unwrap()
    }
}

#[cfg(test)]
mod tests {
    use super::bench::rig;
    use super::*;
    use crate::plant::effects::{EchoPath, HotFilmNonlinearity, PlenumDroop, ValveLag};
    use proptest::prelude::*;

    #[test]
    fn an_edge_between_samples_arrives_between_samples() {
        let delay_s = 0.030_37;
        let mut rig = rig(FlowDelay::Fixed { delay_s }, &[]);
        // On at 1.23 ms, off at 61.66 ms.
        let (on, off) = (0.001_23, 0.061_66);
        for k in 0..150 {
            let t0 = f64::from(k) * 0.001;
            let changes: Vec<(f64, f64)> = [(on, 1.0), (off, 0.0)]
                .iter()
                .filter(|c| c.0 >= t0 && c.0 < t0 + 0.001)
                .map(|c| (c.0 - t0, c.1))
                .collect();
            let (up, down) = (on + delay_s, off + delay_s);
            let rising = |t: f64| 1.0 - (-(t - up).max(0.0) / 0.04).exp();
            let expected = if t0 < down {
                rising(t0)
            } else {
                rising(down) * (-(t0 - down) / 0.1).exp()
            };
            assert!(
                (rig.read() - expected).abs() < 1e-8,
                "at {t0} s: {} instead of {expected}",
                rig.read()
            );
            rig.advance_sample_with(&changes);
        }
    }

    #[test]
    fn the_state_dependent_delay_is_the_law_at_the_arrival() {
        let (floor_s, rise_s, rate) = (0.030, 0.012, 8.0);
        let mut rig = rig(
            FlowDelay::StateDependent {
                floor_s,
                rise_s,
                rate,
            },
            &[],
        );
        // The mean friction at rest is 0, so the delay of the first edge is floor + rise.
        rig.command(1.0);
        for _ in 0..42 {
            rig.advance_sample();
        }
        assert!(
            rig.friction() < 1e-9,
            "not before 42 ms: {}",
            rig.friction()
        );
        rig.advance_sample();
        let expected = 1.0 - (-0.001_f64 / 0.04).exp();
        assert!((rig.friction() - expected).abs() < 1e-3 * expected + 2e-4);
        // After long blowing the mean friction is 1, so the delay of the falling edge is floor +
        // rise·exp(−rate).
        for _ in 0..2000 {
            rig.advance_sample();
        }
        rig.command(0.0);
        let h = floor_s + rise_s * (-rate).exp();
        for _ in 0..60 {
            rig.advance_sample();
        }
        let expected = (-(0.060 - h) / 0.1_f64).exp();
        assert!((rig.friction() - expected).abs() < 1e-6);
    }

    #[test]
    fn every_effect_changes_the_reading_and_stays_finite() {
        use rand::SeedableRng;
        let mut rng = rand_chacha::ChaCha8Rng::seed_from_u64(11);
        for name in Effect::NAMES {
            let plain = BasePlant::draw(&mut rng).with_fixed_delay(&mut rng);
            let effect = Effect::draw(name, &plain, &mut rng).unwrap();
            let plain = if effect.needs_levels() {
                plain.with_one_time_constant()
            } else {
                plain
            };
            let command: Vec<f64> = (0..4000)
                .map(|k| match (effect.needs_levels(), (k / 125) % 4) {
                    (false, phase) => f64::from(u8::from(phase % 2 == 0 && k < 3000)),
                    (true, phase) => [1.0, -0.7, 0.4, 0.0][phase],
                })
                .collect();
            let stream = FreeStream::draw(&mut rng, command.len());
            let play = |effects: &[Effect]| {
                Rig::new(&PlantSpec::new(plain, effects), Some(stream.clone()))
                    .unwrap()
                    .play(&command)
            };
            let (without, with) = (play(&[]), play(&[effect]));
            let rms = (with
                .iter()
                .zip(&without)
                .map(|(a, b)| (a - b) * (a - b))
                .sum::<f64>()
                / 4000.0)
                .sqrt();
            assert!(
                rms > 0.015 && rms < 1.0,
                "{name}: rms change {rms}, {effect:?}"
            );
        }
    }

    #[test]
    fn effects_add_up_in_the_physical_order() {
        // The rig has a lagging valve, a drooping plenum and King's law together, under steady
        // blowing.
        let (ratio, offset) = (1.5, 0.05);
        let effects = [
            HotFilmNonlinearity {
                king_ratio: ratio,
                king_offset: offset,
            }
            .into(),
            PlenumDroop {
                recovery_time: 0.5,
                depletion_rate: 0.5,
            }
            .into(),
            ValveLag {
                opening_time: 0.01,
                closing_time: 0.01,
            }
            .into(),
        ];
        let mut rig = rig(FlowDelay::Fixed { delay_s: 0.03 }, &effects);
        let y = rig.play(&vec![1.0; 8000]);
        let e = |s: f64| (1.0 + ratio * (s + offset).cbrt()).sqrt();
        let expected = (e(0.8) - e(0.0)) / (e(1.0) - e(0.0));
        assert!((y[7999] - expected).abs() < 1e-5);
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(40))]
        /// A later edge is equivalent to a longer delay, at any position between samples.
        #[test]
        fn shifting_every_edge_is_the_same_as_a_longer_delay(
            dwells in prop::collection::vec(0.000_05_f64..0.030, 1..20),
            shift in 0.0_f64..0.020,
        ) {
            let effects = [EchoPath { gain: 0.4, echo_delay: 0.033_3 }.into()];
            let play = |delay_s: f64, offset: f64| {
                let mut rig = rig(FlowDelay::Fixed { delay_s }, &effects);
                let mut at = offset;
                let edges: Vec<(f64, f64)> = dwells
                    .iter()
                    .enumerate()
                    .map(|(i, dwell)| {
                        at += dwell;
                        (at, f64::from(u8::from(i % 2 == 0)))
                    })
                    .collect();
                (0..800)
                    .map(|k| {
                        let (from, to) = (f64::from(k) * 0.001, f64::from(k + 1) * 0.001);
                        let now: Vec<(f64, f64)> = edges
                            .iter()
                            .filter(|e| e.0 >= from && e.0 < to)
                            .map(|e| (e.0 - from, e.1))
                            .collect();
                        rig.advance_sample_with(&now);
                        rig.read()
                    })
                    .collect::<Vec<f64>>()
            };
            for (a, b) in play(0.025 + shift, 0.0).iter().zip(play(0.025, shift)) {
                prop_assert!((a - b).abs() < 1e-6, "{a} {b}");
            }
        }
    }

    #[test]
    fn the_same_rig_answers_the_loop_one_sample_later_than_the_record() {
        let law = FlowDelay::Fixed { delay_s: 0.0317 };
        let command: Vec<f64> = (0..500)
            .map(|k| f64::from(u8::from((k / 70) % 2 == 0)))
            .collect();
        let recorded = rig(law, &[]).play(&command);
        let mut looped = rig(law, &[]);
        for (k, level) in command.iter().enumerate().take(499) {
            assert_eq!(looped.step(*level == 1.0), recorded[k + 1]);
        }
    }
}
