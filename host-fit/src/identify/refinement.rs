//! Output-error refinement: the coefficients refitted on the free run.

use crate::data::{Record, Use};
use crate::fit::{FitOptions, fit};
use crate::model::Model;
use serde::Serialize;

/// Output-error refinement of the coefficients, delays unchanged.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Refinement {
    /// ε over the identify records before and after.
    #[serde(rename = "identify_epsilon")]
    pub identify: (f64, f64),
    /// ε over the validate records before and after; `None` without validate records.
    #[serde(rename = "validate_epsilon")]
    pub validate: Option<(f64, f64)>,
    /// Whether the refined coefficients were kept: the validation ε fell or, without validation records, the
    /// estimation ε.
    pub kept: bool,
}

/// Refines the coefficients on the identify records; keeps them in `model` if the validation ε falls. `None`
/// if the free run diverges.
pub(crate) fn refine(model: &mut Model, data: &[Record]) -> Option<Refinement> {
    let records = model.targets(data);
    let (identify, validate): (Vec<&Record>, Vec<&Record>) =
        records.iter().partition(|r| r.role == Use::Identify);
    let options = FitOptions {
        constant: model.constant != 0.0,
        ..FitOptions::default()
    };
    let refined = fit(model, &identify, &options).ok()?.model;
    let before = epsilon(model, &identify)?;
    let after = epsilon(&refined, &identify)?;
    let held_out = match validate.is_empty() {
        true => None,
        // A model that diverges on validation records is not an improvement.
        false => Some((
            epsilon(model, &validate).unwrap_or(f64::INFINITY),
            epsilon(&refined, &validate).unwrap_or(f64::INFINITY),
        )),
    };
    let (from, to) = held_out.unwrap_or((before, after));
    let kept = to < from;
    if kept {
        *model = refined;
    }
    Some(Refinement {
        identify: (before, after),
        validate: held_out,
        kept,
    })
}

/// ε over records, eq. (9); `None` if a run diverges.
pub(crate) fn epsilon(model: &Model, records: &[&Record]) -> Option<f64> {
    let mut sum = 0.0;
    for record in records {
        let simulated = model.free_run(record).ok()?;
        sum += record
            .y
            .iter()
            .zip(simulated)
            .skip(record.lead)
            .map(|(y, s)| (y - s).powi(2))
            .sum::<f64>();
    }
    Some(sum.sqrt())
}
