//! A published flow on a rig: commands, hidden effects, instruments.

use super::{Flow, Hidden, Published, STEP_S};
use crate::command::Command;
use crate::instrument::{Converter, Instrument, Noise, Unrest};
use crate::recording::{Recorded, RigError};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal};
use recordings::{DataSet, Record, Use};
use std::fmt::Write as _;
use thiserror::Error;

/// Sampling period of the records (s).
const SAMPLE_S: f64 = 1e-3;
const STEPS_A_SAMPLE: usize = 10;
/// Standard deviation of the offset between days (y).
const ZERO_OF_A_DAY: f64 = 0.01;
/// Number of records of the first day; the others are of the second.
const FIRST_DAY: usize = 4;

/// No published flow or hidden effect has that name.
#[derive(Clone, Debug, Error, PartialEq)]
#[error("there is no `{name}`; the names are: {}", names.join(", "))]
pub struct UnknownName {
    name: String,
    names: Vec<&'static str>,
}

/// Specification of a data set of a published flow; determines it bit for bit.
#[derive(Clone, Debug)]
pub struct LiteraturePlan {
    /// The published model.
    pub model: Published,
    /// Hidden effects, from the jet to the sensor.
    pub hidden: Vec<Hidden>,
    /// Whether there is a 12-bit converter, a valve dead time and a new offset each day; otherwise white
    /// noise only.
    pub real_instruments: bool,
    /// Seed of coefficients, commands and noise.
    pub seed: u64,
    dead_s: f64,
    zeros: [f64; 2],
}

/// Random streams by purpose; new purposes are appended.
#[derive(Clone, Copy)]
enum Draws {
    Flow,
    Hidden,
    Rig,
    Commands,
    Noise,
}

impl LiteraturePlan {
    /// The model `name` on a rig with hidden `effects`.
    ///
    /// # Errors
    /// [`UnknownName`] of a model or an effect.
    pub fn draw(
        name: &str,
        effects: &[&str],
        real_instruments: bool,
        seed: u64,
    ) -> Result<Self, UnknownName> {
        let unknown = |name: &str, names: Vec<&'static str>| UnknownName {
            name: name.to_owned(),
            names,
        };
        let models = super::PUBLISHED.map(|model| model.name).to_vec();
        let model = Published::of(name).ok_or_else(|| unknown(name, models))?;
        let mut rng = draws(seed, Draws::Hidden);
        let hidden = effects
            .iter()
            .map(|name| {
                let names = Hidden::names().to_vec();
                Hidden::draw(name, &mut rng).ok_or_else(|| unknown(name, names))
            })
            .collect::<Result<Vec<_>, _>>()?;
        let mut rig = draws(seed, Draws::Rig);
        let mut zero = || {
            let size: f64 = StandardNormal.sample(&mut rig);
            ZERO_OF_A_DAY * size
        };
        let zeros = [zero(), zero()];
        let dead_s = rig.random_range(0.002..0.006);
        Ok(Self {
            model,
            hidden,
            real_instruments,
            seed,
            dead_s: if real_instruments { dead_s } else { 0.0 },
            zeros: if real_instruments { zeros } else { [0.0; 2] },
        })
    }

    /// The flow at rest.
    fn flow(&self) -> Box<dyn Flow> {
        self.model.draw(&mut draws(self.seed, Draws::Flow))
    }

    /// Names of the hidden effects.
    #[must_use]
    pub fn names(&self) -> Vec<&'static str> {
        self.hidden.iter().map(|hidden| hidden.name).collect()
    }

    fn commands(&self) -> Vec<(Command, Use)> {
        let mut rng = draws(self.seed, Draws::Commands);
        let mut random = |name: &str| Command::random(name, &mut rng);
        let [a, b, c] = ["random-a", "random-b", "random-c"].map(&mut random);
        vec![
            (Command::step(), Use::Identify),
            (Command::square(4.0, 0.5), Use::Identify),
            (Command::square(2.0, 0.7), Use::Validate),
            (a, Use::Identify),
            (b, Use::Identify),
            (Command::square(6.0, 0.6), Use::Identify),
            (Command::square(3.0, 0.3), Use::Validate),
            (c, Use::Validate),
        ]
    }

    /// Noise-free readings under a command.
    fn play(&self, levels: &[f64]) -> Vec<f64> {
        let mut flow = self.flow();
        let mut hidden: Vec<Hidden> = self.hidden.iter().map(Hidden::at_rest).collect();
        let dead = (self.dead_s / STEP_S).round() as usize;
        let steps = levels.len() * STEPS_A_SAMPLE;
        let mut shown = 0.0;
        let mut readings = Vec::with_capacity(levels.len());
        for k in 0..steps {
            if k % STEPS_A_SAMPLE == 0 {
                readings.push(shown);
            }
            let level = |k: usize| levels.get(k / STEPS_A_SAMPLE).copied().unwrap_or(0.0);
            let command = level(k);
            let valve = k.checked_sub(dead).map_or(0.0, level);
            let jet = hidden.iter_mut().fold(valve, |jet, effect| effect.jet(jet));
            flow.step(jet);
            let time = (k + 1) as f64 * STEP_S;
            let through = |reading, effect: &mut Hidden| effect.reading(reading, command, time);
            shown = hidden.iter_mut().fold(flow.reading(), through);
        }
        readings
    }

    fn instrument(&self) -> Instrument {
        Instrument {
            noise: Noise {
                white: 0.035,
                coloured: if self.real_instruments { 0.03 } else { 0.0 },
                correlation_s: 0.015,
            },
            converter: self.real_instruments.then_some(Converter {
                bits: 12,
                low: -1.5,
                high: 3.5,
            }),
            repeats: 16,
            level_scatter: 0.0,
            unrest: Unrest::default(),
        }
    }

    /// Runs the rig through every command and measures it.
    ///
    /// # Errors
    /// [`RigError`] if the readings are not a valid recording.
    pub fn build(&self) -> Result<Recorded, RigError> {
        let mut noise = draws(self.seed, Draws::Noise);
        let (mut records, mut noise_free) = (Vec::new(), Vec::new());
        for (index, (command, role)) in self.commands().into_iter().enumerate() {
            let zero = self.zeros[usize::from(index >= FIRST_DAY)];
            let mut truth = self.play(&command.levels);
            truth.iter_mut().for_each(|y| *y += zero);
            let measured = self.instrument().measure(&truth, noise.random())?;
            records.push(Record {
                y_sd: Some(measured.standard_error),
                y_min: Some(measured.min),
                y_max: Some(measured.max),
                ..Record::new(&command.name, role, SAMPLE_S, command.levels, measured.mean)
            });
            noise_free.push(truth);
        }
        let title = format!("Published flow, run {}", self.seed);
        Ok(Recorded {
            data: DataSet::from_records(Some(title), records)?,
            noise_free,
        })
    }

    /// The true effects as TOML text; not part of the data set.
    #[must_use]
    pub fn answer(&self) -> String {
        let list = |names: &[&str]| {
            let quoted: Vec<String> = names.iter().map(|n| format!("\"{n}\"")).collect();
            quoted.join(", ")
        };
        let mut text = format!(
            "# the hidden effects of this set\n\nmodel = \"{}\"\nreference = \"{}\"\nhidden = [{}]\nalso_right \
             = [{}]\nreal_instruments = {}\nseed = {}\n",
            self.model.name,
            self.model.reference,
            list(&self.names()),
            list(self.model.also_right),
            self.real_instruments,
            self.seed
        );
        // Writing to a String cannot fail.
        let _ = writeln!(
            text,
            "valve_dead_time_s = {}\nzeros = {:?}\n\n[flow]",
            self.dead_s, self.zeros
        );
        for (name, value) in self.flow().coefficients() {
            let _ = writeln!(text, "{name} = {value}");
        }
        for hidden in &self.hidden {
            let _ = writeln!(text, "\n[{}]", hidden.name);
            for (name, value) in &hidden.parameters {
                let _ = writeln!(text, "{name} = {value}");
            }
        }
        text
    }
}

fn draws(seed: u64, what: Draws) -> ChaCha8Rng {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    rng.set_stream(what as u64);
    rng
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_set_has_eight_records_near_its_truth_and_repeats_bit_for_bit() {
        for model in super::super::PUBLISHED {
            let plan = LiteraturePlan::draw(model.name, &["hot-film-lag"], true, 5).unwrap();
            let set = plan.build().unwrap();
            assert_eq!(set.data.hash, plan.build().unwrap().data.hash);
            let counts = (set.data.identify().count(), set.data.validate().count());
            assert_eq!(counts, (5, 3));
            for (record, truth) in set.data.records.iter().zip(&set.noise_free) {
                let sd = record.y_sd.as_deref().unwrap();
                let noise = sd.iter().map(|s| s * s).sum::<f64>().sqrt();
                let off = record.y.iter().zip(truth).map(|(a, b)| (a - b) * (a - b));
                let ratio = off.sum::<f64>().sqrt() / noise;
                assert!((ratio - 1.0).abs() < 0.1, "{}: {ratio}", model.name);
            }
            let title = set.data.title.unwrap();
            assert!(!title.contains(model.name), "the data do not tell");
            assert!(plan.answer().contains(model.reference));
        }
    }

    #[test]
    fn instruments_and_effects_can_be_switched() {
        let draw =
            |effects: &[&str], real| LiteraturePlan::draw("wrong-way", effects, real, 2).unwrap();
        let clean = |plan: &LiteraturePlan| plan.build().unwrap().noise_free;
        let (ideal, real) = (clean(&draw(&[], false)), clean(&draw(&[], true)));
        assert_eq!(ideal[0][0], 0.0);
        assert_ne!(real[0][0], 0.0);
        // The offset differs on the second day.
        assert!(real[0][0] == real[3][0] && real[4][0] != real[3][0]);
        let drifting = clean(&draw(&["thermal-drift"], false));
        assert!(drifting[0][9_000] > ideal[0][9_000] + 0.05);
        for (model, effects) in [("wrong-way", "droop"), ("goman", "valve-lag")] {
            let error = LiteraturePlan::draw(model, &[effects], true, 1).unwrap_err();
            assert!(error.to_string().contains("the names are"));
        }
    }
}
