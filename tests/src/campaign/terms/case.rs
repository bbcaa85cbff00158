//! The cases of a campaign, drawn from a seed.

use firmware_sim::family::{Family, NoiseKind};
use firmware_sim::plant::Beyond;
use rand::seq::SliceRandom;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

use super::spot::Truth;
use crate::campaign::case::{Case, Group, Seeds, nothing};

/// Number of cases per group.
#[derive(Clone, Copy, Debug)]
pub struct Sizes {
    /// Rigs for each physics and family.
    pub draws: u64,
    /// Rigs for each effect that is removed from the catalogue, cycling through the families.
    pub without: u64,
    /// Rigs with nothing missing, over all families, noises and nuisances.
    pub nulls: u64,
}

/// A place with its correct coordinates.
type Curve = (&'static str, &'static [&'static str]);
/// An effect with the equivalent curves.
type Known = (&'static str, &'static [Curve]);

/// Effects of the catalogue that equal a curve over one coordinate, with the correct findings. Lags, echoes,
/// friction and hysteresis are not of this kind.
const CURVES: &[Known] = &[
    ("state-dependent-delay", &[("delay", &["mean y (0.25 s)"])]),
    (
        "plenum-droop",
        &[("jet", &["memory of u", "blowing in the last"])],
    ),
    ("free-stream-variation", &[("jet", &["u_inf"])]),
    // The starting vortex acts during the jet only, where both coordinates are equal.
    (
        "starting-vortex",
        &[("jet", &["since rising edge", "pulse length"])],
    ),
    // The stopping vortex acts after the jet has ended: the place is the flow.
    ("stopping-vortex", &[("flow", &["since falling edge"])]),
    ("amplitude-saturation", &[("flow", &["y"])]),
    ("hot-film-nonlinearity", &[("sensor", &["reading", "y"])]),
    ("sensor-saturation", &[("sensor", &["reading", "y"])]),
    ("thermal-drift", &[("sensor", &["time in record"])]),
];

/// The correct findings for an effect removed from the catalogue.
pub(super) fn of_the_catalogue(name: &str) -> Vec<Truth> {
    let own = CURVES.iter().find(|(effect, _)| *effect == name);
    let spots = own.map_or(&[][..], |(_, spots)| spots);
    let truth = |(place, coordinates): &(&str, &[&str])| Truth {
        place: (*place).to_owned(),
        coordinates: coordinates.iter().map(|c| (*c).to_owned()).collect(),
    };
    spots.iter().map(truth).collect()
}

/// The cases of a campaign in random order, so that any first part is a sample of all. Every rig has its own seed
/// and flow. Half have white and coloured noise, the others any kind.
#[must_use]
pub fn cases(sizes: &Sizes, seed: u64) -> Vec<Case> {
    let mut all: Vec<Case> = Vec::new();
    let mut seeds = Seeds::of(seed);
    let mut add = |group, family, hidden: &str| {
        let seed = seeds.next(group);
        let mut rng = ChaCha8Rng::seed_from_u64(seed ^ 0x7e55);
        let mut case = Case::new(group, family, &[hidden], seed);
        if rng.random_bool(0.5) {
            case.noise = NoiseKind::ALL[rng.random_range(0..NoiseKind::ALL.len())];
        }
        all.push(case);
    };
    for _ in 0..sizes.draws {
        for family in Family::ALL {
            for name in Beyond::NAMES {
                add(Group::Beyond, family, name);
            }
        }
    }
    for round in 0..sizes.without {
        for (index, (name, _)) in CURVES.iter().enumerate() {
            let family = Family::ALL[(round as usize + index) % Family::ALL.len()];
            add(Group::Single, family, name);
        }
    }
    for number in 0..sizes.nulls {
        all.push(nothing(number, seeds.next(Group::Nothing)));
    }
    all.shuffle(&mut ChaCha8Rng::seed_from_u64(seed ^ 0x9a12));
    all
}

#[cfg(test)]
mod tests {
    use super::*;
    use firmware_sim::plant::Effect;
    use std::collections::BTreeSet;

    #[test]
    fn every_physics_meets_every_family_and_every_rig_is_another() {
        let sizes = Sizes {
            draws: 1,
            without: 1,
            nulls: 60,
        };
        let all = cases(&sizes, 77);
        let physics = Beyond::NAMES.len();
        assert!(physics >= 12);
        assert_eq!(all.len(), 6 * physics + CURVES.len() + 60);
        let seeds: BTreeSet<u64> = all.iter().map(|case| case.seed).collect();
        assert_eq!(seeds.len(), all.len());
        let mut beyond = all.iter().filter(|case| case.group == Group::Beyond);
        assert!(beyond.all(|case| Beyond::NAMES.contains(&case.label().as_str())));
        for (name, _) in CURVES {
            assert!(Effect::NAMES.contains(name) && !of_the_catalogue(name).is_empty());
        }
    }
}
