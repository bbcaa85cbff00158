//! The law of the delay, taken from the records themselves.

use super::StepError;
use crate::data::{DataSet, Record};
use crate::delay::{DelayOptions, DelayVerdict, study_delays};
use crate::fit::lean_base;
use crate::identify::ExponentialDelay;
use crate::model::{Delay, Model};
use model_core::effects::StateDependentDelay;

/// Law (2) from the edges; where they do not bear one out, from the free run of the leanest model.
pub(super) fn measured_law(
    set: &DataSet,
    learning: &[&Record],
    remarks: &mut Vec<String>,
) -> Result<ExponentialDelay, StepError> {
    let study = study_delays(set, &DelayOptions::default())?;
    let borne_out = matches!(
        study.verdict,
        DelayVerdict::StateDependent | DelayVerdict::EdgeAndStateDependent
    );
    if let Some(law) = study.law.as_ref().filter(|_| borne_out) {
        let measured = ExponentialDelay {
            floor: law.p0.value,
            rise: law.p1.value,
            rate: law.p2.value,
        };
        if measured.floor >= 0.0 && measured.rate > 0.0 {
            remarks.push(format!("delay law measured on {} edges", law.edges));
            return Ok(measured);
        }
    }
    let template = Model {
        sample_period_s: set.sample_period_s,
        delay: Delay::of::<StateDependentDelay<f64>>(
            &[
                ExponentialDelay::PAPER.floor,
                ExponentialDelay::PAPER.rise,
                ExponentialDelay::PAPER.rate,
            ],
            vec![1.0],
            false,
        ),
        ..Model::default()
    };
    let lean = lean_base(&template, learning)?;
    remarks.push(format!(
        "the edges bear no state-dependent law out ({}): it was fitted in free run instead",
        study.words
    ));
    let law = lean.model.delay.law::<StateDependentDelay<f64>>();
    match law.map(|law| law.parameters.as_slice()) {
        Some(&[floor, rise, rate]) => Ok(ExponentialDelay { floor, rise, rate }),
        _ => Err(StepError::NoDelayLaw),
    }
}
