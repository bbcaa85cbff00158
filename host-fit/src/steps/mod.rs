//! Steps from recordings to constants on a board; each is a function.
//!
//! | step | from | to |
//! |---|---|---|
//! | [`average`] | raw recordings | a [`DataSet`] |
//! | [`import`] | files of other programs | a [`DataSet`] |
//! | [`measure_delays`] | a data set | [`DelayReport`] |
//! | [`identify`] | a data set | [`Identification`] |
//! | [`compare`] | a model and a data set | [`Comparison`] |
//! | [`diagnose`] | a model and a data set | [`Finding`] |
//! | [`discover`] | a model and a data set | [`Terms`] |
//! | [`extend`] | a model, a data set and effects | [`Extension`] |
//! | [`simulate`] | a model and a command | [`Simulation`] |
//! | [`design`] | a model and a goal | [`Design`] |
//! | [`possible`] | a model and a data set | [`PossibleFlow`](crate::design::PossibleFlow)s |
//! | [`try_out`] | a design and flows | [`Proof`](crate::design::Proof) |
//! | [`law_margin`] | a design | [`Margin`](crate::design::Margin) |
//! | [`constants`] | a model | [`BoardConstants`] |
//!
//! [`catalogue`] lists the effects, [`rulebooks`] every threshold.
//!
//! Every result serialises to the JSON document of the step, without paths of written files and without data that
//! only pictures need. The program consists of these functions, a parser, and three renderers (text, JSON, pages).

mod answer;
mod average;
mod baselines;
mod candidate_law;
mod catalogue;
mod compare;
mod constants;
mod delay;
mod design;
mod diagnose;
mod discover;
mod error;
mod extend;
mod identify;
mod import;
mod level;
mod memory;
mod onlooker;
mod prepared;
mod rules;
mod simulate;
mod symptom;
mod verdict;

pub use answer::{Answer, DATASET, MODEL, Tone};
pub use average::{Average, average};
pub use baselines::Beside;
pub use catalogue::{EffectEntry, ParameterEntry, base_terms, catalogue};
pub use compare::{Comparison, NamedComparison, SideBySide, compare, compare_several};
pub use constants::{BoardConstants, constants, written};
pub use delay::{DelayReport, EdgeReport, measure_delays};
pub use design::{
    Design, DesignOutcome, DesignRequest, NoStress, TargetVerdict, design, law_margin,
    passing_targets, possible, slow_noise, try_out, units_of_order_one,
};
pub use diagnose::{Finding, diagnose};
pub use discover::{Terms, discover};
pub use error::StepError;
pub use extend::{Extension, RecordChange, extend};
pub use identify::{DelayKind, Identification, IdentifiedDelays, IdentifyRequest, identify};
pub use import::{ImportedSet, import};
pub use onlooker::Onlooker;
pub use rules::{rule_change, rulebooks, rules_pages};
pub use simulate::{Simulation, simulate};
pub use symptom::effect_in_words;
pub use verdict::p_bound;

use crate::data::DataSet;
use crate::indicators::{Indicators, Scores};
use crate::model::{Model, Training};

/// Rejects data whose sampling period differs from the model's.
fn check_period(model: &Model, set: &DataSet) -> Result<(), StepError> {
    if model.is_sampled_at(set.sample_period_s) {
        return Ok(());
    }
    Err(StepError::SamplePeriod {
        place: Box::new(set.place(0, None)),
        data: set.sample_period_s,
        model: model.sample_period_s,
    })
}

/// FIT in percent; none without a run or if it diverged.
fn finite_fit(indicators: Option<&Indicators>) -> Option<f64> {
    indicators
        .map(|i| i.fit_percent)
        .filter(|fit| fit.is_finite())
}

/// The training record of a model file.
fn training(set: &DataSet, scores: &Scores, seed: u64, objective: &str, value: f64) -> Training {
    let learning: Vec<_> = set.identify().collect();
    Training {
        data_hash: set.hash.clone(),
        tool_version: env!("CARGO_PKG_VERSION").to_owned(),
        seed,
        objective: objective.to_owned(),
        objective_value: value,
        identify_fit_percent: finite_fit(scores.identify.as_ref()).unwrap_or(0.0),
        validate_fit_percent: finite_fit(scores.validate.as_ref()),
        ..Training::envelope(&learning)
    }
}

/// [`training`] of a model that was fitted in free run.
fn trained_in_free_run(set: &DataSet, scores: &Scores, seed: u64) -> Training {
    let epsilon = scores.identify.as_ref().map_or(0.0, |i| i.epsilon);
    let finite = if epsilon.is_finite() { epsilon } else { 0.0 };
    training(set, scores, seed, "free-run", finite)
}
