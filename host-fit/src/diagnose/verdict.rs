//! The verdict: whether an effect is missing, and which effects are significant.

use super::certificate::Certificate;
use super::outcome::Conclusion;
use super::session::Session;
use super::{RULES, Verdict};
use crate::parallel;
use crate::residual::{Dependence, FailureCoordinate, NoiseSource, examine};
use crate::terms::{
    Found, HeldOut, HeldOutBy, Hypothesis, Judged, Likelihood, RULES as TERMS, Search, Term,
};
use model_core::effect::Spec;

impl Session<'_> {
    /// Whether an error is at the noise level, within its uncertainty.
    pub(super) fn fits(&self, judged: &Judged) -> bool {
        let judge = self.judge();
        self.is_at_noise(&judged.held_out)
            || (judge.noise_source == NoiseSource::Scatter
                && judge.error_of_motion(&judged.held_out) <= RULES.too_much
                && !self.depends(judged))
    }

    /// Whether an error does not exceed the noise, by a test or within the uncertainty of a known level.
    pub(super) fn is_at_noise(&self, held_out: &HeldOut) -> bool {
        let judge = self.judge();
        judge.p_above_noise(held_out, RULES.floor_margin) >= RULES.level
            || (judge.noise_source != NoiseSource::Scatter
                && judge.over_noise(held_out.rmse()) <= RULES.floor_margin)
    }

    /// Whether `lesser` with a second copy of one of its `effects` fits the records as well as `best`, which has one
    /// effect more. An effect whose equation differs from the catalogue's can look like two copies of it.
    pub(super) fn does_as_well_twice(
        &self,
        effects: &[&'static Spec],
        lesser: &Hypothesis,
        best: &Hypothesis,
    ) -> bool {
        let enough = (1.0 + RULES.worthwhile) * best.judged.rmse();
        effects.iter().any(|spec| {
            (self.search.progress)(&format!(
                "testing a second {} instead of another effect",
                spec.name
            ));
            let twice = self.search.again(lesser, spec, enough);
            twice.is_some_and(|twice| twice.rmse() <= enough)
        })
    }

    /// Whether the error is a function of any coordinate other than its own frequency. An error of which only the
    /// magnitude depends on a coordinate may be noise. Where there are validation records, estimation records count as
    /// well: a few validation records show no dependence.
    fn depends(&self, judged: &Judged) -> bool {
        let judge = self.judge();
        let (mut records, mut runs) = (Vec::new(), Vec::new());
        for (fold, fit) in judge.folds.iter().zip(&judged.fits) {
            let judging = fold.judging.iter().map(|judging| &judging.record);
            let learning = fold
                .learning
                .iter()
                .filter(|_| judge.held_out_by == HeldOutBy::Records);
            for record in judging.chain(learning) {
                let Ok(run) = fit.model.free_run(record) else {
                    return true;
                };
                records.push(record);
                runs.push(run);
            }
        }
        let model = judged.model();
        let failures = examine(&records, runs, model.longest_delay());
        failures
            .by
            .iter()
            .filter(|place| place.coordinate != FailureCoordinate::FrequencyBand)
            .filter(|place| place.dependence != Some(Dependence::Size))
            .any(|place| place.explained_fraction > RULES.depends)
    }

    /// The best hypothesis, without effects that reduce the evidence or that lags replace.
    pub(super) fn named(&self, found: &Found) -> Hypothesis {
        self.without_what_lags_do(self.most_evident(found), &found.root)
    }

    /// Replaces the best hypothesis while another one has more evidence. For each effect three others are compared: the
    /// best hypothesis refitted without the effect, the best result of the search without the effect, and that result
    /// with the effect added.
    fn most_evident(&self, found: &Found) -> Hypothesis {
        let mut best = found.best.clone();
        let Some(likelihood) = Likelihood::of(self.judge(), best.judged.model()) else {
            return best;
        };
        let evidence = |of: &Hypothesis| likelihood.evidence(of.judged.model());
        // If the noise level is known, the validation records decide as well.
        let scatter = self.judge().noise_source == NoiseSource::Scatter;
        let largest = (1.0 + RULES.worthwhile) * best.judged.rmse();
        let may_stand =
            |of: &Hypothesis| (scatter || of.judged.rmse() <= largest) && !of.reaches_a_bound();
        let mut own = evidence(&best);
        loop {
            let effects = best.terms.iter().enumerate();
            let effects: Vec<(usize, &Term)> = effects
                .filter(|(_, term)| term.effect().is_some())
                .collect();
            let others = parallel::each(effects, |(index, term)| {
                let name = term.effect().map_or("", |effect| effect.name);
                let other = Hypothesis::best_without(found.all.iter(), &[name]).cloned();
                let with = other
                    .as_ref()
                    .and_then(|other| self.search.with(other, term, best.judged.model()));
                [self.search.without(&best, index, &found.root), other, with]
            });
            let others = others.into_iter().flatten().flatten().filter(may_stand);
            let others: Vec<Hypothesis> = others.collect();
            let evident = parallel::some(others, |other| Some((evidence(&other)?, other)));
            let count = |of: &Hypothesis| of.terms.iter().filter_map(Term::effect).count();
            match evident.into_iter().max_by(|a, b| a.0.total_cmp(&b.0)) {
                Some((most, other))
                    if own.is_none_or(|own| {
                        most > own || (most >= own && count(&other) < count(&best))
                    }) =>
                {
                    (best, own) = (other, Some(most));
                }
                _ => return best,
            }
        }
    }

    /// `best` without the effects that additional lags replace equally well. Lags are searched again together with
    /// the other effects, because the present lags were found with all effects in the model. An effect that lags do not
    /// replace in a larger model is not tested again in a smaller one. Skipped if the noise level is unknown, because the
    /// error is then not informative.
    fn without_what_lags_do(&self, mut best: Hypothesis, root: &Hypothesis) -> Hypothesis {
        if self.judge().noise_source == NoiseSource::Scatter {
            return best;
        }
        let effects = |of: &Hypothesis| of.terms.iter().filter_map(Term::effect).count();
        let mut open: Vec<&'static str> = best
            .terms
            .iter()
            .filter_map(Term::effect)
            .map(|spec| spec.name)
            .collect();
        while effects(&best) > 1 && !open.is_empty() {
            let lesser = open.iter().filter_map(|name| {
                (self.search.progress)(&format!("testing lags instead of {name}"));
                Some((*name, self.with_lags_instead(&best, name, root)?))
            });
            let lesser: Vec<(&str, Hypothesis)> = lesser.collect();
            open = lesser.iter().map(|(name, _)| *name).collect();
            let by_score =
                |a: &(_, Hypothesis), b: &(_, Hypothesis)| a.1.score().total_cmp(&b.1.score());
            let Some((dropped, with_lags)) = lesser.into_iter().min_by(by_score) else {
                break;
            };
            best = with_lags;
            open.retain(|name| *name != dropped);
        }
        best
    }

    /// `best` with additional lags instead of the effect `name`, if its error is as small.
    fn with_lags_instead(
        &self,
        best: &Hypothesis,
        name: &str,
        root: &Hypothesis,
    ) -> Option<Hypothesis> {
        let is_named = |term: &Term| term.effect().is_some_and(|spec| spec.name == name);
        let index = best.terms.iter().position(is_named)?;
        let lesser = self.search.without(best, index, root)?;
        let is_effect = |term: &Term| term.effect().is_some();
        let (kept, lags) = lesser.terms.into_iter().partition(is_effect);
        let mut from = Hypothesis::new(lesser.judged);
        from.terms = lags;
        // Lags with many more parameters than the effect are not a simpler explanation.
        let bases = Search {
            effects: false,
            most_parameters: from.cost() + best.terms[index].cost() + TERMS.head_start,
            known: self.search.known.clone(),
            ..*self.search
        };
        let mut found = bases.run(from, None).best;
        let mut terms: Vec<Term> = kept;
        terms.append(&mut found.terms);
        found.terms = terms;
        let enough = (1.0 + RULES.worthwhile) * best.judged.rmse();
        (found.judged.rmse() <= enough && !found.reaches_a_bound()).then_some(found)
    }

    /// The error of a hypothesis on the validation samples, fitted as the given model was: to these as well where they are
    /// part of the estimation records.
    pub(super) fn error_as_given(&self, of: &Hypothesis) -> f64 {
        let judge = self.judge();
        if judge.held_out_by == HeldOutBy::Records {
            return of.judged.rmse();
        }
        let end = judge.final_fit(&of.judged);
        let fitted = judge.held_out(|_| &end.model);
        fitted.map_or_else(|_| of.judged.rmse(), |fitted| fitted.rmse())
    }

    /// The verdict on `best` compared with the best model without effects, which may be the given one.
    pub(super) fn concluded(&self, best: &Hypothesis, found: &Found) -> Conclusion {
        let (bare, as_given) = (&found.bare, self.as_given);
        let effects: Vec<&'static Spec> = best.terms.iter().filter_map(Term::effect).collect();
        let judge = self.judge();
        // If the given model has the smallest error, it is the result, and the verdict refers to it.
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
        // Effects on a base model with a larger error than the given model explain nothing, unless the given model
        // imitates them. If the noise level is unknown, no effect is missing if the error of the given model is as small
        // in practice.
        let margin = match judge.noise_source {
            NoiseSource::Scatter => RULES.worthwhile,
            NoiseSource::Measured | NoiseSource::Repeats => 0.0,
        };
        let no_better = (1.0 + margin) * self.error_as_given(best) >= as_given.rmse();
        if effects.is_empty() || (no_better && !self.given_imitates(best)) {
            return of_bare();
        }
        let certificate = (!judge.drifts_more(&best.judged, &bare.judged))
            .then(|| self.certified(best, bare, found))
            .flatten()
            .filter(Certificate::holds);
        let Some(certificate) = certificate else {
            return of_bare();
        };
        // Above the noise level, an effect is missing if it explains most of the unexplained variance of the reference
        // model. The reference is the given model; it is the best model without effects if that has a smaller error or
        // if the given model imitates the effect.
        let as_structured = self.as_structured;
        let is_reference = as_structured.rmse() < bare.judged.rmse() && !self.given_imitates(best);
        let without = match is_reference {
            true => as_structured,
            false => &bare.judged.held_out,
        };
        let taken = 1.0
            - judge.excess(&best.judged.held_out) / judge.excess(without).max(f64::MIN_POSITIVE);
        let fits = self.fits(&best.judged);
        let explained = match judge.noise_source {
            NoiseSource::Scatter => taken >= RULES.explained_in_unknown_noise,
            NoiseSource::Measured | NoiseSource::Repeats => {
                taken >= RULES.explained && judge.over_noise(best.judged.rmse()) <= TERMS.much
            }
        };
        // If a model without the effects is at the noise level already, its small error above the noise is uncertain.
        let least = match self.fits(&bare.judged) {
            true => RULES.most,
            false => RULES.stands_in,
        };
        if certificate.share < least {
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
            p_value: Some(certificate.p_value()),
        }
    }
}
