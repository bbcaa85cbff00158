//! Candidate for the delay law (2), from the records.

use super::StepError;
use crate::averages::averaged_past;
use crate::data::{DataSet, Record};
use crate::delay::{DelayOptions, DelayStudy, study_delays};
use crate::fit::lean_base;
use crate::identify::ExponentialDelay;
use crate::model::{Delay, Model};
use model_core::average::WINDOW;
use model_core::effects::StateDependentDelay;

/// Law (2) from the edges; if they do not support one, from a free-run fit with the lowest-order model. `None` if
/// it is negative on the records. The caller tests it against a constant delay.
pub(super) fn candidate_law(
    set: &DataSet,
    learning: &[&Record],
) -> Result<Option<(ExponentialDelay, String)>, StepError> {
    let study = study_delays(set, &DelayOptions::default())?;
    if let Some(law) = law_of_edges(&study) {
        let edges = study.law.as_ref().map_or(0, |law| law.edges);
        return Ok(Some((law, format!("measured on {edges} edges"))));
    }
    let paper = ExponentialDelay::PAPER;
    let values = [paper.floor, paper.rise, paper.rate];
    let template = Model {
        sample_period_s: set.sample_period_s,
        delay: Delay::of::<StateDependentDelay<f64>>(&values, vec![1.0], false),
        ..Model::default()
    };
    let fitted = lean_base(&template, learning)?.model;
    let found = fitted.delay.law::<StateDependentDelay<f64>>();
    let Some(&[floor, rise, rate]) = found.map(|law| law.parameters.as_slice()) else {
        return Ok(None);
    };
    let law = ExponentialDelay { floor, rise, rate };
    let reason = study.law_not_kept.as_deref();
    let reason = reason.unwrap_or("no edge was measured");
    let origin =
        format!("fitted in free run, because the edges alone do not support it ({reason})");
    Ok(is_positive(law, learning).then_some((law, origin)))
}

/// The law of the edges in the model's form.
fn law_of_edges(study: &DelayStudy) -> Option<ExponentialDelay> {
    let law = study.law.as_ref()?;
    let law = ExponentialDelay {
        floor: law.p0.value,
        rise: law.p1.value,
        rate: law.p2.value,
    };
    (law.floor >= 0.0 && law.rate > 0.0).then_some(law)
}

/// Whether a law is at least 0 at the smallest and largest ỹ of the records, and therefore between. ỹ below 0
/// counts as 0.
fn is_positive(law: ExponentialDelay, learning: &[&Record]) -> bool {
    let outputs = learning.iter().flat_map(|r| averaged_past(&r.y, WINDOW));
    let (low, high) = outputs.fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), y| {
        (l.min(y.max(0.0)), h.max(y.max(0.0)))
    });
    [low, high]
        .iter()
        .all(|y| law.floor + law.rise * (-law.rate * y).exp() >= 0.0)
}
