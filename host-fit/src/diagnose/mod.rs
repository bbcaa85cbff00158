//! Which physical effect is missing.
//!
//! The search over [`terms`](crate::terms) finds the best model with effects and the best without. This module
//! decides on the verdict: whether an effect is missing, its name, its equivalence set, and the confidence.

mod alternatives;
mod certificate;
mod estimate;
mod flexible;
mod memory;
mod outcome;
mod quoted;
mod ranking;
mod rules;
mod session;
mod thorough;
mod verdict;

pub use crate::terms::HeldOutBy;
pub use certificate::{Certificate, Parsimony};
pub use estimate::ParameterEstimate;
pub(crate) use estimate::estimates_among;
pub use flexible::Curve;
pub use memory::Memory;
pub use outcome::{Diagnosis, NotTried, Ranked, Rung, Verdict};
pub use quoted::Quoted;
pub(crate) use quoted::kept_back;
pub use ranking::{FLOW_LAG, FLOW_MEMORY};
pub use rules::{RULES, Rules};
pub(crate) use thorough::Given;

use crate::data::Record;
use crate::excitation::bears_little;
use crate::model::Model;
use crate::simulate::SimulateError;
use crate::terms::{Bench, Hypothesis, Known, Search};
use session::Session;
use std::sync::Mutex;
use std::sync::atomic::{AtomicBool, Ordering};
use thiserror::Error;

/// Why there is no diagnosis.
#[derive(Clone, Debug, Error)]
#[non_exhaustive]
pub enum DiagnoseError {
    /// No estimation record.
    #[error(
        "the data set has no `identify` record to refit the model on. \
         Set `use = \"identify\"` for at least one record in dataset.toml."
    )]
    NothingToLearnFrom,
    /// The model cannot be run on the data.
    #[error(transparent)]
    Simulate(#[from] SimulateError),
    /// The user stopped the diagnosis.
    #[error("the search was interrupted before it had a result; nothing was written.")]
    Interrupted,
}

/// Options of a diagnosis.
#[derive(Clone, Debug)]
pub struct Options {
    /// Largest number of effects added one after the other.
    pub most_effects: usize,
    /// Seed of the search for the command that distinguishes candidates.
    pub seed: u64,
}

impl Default for Options {
    fn default() -> Self {
        Self {
            most_effects: 4,
            seed: 0,
        }
    }
}

/// Diagnoses `given` on `records`. `progress` receives messages on the candidate that is being tried.
///
/// # Errors
/// [`DiagnoseError`].
pub fn diagnose(
    given: &Model,
    records: &[Record],
    options: &Options,
    interrupt: &AtomicBool,
    progress: &(dyn Fn(&str) + Sync),
) -> Result<Diagnosis, DiagnoseError> {
    let Some((chosen_by, kept)) = kept_back(records) else {
        return chosen(given, records, options, interrupt, progress);
    };
    let diagnosis = chosen(given, &chosen_by, options, interrupt, progress)?;
    let quoted = Quoted::of(given, &diagnosis.model, &kept);
    Ok(Diagnosis {
        quoted,
        ..diagnosis
    })
}

/// The diagnosis with all `records`.
fn chosen(
    given: &Model,
    records: &[Record],
    options: &Options,
    interrupt: &AtomicBool,
    progress: &(dyn Fn(&str) + Sync),
) -> Result<Diagnosis, DiagnoseError> {
    let bench = Bench::of(given, records).ok_or(DiagnoseError::NothingToLearnFrom)?;
    let Bench {
        units,
        judge,
        given: given_inside,
        mid_run,
        restarted,
        ..
    } = bench;
    let known = Known::of(&judge.learning(0));
    let search = Search {
        judge: &judge,
        known,
        effects: true,
        most_effects: options.most_effects,
        most_parameters: usize::MAX,
        interrupt,
        progress,
    };
    progress("the model as given");
    let as_given = judge.held_out(|_| &given_inside)?;
    let refitted = (judge.held_out_by != HeldOutBy::Records)
        .then(|| judge.refitted(&given_inside).ok())
        .flatten();
    let as_structured = refitted
        .map(|refitted| refitted.held_out)
        .filter(|held_out| held_out.rmse() > as_given.rmse())
        .unwrap_or_else(|| as_given.clone());
    let session = Session {
        search: &search,
        units,
        options,
        given: &given_inside,
        as_given: &as_given,
        as_structured: &as_structured,
        evidences: Mutex::default(),
    };
    let first = Rung::of(
        &judge,
        &session.units,
        &as_given,
        &[],
        "the model as given",
        Some(given.clone()),
    );
    if bears_little(records) {
        // These records cannot identify how the response depends on y or u, so effects and further lags are not tried.
        let given_alone = Hypothesis::new(judge.refitted(&given_inside)?);
        let second = session.rung(&given_alone.judged, &[], "refitted");
        let rungs = [first, second];
        return Ok(session.conclude(given_alone.alone(), rungs, None));
    }
    progress("the model with the fewest lags");
    let keeps_lags = search.keeps_lags(&given_inside, mid_run);
    let (root, step) = if keeps_lags {
        session.root_of_given()?
    } else {
        let root = search.root(&given_inside, mid_run)?;
        (root, "refitted with the fewest lags")
    };
    // A verdict of an incomplete search or test would be wrong.
    let complete = || match interrupt.load(Ordering::Relaxed) {
        true => Err(DiagnoseError::Interrupted),
        false => Ok(()),
    };
    complete()?;
    let starts = Given {
        model: &given_inside,
        rmse: as_given.rmse(),
        keeps_lags,
        root: &|model| search.root(model, mid_run),
    };
    let (found, origin) = search.thorough(root, &starts);
    complete()?;
    let restarted_s = restarted.map(|samples| samples as f64 * given.sample_period_s);
    let second = session.rung(&origin.judged, &[], step);
    let rungs = [first.clone(), second];
    let concluded = session.conclude(found, rungs, restarted_s);
    complete()?;
    Ok(concluded.no_worse_than(given, first))
}
