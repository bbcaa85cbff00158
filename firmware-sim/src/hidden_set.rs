//! Data sets with something hidden in them, and the truth kept apart.

use std::collections::BTreeMap;

use rand::RngExt;
use recordings::{DataError, DataSet, Record, Use};
use thiserror::Error;

use crate::command::Command;
use crate::instrument::{Instrument, InstrumentError};
use crate::plant::{
    BasePlant, Effect, EffectError, Fault, FreeStream, PlantError, PlantSpec, Rig, SAMPLE_PERIOD_S,
    ShowsWith,
};
use crate::stream::{Stream, stream};

/// Why a data set could not be made.
#[derive(Debug, Error)]
pub enum HiddenSetError {
    /// An effect is unknown.
    #[error(transparent)]
    Effect(#[from] EffectError),
    /// The rig is impossible.
    #[error(transparent)]
    Plant(#[from] PlantError),
    /// The instrument is impossible.
    #[error(transparent)]
    Instrument(#[from] InstrumentError),
    /// What the rig gave is no recording.
    #[error(transparent)]
    Data(#[from] DataError),
    /// No fault of that name.
    #[error("there is no fault `{0}`; the names are: {names}", names = Fault::NAMES.join(", "))]
    UnknownFault(String),
    /// Two effects want the same part of the rig.
    #[error("`{0}` and `{1}` exclude each other; hide one of them")]
    Exclusive(&'static str, &'static str),
}

/// Everything that determines a data set, bit for bit.
#[derive(Debug, Clone, PartialEq)]
pub struct HiddenSetPlan {
    /// The rig with what it hides.
    pub plant: PlantSpec,
    /// How it is measured.
    pub instrument: Instrument,
    /// Whether the free stream wanders and is recorded as the channel `u_inf`.
    pub free_stream: bool,
    /// Seed of commands, free stream and noise.
    pub seed: u64,
}

impl HiddenSetPlan {
    /// A random rig hiding the named effects and faults (none of either is the null case).
    ///
    /// The base plant has a state-dependent delay, unless a hidden effect sets the delay. The free
    /// stream wanders when an effect needs it, and in a quarter of the other cases to no effect.
    ///
    /// # Errors
    /// [`HiddenSetError`] for unknown names and for effects that exclude each other.
    pub fn draw(effects: &[&str], faults: &[&str], seed: u64) -> Result<Self, HiddenSetError> {
        let mut base = BasePlant::draw(&mut stream(seed, Stream::Base));
        let mut rng = stream(seed, Stream::Effects);
        let mut hidden: Vec<Effect> = Vec::new();
        for name in effects {
            let effect = Effect::draw(name, &base, &mut rng)?;
            if let Some(other) = hidden.iter().find(|e| e.excludes(&effect)) {
                return Err(HiddenSetError::Exclusive(other.name(), effect.name()));
            }
            hidden.push(effect);
        }
        if hidden.iter().any(Effect::needs_levels) {
            base = base.with_one_time_constant();
        }
        let faults = faults
            .iter()
            .map(|name| {
                Fault::draw(name, &mut rng)
                    .ok_or_else(|| HiddenSetError::UnknownFault((*name).to_owned()))
            })
            .collect::<Result<Vec<_>, _>>()?;
        let wanders = hidden.iter().any(|e| e.channel().is_some());
        Ok(Self {
            plant: PlantSpec {
                faults,
                ..PlantSpec::new(base, &hidden)
            },
            instrument: Instrument::default(),
            free_stream: wanders || rng.random_bool(0.25),
            seed,
        })
    }

    /// The commands of the set: on/off, or many levels when a hidden effect only shows with those.
    pub fn commands(&self) -> Vec<(Command, Use)> {
        let mut rng = stream(self.seed, Stream::Commands);
        let mut random = |name: &str| Command::random(name, &mut rng);
        let (first, second) = (random("random-a"), random("random-b"));
        let on_off = [
            (Command::step(), Use::Identify),
            (Command::square(8.0, 0.5), Use::Identify),
            (Command::square(4.0, 0.8), Use::Identify),
            (Command::square(4.0, 0.5), Use::Identify),
            (first, Use::Identify),
            (Command::square(8.0, 0.8), Use::Validate),
            (Command::square(2.0, 0.3), Use::Validate),
            (second, Use::Validate),
        ];
        let effects = &self.plant.effects;
        if !effects.iter().any(Effect::needs_levels) {
            return on_off.into();
        }
        let signed = (effects.iter()).any(|e| e.shows_with() == ShowsWith::SignedLevels);
        let low = if signed { -1.0 } else { 0.0 };
        on_off
            .into_iter()
            .map(|(command, role)| {
                let command = if command.name.starts_with("random") {
                    let name = command.name.replace("random", "levels");
                    Command::random_levels(&name, low, 1.0, &mut rng)
                } else {
                    let size = rng.random_range(0.4..1.0);
                    let turned = signed && rng.random_bool(0.5);
                    let level = if turned { -size } else { size };
                    command.map(|u| u * level)
                };
                (command, role)
            })
            .collect()
    }

    /// Runs the rig through every command and measures it.
    ///
    /// # Errors
    /// [`HiddenSetError`] when an effect's parameters or the instrument are impossible.
    pub fn build(&self) -> Result<HiddenSet, HiddenSetError> {
        let mut records = Vec::new();
        let mut noise_free = Vec::new();
        let mut tunnel = stream(self.seed, Stream::Tunnel);
        let mut noise = stream(self.seed, Stream::Noise);
        for (command, role) in self.commands() {
            let n = command.levels.len();
            let free_stream = self.free_stream.then(|| FreeStream::draw(&mut tunnel, n));
            let truth = Rig::new(&self.plant, free_stream.clone())?.play(&command.levels);
            let measured = self.instrument.measure(&truth, noise.random())?;
            let channels = free_stream
                .map(|stream| {
                    let times = (0..n).map(|k| k as f64 * SAMPLE_PERIOD_S);
                    let u_inf = times.map(|t| stream.velocity(t)).collect();
                    BTreeMap::from([("u_inf".to_owned(), u_inf)])
                })
                .unwrap_or_default();
            records.push(Record {
                y_sd: Some(measured.standard_error),
                y_min: Some(measured.min),
                y_max: Some(measured.max),
                channels,
                ..Record::new(
                    &command.name,
                    role,
                    SAMPLE_PERIOD_S,
                    command.levels,
                    measured.mean,
                )
            });
            noise_free.push(truth);
        }
        Ok(HiddenSet {
            // The title says nothing about what is hidden.
            data: DataSet::from_records(
                Some(format!("Simulated ramp, run {}", self.seed)),
                records,
            )?,
            truth: Truth {
                plant: self.plant.clone(),
                seed: self.seed,
                noise_free,
            },
        })
    }
}

/// A data set and what is really behind it.
#[derive(Debug, Clone)]
pub struct HiddenSet {
    /// What a user of the tool would have.
    pub data: DataSet,
    /// What the tool must find out.
    pub truth: Truth,
}

/// The answer to a hidden set; never given to the diagnosis.
#[derive(Debug, Clone, PartialEq)]
pub struct Truth {
    /// The rig with its effects and faults.
    pub plant: PlantSpec,
    /// Seed of the set.
    pub seed: u64,
    /// The readings without noise, per record in the order of the data set (y).
    pub noise_free: Vec<Vec<f64>>,
}

impl Truth {
    /// The truth as TOML text for people and scoring scripts.
    pub fn to_toml(&self) -> String {
        format!("seed = {}\n\n{}", self.seed, self.plant.to_toml())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_set_has_the_promised_records_and_repeats_bit_for_bit() {
        let plan = HiddenSetPlan::draw(&["plenum-droop"], &[], 7).unwrap();
        let set = plan.build().unwrap();
        let names: Vec<&str> = set.data.records.iter().map(|r| r.name.as_str()).collect();
        assert_eq!(
            names,
            [
                "step", "sq8-50", "sq4-80", "sq4-50", "random-a", "sq8-80", "sq2-30", "random-b"
            ]
        );
        let held_out = set.data.records.iter().filter(|r| r.role == Use::Validate);
        assert_eq!(held_out.count(), 3);
        for (record, truth) in set.data.records.iter().zip(&set.truth.noise_free) {
            assert_eq!(record.y.len(), 10_000);
            let sd = record.y_sd.as_deref().unwrap();
            let floor = (sd.iter().map(|s| s * s).sum::<f64>() / 1e4).sqrt();
            let error = record
                .y
                .iter()
                .zip(truth)
                .map(|(a, b)| (a - b) * (a - b))
                .sum::<f64>();
            let ratio = (error / 1e4).sqrt() / floor;
            assert!(
                (ratio - 1.0).abs() < 0.06,
                "noise floor is calibrated: {ratio}"
            );
        }
        assert_eq!(set.data.hash, plan.build().unwrap().data.hash);
        let title = set.data.title.unwrap();
        assert!(!title.contains("plenum"), "the data do not tell");
    }

    #[test]
    fn every_effect_and_fault_can_be_hidden() {
        for name in Effect::NAMES {
            let plan = HiddenSetPlan::draw(&[name], &[], 3).unwrap();
            let set = plan.build().unwrap();
            assert!(set.truth.to_toml().contains(name));
            assert_eq!(
                set.data.is_on_off(),
                !plan.plant.effects[0].needs_levels(),
                "{name}"
            );
            let has_channel = set.data.records[0].channels.contains_key("u_inf");
            assert!(has_channel || *name != "free-stream-variation");
        }
        for name in Fault::NAMES {
            let set = HiddenSetPlan::draw(&[], &[name], 3)
                .unwrap()
                .build()
                .unwrap();
            assert!(set.truth.to_toml().contains(name));
        }
    }

    #[test]
    fn the_free_stream_sometimes_wanders_without_meaning_anything() {
        let wandering = (0..200)
            .filter(|seed| HiddenSetPlan::draw(&[], &[], *seed).unwrap().free_stream)
            .count();
        assert!((30..75).contains(&wandering), "{wandering} of 200");
    }

    #[test]
    fn wrong_names_and_impossible_pairs_are_refused() {
        let two_delays = ["state-dependent-delay", "edge-dependent-delay"];
        assert!(HiddenSetPlan::draw(&two_delays, &[], 1).is_err());
        let message = HiddenSetPlan::draw(&["droop"], &[], 1)
            .unwrap_err()
            .to_string();
        assert!(
            message.contains("plenum-droop"),
            "names the choices: {message}"
        );
        assert!(HiddenSetPlan::draw(&[], &["gremlin"], 1).is_err());
    }
}
