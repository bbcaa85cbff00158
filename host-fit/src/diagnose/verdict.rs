//! The verdict: whether anything is missing, and which effects are significant.

use super::estimate::{is_identified, is_there};
use super::outcome::Conclusion;
use super::session::Session;
use super::{RULES, Verdict};
use crate::residual::{FailureCoordinate, NoiseSource, examine};
use crate::terms::{
    Found, HeldOut, Hypothesis, Judged, Noise, RULES as TERMS, Screen, Search, Table, Term, p_value,
};
use model_core::effect::Spec;

impl Session<'_> {
    /// Whether an error is at the noise level, within its uncertainty.
    fn fits(&self, judged: &Judged) -> bool {
        let judge = self.judge();
        self.is_at_noise(&judged.held_out)
            || (judge.noise_source == NoiseSource::Scatter
                && judge.error_of_motion(&judged.held_out) <= RULES.too_much
                && !self.depends(judged))
    }

    /// Whether an error is no more than the noise, by a test or within the uncertainty of a known level.
    fn is_at_noise(&self, held_out: &HeldOut) -> bool {
        let judge = self.judge();
        judge.p_above_noise(held_out, RULES.floor_margin) >= RULES.level
            || (judge.noise_source != NoiseSource::Scatter
                && judge.over_noise(held_out.rmse()) <= RULES.floor_margin)
    }

    /// Whether a model fits within the uncertainty of a known noise level: further effects are then not
    /// significant.
    pub(super) fn is_enough(&self, hypothesis: &Hypothesis) -> bool {
        let known = self.judge().noise_source != NoiseSource::Scatter;
        known && self.fits(&hypothesis.judged)
    }

    /// Whether `lesser` with a second copy of one of its `effects` fits equally well as `best`, which has one
    /// effect more. An effect whose law differs from the catalogue's looks like two of it.
    pub(super) fn does_as_well_twice(
        &self,
        effects: &[&'static Spec],
        lesser: &Hypothesis,
        best: &Hypothesis,
    ) -> bool {
        let enough = (1.0 + RULES.worthwhile) * best.judged.rmse();
        effects.iter().any(|spec| {
            (self.search.progress)(&format!(
                "a second {} in the place of another effect",
                spec.name
            ));
            let twice = self.search.again(lesser, spec);
            twice.is_some_and(|twice| twice.rmse() <= enough)
        })
    }

    /// Whether the validation error is a function of any coordinate other than its own frequency.
    fn depends(&self, judged: &Judged) -> bool {
        let (mut records, mut runs) = (Vec::new(), Vec::new());
        for (fold, fit) in self.judge().folds.iter().zip(&judged.fits) {
            for judging in &fold.judging {
                let Ok(run) = fit.model.free_run(&judging.record) else {
                    return true;
                };
                records.push(&judging.record);
                runs.push(run);
            }
        }
        let model = judged.model();
        let failures = examine(&records, runs, model.longest_delay());
        failures
            .by
            .iter()
            .filter(|place| place.coordinate != FailureCoordinate::FrequencyBand)
            .any(|place| place.explained_fraction > RULES.depends)
    }

    /// Why effects are named or reported as surrogates: they beat the best base model, or fit equally well
    /// with fewer parameters. `None` if neither holds.
    fn earned(&self, best: &Hypothesis, found: &Found) -> Option<Earned> {
        let (bare, root) = (&found.bare, &found.root);
        let (with, without) = (best.judged.rmse(), bare.judged.rmse());
        let worthwhile = if self.in_the_dark(bare) {
            RULES.worthwhile_in_the_dark
        } else {
            RULES.worthwhile
        };
        // A model at the noise level cannot be improved.
        let open = self.judge().over_noise(without) > TERMS.at_the_floor;
        if self.judge().drifts_more(&best.judged, &bare.judged) {
            return None;
        }
        let is_worthwhile = with < (1.0 - worthwhile) * without;
        if open
            && with < without
            && (self.all_are_there(best) || self.is_certified_alone(best, found))
            && let Some(p) = self.more_than_chance(best, bare)
        {
            // On a base that fits, effects with unidentifiable parameters need a certificate.
            let is_sure = is_worthwhile && (!self.is_enough(bare) || self.is_known(best));
            if is_sure || (self.is_enough(bare) && self.is_certified(best, found)) {
                return Some(Earned { p_value: Some(p) });
            }
        }
        // To be named for parsimony on a base that fits, an effect must be identifiable and needed: the
        // remaining model without it does not fit.
        let needed = || {
            let without = self.search.without_effects(best, root, |_| true);
            !(without.is_bare() && self.is_enough(&without))
        };
        let scatter = self.judge().noise_source == NoiseSource::Scatter;
        let leaner = is_leaner(best, bare) && !scatter;
        (leaner && self.is_known(best) && needed()).then_some(Earned { p_value: None })
    }

    /// Whether `best` has one effect, is at a known noise level and holds a certificate: a likelihood ratio says more of
    /// an amplitude than its interval, which correlated lags widen.
    fn is_certified_alone(&self, best: &Hypothesis, found: &Found) -> bool {
        let effects = best.terms.iter().filter_map(Term::effect).count();
        effects == 1
            && self.is_enough(best)
            && !self.is_enough(&found.bare)
            && self.is_certified(best, found)
    }

    /// Whether the effects' parameters are identifiable in the final fit.
    fn is_known(&self, best: &Hypothesis) -> bool {
        let end = self.judge().final_fit(&best.judged);
        let mut effects = best.terms.iter().filter_map(Term::effect);
        effects.all(|spec| is_identified(&end, spec))
    }

    /// Whether the 95 % interval of every effect's amplitude excludes 0.
    fn all_are_there(&self, best: &Hypothesis) -> bool {
        let end = self.judge().final_fit(&best.judged);
        let mut effects = best.terms.iter().filter_map(Term::effect);
        effects.all(|spec| is_there(&end, spec))
    }

    /// Whether the noise level is unknown and the error of the base depends on no coordinate.
    fn in_the_dark(&self, bare: &Hypothesis) -> bool {
        self.judge().noise_source == NoiseSource::Scatter && self.fits(&bare.judged)
    }

    /// p-value of the gain of `best` over `bare`; `None` if noise alone often gives as large a gain.
    fn more_than_chance(&self, best: &Hypothesis, bare: &Hypothesis) -> Option<f64> {
        let scatter = self.judge().noise_source == NoiseSource::Scatter;
        // Family-wise testing is strict with many candidates. Where the base error is far above the
        // sample-to-sample scatter, records are usually few and short: one test per effect is used there.
        let (p, level) = if scatter && !self.in_the_dark(bare) {
            let one = p_value(&bare.judged.held_out, &best.judged.held_out);
            let effects = best.judged.model().candidates().count();
            (f64::min(one * effects as f64, 1.0), RULES.level)
        } else {
            (self.by_chance(best, bare), RULES.level_of_search)
        };
        (p <= level).then_some(p)
    }

    /// Family-wise p-value of the gain of `best` over `bare`, with the residual of `best` as the noise. The
    /// residual of `bare` would hide an effect that shows in few records.
    fn by_chance(&self, best: &Hypothesis, bare: &Hypothesis) -> f64 {
        let chance = Screen::new(self.judge(), bare.judged.model()).and_then(|screen| {
            let block = best.judged.held_out.block();
            let noise = Noise::new(&screen, best.judged.model(), block, self.options.seed)?;
            Some(Table::with_chance(&screen, &self.search.known, &noise).chance)
        });
        let left = (best.judged.rmse() / bare.judged.rmse()).powi(2);
        chance.map_or(1.0, |chance| chance.p_value(1.0 - left))
    }

    /// The hypothesis without the effects that are not needed.
    fn pared(
        &self,
        found: &Found,
        needless: impl Fn(&Hypothesis, &Hypothesis) -> bool,
    ) -> Hypothesis {
        let mut best = found.best.clone();
        let mut index = 0;
        while index < best.terms.len() {
            let lesser = match best.terms[index].effect() {
                Some(_) => self.search.without(&best, index, &found.root),
                None => None,
            };
            match lesser.filter(|lesser| needless(lesser, &best)) {
                Some(lesser) => best = lesser,
                None => index += 1,
            }
        }
        best
    }

    /// The best hypothesis, pruned to the effects that are significant beside each other.
    pub(super) fn named(&self, found: &Found) -> Hypothesis {
        let scatter = self.judge().noise_source == NoiseSource::Scatter;
        let dark =
            scatter && self.judge().error_of_motion(&found.bare.judged.held_out) <= RULES.too_much;
        if dark {
            // Without a known noise level, each effect gets a single test.
            self.pared(found, |lesser, best| {
                let p = p_value(&lesser.judged.held_out, &best.judged.held_out);
                best.judged.model().candidates().count() as f64 * p >= RULES.level
            })
        } else if found.best.terms.iter().filter_map(Term::effect).count() > 1 {
            let pared = self.pared(found, |lesser, best| self.is_beside_the_point(lesser, best));
            // On a base that fits, several effects that are useless one by one over-fit its residual, unless
            // the model has fewer parameters than that base.
            let leaner = pared.cost() <= found.bare.cost();
            if self.fits(&found.bare.judged) && !leaner && !self.one_leads(&pared, found) {
                return found.bare.clone();
            }
            self.without_what_lags_do(pared, &found.root)
        } else {
            found.best.clone()
        }
    }

    /// `best` without the effects that additional lags replace equally well. Lags are searched anew beside
    /// the other effects, since the present ones were found beside all of them. Skipped if the noise level is
    /// unknown: the error then says too little.
    fn without_what_lags_do(&self, mut best: Hypothesis, root: &Hypothesis) -> Hypothesis {
        if self.judge().noise_source == NoiseSource::Scatter {
            return best;
        }
        let bases = Search {
            effects: false,
            known: self.search.known.clone(),
            ..*self.search
        };
        while best.terms.iter().filter_map(Term::effect).count() > 1 {
            let enough = (1.0 + RULES.worthwhile) * best.judged.rmse();
            let named = (0..best.terms.len()).filter(|i| best.terms[*i].effect().is_some());
            let lesser = named.filter_map(|index| {
                let name = best.terms[index].name();
                (self.search.progress)(&format!("lags in the place of {name}"));
                let lesser = self.search.without(&best, index, root)?;
                let is_effect = |term: &Term| term.effect().is_some();
                let (kept, lags) = lesser.terms.into_iter().partition(is_effect);
                let mut from = Hypothesis::new(lesser.judged);
                from.terms = lags;
                let mut found = bases.run(from, None).best;
                let mut terms: Vec<Term> = kept;
                terms.append(&mut found.terms);
                found.terms = terms;
                (found.judged.rmse() <= enough).then_some(found)
            });
            match lesser.min_by(|a, b| a.score().total_cmp(&b.score())) {
                Some(lesser) => best = lesser,
                None => break,
            }
        }
        best
    }

    /// Whether one effect of `best` alone beats the best model without effects.
    fn one_leads(&self, best: &Hypothesis, found: &Found) -> bool {
        let names: Vec<&str> = best
            .terms
            .iter()
            .filter_map(Term::effect)
            .map(|spec| spec.name)
            .collect();
        names.len() < 2
            || names.iter().any(|name| {
                let alone = self
                    .search
                    .without_effects(best, &found.root, |spec| spec.name != *name);
                alone.judged.rmse() < (1.0 - RULES.worthwhile) * found.bare.judged.rmse()
                    && self.more_than_chance(&alone, &found.bare).is_some()
            })
    }

    /// Whether an effect beside others is not significant. It is if adding it to the model without it
    /// explains enough of the error and of the unexplained variance, with a small family-wise p-value.
    fn is_beside_the_point(&self, lesser: &Hypothesis, best: &Hypothesis) -> bool {
        let judge = self.judge();
        let excess = |hypothesis: &Hypothesis| judge.excess(&hypothesis.judged.held_out);
        let little = best.judged.rmse() > (1.0 - RULES.worthwhile) * lesser.judged.rmse()
            || excess(best) > (1.0 - RULES.most) * excess(lesser)
            || judge.over_noise(lesser.judged.rmse()) <= RULES.floor_margin;
        (little && self.fits(&lesser.judged)) || self.more_than_chance(best, lesser).is_none()
    }

    /// The verdict on `best` compared with the best model without effects.
    pub(super) fn concluded(
        &self,
        best: &Hypothesis,
        found: &Found,
        as_given: &HeldOut,
    ) -> Conclusion {
        let bare = &found.bare;
        let effects: Vec<&'static Spec> = best.terms.iter().filter_map(Term::effect).collect();
        let judge = self.judge();
        // Where the given model has the smallest error it is handed over, and the verdict is on it.
        let of_bare = || Conclusion {
            verdict: if self.fits(&bare.judged)
                || (as_given.rmse() < bare.judged.rmse() && self.is_at_noise(as_given))
            {
                Verdict::NothingMissing
            } else {
                Verdict::Unexplained
            },
            model: bare.clone(),
            effects: Vec::new(),
            p_value: None,
        };
        // Effects on a base with a larger error than the given model explain nothing.
        let no_better = best.judged.rmse() >= as_given.rmse();
        if effects.is_empty() || no_better {
            return of_bare();
        }
        let Some(earned) = self.earned(best, found) else {
            return of_bare();
        };
        let left = judge.excess(&best.judged.held_out)
            / judge.excess(&bare.judged.held_out).max(f64::MIN_POSITIVE);
        let taken = 1.0 - left;
        let fits = self.fits(&best.judged);
        let explained = match judge.noise_source {
            NoiseSource::Scatter => taken >= RULES.explained_in_unknown_noise,
            NoiseSource::Measured | NoiseSource::Repeats => {
                taken >= RULES.explained && judge.over_noise(best.judged.rmse()) <= TERMS.much
            }
        };
        let leaner = is_leaner(best, bare);
        let known = judge.noise_source != NoiseSource::Scatter;
        // Near a known noise level any effect with a small gain reaches it.
        let least = if fits || explained {
            RULES.most
        } else {
            RULES.stands_in
        };
        if taken < least && !(fits && (leaner || !known)) {
            return of_bare();
        }
        Conclusion {
            verdict: if fits || explained {
                Verdict::EffectMissing
            } else {
                Verdict::PartlyExplained
            },
            model: best.clone(),
            effects,
            p_value: earned.p_value,
        }
    }
}

/// The test by which effects were named.
struct Earned {
    /// Family-wise p-value; none if they were named for parsimony.
    p_value: Option<f64>,
}

/// Whether effects fit equally well as additional lags, with fewer parameters.
fn is_leaner(best: &Hypothesis, bare: &Hypothesis) -> bool {
    best.judged.rmse() < (1.0 + RULES.alike) * bare.judged.rmse() && best.cost() < bare.cost()
}
