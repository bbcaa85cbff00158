//! Simulated rigs of all families: flows beyond the model class, effects with the catalogue's laws and with
//! others, non-white noise, and nuisances that are not effects.
//!
//! A [`RigPlan`] is drawn from a seed and determines its data set bit for bit.

mod draw;
mod truth;
mod weight;

use std::fmt::Write as _;

use recordings::Use;

use crate::command::Command;
use crate::instrument::Instrument;
use crate::named;
use crate::plant::{Effect, Parameter, PlantSpec};
use crate::recording::{Recorded, RigError, Session, with_levels};
use crate::stream::{Stream, stream};

pub use crate::nuisance::{Nuisance, Nuisances};
pub use crate::recording::Units;

named! {
    /// Family of flows.
    pub enum Family {
        /// One time constant per direction: the lowest-order bilinear model is exact.
        FirstOrder = "first-order",
        /// The flow depends on its own past at one lag.
        Memory1 = "memory1",
        /// The flow depends on its own past at two lags.
        Memory2 = "memory2",
        /// Second order: inertia, or a second lag in series.
        Inertia = "inertia",
        /// A slow wake reduces the level.
        Wake = "wake",
        /// The separation rate depends on the friction.
        RateOfY = "rate-of-y",
    }
}

named! {
    /// Kind of noise in the repeats.
    pub enum NoiseKind {
        /// White only.
        White = "white",
        /// White and first-order coloured, 10–40 ms.
        Coloured = "coloured",
        /// With an additional slow component of 0.5–2 s.
        Wander = "wander",
        /// The level scatters between repeats by a few per cent.
        Scatter = "scatter",
        /// White noise with the tails of Student's t.
        HeavyTails = "heavy-tails",
        /// Occasional readings far off.
        Outliers = "outliers",
    }
}

/// Number of flows that are drawn; the one with the largest weight of its effects is used.
const FLOWS: usize = 5;

/// Largest number of averaged repeats, if twenty do not show the hidden effect.
const MOST_REPEATS: usize = 100;

/// Specification of a data set; determines it bit for bit.
#[derive(Debug, Clone, PartialEq)]
pub struct RigPlan {
    /// Family of the flow.
    pub family: Family,
    /// The rig with its hidden effects.
    pub plant: PlantSpec,
    /// Kind of noise in the repeats.
    pub noise: NoiseKind,
    /// The instruments.
    pub instrument: Instrument,
    /// Nuisances: deviations that are neither flow nor effect nor noise.
    pub nuisances: Nuisances,
    /// Whether the free stream varies and is recorded as the channel `u_inf`.
    pub free_stream: bool,
    /// Units of the recorded data.
    pub units: Units,
    /// Weight of the lightest hidden effect; below 1 it is not detectable. Infinite without a weighed effect.
    pub weight: f64,
    /// Seed of commands, free stream and noise.
    pub seed: u64,
}

impl RigPlan {
    /// A random rig of a family with the named effects hidden. These may be effects of the catalogue, laws of
    /// [`Altered`](crate::plant::Altered), physics of [`Beyond`](crate::plant::Beyond), or
    /// [`Fault`](crate::plant::Fault)s.
    ///
    /// Effects are drawn from their usual ranges until they are detectable, and the flow is drawn anew if none is.
    /// An effect is detectable if its change of the readings on a random on/off command is large enough, in
    /// standard errors of the average. The total change must be at least 4. The part that a change of the flow's
    /// gain, time constants, delay and zero cannot imitate must be at least 1.2. The part that memories of the
    /// flow up to 0.48 s, alone or multiplied by the jet, cannot imitate either must be at least 0.6; the best
    /// model without the effect then has an error of 1.17 × the noise level. Short lags are not among the
    /// imitations, because lags in series commute: a lag of the sensor equals one of the flow. If no flow
    /// satisfies these conditions, more than twenty repeats are averaged. [`weight`](Self::weight) is below 1 if
    /// even that does not suffice.
    ///
    /// # Errors
    /// [`RigError`] for unknown names and for effects that exclude each other.
    pub fn draw(
        family: Family,
        hidden: &[&str],
        noise: NoiseKind,
        nuisances: &[Nuisance],
        seed: u64,
    ) -> Result<Self, RigError> {
        let instrument = noise.draw(&mut stream(seed, Stream::Instrument));
        let nuisances = Nuisances::draw(nuisances, &mut stream(seed, Stream::Nuisances));
        let mut flows = stream(seed, Stream::Base);
        let mut next = || -> Result<Self, RigError> {
            let mut plan = Self {
                family,
                plant: family.draw(&mut flows),
                noise,
                instrument,
                nuisances,
                free_stream: false,
                units: Units::OWN,
                weight: f64::INFINITY,
                seed,
            };
            plan.weight = plan.hide(hidden)?;
            Ok(plan)
        };
        let mut heaviest = next()?;
        for _ in 1..FLOWS {
            if heaviest.weight >= 1.0 {
                break;
            }
            let plan = next()?;
            if plan.weight > heaviest.weight {
                heaviest = plan;
            }
        }
        heaviest.repeat_more();
        Ok(heaviest)
    }

    /// Averages more repeats if too few show the hidden effect.
    fn repeat_more(&mut self) {
        let before = self.instrument.repeats as f64;
        if self.weight < 1.0 {
            let needed = (before / (self.weight * self.weight)).ceil();
            // Weight 0 would need infinitely many repeats.
            self.instrument.repeats = needed.min(MOST_REPEATS as f64) as usize;
            self.weight *= (self.instrument.repeats as f64 / before).sqrt();
        }
    }

    /// The rig recorded in other units.
    #[must_use]
    pub fn in_units(mut self, units: Units) -> Self {
        self.units = units;
        self
    }

    /// The names that a diagnosis should find: hidden effects of the catalogue, also with an altered equation.
    pub fn hidden(&self) -> Vec<&'static str> {
        let effects = self.plant.effects.iter().map(Effect::name);
        let altered = self.plant.altered.iter().map(|e| e.resembles());
        effects.chain(altered).collect()
    }

    /// Further correct names: properties of the rig that were not hidden on purpose.
    pub fn also_right(&self) -> Vec<&'static str> {
        let delay = self.plant.delay().effect();
        delay.into_iter().chain(self.nuisances.effect()).collect()
    }

    /// Hidden effects of the catalogue with their true parameters, in the rig's own units. Effects with altered
    /// equations have no such parameters.
    pub fn exact(&self) -> Vec<(&'static str, Vec<Parameter>)> {
        let effects = self.plant.effects.iter();
        effects.map(|e| (e.name(), e.parameters())).collect()
    }

    /// The commands of the set: a step, square waves and random on/off commands, five for estimation and three for
    /// validation. They have many levels if the input is graded or a hidden effect requires it.
    pub fn commands(&self) -> Vec<(Command, Use)> {
        let mut rng = stream(self.seed, Stream::Commands);
        let squares = draw::squares(&mut rng);
        let random = ["random-a", "random-b"].map(|name| draw::telegraph(name, &mut rng));
        let [first, second] = random;
        let mut all = vec![(Command::step(), Use::Identify)];
        for (i, (frequency, duty)) in squares.into_iter().enumerate() {
            let role = if i < 3 { Use::Identify } else { Use::Validate };
            all.push((Command::square(frequency, duty), role));
        }
        all.insert(4, (first, Use::Identify));
        all.push((second, Use::Validate));

        with_levels(all, &self.plant.effects, self.nuisances.graded, &mut rng)
    }

    /// Runs the rig through every command and measures it.
    ///
    /// # Errors
    /// [`RigError`] when an effect's parameters or the instrument are impossible.
    pub fn build(&self) -> Result<Recorded, RigError> {
        let session = Session {
            plant: &self.plant,
            instrument: &self.instrument,
            nuisances: self.nuisances,
            free_stream: self.free_stream,
            units: self.units,
            title: format!("Simulated rig {}", self.seed),
            seed: self.seed,
        };
        session.record(self.commands())
    }

    /// The true effects as TOML text for users and scoring scripts.
    pub fn answer(&self) -> String {
        let list = |names: Vec<&str>| {
            let quoted: Vec<String> = names.iter().map(|n| format!("\"{n}\"")).collect();
            quoted.join(", ")
        };
        let mut text = format!(
            "# the hidden effects of this set\n\nfamily = \"{}\"\nhidden = [{}]\nalso_right = [{}]\nnoise = \
             \"{}\"\nstandard_error = {:.5}\nseed = {}\n",
            self.family.name(),
            list(self.hidden()),
            list(self.also_right()),
            self.noise.name(),
            self.instrument.standard_error() * self.units.y,
            self.seed
        );
        // Writing to a String cannot fail.
        if self.weight.is_finite() {
            let _ = writeln!(
                text,
                "# at least 1 if detectable\nweight = {:.2}",
                self.weight
            );
        }
        if self.units != Units::OWN {
            let _ = write!(
                text,
                "\n# the following is in the rig's own units; recorded times and y are these, multiplied by \
                 the factors\n[units]\ntime = {}\ny = {}\n",
                self.units.time, self.units.y
            );
        }
        text + &self.nuisances.to_toml() + "\n" + &self.plant.to_toml()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::plant::{Altered, Rig};

    #[test]
    fn every_family_records_eight_runs_near_its_truth_and_repeats_bit_for_bit() {
        for (family, noise) in Family::ALL.into_iter().zip(NoiseKind::ALL) {
            assert_eq!(Family::of(family.name()), Some(family));
            assert_eq!(NoiseKind::of(noise.name()), Some(noise));
            let plan = RigPlan::draw(family, &[], noise, &[], 5).unwrap();
            let set = plan.build().unwrap();
            assert_eq!(set.data.hash, plan.build().unwrap().data.hash);
            assert!(set.data.is_on_off());
            assert_eq!(
                (set.data.identify().count(), set.data.validate().count()),
                (5, 3)
            );
            let highest = (set.noise_free.iter().flatten()).fold(0.0_f64, |m, y| m.max(*y));
            assert!((0.7..1.5).contains(&highest), "{family:?}: {highest}");
            for (record, truth) in set.data.records.iter().zip(&set.noise_free) {
                assert_eq!(record.y.len(), 10_000);
                let sd = record.y_sd.as_deref().unwrap();
                let floor = (sd.iter().map(|s| s * s).sum::<f64>() / 1e4).sqrt();
                let off = record.y.iter().zip(truth).map(|(a, b)| (a - b) * (a - b));
                let ratio = (off.sum::<f64>() / 1e4).sqrt() / floor;
                // Slow components and level scatter have few independent samples per record.
                assert!((0.6..1.6).contains(&ratio), "{noise:?}: {ratio}");
            }
        }
    }

    #[test]
    fn every_effect_and_every_altered_law_can_be_hidden_in_every_family() {
        let fault = RigPlan::draw(Family::Wake, &["missing-pulse"], NoiseKind::White, &[], 1);
        let fault = fault.unwrap();
        assert!(fault.hidden().is_empty() && fault.plant.faults.len() == 1);
        let names: Vec<&str> = Effect::NAMES
            .iter()
            .chain(Altered::NAMES)
            .copied()
            .collect();
        for (seed, name) in (0..).zip(names) {
            let family = Family::ALL[seed as usize % 6];
            let plan = RigPlan::draw(family, &[name], NoiseKind::Coloured, &[], seed).unwrap();
            assert_eq!(plan.hidden().len(), 1);
            assert!(plan.weight >= 1.0, "{family:?} {name}: {}", plan.weight);
            assert!(Effect::NAMES.contains(&plan.hidden()[0]));
            assert_eq!(
                plan.exact().len(),
                usize::from(Effect::NAMES.contains(&name))
            );
            assert!(plan.answer().contains(name), "{name}");
            Rig::new(&plan.plant, None).unwrap();
        }
    }

    /// An echo of opposite sign drives the flow below rest; one of equal sign drives it above full strength.
    #[test]
    fn no_flow_runs_away() {
        let draw =
            |seed, echo, noise| RigPlan::draw(Family::RateOfY, &[echo], noise, &[], seed).unwrap();
        for (seed, echo, noise) in [
            (900_000_103, "echo-path", NoiseKind::Coloured),
            (1, "echo-path", NoiseKind::Coloured),
            (777_001_100_161, "smeared-echo", NoiseKind::Scatter),
        ] {
            let plan = draw(seed, echo, noise);
            assert!(plan.weight >= 1.0);
            let readings = plan.build().unwrap().noise_free;
            let mut readings = readings.iter().flatten();
            assert!(readings.all(|y| (-1.0..3.0).contains(y)), "{seed}");
        }
    }

    #[test]
    fn nuisances_do_what_they_say() {
        let plan = |nuisances: &[Nuisance]| {
            RigPlan::draw(Family::Wake, &[], NoiseKind::White, nuisances, 3).unwrap()
        };
        let first = |nuisances: &[Nuisance]| plan(nuisances).build().unwrap().noise_free[0][0];
        assert_eq!(first(&[]), 0.0);
        let offset = plan(&[Nuisance::Offset]).nuisances.offset;
        assert!(offset.abs() > 0.01 && first(&[Nuisance::Offset]) == offset);
        let drifting = plan(&[Nuisance::Drift]).build().unwrap().noise_free;
        let quiet = plan(&[]).build().unwrap().noise_free;
        let crept = drifting[7][9_999] - quiet[7][9_999];
        let drift = plan(&[Nuisance::Drift]).nuisances.drift;
        assert!((crept - drift).abs() < 1e-3 * drift.abs());
        let graded = plan(&[Nuisance::Graded]).build().unwrap().data;
        assert!(!graded.is_on_off());
        let mid_run = plan(&[Nuisance::MidRun]).build().unwrap();
        assert!(mid_run.noise_free.iter().any(|y| y[0] > 0.1));
        assert!(mid_run.data.is_on_off());
    }

    #[test]
    fn other_units_are_the_same_samples() {
        let plan =
            RigPlan::draw(Family::Memory1, &["valve-lag"], NoiseKind::White, &[], 9).unwrap();
        let own = plan.build().unwrap().data;
        let units = Units {
            time: 20.0,
            y: 0.02,
        };
        let twin = plan.in_units(units);
        assert!(twin.answer().contains("[units]\ntime = 20\ny = 0.02"));
        let twin = twin.build().unwrap().data;
        assert!((twin.sample_period_s - 0.02).abs() < 1e-15);
        for (a, b) in own.records.iter().zip(&twin.records) {
            assert_eq!(a.u, b.u);
            assert_eq!(a.y[777] * 0.02, b.y[777]);
        }
    }

    #[test]
    fn wrong_names_and_impossible_pairs_are_refused() {
        let draw = |names: &[&str]| RigPlan::draw(Family::Wake, names, NoiseKind::White, &[], 1);
        assert!(
            draw(&["gremlin"])
                .unwrap_err()
                .to_string()
                .contains("two-reservoirs")
        );
        for pair in [
            ["valve-lag", "ramp-valve"],
            ["clamped-delay", "edge-dependent-delay"],
        ] {
            assert!(matches!(draw(&pair), Err(RigError::Exclusive(_, _))));
        }
    }
}
