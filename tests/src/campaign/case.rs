//! What is tried: the cases of a campaign, from a seed.

use std::fmt;

use firmware_sim::family::{Family, NoiseKind, Nuisance, RigPlan, Units};
use firmware_sim::plant::{Altered, Effect, Fault, ShowsWith};
use firmware_sim::recording::RigError;
use rand::seq::SliceRandom;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use serde::{Deserialize, Serialize};

/// What a case is counted under.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Group {
    /// One effect of the catalogue.
    Single,
    /// One effect in another law than the catalogue's.
    Altered,
    /// No effect: noise and nuisances only.
    Nothing,
    /// Two effects.
    Pair,
    /// What the catalogue does not have.
    Outside,
    /// A rig with one effect, written down in several units.
    Units,
    /// Physics beyond the catalogue, which a search for unknown terms should find.
    Beyond,
    /// One effect of the size at which the diagnosis of the rig without it says that it would be seen.
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

    /// The word in keys and on command lines.
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

/// The model that is handed in.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Given {
    /// What `identify` makes of the data with its defaults; with fixed delays where a delay law is hidden, which
    /// would not be missing otherwise.
    Default,
    /// One lag of each kind, identified.
    Lean,
    /// The lags that the flow has in truth, identified, with a delay law unless that is hidden.
    Truth,
    /// A rough guess that nobody fitted.
    Guess,
    /// A guess with bad delays.
    BadDelays,
}

impl Given {
    /// Every kind.
    pub const ALL: [Self; 5] = [
        Self::Default,
        Self::Lean,
        Self::Truth,
        Self::Guess,
        Self::BadDelays,
    ];

    /// The word in keys and on command lines.
    #[must_use]
    pub fn word(self) -> &'static str {
        match self {
            Self::Default => "default",
            Self::Lean => "lean",
            Self::Truth => "truth",
            Self::Guess => "guess",
            Self::BadDelays => "bad-delays",
        }
    }
}

/// A rig to be diagnosed.
#[derive(Clone, Debug, PartialEq)]
pub struct Case {
    /// What it is counted under.
    pub group: Group,
    /// The kind of flow.
    pub family: Family,
    /// What is hidden, by the plant's names.
    pub hidden: Vec<String>,
    /// What the repeats are disturbed by.
    pub noise: NoiseKind,
    /// What is no effect.
    pub nuisances: Vec<Nuisance>,
    /// So many times what is said to be seen is put in, where that is asked.
    pub times: f64,
    /// In which units the rig is written down.
    pub units: Units,
    /// The model that is handed in.
    pub given: Given,
    /// Seed of rig, parameters, commands and noise.
    pub seed: u64,
}

impl Case {
    /// A case of a first kind: coloured noise, no nuisance, own units, `identify`'s default model.
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
        // How much there is of an effect of just the size that is seen, its rig without it has to tell first.
        let drawn = if self.group == Group::Power {
            &[]
        } else {
            self.hidden.as_slice()
        };
        let hidden: Vec<&str> = drawn.iter().map(String::as_str).collect();
        let plan = RigPlan::draw(self.family, &hidden, self.noise, &self.nuisances, self.seed)?;
        Ok(plan.in_units(self.units))
    }

    /// What is hidden, in words.
    #[must_use]
    pub fn label(&self) -> String {
        if self.hidden.is_empty() {
            "nothing".to_owned()
        } else {
            self.hidden.join("+")
        }
    }
}

/// One word by which a row is found again; everything that determines the case is in it.
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
        write!(f, "{}/{}", self.given.word(), self.seed)
    }
}

/// How many of each group.
#[derive(Clone, Copy, Debug)]
pub struct Sizes {
    /// Rigs for each effect and family.
    pub draws: u64,
    /// Rigs for each altered law; the families take turns.
    pub altered: u64,
    /// Rigs without an effect, over all families, noises and nuisances.
    pub nulls: u64,
    /// Pairs.
    pub pairs: u64,
    /// Rigs for each fault.
    pub outside: u64,
    /// Rigs that are written down in five units each.
    pub units: u64,
    /// Rigs for each effect of the size at which it is said to be seen; the families take turns …
    pub power: u64,
    /// … or of so many times that size.
    pub power_times: f64,
}

/// The units of twins: seconds and y times these.
const UNITS: [Units; 5] = [
    Units::OWN,
    Units { time: 20.0, y: 1.0 },
    Units { time: 0.1, y: 1.0 },
    Units { time: 1.0, y: 50.0 },
    Units { time: 1.0, y: 0.02 },
];

/// Seeds of campaigns and of groups lie this far apart: no two share a rig.
const CAMPAIGN_SEEDS: u64 = 1_000_000;
const GROUP_SEEDS: u64 = 100_000;

/// Hands every rig of a campaign a seed of its own.
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

/// One in so many rigs with an effect that shows on off and on is told levels between them nevertheless.
const GRADED: u32 = 8;

/// The cases of a campaign in an order that mixes them, so that the first of them are a sample of all. Every
/// rig has a seed of its own, and with it a flow of its own.
#[must_use]
pub fn cases(sizes: &Sizes, given: Given, seed: u64) -> Vec<Case> {
    let mut all: Vec<Case> = Vec::new();
    let mut seeds = Seeds::of(seed);
    let mut next = |group: Group| seeds.next(group);
    let mut add = |group, family, hidden: &[&str], seed| {
        let mut rng = ChaCha8Rng::seed_from_u64(seed ^ 0x9013e);
        let mut case = Case::new(group, family, hidden, seed);
        case.given = given;
        // Half of the rigs have noise that is white and coloured, the others any.
        if rng.random_bool(0.5) {
            case.noise = NoiseKind::ALL[rng.random_range(0..NoiseKind::ALL.len())];
        }
        let plain = Fault::NAMES.contains(&hidden[0]) || !hidden.iter().all(|name| on_off(name));
        if rng.random_ratio(1, GRADED) && !plain {
            case.nuisances = vec![Nuisance::Graded];
        }
        all.push(case);
    };
    // Effect, family: every effect meets every family in the course of the rounds.
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
        // Pairs that cannot be in one rig, or would not show, are drawn again.
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

/// The so-manieth rig that hides nothing: in sixty of them each family meets each noise and each nuisance once.
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

/// Effects that need levels between off and on are asked for on the plain flow only: on others, what a part
/// jet does to the flow is not defined by anybody.
fn shows(name: &str, family: Family) -> bool {
    on_off(name) || family == Family::FirstOrder
}

/// Whether the diagnosis can say on plain records how much of it would be seen.
fn has_amplitude(name: &str) -> bool {
    let card = model_core::effects::spec(name);
    let said = card.is_some_and(|card| card.amplitude.is_some() && card.channel.is_none());
    said && on_off(name)
}

/// Whether off and on are enough for it to show.
fn on_off(name: &str) -> bool {
    let mut rng = ChaCha8Rng::seed_from_u64(0);
    let base = firmware_sim::plant::BasePlant::draw(&mut rng);
    // Laws that are not the catalogue's all do.
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
        // Coloured noise is also what the nuisances come with.
        assert_eq!(kinds.len(), 60);
        assert_eq!(all, cases(&sizes, Given::Default, 5000));
        let other = cases(&sizes, Given::Default, 5001);
        let other: BTreeSet<u64> = other.iter().map(|case| case.seed).collect();
        assert!(other.is_disjoint(&seeds));
    }
}
