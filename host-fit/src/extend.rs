//! Addition of physical effects to a model with a full refit.
//!
//! A model of high order imitates part of a missing effect. The effects are therefore added to the given
//! structure and to the one of lowest order, and the better of the two is kept; if both fit equally well, the
//! one with fewer parameters.

use std::collections::BTreeMap;
use std::sync::atomic::{AtomicBool, Ordering};

use crate::data::{Record, Use};
use crate::diagnose::ParameterEstimate;
use crate::fit::{
    CandidateError, Fit, FitOptions, RULES, channel_reference, fit, fit_with_effect, lean_base,
    pieces_of,
};
use crate::model::{Model, Start};
use crate::preparation::Preparation;
use crate::simulate::SimulateError;
use crate::terms::{Units, restarted};
use model_core::effect::Spec;
use serde::Serialize;
use strsim::levenshtein;
use thiserror::Error;

/// Why a model was not extended.
#[derive(Clone, Debug, Error)]
#[non_exhaustive]
pub enum ExtendError {
    /// No effect of this name in the catalogue or in the user's effect files.
    #[error("{}", nearest_name(.name, .known))]
    Unknown {
        /// The name.
        name: String,
        /// All known effects: the catalogue's and the user's own.
        known: Vec<&'static str>,
    },
    /// The effect is in the model, or was named twice.
    #[error(
        "effect `{0}` is in the model already; each effect can be in it once. Leave out this `--effect`."
    )]
    Doubled(String),
    /// No estimation record for the refit.
    #[error(
        "the data set has no `identify` record to refit the model on. \
         Set `use = \"identify\"` for at least one record in dataset.toml."
    )]
    NothingToLearnFrom,
    /// Interrupted by the user.
    #[error("the refit was interrupted before it had a result; nothing was written.")]
    Interrupted,
    /// No structure could be fitted with the effects.
    #[error(transparent)]
    Candidate(#[from] CandidateError),
    /// The model cannot be run on the data.
    #[error(transparent)]
    Simulate(#[from] SimulateError),
}

/// Which structure the effects were added to.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum StructureKept {
    /// The structure of the given model.
    Given,
    /// The lowest order: one lag each and one input.
    Lean,
}

/// A model with effects added.
#[derive(Clone, Debug)]
pub struct Extended {
    /// The model.
    pub model: Model,
    /// The structure to which the effects were added.
    pub structure: StructureKept,
    /// Parameters of the added effects: by effect, by name.
    pub parameters: BTreeMap<String, BTreeMap<String, ParameterEstimate>>,
    /// Root mean square error of the free run on the identify records, y.
    pub identify_rmse: f64,
}

/// The message for a name that is not among the `known` ones.
#[must_use]
pub fn nearest_name(name: &str, known: &[&str]) -> String {
    let nearest = known
        .iter()
        .map(|known| (levenshtein(name, known), *known))
        .min();
    let hint = match nearest {
        Some((edits, nearest)) if edits <= 1 + nearest.len() / 3 => {
            format!(" Did you mean `{nearest}`?")
        }
        _ => String::new(),
    };
    format!(
        "there is no effect `{}` in the catalogue.{hint} The effects are: {}; `host-fit effects` explains them.",
        name.escape_debug(),
        known.join(", ")
    )
}

/// The effects with these `names`, none of which `model` may contain yet: from the catalogue, or user effects
/// of the model.
///
/// # Errors
/// [`ExtendError::Unknown`] and [`ExtendError::Doubled`].
pub fn effects_for(model: &Model, names: &[String]) -> Result<Vec<&'static Spec>, ExtendError> {
    let mut present = model.effect_names();
    let mut specs = Vec::new();
    for name in names {
        let found = model.spec(name).ok_or_else(|| ExtendError::Unknown {
            name: name.clone(),
            known: model.candidates().map(|spec| spec.name).collect(),
        })?;
        if present.contains(name) {
            return Err(ExtendError::Doubled(name.clone()));
        }
        present.push(name.clone());
        specs.push(found);
    }
    Ok(specs)
}

/// Adds the effects `names` to `model` and refits all parameters to the identify records among `records` (see
/// [`Model::targets`]).
///
/// # Errors
/// [`ExtendError`]; a missing channel is named, not guessed. `interrupt` is checked between fits.
pub fn extend(
    model: &Model,
    records: &[Record],
    names: &[String],
    interrupt: &AtomicBool,
) -> Result<Extended, ExtendError> {
    let specs = effects_for(model, names)?;
    // Cards are written for y of order 1 and 1 ms a sample, as for a diagnosis.
    let prepared = Preparation::of(records);
    let units = Units::of(model, &prepared);
    let records = units.records_in(&prepared.records);
    let (model, records) = (&units.model_in(model), records.as_slice());
    let learning: Vec<&Record> = records.iter().filter(|r| r.role == Use::Identify).collect();
    if learning.is_empty() {
        return Err(ExtendError::NothingToLearnFrom);
    }
    // A validation record without the channel could not be simulated afterwards.
    let all: Vec<&Record> = records.iter().collect();
    for spec in &specs {
        channel_reference(spec, &all)?;
    }
    let options = FitOptions {
        constant: model.constant != 0.0,
        ..FitOptions::default()
    };
    let cut: Vec<Record>;
    let learning = match restarted(model, records, prepared.reference.as_ref()) {
        Some(samples) => {
            cut = pieces_of(learning, samples);
            cut.iter().collect()
        }
        None => learning,
    };
    let with_each = |base: &Model, specs: &mut dyn Iterator<Item = &&'static Spec>| {
        let mut current = base.clone();
        let mut last = None;
        for spec in specs {
            if interrupt.load(Ordering::Relaxed) {
                return Err(ExtendError::Interrupted);
            }
            let fitted = fit_with_effect(&current, spec, &learning, &options)?;
            current = fitted.model.clone();
            last = Some(fitted);
        }
        match last {
            // Effects added one by one are refitted together.
            Some(fitted) if names.len() == 1 => Ok(fitted),
            _ if interrupt.load(Ordering::Relaxed) => Err(ExtendError::Interrupted),
            _ => Ok::<Fit, ExtendError>(fit(&current, &learning, &options)?),
        }
    };
    // The first of two effects may be fitted to imitate the second and stay there: both orders are tried.
    let with_all = |base: Model| {
        let forth = with_each(&base, &mut specs.iter());
        if specs.len() < 2 {
            return forth;
        }
        match (forth, with_each(&base, &mut specs.iter().rev())) {
            (Ok(forth), Ok(back)) if back.mean_square() < forth.mean_square() => Ok(back),
            (Err(_), back) => back,
            (forth, _) => forth,
        }
    };
    let given = with_all(model.clone());
    let lean = if model.start == Start::Rest && !interrupt.load(Ordering::Relaxed) {
        lean_structure(model, &learning, &options).and_then(with_all)
    } else {
        Err(ExtendError::NothingToLearnFrom)
    };
    // After an interrupt the intermediate result is not the best: no result is returned.
    if interrupt.load(Ordering::Relaxed) {
        return Err(ExtendError::Interrupted);
    }
    let (fitted, structure) = match (given, lean) {
        (Ok(given), Ok(lean)) => {
            let as_good = given.mean_square() * RULES.as_good * RULES.as_good;
            if lean.mean_square() <= as_good {
                (lean, StructureKept::Lean)
            } else {
                (given, StructureKept::Given)
            }
        }
        (Ok(given), Err(_)) => (given, StructureKept::Given),
        (Err(_), Ok(lean)) => (lean, StructureKept::Lean),
        (Err(error), Err(_)) => return Err(error),
    };
    let parameters = specs.iter().map(|spec| {
        let own = crate::diagnose::estimates(&fitted, spec, &units);
        (spec.name.to_owned(), own)
    });
    Ok(Extended {
        structure,
        parameters: parameters.collect(),
        identify_rmse: units.y * fitted.mean_square().sqrt(),
        model: Model {
            // A control law belongs to the model it was designed for.
            law: None,
            ..units.model_out(&fitted.model)
        },
    })
}

/// The lowest-order structure with the effects of `model`.
fn lean_structure(
    model: &Model,
    learning: &[&Record],
    options: &FitOptions,
) -> Result<Model, ExtendError> {
    let mut bare = model.clone();
    let kept = std::mem::take(&mut bare.effects);
    let lean = lean_base(&bare, learning)?;
    if kept.is_empty() {
        return Ok(lean.model);
    }
    let with_kept = Model {
        effects: kept,
        ..lean.model
    };
    Ok(fit(&with_kept, learning, options)?.model)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_misspelt_effect_is_answered_with_the_nearest() {
        let known = ["valve-lag", "plenum-droop"];
        let text = nearest_name("plenum-drop", &known);
        assert!(text.contains("Did you mean `plenum-droop`?"), "{text}");
        let text = nearest_name("x\n", &known);
        assert!(
            !text.contains("Did you mean") && !text.contains('\n'),
            "{text}"
        );
    }
}
