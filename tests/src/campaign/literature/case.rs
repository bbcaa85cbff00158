//! The cases: published flows and effects in turn, from a seed.

use std::fmt;

use firmware_sim::literature::{Hidden, LiteraturePlan, PUBLISHED, UnknownName};

/// A published flow with its hidden effect and seed.
#[derive(Clone, Debug, PartialEq)]
pub struct Case {
    /// Name of the published model.
    pub model: &'static str,
    /// The hidden effect; none for the null case.
    pub hidden: Option<&'static str>,
    /// Whether there are realistic instruments (converter, dead time, changing offset), or white noise only.
    pub real_instruments: bool,
    /// Seed of the rig.
    pub seed: u64,
}

impl Case {
    /// Name of the hidden effect, or `nothing`.
    #[must_use]
    pub fn label(&self) -> &'static str {
        self.hidden.unwrap_or("nothing")
    }

    /// The rig.
    ///
    /// # Errors
    /// Names that do not exist.
    pub fn plan(&self) -> Result<LiteraturePlan, UnknownName> {
        let hidden: Vec<&str> = self.hidden.into_iter().collect();
        LiteraturePlan::draw(self.model, &hidden, self.real_instruments, self.seed)
    }
}

impl fmt::Display for Case {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let instruments = if self.real_instruments { "" } else { "/ideal" };
        write!(
            f,
            "{}/{}/{}{instruments}",
            self.model,
            self.label(),
            self.seed
        )
    }
}

/// The first `count` cases of a campaign. Models alternate, a third of the cases hides nothing, and effects
/// alternate over the others, so that any first part is a sample of all.
#[must_use]
pub fn cases(count: usize, real_instruments: bool, seed: u64) -> Vec<Case> {
    let effects = Hidden::names();
    // The seed selects the first effect.
    let mut next = seed as usize % effects.len();
    let one = |index: usize| {
        let (turn, model) = (index / PUBLISHED.len(), index % PUBLISHED.len());
        let hidden = ((turn + model) % 3 != 0).then(|| {
            next += 1;
            effects[next % effects.len()]
        });
        Case {
            model: PUBLISHED[model].name,
            hidden,
            real_instruments,
            seed: seed.wrapping_mul(1_000) + index as u64,
        }
    };
    (0..count).map(one).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn eighteen_cases_hold_two_effects_and_a_null_of_every_model() {
        let all = cases(18, true, 7);
        for model in PUBLISHED {
            let own = all.iter().filter(|case| case.model == model.name);
            let nulls = own.clone().filter(|case| case.hidden.is_none()).count();
            assert_eq!((own.count(), nulls), (3, 1), "{}", model.name);
        }
        let names: Vec<&str> = all.iter().filter_map(|case| case.hidden).collect();
        let all_effects = Hidden::names();
        assert!(all_effects.iter().all(|name| names.contains(name)));
        assert_eq!(all[..5], cases(5, true, 7)[..]);
        assert!(all.iter().all(|case| case.plan().is_ok()));
    }
}
