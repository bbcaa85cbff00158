//! A diagnosis in progress: from the result of the search to the final answer.

use super::alternatives::Set;
use super::certificate::Certificate;
use super::estimate::{estimates_among, is_identified};
use super::memory::memory;
use super::outcome::Conclusion;
use super::ranking::{Rival, not_tried, rivals};
use super::{DiagnoseError, Diagnosis, Options, RULES, Rung, Verdict};
use crate::model::Model;
use crate::parallel;
use crate::residual::NoiseSource;
use crate::terms::{
    Found, HeldOut, Hypothesis, Judge, Judged, Likelihood, Search, Term, Units, p_value,
};
use model_core::effect::Spec;
use std::collections::BTreeMap;
use std::sync::Mutex;

/// A diagnosis in progress.
pub(super) struct Session<'a> {
    pub(super) search: &'a Search<'a>,
    pub(super) units: Units,
    pub(super) options: &'a Options,
    /// The given model.
    pub(super) given: &'a Model,
    /// Validation error of the given model.
    pub(super) as_given: &'a HeldOut,
    /// Validation error of its structure. Where the validation samples are part of the estimation records, the given model
    /// was fitted to them, and its structure is refitted without them, as every hypothesis is.
    pub(super) as_structured: &'a HeldOut,
    /// ln of the evidence of models, nats, for those models that were compared so far.
    pub(super) evidences: Mutex<Vec<(Model, Option<f64>)>>,
}

/// The ladder from the first effect to the last.
struct Way {
    /// The effects, the most important first.
    order: Vec<&'static Spec>,
    /// One step of the ladder for each effect; a step contains the effects before it.
    rungs: Vec<Rung>,
    /// Number of significant effects. Effects that a second copy of another effect replaces, and effects whose
    /// parameters are not identifiable, are not counted.
    proven: usize,
    /// The step with fewer effects and the least error, if that is clearly smaller than the error of the model with all
    /// effects, which then has not converged.
    better: Option<Hypothesis>,
}

/// A base model, and the result of adding each effect to it.
pub(super) struct Compared {
    pub(super) context: Hypothesis,
    pub(super) others: Vec<Rival>,
}

impl Compared {
    /// The best model with one effect.
    fn best_alone(&self) -> Option<&Hypothesis> {
        let effects = self.others.iter().filter(|rival| rival.spec.is_some());
        let alone = effects.filter_map(|rival| rival.refitted.as_ref());
        alone.min_by(|a, b| a.score().total_cmp(&b.score()))
    }
}

impl Session<'_> {
    pub(super) fn judge(&self) -> &Judge {
        self.search.judge
    }

    /// The step of the ladder for `judged`.
    pub(super) fn rung(&self, judged: &Judged, effects: &[String], step: &str) -> Rung {
        let (judge, units) = (self.judge(), &self.units);
        let end = judge.final_fit(judged);
        let held_out = judge.handed_over(judged, &end.model);
        let model = units.model_out(&end.model);
        Rung::of(judge, units, &held_out, effects, step, Some(model))
    }

    /// The given model's own structure, for users who chose lags and delays themselves. The product u·y is added if
    /// it is missing and lowers the error, because it belongs to the base class and never counts as a missing
    /// effect.
    pub(super) fn root_of_given(&self) -> Result<(Hypothesis, &'static str), DiagnoseError> {
        let (given, as_given) = (self.given, self.as_given);
        let plain = self.judge().refitted(given)?;
        if given.product_lags.is_empty() {
            let bilinear = Model {
                product_lags: vec![1],
                c: vec![0.0; given.b.len()],
                ..plain.model().clone()
            };
            if let Ok(bilinear) = self.judge().refitted(&bilinear) {
                let before = plain.rmse().min(as_given.rmse());
                let gain = 1.0 - bilinear.rmse() / before;
                let p = p_value(&plain.held_out, &bilinear.held_out);
                if gain > RULES.worthwhile && p < RULES.level {
                    return Ok((
                        Hypothesis::new(bilinear),
                        "refitted with the product of input and output",
                    ));
                }
            }
        }
        Ok((Hypothesis::new(plain), "refitted in free run"))
    }

    pub(super) fn conclude(
        &self,
        found: Found,
        first: [Rung; 2],
        restarted_s: Option<f64>,
    ) -> Diagnosis {
        let (search, judge, units) = (self.search, self.judge(), &self.units);
        let named = self.named(&found);
        (search.progress)("testing equivalent candidates");
        let mut compared = self.compared(&named, &found);
        // One effect alone may give a smaller error than all effects found together.
        let alone = compared.best_alone();
        let alone = alone.filter(|alone| alone.score() < named.score());
        let concluded = |best: &Hypothesis| self.concluded(best, &found);
        let mut conclusion = alone
            .map(concluded)
            .filter(|conclusion| !conclusion.effects.is_empty())
            .unwrap_or_else(|| concluded(&named));
        // A fit with fewer effects may have converged further; then it is the result.
        let mut way = loop {
            let mut way = self.way(&conclusion, &found.root);
            match way.better.take() {
                Some(better) => conclusion = concluded(&better),
                None => break way,
            }
        };
        // If the most important effect may not be named and the given model is as good without the effects, or at the
        // noise level, the given model is the answer.
        let is_as_good = |other: &Hypothesis| {
            self.is_at_noise(self.as_given)
                || self.as_given.rmse() <= (1.0 + RULES.worthwhile) * self.error_as_given(other)
        };
        if conclusion.verdict == Verdict::EffectMissing
            && is_as_good(&conclusion.model)
            && !self.first_has_a_name(&conclusion.model, &way, &compared, &found)
        {
            let explained =
                self.fits(&conclusion.model.judged) || judge.noise_source == NoiseSource::Scatter;
            conclusion = concluded(&found.bare);
            if explained {
                conclusion.verdict = Verdict::NothingMissing;
            }
            way = self.way(&conclusion, &found.root);
        }
        let Conclusion {
            verdict,
            model: last,
            effects,
            p_value,
        } = conclusion;
        if effects.is_empty() && !named.is_bare() {
            compared = self.compared(&last, &found);
        }
        let Compared { context, others } = &compared;
        let claims = verdict == Verdict::EffectMissing;
        let order = way.order;
        let refitted = first[1].step.clone();
        let mut ladder = first.to_vec();
        if !context.terms.is_empty() {
            let step = format!("with {}", context.words());
            ladder.push(self.rung(&context.judged, &[], &step));
        }
        ladder.extend(way.rungs);
        // Surrogates are not named, and no experiment is proposed for them.
        let told = if claims { way.proven } else { order.len() };
        let mut sets = self.sets(&last, &order, told, &compared, &found.root);
        let alternatives: Vec<Model> = sets
            .iter()
            .flat_map(|set| &set.others)
            .map(|(_, model)| units.model_out(model))
            .collect();
        let end = judge.final_fit(&last.judged);
        let model = units.model_out(&end.model);
        // The ladder ends with the final model.
        if order.is_empty() && ladder.last().and_then(|rung| rung.model.as_ref()) != Some(&model) {
            let step = match last.terms.is_empty() {
                true if found.root.is_given() => "the given model, refitted".to_owned(),
                true => refitted,
                false => format!("with {}", last.words()),
            };
            ladder.pop_if(|rung| rung.step == step);
            ladder.push(self.rung(&last.judged, &[], &step));
        }
        let alike = found.as_good_as(&last);
        let parameters: BTreeMap<_, _> = order
            .iter()
            .map(|spec| {
                let estimates = estimates_among(&end, &alike, spec, units);
                (spec.name.to_owned(), estimates)
            })
            .collect();
        (search.progress)("computing the evidence of the models");
        let subject = if !order.is_empty() {
            &last
        } else if !named.is_bare() {
            &named
        } else {
            &found.best
        };
        let certificates = self.certificates(subject, &sets, others, &found, !order.is_empty());
        // The first effect whose certificate does not permit a name, and all after it, are surrogates.
        let remains = judge.noise_source != NoiseSource::Scatter
            && judge.over_noise(last.judged.rmse()) > RULES.floor_margin;
        let holds = |spec: &&&'static Spec| {
            let own = certificates.get(spec.name);
            own.is_none_or(|own| own.permits_a_name(remains))
        };
        let evident = order.iter().take(way.proven).take_while(holds).count();
        let is_known = |spec: &&&'static Spec| is_identified(&parameters[spec.name], spec);
        let known = order.iter().take_while(is_known).count();
        let decided = decided(&order, last.judged.model());
        let proven = if claims {
            evident.min(known).min(decided)
        } else {
            0
        };
        let (verdict, claims) = match claims && proven == 0 {
            true => (Verdict::PartlyExplained, false),
            false => (verdict, claims),
        };
        let named_sets = sets.iter().take(proven);
        let likelihood = claims.then(|| Likelihood::of(judge, last.judged.model()));
        let likelihood = likelihood.flatten();
        let posterior = |set: &Set| {
            let all = likelihood.as_ref()?;
            Some(set.posterior(all, &last.judged))
        };
        let posterior = named_sets
            .map(|set| posterior(set).unwrap_or_default())
            .collect();
        let mut ranking = self.ranked(context, others, &found);
        for entry in &mut ranking {
            // The ranking shows the parameters of the final model, and of the equivalences only those that hold
            // for that model.
            if let Some(own) = parameters.get(&entry.effect) {
                entry.parameters.clone_from(own);
                let set = sets.iter().find(|set| set.effect.name == entry.effect);
                entry.confounded_with = set.map(|s| s.names()[1..].to_vec()).unwrap_or_default();
            }
        }
        let separated: Vec<String> = {
            let mut names: Vec<String> = Vec::new();
            for set in sets.iter().filter(|set| !set.others.is_empty()) {
                let others = set.others.iter().map(|(name, _)| name.as_str());
                for name in std::iter::once(set.effect.name).chain(others) {
                    if !names.iter().any(|met| met == name) {
                        names.push(name.to_owned());
                    }
                }
            }
            names
        };
        let separation = self.separation(&model, alternatives, separated);
        let mut missing: Vec<String> = order.iter().map(|spec| spec.name.to_owned()).collect();
        let stand_ins = missing.split_off(proven);
        sets.truncate(proven);
        let is_certified = |name: &String| {
            let spec = order.iter().find(|spec| spec.name == name.as_str());
            let certificate = certificates.get(name);
            spec.is_some_and(|spec| is_identified(&parameters[spec.name], spec))
                && certificate.is_some_and(Certificate::holds_beside_others)
        };
        let certified = stand_ins
            .iter()
            .take(decided - proven)
            .filter(|_| verdict == Verdict::PartlyExplained);
        let certified = certified.filter(|name| is_certified(name));
        let certified: Vec<String> = certified.cloned().collect();
        let parsimony = self.parsimony(&last, if claims { &missing } else { &certified });
        Diagnosis {
            verdict,
            sets: sets.iter().map(Set::names).collect(),
            missing,
            stand_ins,
            certified,
            memory: memory(&model),
            tried: found.tried,
            held_out_by: judge.held_out_by,
            quoted: None,
            restarted_s,
            noise_source: judge.noise_source,
            noise_estimate: judge.measured_noise_rmse() * units.y,
            level_scatter: judge.level_scatter(),
            ladder,
            candidates_base_rmse: context.judged.held_out.measured_rmse() * units.y,
            ranking,
            parameters,
            evidence_nats: self.evidence_of(last.judged.model()),
            certificates,
            parsimony,
            posterior,
            not_tried: not_tried(search, found.root.judged.model()),
            separation,
            p_value,
            base: units.model_out(&judge.final_fit(&found.bare.judged).model),
            model,
        }
    }

    /// Whether the most important effect has a certificate and parameters that the records determine.
    fn first_has_a_name(
        &self,
        model: &Hypothesis,
        way: &Way,
        compared: &Compared,
        found: &Found,
    ) -> bool {
        let sets = self.sets(model, &way.order, way.proven, compared, &found.root);
        let certificates = self.certificates(model, &sets, &compared.others, found, true);
        way.order.first().is_none_or(|first| {
            let fit = self.judge().final_fit(&model.judged);
            let estimates = estimates_among(&fit, &found.as_good_as(model), first, &self.units);
            let own = certificates.get(first.name);
            own.is_none_or(Certificate::holds) && is_identified(&estimates, first)
        })
    }

    /// The effect that lowers the error of `hypothesis` the least, and the hypothesis refitted without it. A measured
    /// channel is a cause on record: it goes after all effects that nobody measured.
    fn without_the_least(
        &self,
        hypothesis: &Hypothesis,
        root: &Hypothesis,
    ) -> Option<(&'static Spec, Hypothesis)> {
        let model = hypothesis.judged.model();
        let effects = hypothesis.terms.iter().enumerate();
        let effects = effects.filter_map(|(index, term)| Some((index, term.effect()?)));
        let (measured, unmeasured): (Vec<_>, Vec<_>) =
            effects.partition(|(_, spec)| model.is_of_a_channel(spec.name));
        let open = if unmeasured.is_empty() {
            measured
        } else {
            unmeasured
        };
        let without = |(index, spec): (usize, &'static Spec)| {
            Some((spec, self.search.without(hypothesis, index, root)?))
        };
        let lesser = parallel::some(open, without);
        let size = |one: &(_, Hypothesis)| one.1.judged.rmse();
        lesser
            .into_iter()
            .min_by(|a, b| size(a).total_cmp(&size(b)))
    }

    /// A hypothesis without its effects, and all candidates on that model.
    fn compared(&self, with: &Hypothesis, found: &Found) -> Compared {
        let effects = with.terms.iter().filter_map(Term::effect);
        let names: Vec<&str> = effects.map(|spec| spec.name).collect();
        let without = self.search.without_effects(with, &found.root, |_| true);
        // The lags of a model without effects may make its free run unstable.
        let context = if without.is_bare() {
            without
        } else {
            found.bare.clone()
        };
        let others = rivals(self.search, &context, &names);
        Compared { context, others }
    }

    /// The ladder from no effect to the model of the conclusion, with one more of its effects at each step, the least
    /// important last. The significance of each is tested only if effects are claimed.
    fn way(&self, conclusion: &Conclusion, root: &Hypothesis) -> Way {
        let last = &conclusion.model;
        let claims = conclusion.verdict == Verdict::EffectMissing;
        let mut left = conclusion.effects.clone();
        let mut current = last.clone();
        let mut later: Vec<(&'static Spec, Hypothesis)> = Vec::new();
        let (mut unproven, mut better) = (0, None);
        while left.len() > 1 {
            let Some((spec, lesser)) = self.without_the_least(&current, root) else {
                break;
            };
            let least = better.as_ref().map_or(
                (1.0 - RULES.worthwhile) * last.judged.rmse(),
                |better: &Hypothesis| better.judged.rmse(),
            );
            if lesser.judged.rmse() < least {
                better = Some(lesser.clone());
            }
            left.retain(|other| other.name != spec.name);
            let stands_in = || self.does_as_well_twice(&left, &lesser, &current);
            if claims && unproven == later.len() && stands_in() {
                unproven += 1;
            }
            later.push((spec, std::mem::replace(&mut current, lesser)));
        }
        let mut names: Vec<String> = left.iter().map(|spec| spec.name.to_owned()).collect();
        let mut rungs = Vec::new();
        if let Some(first) = names.last() {
            rungs.push(self.rung(&current.judged, &names, &format!("with {first}")));
        }
        for (spec, with) in later.iter().rev() {
            names.push(spec.name.to_owned());
            rungs.push(self.rung(&with.judged, &names, &format!("with {}", spec.name)));
        }
        left.extend(later.iter().rev().map(|(spec, _)| *spec));
        Way {
            proven: left.len() - unproven,
            order: left,
            rungs,
            better,
        }
    }
}

/// How many effects of `order` can be named. The base was identified without the measured channels that lead; what follows
/// them is decided when it is identified with them.
fn decided(order: &[&'static Spec], model: &Model) -> usize {
    let of_a_channel = |spec: &&&Spec| model.is_of_a_channel(spec.name);
    match order.iter().take_while(of_a_channel).count() {
        0 => order.len(),
        leading => leading,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::residual::plants::{base, base_with_channel, drift, records};
    use crate::terms::Bench;
    use model_core::effects::spec;
    use std::sync::atomic::AtomicBool;

    #[test]
    fn what_follows_a_measured_channel_is_decided_later() {
        let model = base_with_channel("q");
        let known = |name: &str| model.spec(name).expect("known");
        let [lag, drift] = ["valve-lag", "thermal-drift"].map(known);
        let [input, scaled] = ["input-q", "scaled-by-q"].map(known);
        let of = |order: &[&'static Spec]| decided(order, &model);
        assert_eq!(of(&[scaled, lag, drift]), 1);
        assert_eq!(of(&[input, scaled, lag]), 2);
        assert_eq!(of(&[lag, scaled, drift]), 3);
        assert_eq!(of(&[lag, drift]), 2);
        assert_eq!(of(&[]), 0);
    }

    /// A drift is hidden. A vortex in the same model has an amplitude whose interval contains 0. The uncertainty
    /// must be attributed to the vortex.
    #[test]
    fn doubts_about_one_effect_are_no_doubts_about_another() {
        let mut records = records(&[], &[], 3);
        let given = base(&records);
        drift(&mut records, &[(0.15, 1.5)]);
        let bench = Bench::of(&given, &records).expect("records to learn from");
        let options = Options::default();
        let never = AtomicBool::new(false);
        let search = Search::silent(&bench.judge, 4, &never);
        let with = |effects: &[(&str, &[f64])]| {
            let mut model = bench.given.clone();
            for (name, start) in effects {
                model.add(spec(name).expect("in the catalogue"), start, None);
            }
            let judged = bench.judge.refitted(&model).expect("stable");
            let term = |(name, start): &(&str, &[f64])| Term::Effect {
                spec: spec(name).expect("in the catalogue"),
                parameters: start.to_vec(),
                grading: bench.given.grading,
                reference: None,
            };
            let mut with = Hypothesis::new(judged);
            with.terms = effects.iter().map(term).collect();
            with
        };
        let bare = with(&[]);
        let found = bare.clone().alone();
        let drifting = ("thermal-drift", [0.1, 1.0].as_slice());
        let both = with(&[drifting, ("stopping-vortex", &[0.001, 0.03])]);
        let session = |as_given| Session {
            search: &search,
            units: bench.units,
            options: &options,
            given: &bench.given,
            as_given,
            as_structured: as_given,
            evidences: Mutex::default(),
        };
        let as_given = &bare.judged.held_out;
        let searched = Found {
            all: vec![bare.clone(), both.clone()],
            best: both,
            ..found.clone()
        };
        let usual = session(as_given);
        let claimed = usual.concluded(&usual.named(&searched), &searched);
        let names: Vec<&str> = claimed.effects.iter().map(|spec| spec.name).collect();
        assert_eq!(names, ["thermal-drift"]);
        assert_eq!(claimed.verdict, Verdict::EffectMissing);
        // A model that has not converged with both effects gives way to the one with the drift alone.
        let mut stuck = searched.best.clone();
        stuck.judged.held_out = bare.judged.held_out.clone();
        let drift_and = |model: &Hypothesis| Conclusion {
            verdict: Verdict::EffectMissing,
            model: model.clone(),
            effects: model.terms.iter().filter_map(Term::effect).collect(),
            p_value: None,
        };
        let better = |model| usual.way(&drift_and(model), &found.root).better;
        assert!(better(&searched.best).is_none());
        let better = better(&stuck).expect("the drift alone");
        assert_eq!(better.words(), "thermal-drift");
        // The verdict refers to the resulting model: nothing is missing in a given model at the noise level.
        let verdict = |session: Session<'_>| session.concluded(&bare, &found).verdict;
        assert_eq!(verdict(usual), Verdict::Unexplained);
        let drifts = &claimed.model.judged.held_out;
        assert_eq!(verdict(session(drifts)), Verdict::NothingMissing);
    }
}
