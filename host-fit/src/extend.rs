//! Addition of physical effects to a model: the search of a diagnosis with these effects in every model.
//!
//! A model without an effect imitates part of it by lags and base terms. Lags and base terms are therefore
//! searched again with the effects, from the lowest order and from the given structure.

use std::collections::BTreeMap;
use std::path::Path;
use std::sync::atomic::{AtomicBool, Ordering};

use crate::data::Record;
use crate::diagnose::{Given, ParameterEstimate, estimates_among, kept_back};
use crate::excitation::bears_little;
use crate::fit::{CandidateError, channel_reference, fit_with_effect};
use crate::model::Model;
use crate::simulate::SimulateError;
use crate::terms::{Bench, Hypothesis, Judged, Search, second_order};
use model_core::effect::Spec;
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

/// A model with effects added.
#[derive(Clone, Debug)]
pub struct Extended {
    /// The model.
    pub model: Model,
    /// Parameters of the added effects: by effect, by name.
    pub parameters: BTreeMap<String, BTreeMap<String, ParameterEstimate>>,
}

/// The message for a name that is not among the `known` ones.
#[must_use]
pub fn nearest_name(name: &str, known: &[&str]) -> String {
    let nearest = known
        .iter()
        .map(|known| (levenshtein(name, known), *known))
        .min();
    let is_file = Path::new(name)
        .extension()
        .is_some_and(|kind| kind == "toml");
    let hint = match nearest {
        _ if is_file => format!(
            " An effect file is given with `--effect-file {}`; `--effect` is the name in it.",
            name.escape_debug()
        ),
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

/// Adds the effects `names` to `model`, and chooses lags and base terms again with them. Records are those of a
/// diagnosis (see [`Model::targets`]), so that `extend` and a diagnosis give the same model.
///
/// # Errors
/// [`ExtendError`]; a missing channel is named, not guessed. After an interrupt there is no result.
pub fn extend(
    model: &Model,
    records: &[Record],
    names: &[String],
    interrupt: &AtomicBool,
    progress: &(dyn Fn(&str) + Sync),
) -> Result<Extended, ExtendError> {
    let specs = effects_for(model, names)?;
    // A validation record without the channel could not be simulated afterwards.
    let all: Vec<&Record> = records.iter().collect();
    for spec in &specs {
        channel_reference(spec, &all)?;
    }
    let chosen_by = kept_back(records).map(|(chosen_by, _)| chosen_by);
    let records = chosen_by.as_deref().unwrap_or(records);
    let bench = Bench::of(model, records).ok_or(ExtendError::NothingToLearnFrom)?;
    let (judge, given, units) = (&bench.judge, &bench.given, &bench.units);
    let search = Search {
        progress,
        ..Search::silent(judge, 0, interrupt)
    };
    let with_effects = |base: &Model| with_all(&search, base, &specs);
    let lean = |frame: &Model| {
        let mut bare = frame.clone();
        bare.effects.retain(|added| !names.contains(&added.name));
        let first = search.root(&bare, bench.mid_run)?;
        let second = second_order(judge, &first, !bare.delay.follows_y());
        let first = with_effects(first.judged.model());
        let second = second.and_then(|second| with_effects(second.judged.model()).ok());
        match (first, second) {
            (Ok(first), Some(second)) if second.size() < first.size() => Ok(second),
            (first, _) => first,
        }
    };
    progress("the given structure with the effects");
    let as_given = with_effects(given);
    let searched = !bears_little(records);
    let as_lean = searched.then(|| {
        progress("the model with the fewest lags and the effects");
        lean(given)
    });
    let (best, alike) = match (as_given, as_lean) {
        (as_given, Some(Ok(as_lean))) => {
            let with = as_given.as_ref().unwrap_or(&as_lean);
            let starts = Given {
                model: with.model(),
                rmse: with.rmse(),
                keeps_lags: false,
                root: &|frame| lean(frame).map(Hypothesis::new),
            };
            let root = Hypothesis::new(as_lean.clone());
            let found = search.thorough(root, &starts).0;
            let alike = found.as_good_as(&found.best).into_iter().cloned().collect();
            (found.best.judged, alike)
        }
        (as_given, _) => (as_given?, Vec::new()),
    };
    // After an interrupt the intermediate result is not the best: no result is returned.
    if interrupt.load(Ordering::Relaxed) {
        return Err(ExtendError::Interrupted);
    }
    let end = judge.final_fit(&best);
    let alike: Vec<&Model> = alike.iter().collect();
    let parameters = specs.iter().map(|spec| {
        let own = estimates_among(&end, &alike, spec, units);
        (spec.name.to_owned(), own)
    });
    Ok(Extended {
        parameters: parameters.collect(),
        model: Model {
            // A control law belongs to the model it was designed for.
            law: None,
            ..units.model_out(&end.model)
        },
    })
}

/// `base` with all effects, refitted. The effects are added one after the other. The first one may be fitted such
/// that it imitates the second, so the reverse order is tried too.
fn with_all(
    search: &Search<'_>,
    base: &Model,
    specs: &[&'static Spec],
) -> Result<Judged, ExtendError> {
    let judge = search.judge;
    let learning = judge.learning(0);
    let in_order = |specs: &mut dyn Iterator<Item = &&'static Spec>| {
        let mut current = base.clone();
        for spec in specs {
            if search.interrupt.load(Ordering::Relaxed) {
                return Err(ExtendError::Interrupted);
            }
            let options = judge.options_for(&current);
            current = fit_with_effect(&current, spec, &learning, &options)?.model;
        }
        Ok(judge.refitted(&current)?)
    };
    let forth = in_order(&mut specs.iter());
    if specs.len() < 2 {
        return forth;
    }
    match (forth, in_order(&mut specs.iter().rev())) {
        (Ok(forth), Ok(back)) if back.rmse() < forth.rmse() => Ok(back),
        (Err(_), back) => back,
        (forth, _) => forth,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_misspelt_effect_is_answered_with_the_nearest() {
        let known = ["valve-lag", "plenum-droop"];
        let text = nearest_name("plenum-drop", &known);
        assert!(text.contains("Did you mean `plenum-droop`?"), "{text}");
        let text = nearest_name("my.toml", &known);
        assert!(text.contains("`--effect-file my.toml`"), "{text}");
        let text = nearest_name("x\n", &known);
        assert!(
            !text.contains("Did you mean") && !text.contains('\n'),
            "{text}"
        );
    }
}
