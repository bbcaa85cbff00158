//! A second copy of an effect. An effect whose equation differs from the catalogue's often looks like two copies:
//! two reservoirs, two time constants of a drift, two lags of a film.

use super::RULES;
use super::hypothesis::Hypothesis;
use super::judge::Judged;
use super::search::Search;
use crate::fit::{Fit, FitOptions, fit, starts};
use crate::order;
use crate::parallel;
use model_core::effect::Spec;

impl Search<'_> {
    /// `hypothesis` with a second copy of one of its effects, fitted from the best starting points of its card.
    /// `None` if it has no effect except a delay law, if no copy is stable, or if the error of every copy is still
    /// far above `enough` after a few iterations.
    pub(crate) fn again(
        &self,
        hypothesis: &Hypothesis,
        spec: &'static Spec,
        enough: f64,
    ) -> Option<Judged> {
        let model = hypothesis.judged.model();
        let own = model.effects.iter().find(|added| added.name == spec.name)?;
        let learning = self.judge.learning(0);
        let starts = starts(model, spec, &learning);
        let mut brief = parallel::some(&starts, |start| {
            let mut twice = model.clone();
            twice.add(spec, start, own.reference);
            let options = FitOptions {
                iterations: RULES.brief,
                ..self.judge.options_for(&twice)
            };
            let begun = fit(&twice, &learning, &options).ok()?;
            let held_out = self.judge.held_out(|_| &begun.model).ok()?;
            (held_out.rmse() < RULES.in_reach * enough).then_some(begun)
        });
        order::ascending(&mut brief, Fit::mean_square);
        brief.truncate(RULES.followed);
        let both = parallel::some(&brief, |begun| self.judge.refitted(&begun.model).ok());
        both.into_iter()
            .min_by(|a, b| a.rmse().total_cmp(&b.rmse()))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::residual::plants::{base, drift, long_records};
    use crate::terms::Bench;
    use model_core::effects::spec;
    use std::sync::atomic::AtomicBool;

    /// A drift with two exponential parts, of 0.6 s and 5 s.
    #[test]
    fn a_drift_of_two_time_constants_is_two_drifts() {
        let mut records = long_records(&[], &[], 3);
        let given = base(&records);
        drift(&mut records, &[(0.10, 0.6), (0.12, 5.0)]);
        let bench = Bench::of(&given, &records).expect("records to learn from");
        let never = AtomicBool::new(false);
        let search = Search::silent(&bench.judge, 4, &never);
        let exponential = spec("thermal-drift").expect("in the catalogue");
        let mut one = bench.given.clone();
        one.add(exponential, &[0.2, 2.0], None);
        let one = Hypothesis::new(bench.judge.refitted(&one).expect("stable"));
        let over = |rmse: f64| bench.judge.over_noise(rmse);
        assert!(
            over(one.judged.rmse()) > 1.15,
            "{}",
            over(one.judged.rmse())
        );
        let own = one.judged.rmse();
        let two = search.again(&one, exponential, own).expect("stable");
        assert!(over(two.rmse()) < 1.03, "{}", over(two.rmse()));
        assert!(search.again(&one, exponential, 0.2 * own).is_none());
        let echo = spec("echo-path").expect("in the catalogue");
        assert!(search.again(&one, echo, own).is_none());
    }
}
