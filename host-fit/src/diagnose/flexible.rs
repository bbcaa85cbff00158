//! Curves in place of effects (theory 4.5). Above the noise level an effect can stand for a cause that is not in the
//! catalogue: it must explain the records better than any curve of a coordinate.

use super::session::Session;
use crate::curves::{self, Context, Entry, Place, RULES as CURVES, briefly, diverse};
use crate::parallel;
use crate::terms::{Hypothesis, Term};
use serde::Serialize;

/// The curve in free form that has the most evidence in place of an effect.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Curve {
    /// Where the curve acts.
    pub place: Place,
    /// The coordinate of the curve, in the user's units.
    pub coordinate: String,
    /// ln of the Bayes factor of the model with the effect against the model with the curve, nats. The prior probability
    /// of a curve is 1/(number of curves).
    pub evidence_nats: f64,
}

impl Session<'_> {
    /// Compares the effect `term` with the best curve in its place, on the model `without` it. `own` is ln of the evidence
    /// of the model with the effect. `None` if no curve is defined on the records.
    pub(super) fn against_curves(
        &self,
        term: &Term,
        without: &Hypothesis,
        own: f64,
    ) -> Option<Curve> {
        let name = term.effect()?.name;
        (self.search.progress)(&format!("testing curves instead of {name}"));
        let context = Context::new(self.search, without.judged.model(), 1)?;
        let curves = context.all(&Entry::ALL);
        let prior = (curves.len() as f64).ln();
        let curves = diverse(curves, CURVES.tried);
        let mut curves = briefly(self.search, without, curves);
        curves.truncate(CURVES.finished);
        let evident = parallel::some(curves, |curve| {
            Some((self.evidence_of(&curve.brief.model)? - prior, curve))
        });
        let (most, best) = evident.into_iter().max_by(|a, b| a.0.total_cmp(&b.0))?;
        let curves::Term {
            entry, coordinate, ..
        } = &best.term;
        Some(Curve {
            place: entry.place(),
            coordinate: entry.depends_on(&coordinate.out(&self.units)),
            evidence_nats: own - most,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::diagnose::Options;
    use crate::residual::plants::{base, drift, records};
    use crate::terms::{Bench, Search};
    use model_core::effects::spec;
    use std::sync::Mutex;
    use std::sync::atomic::AtomicBool;

    /// A drift is hidden. A thermal drift explains it better than any curve does; a vortex that stands for it explains it
    /// worse than a curve of the time in the record.
    #[test]
    fn an_effect_is_compared_with_the_best_curve() {
        let mut records = records(&[], &[], 3);
        let given = base(&records);
        drift(&mut records, &[(0.15, 1.5)]);
        let bench = Bench::of(&given, &records).expect("records to learn from");
        let never = AtomicBool::new(false);
        let search = Search::silent(&bench.judge, 1, &never);
        let bare = Hypothesis::new(bench.judge.refitted(&bench.given).expect("stable"));
        let session = Session {
            search: &search,
            units: bench.units,
            options: &Options::default(),
            given: &bench.given,
            as_given: &bare.judged.held_out,
            as_structured: &bare.judged.held_out,
            evidences: Mutex::default(),
        };
        let compared = |name: &str, start: &[f64]| {
            let term = Term::Effect {
                spec: spec(name).expect("in the catalogue"),
                parameters: start.to_vec(),
                grading: bench.given.grading,
                reference: None,
            };
            let with = search.with(&bare, &term, &bench.given).expect("stable");
            let model = with.judged.model();
            let own = session.evidence_of(model).expect("stable");
            session.against_curves(&term, &bare, own).expect("curves")
        };
        let right = compared("thermal-drift", &[0.1, 1.0]);
        assert!(right.evidence_nats > 10.0, "{right:?}");
        let wrong = compared("starting-vortex", &[0.2, 0.05]);
        assert!(wrong.evidence_nats < -100.0, "{wrong:?}");
        assert_eq!(wrong.coordinate, "time in record");
    }
}
