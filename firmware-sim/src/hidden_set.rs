//! Data sets with a hidden effect; the truth is stored separately.

use rand::RngExt;
use recordings::Use;

use crate::command::Command;
use crate::family::{Nuisances, Units};
use crate::instrument::Instrument;
use crate::plant::{BasePlant, Effect, Fault, PlantSpec};
use crate::recording::{Recorded, RigError, Session, with_levels};
use crate::stream::{Stream, stream};

/// Specification of a data set; determines it bit for bit.
#[derive(Debug, Clone, PartialEq)]
pub struct HiddenSetPlan {
    /// The rig with its hidden effects.
    pub plant: PlantSpec,
    /// Instruments of the rig.
    pub instrument: Instrument,
    /// Whether the free stream varies and is recorded as the channel `u_inf`.
    pub free_stream: bool,
    /// Seed of commands, free stream and noise.
    pub seed: u64,
}

impl HiddenSetPlan {
    /// A random rig with the named effects and faults hidden; without names, the null case.
    ///
    /// The base plant has a state-dependent delay, unless a hidden effect sets the delay. The free stream varies if
    /// an effect needs it. In a quarter of the other cases it varies too, without influence on the readings.
    ///
    /// # Errors
    /// [`RigError`] for unknown names and for effects that exclude each other.
    pub fn draw(effects: &[&str], faults: &[&str], seed: u64) -> Result<Self, RigError> {
        let mut base = BasePlant::draw(&mut stream(seed, Stream::Base));
        let mut rng = stream(seed, Stream::Effects);
        let mut hidden: Vec<Effect> = Vec::new();
        for name in effects {
            let effect = Effect::draw(name, &base, &mut rng)?;
            if let Some(other) = hidden.iter().find(|e| e.excludes(&effect)) {
                return Err(RigError::Exclusive(other.name(), effect.name()));
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
                    .ok_or_else(|| RigError::UnknownFault((*name).to_owned()))
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

    /// The commands of the set: on/off, or many levels if a hidden effect requires them.
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
        with_levels(on_off.into(), &self.plant.effects, false, &mut rng)
    }

    /// Runs the rig through every command and measures it.
    ///
    /// # Errors
    /// [`RigError`] when an effect's parameters or the instrument are impossible.
    pub fn build(&self) -> Result<Recorded, RigError> {
        let session = Session {
            plant: &self.plant,
            instrument: &self.instrument,
            nuisances: Nuisances::default(),
            free_stream: self.free_stream,
            units: Units::OWN,
            title: format!("Simulated ramp, run {}", self.seed),
            seed: self.seed,
        };
        session.record(self.commands())
    }

    /// The true effects as TOML text for users and scoring scripts; never an input of the diagnosis.
    pub fn answer(&self) -> String {
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
        for (record, truth) in set.data.records.iter().zip(&set.noise_free) {
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
            assert!(plan.answer().contains(name));
            assert_eq!(
                set.data.is_on_off(),
                !plan.plant.effects[0].needs_levels(),
                "{name}"
            );
            let has_channel = set.data.records[0].channels.contains_key("u_inf");
            assert!(has_channel || *name != "free-stream-variation");
        }
        for name in Fault::NAMES {
            let plan = HiddenSetPlan::draw(&[], &[name], 3).unwrap();
            plan.build().unwrap();
            assert!(plan.answer().contains(name));
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
