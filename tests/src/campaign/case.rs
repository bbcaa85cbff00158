//! The cases of a campaign, drawn from a seed.

use std::fmt;

use firmware_sim::family::{Family, NoiseKind, Nuisance, RigPlan, Units};
use firmware_sim::named;
use firmware_sim::plant::{Altered, Effect, Fault, ShowsWith};
use firmware_sim::recording::RigError;
use rand::seq::SliceRandom;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use serde::{Deserialize, Serialize};

/// Group of a case in the tables.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Group {
    /// One effect of the catalogue.
    Single,
    /// One effect with an equation other than the catalogue's.
    Altered,
    /// No effect: noise and nuisances only.
    Nothing,
    /// Two effects.
    Pair,
    /// A fault outside the catalogue.
    Outside,
    /// A rig with one effect, recorded in several units.
    Units,
    /// Physics outside the catalogue, for the search for unknown terms.
    Beyond,
    /// One effect at its detectable size according to the diagnosis of the rig without it.
    Power,
}

impl Group {
    /// The groups of the diagnosis, in the order of tables.
    pub const ALL: [Self; 7] = [
        Self::Single,
        Self::Altered,
        Self::Nothing,
        Self::Pair,
        Self::Outside,
        Self::Units,
        Self::Power,
    ];

    /// Name of the group in keys and on command lines.
    #[must_use]
    pub fn word(self) -> &'static str {
        match self {
            Self::Single => "single",
            Self::Altered => "altered",
            Self::Nothing => "nothing",
            Self::Pair => "pair",
            Self::Outside => "outside",
            Self::Units => "units",
            Self::Beyond => "beyond",
            Self::Power => "power",
        }
    }
}

named! {
    /// The model that is given to the diagnosis.
    #[derive(Serialize, Deserialize)]
    #[serde(rename_all = "kebab-case")]
    pub enum Given {
        /// The model that `identify` makes by default; with fixed delays if a delay law is hidden.
        Default = "default",
        /// One lag of each kind, identified.
        Lean = "lean",
        /// The true lags of the flow, identified, with a delay law unless that is hidden.
        Truth = "truth",
        /// A rough guess without a fit.
        Guess = "guess",
        /// A guess with bad delays.
        BadDelays = "bad-delays",
    }
}

/// A rig to be diagnosed.
#[derive(Clone, Debug, PartialEq)]
pub struct Case {
    /// Its group.
    pub group: Group,
    /// The kind of flow.
    pub family: Family,
    /// The hidden effects, by the plant's names.
    pub hidden: Vec<String>,
    /// Kind of noise in the repeats.
    pub noise: NoiseKind,
    /// Nuisances: deviations that are not effects.
    pub nuisances: Vec<Nuisance>,
    /// Multiple of the detectable size, in the group `Power`.
    pub times: f64,
    /// Units of the recorded data.
    pub units: Units,
    /// The given model.
    pub given: Given,
    /// Seed of rig, parameters, commands and noise.
    pub seed: u64,
}

impl Case {
    /// A basic case: coloured noise, no nuisance, own units, default model.
    #[must_use]
    pub fn new(group: Group, family: Family, hidden: &[&str], seed: u64) -> Self {
        Self {
            group,
            family,
            hidden: hidden.iter().map(|name| (*name).to_owned()).collect(),
            noise: NoiseKind::Coloured,
            nuisances: Vec::new(),
            times: 1.0,
            units: Units::OWN,
            given: Given::Default,
            seed,
        }
    }

    /// The rig.
    ///
    /// # Errors
    /// [`RigError`] for effects that cannot be in one rig.
    pub fn plan(&self) -> Result<RigPlan, RigError> {
        // The detectable size is known only after diagnosing the rig without the effect.
        let drawn = if self.group == Group::Power {
            &[]
        } else {
            self.hidden.as_slice()
        };
        let hidden: Vec<&str> = drawn.iter().map(String::as_str).collect();
        let plan = RigPlan::draw(self.family, &hidden, self.noise, &self.nuisances, self.seed)?;
        Ok(plan.in_units(self.units))
    }

    /// The hidden effects in words.
    #[must_use]
    pub fn label(&self) -> String {
        if self.hidden.is_empty() {
            "nothing".to_owned()
        } else {
            self.hidden.join("+")
        }
    }
}

/// Key of a result; contains everything that determines the case.
impl fmt::Display for Case {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let nuisances: Vec<&str> = self.nuisances.iter().map(|n| n.name()).collect();
        write!(
            f,
            "{}/{}/{}/{}/",
            self.group.word(),
            self.family.name(),
            self.label(),
            self.noise.name()
        )?;
        if !nuisances.is_empty() {
            write!(f, "{}/", nuisances.join("+"))?;
        }
        if self.times != 1.0 {
            write!(f, "x{}/", self.times)?;
        }
        if self.units != Units::OWN {
            write!(f, "t*{},y*{}/", self.units.time, self.units.y)?;
        }
        write!(f, "{}/{}", self.given.name(), self.seed)
    }
}

/// Number of cases per group.
#[derive(Clone, Copy, Debug)]
pub struct Sizes {
    /// Rigs for each effect and family.
    pub draws: u64,
    /// Rigs for each altered law, cycling through the families.
    pub altered: u64,
    /// Rigs without an effect, over all families, noises and nuisances.
    pub nulls: u64,
    /// Pairs.
    pub pairs: u64,
    /// Rigs for each fault.
    pub outside: u64,
    /// Rigs that are recorded in five units each.
    pub units: u64,
    /// Rigs for each effect at its detectable size, cycling through the families.
    pub power: u64,
    /// Multiple of the detectable size in the group `Power`.
    pub power_times: f64,
}

/// Units of the copies of a rig: factors on time and y.
const UNITS: [Units; 5] = [
    Units::OWN,
    Units { time: 20.0, y: 1.0 },
    Units { time: 0.1, y: 1.0 },
    Units { time: 1.0, y: 50.0 },
    Units { time: 1.0, y: 0.02 },
];

/// Distance between the seeds of campaigns and of groups, so that no two share a rig.
const CAMPAIGN_SEEDS: u64 = 1_000_000;
const GROUP_SEEDS: u64 = 100_000;

/// Gives every rig of a campaign its own seed.
pub(super) struct Seeds {
    campaign: u64,
    used: [u64; 8],
}

impl Seeds {
    pub(super) fn of(campaign: u64) -> Self {
        Self {
            campaign,
            used: [0; 8],
        }
    }

    pub(super) fn next(&mut self, group: Group) -> u64 {
        let used = &mut self.used[group as usize];
        *used += 1;
        self.campaign * CAMPAIGN_SEEDS + group as u64 * GROUP_SEEDS + *used
    }
}

/// One in this many rigs with an on/off effect has a graded command.
const GRADED: u32 = 8;

/// The cases of a campaign in random order, so that any first part is a sample of all. Every rig has its own
/// seed and flow.
#[must_use]
pub fn cases(sizes: &Sizes, given: Given, seed: u64) -> Vec<Case> {
    let mut all: Vec<Case> = Vec::new();
    let mut seeds = Seeds::of(seed);
    let mut next = |group: Group| seeds.next(group);
    let mut add = |group, family, hidden: &[&str], seed| {
        let mut rng = ChaCha8Rng::seed_from_u64(seed ^ 0x9013e);
        let mut case = Case::new(group, family, hidden, seed);
        case.given = given;
        // Half of the rigs have white and coloured noise, the others any kind.
        if rng.random_bool(0.5) {
            case.noise = NoiseKind::ALL[rng.random_range(0..NoiseKind::ALL.len())];
        }
        let plain = Fault::NAMES.contains(&hidden[0]) || !hidden.iter().all(|name| on_off(name));
        if rng.random_ratio(1, GRADED) && !plain {
            case.nuisances = vec![Nuisance::Graded];
        }
        all.push(case);
    };
    // Over the rounds every effect is combined with every family.
    let families = Family::ALL.len();
    let turn = |round: u64, index: usize| Family::ALL[(round as usize + index) % families];

    for _ in 0..sizes.draws {
        for family in Family::ALL {
            for name in Effect::NAMES.iter().filter(|name| shows(name, family)) {
                add(Group::Single, family, &[name], next(Group::Single));
            }
        }
    }
    for round in 0..sizes.altered {
        for (index, name) in Altered::NAMES.iter().enumerate() {
            let seed = next(Group::Altered);
            add(Group::Altered, turn(round, index), &[name], seed);
        }
    }
    for round in 0..sizes.outside {
        for (index, name) in Fault::NAMES.iter().enumerate() {
            let seed = next(Group::Outside);
            add(Group::Outside, turn(round, index), &[name], seed);
        }
    }
    let mut rng = ChaCha8Rng::seed_from_u64(seed ^ 0x9a12);
    for number in 0..sizes.pairs {
        let (seed, family) = (next(Group::Pair), turn(number, 0));
        let mut name = || Effect::NAMES[rng.random_range(0..Effect::NAMES.len())];
        // Incompatible or undetectable pairs are drawn again.
        let names = loop {
            let names = [name(), name()];
            let shown = names.iter().all(|name| shows(name, family));
            if shown && RigPlan::check(&names).is_ok() {
                break names;
            }
        };
        add(Group::Pair, family, &names, seed);
    }
    for number in 0..sizes.units {
        let (seed, family) = (next(Group::Units), turn(number, 0));
        let shown: Vec<&str> = (Effect::NAMES.iter().copied())
            .filter(|name| on_off(name))
            .collect();
        let name = shown[rng.random_range(0..shown.len())];
        for units in UNITS {
            all.push(Case {
                units,
                given,
                ..Case::new(Group::Units, family, &[name], seed)
            });
        }
    }
    for round in 0..sizes.power {
        let named = Effect::NAMES.iter().filter(|name| has_amplitude(name));
        for (index, name) in named.enumerate() {
            let seed = next(Group::Power);
            all.push(Case {
                given,
                times: sizes.power_times,
                ..Case::new(Group::Power, turn(round, index), &[name], seed)
            });
        }
    }
    for number in 0..sizes.nulls {
        all.push(Case {
            given,
            ..nothing(number, next(Group::Nothing))
        });
    }
    all.shuffle(&mut rng);
    all
}

/// The null rig with this number: sixty cover each combination of family, noise and nuisance once.
pub(super) fn nothing(number: u64, seed: u64) -> Case {
    let families = Family::ALL.len();
    let number = number as usize;
    let mut case = Case::new(Group::Nothing, Family::ALL[number % families], &[], seed);
    let kinds = NoiseKind::ALL.len() + Nuisance::ALL.len();
    let kind = (number + number / families) % kinds;
    match NoiseKind::ALL.get(kind) {
        Some(noise) => case.noise = *noise,
        None => case.nuisances = vec![Nuisance::ALL[kind - NoiseKind::ALL.len()]],
    }
    case
}

/// Effects that need levels between off and on are used on the first-order flow only, because for the other flows
/// the response to jets of part strength is undefined.
fn shows(name: &str, family: Family) -> bool {
    on_off(name) || family == Family::FirstOrder
}

/// Whether the diagnosis states a detectable size for the effect `name`.
fn has_amplitude(name: &str) -> bool {
    let card = model_core::effects::spec(name);
    let said = card.is_some_and(|card| card.amplitude.is_some() && card.channel.is_none());
    said && on_off(name)
}

/// Whether the effect `name` is visible with on/off commands.
fn on_off(name: &str) -> bool {
    let mut rng = ChaCha8Rng::seed_from_u64(0);
    let base = firmware_sim::plant::BasePlant::draw(&mut rng);
    // Effects with altered equations are all visible.
    let effect = Effect::draw(name, &base, &mut rng);
    effect.is_ok_and(|effect| effect.shows_with() == ShowsWith::OnOff)
        || Altered::NAMES.contains(&name)
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::collections::BTreeSet;

    #[test]
    fn every_case_has_a_key_and_every_rig_a_seed_of_its_own() {
        let sizes = Sizes {
            draws: 1,
            altered: 1,
            nulls: 60,
            pairs: 6,
            outside: 1,
            units: 3,
            power: 0,
            power_times: 1.0,
        };
        let all = cases(&sizes, Given::Default, 5000);
        assert_eq!(all.len(), 21 + 5 * 19 + 12 + 60 + 6 + 3 + 15);
        let keys: BTreeSet<String> = all.iter().map(Case::to_string).collect();
        assert_eq!(keys.len(), all.len());
        let own = |case: &&Case| case.group != Group::Units || case.units == Units::OWN;
        let rigs: Vec<&Case> = all.iter().filter(own).collect();
        let seeds: BTreeSet<u64> = rigs.iter().map(|case| case.seed).collect();
        assert_eq!(seeds.len(), rigs.len());
        let nulls = all.iter().filter(|case| case.group == Group::Nothing);
        let kinds: BTreeSet<_> = nulls
            .map(|c| (c.family, c.noise, c.nuisances.clone()))
            .collect();
        // Coloured noise is also combined with the nuisances.
        assert_eq!(kinds.len(), 60);
        assert_eq!(all, cases(&sizes, Given::Default, 5000));
        let other = cases(&sizes, Given::Default, 5001);
        let other: BTreeSet<u64> = other.iter().map(|case| case.seed).collect();
        assert!(other.is_disjoint(&seeds));
    }
}
