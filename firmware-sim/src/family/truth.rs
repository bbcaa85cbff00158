//! Truth of a rig for the search for unknown terms: the terms to find, and further correct ones.

use super::RigPlan;
use crate::plant::{Beyond, Character, FlowDelay, Port, Truth};

impl RigPlan {
    /// Place and coordinate of each physics beyond the catalogue.
    pub fn truths(&self) -> Vec<Truth> {
        self.plant.beyond.iter().map(Beyond::truth).collect()
    }

    /// Further terms that are true of the rig: properties of its flow, delay and nuisances outside the
    /// bilinear class.
    pub fn also_true(&self) -> Vec<Truth> {
        let delay = match self.plant.delay() {
            FlowDelay::Fixed { .. } => None,
            // A delay law depends on one mean of the friction, and other means of the past are
            // similar to it.
            FlowDelay::StateDependent { .. } | FlowDelay::Clamped { .. } => Some(Truth::new(
                Port::Delay,
                &["mean y", "memory of y", "past y", "y"],
            )),
            FlowDelay::EdgeDependent { .. } => Some(Truth::new(
                Port::Delay,
                &["since rising edge", "since falling edge", "pulse length"],
            )),
        };
        let flow = match &self.plant.character {
            Character::FirstOrder | Character::Inertia { .. } | Character::SecondLag { .. } => None,
            Character::Memory(_) => Some(&["past y"][..]),
            Character::Wake { .. } => Some(&["memory of y", "mean y"][..]),
            Character::RateOfFriction { .. } => Some(&["y"][..]),
        };
        let flow = flow.map(|coordinates| Truth::new(Port::Flow, coordinates));
        // A memory that the jet reduces has the same effect as a factor on the jet.
        let jet = match &self.plant.character {
            Character::Memory(terms) if terms.iter().any(|term| term.lost != 0.0) => {
                Some(Truth::new(Port::Jet, &["past y"]))
            }
            _ => None,
        };
        let drift = self.nuisances.drift != 0.0;
        let zero = drift.then(|| Truth::new(Port::Sensor, &["time in record"]));
        delay
            .into_iter()
            .chain(flow)
            .chain(jet)
            .chain(zero)
            .collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::family::{Family, NoiseKind, Nuisance};

    #[test]
    fn what_is_hidden_is_told_apart_from_what_the_flow_has_anyway() {
        let nuisances = [Nuisance::Drift];
        let draw = |hidden: &[&str]| {
            RigPlan::draw(Family::Wake, hidden, NoiseKind::White, &nuisances, 4).unwrap()
        };
        let plan = draw(&["power-law"]);
        let [truth] = &plan.truths()[..] else {
            panic!("one physics is hidden");
        };
        assert_eq!(truth.port, Port::Sensor);
        assert!(draw(&[]).truths().is_empty());
        let also = plan.also_true();
        let has = |port, word: &str| {
            let mut own = also.iter().filter(|truth| truth.port == port);
            own.any(|truth| truth.coordinates.iter().any(|other| other == word))
        };
        assert!(has(Port::Flow, "memory of y") && has(Port::Sensor, "time in record"));
        assert!(!has(Port::Jet, "pulse number"));
    }

    /// Every physics matters on every family, with the same weight as effects of the catalogue.
    #[test]
    fn every_physics_beyond_the_catalogue_matters_in_some_rig() {
        for (seed, name) in (0..).zip(Beyond::NAMES) {
            let family = Family::ALL[seed as usize % Family::ALL.len()];
            let plan = RigPlan::draw(family, &[name], NoiseKind::Coloured, &[], seed).unwrap();
            assert!(plan.weight >= 1.0, "{family:?} {name}: {}", plan.weight);
            assert!(plan.hidden().is_empty());
            assert!(plan.answer().contains(name), "{name}");
            let channel = plan.plant.beyond[0].channel();
            assert!(channel.is_none() || plan.free_stream);
        }
    }
}
