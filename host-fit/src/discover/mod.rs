//! Discovery of a term that is not in the catalogue: its place, its coordinate, its curve, and the shortest
//! formula that fits equally well.
//!
//! Candidates are all entries (jet, delay, flow, sensor) times all coordinates defined there, each with a
//! piecewise-linear curve. A first-order screening predicts the share of the free-run error that each explains
//! beyond the base. The best are refitted with the whole model, the flow's lags are searched again, and the
//! validation error decides. A term must beat the best base without it, tested over all screened curves.

mod finder;
mod follow;
mod formulas;
mod outcome;
mod rules;
mod trace;

pub use outcome::{Alike, CurvePoint, Discovery, FoundTerm, Smallest};
pub use rules::{RULES, Rules};
pub use trace::{Signal, TRACED, Trace, TracedRecord};

use crate::curves::{Context, Entry, Place, Term};
use crate::data::Record;
use crate::diagnose::{DiagnoseError, Rung};
use crate::excitation::says_little;
use crate::model::Model;
use crate::terms::{Bench, Found as Searched, Hypothesis, Known, Search};
use finder::Finder;
use outcome::Found;
use serde::Serialize;
use std::sync::atomic::{AtomicBool, Ordering};

/// Options of a discovery.
#[derive(Clone, Debug)]
pub struct Options {
    /// Largest number of terms.
    pub terms: usize,
    /// Effects of the catalogue to ignore: no term is reported to resemble them.
    pub without: Vec<String>,
}

impl Default for Options {
    fn default() -> Self {
        Self {
            terms: 2,
            without: Vec::new(),
        }
    }
}

/// First-order prediction for the most promising term.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Glance {
    /// Where a term would act.
    pub place: Place,
    /// The coordinate of the term.
    pub coordinate: String,
    /// Predicted reduction of the validation error energy, %.
    pub error_taken_percent: f64,
}

/// The most promising curve for `model` without any refit: the first candidate of [`discover`]. `None` if no
/// predicted gain is above the practical margin.
#[must_use]
pub fn glance(model: &Model, records: &[Record], interrupt: &AtomicBool) -> Option<Glance> {
    let bench = Bench::of(model, records)?;
    let search = Search::silent(&bench.judge, 0, interrupt);
    let context = Context::new(&search, &bench.given, 1)?;
    let first = context.all(&Entry::ALL).into_iter().next()?;
    (first.score < 0.0).then(|| Glance {
        place: first.term.entry.place(),
        coordinate: first
            .term
            .entry
            .depends_on(&first.term.coordinate.out(&bench.units)),
        error_taken_percent: 100.0 * first.held_out,
    })
}

/// The best base with at least one and at most half as many terms as the best one. A high-order base has adapted to
/// the missing term, and the lowest-order one is too far from the flow.
fn halfway(found: &Searched) -> Option<Hypothesis> {
    let most = found.best.terms.len() / 2;
    let all = found.all.iter();
    let leaner = all.filter(|other| (1..=most).contains(&other.terms.len()));
    leaner
        .min_by(|a, b| a.judged.size().total_cmp(&b.judged.size()))
        .cloned()
}

/// Searches for terms missing from the model `handed_in` on `records`. Without a finding, that model or a better
/// base is returned. `progress` receives messages.
///
/// # Errors
/// [`DiagnoseError`].
pub fn discover(
    handed_in: &Model,
    records: &[Record],
    options: &Options,
    interrupt: &AtomicBool,
    progress: &(dyn Fn(&str) + Sync),
) -> Result<Discovery, DiagnoseError> {
    let bench = Bench::of(handed_in, records).ok_or(DiagnoseError::NothingToLearnFrom)?;
    let (judge, units) = (&bench.judge, &bench.units);
    let search = Search {
        judge,
        known: Known::of(&judge.learning(0)),
        effects: false,
        most_effects: 0,
        most_parameters: usize::MAX,
        interrupt,
        progress,
    };
    let moving_zero = bench.moving_zero.clone();
    let finder = Finder {
        search: &search,
        units,
        options,
        moving_zero: moving_zero.is_some(),
    };
    let rung = |hypothesis: &Hypothesis, terms: &[&Term], model: Model, step: &str| {
        let held_out = &hypothesis.judged.held_out;
        let names: Vec<String> = terms.iter().map(|term| term.name()).collect();
        Rung::of(judge, units, held_out, &names, step, Some(model))
    };
    let refitted_rung = |hypothesis: &Hypothesis, terms: &[&Term], step: &str| {
        let (model, _) = finder.outer(&judge.final_fit(&hypothesis.judged).model, terms);
        rung(hypothesis, terms, model, step)
    };
    progress("the model as given");
    let as_given = judge.held_out(|_| &bench.given)?;
    let given_rung = Rung::of(judge, units, &as_given, &[], "the model as given", None);
    let mut ladder = vec![given_rung.clone()];
    progress("the base model");
    let root = search.root(&bench.given, bench.mid_run)?;
    if interrupt.load(Ordering::Relaxed) {
        return Err(DiagnoseError::Interrupted);
    }
    let given = search.second_root(&bench.given, &root);
    let refitted = || Some(Hypothesis::new(judge.refitted(&bench.given).ok()?));
    let given = given.or_else(refitted);
    // The delay laws of the catalogue do not count as discoveries, because a base without the right law imitates
    // it.
    let after_another_law = |base: &Hypothesis| search.after_another_law(base, &options.without);
    let leanest: Vec<Hypothesis> = [after_another_law(&root), Some(root.clone())]
        .into_iter()
        .flatten()
        .collect();
    let found = search.run(leanest[0].clone(), None);
    let half = halfway(&found);
    let last = after_another_law(&found.best);
    let bases = leanest.iter().cloned().chain(given).chain([found.best]);
    let by_size = |a: &Hypothesis, b: &Hypothesis| a.judged.size().total_cmp(&b.judged.size());
    let base = bases.chain(last).min_by(by_size).unwrap_or(root);
    ladder.push(refitted_rung(&base, &[], "base model, no new term"));
    let mut current = base.clone();
    let mut contexts = vec![current.clone()];
    let leaner = half.into_iter().chain(leanest);
    let missing = |rmse: f64| judge.over_noise(rmse) > crate::terms::RULES.at_the_floor;
    if missing(base.judged.rmse()) {
        contexts.extend(leaner.filter(|leaner| leaner.judged.size() > base.judged.size()));
    }
    let mut found = Vec::new();
    let mut smallest = None;
    let mut looked_at = 0;
    // A term describes how the response depends on a coordinate; few records hardly identify such a dependence.
    let most = match says_little(records) {
        Some(_) => 0,
        None => options.terms,
    };
    while found.len() < most && !interrupt.load(Ordering::Relaxed) {
        let next = finder.next(&contexts, &current, found.len() + 1);
        looked_at += next.looked_at;
        smallest.get_or_insert(next.smallest);
        let Some(mut term) = next.found else { break };
        term.beside = found
            .iter()
            .map(|before: &Found| before.term.clone())
            .collect();
        current = term.with.clone();
        let step = format!("with {}", term.term.name());
        let own: Vec<&Term> = term.beside.iter().chain([&term.term]).collect();
        ladder.push(refitted_rung(&current, &own, &step));
        if missing(current.judged.rmse()) && found.len() + 1 < options.terms {
            finder.better_as_formula(&mut term, &mut current);
        }
        contexts = vec![current.clone()];
        found.push(term);
        if !missing(current.judged.rmse()) {
            break;
        }
    }
    // The comparison is made on the base model that belongs to the first term, because the best base without the
    // term may imitate it.
    let lacking = found.first().map_or(&base.judged, |found| &found.without);
    let trace = missing(lacking.rmse())
        .then(|| {
            progress("the trace of the unexplained error");
            trace::trace(judge, lacking, units)
        })
        .flatten();
    progress("formulas");
    let (terms, end) = finder.formulas(found, current);
    let own: Vec<&Term> = terms.iter().map(|found| &found.term).collect();
    let fitted = judge.final_fit(&end.judged);
    let (mut model, written) = finder.outer(&fitted.model, &own);
    if !terms.is_empty() {
        let step = "with formulas that fit equally well";
        ladder.push(rung(&end, &own, model.clone(), step));
    }
    if own.is_empty() && as_given.rmse() <= end.judged.rmse() {
        model = handed_in.clone();
        if as_given.rmse() < end.judged.rmse() {
            ladder.push(given_rung.once_more());
        }
    }
    let separation = finder.separation(&terms, &model);
    // The result of an incomplete search would be wrong.
    if interrupt.load(Ordering::Relaxed) {
        return Err(DiagnoseError::Interrupted);
    }
    let scored = judge.held_out_by.judged().records();
    let terms = terms
        .iter()
        .zip(&written)
        .map(|(found, written)| outcome::told(found, written, &fitted, units, scored))
        .collect();
    Ok(Discovery {
        terms,
        ladder,
        smallest_seen: smallest.unwrap_or_default(),
        held_out_by: judge.held_out_by,
        noise_source: judge.noise_source,
        noise_estimate: judge.measured_noise_rmse() * units.y,
        looked_at,
        trace,
        separation,
        moving_zero,
        model,
    })
}
