//! The base model of the lowest order: bilinear, one lag each, one input.
//!
//! A high-order model imitates slow effects: with 18 free coefficients a twentieth of a plenum's droop remains
//! visible (theory 4.2). The lowest-order model cannot imitate it, so a missing effect stays visible in its
//! residual.

use super::rules::RULES;
use super::starts::starts;
use super::{Fit, FitOptions, fit};
use crate::data::Record;
use crate::model::{Delay, Model, Start, TransportLaw};
use crate::parallel;
use crate::simulate::SimulateError;
use model_core::recursion::{Grading, LagConvention};

/// y_{k+1} = a·y_k + (b + c·y_k)·u_{k−h}, fitted to the records in free run,
/// with the kind of delay law that `given` has.
///
/// # Errors
/// If no starting point gives a stable free run.
pub fn lean_base(given: &Model, records: &[&Record]) -> Result<Fit, SimulateError> {
    let starts = fresh_starts(given, records);
    let brief = FitOptions {
        iterations: RULES.brief,
        ..FitOptions::default()
    };
    let tried = parallel::each(&starts, |model| fit(model, records, &brief));
    let mut best: Option<Fit> = None;
    let mut refused = None;
    for attempt in tried {
        match attempt {
            Ok(fit)
                if best
                    .as_ref()
                    .is_none_or(|b| fit.mean_square() < b.mean_square()) =>
            {
                best = Some(fit);
            }
            Ok(_) => {}
            Err(error) => refused = Some(error),
        }
    }
    let best = match (best, refused) {
        (Some(best), _) => best,
        (None, Some(error)) => return Err(error),
        (None, None) => fit(given, records, &brief)?,
    };
    let best = settle_fixed_delay(best, records, &FitOptions::default())?;
    match given.delay {
        Delay::Fixed { .. } => Ok(best),
        Delay::Law(_) => with_law_of(&best.model, given, records),
    }
}

/// Starting models with a fixed delay that use only the level of y: equally spaced delays and that of
/// `given`, with several time constants each.
pub(super) fn fresh_starts(given: &Model, records: &[&Record]) -> Vec<Model> {
    let level = steady_level(records);
    let start = |delay: u16, time_constant: f64| {
        let kept = (-given.sample_period_s / time_constant).exp();
        Model {
            convention: LagConvention::OneStep,
            start: Start::Rest,
            grading: Grading::Proportional,
            constant: 0.0,
            state_lags: vec![1],
            a: vec![kept],
            product_lags: vec![1],
            b: vec![(1.0 - kept) * level],
            c: vec![0.0],
            delay: Delay::Fixed {
                delays: vec![delay],
            },
            effects: Vec::new(),
            ..given.clone()
        }
    };
    let longest = (RULES.longest_start_s / given.sample_period_s)
        .round()
        .clamp(8.0, 400.0) as u16;
    let mut delays: Vec<u16> = (0..8).map(|i| longest * i / 8 + longest / 16).collect();
    delays.push(given.longest_delay().min(usize::from(u16::MAX)) as u16);
    let pairs = delays
        .iter()
        .flat_map(|h| RULES.time_constants_s.iter().map(|time| start(*h, *time)));
    pairs.collect()
}

/// Steady |y| under u = 1: the 95 % quantile of |y/u| while the input is at least half of its maximum. Under
/// a weaker input y may still be decaying from a stronger one.
fn steady_level(records: &[&Record]) -> f64 {
    let samples = || {
        let pairs = records
            .iter()
            .flat_map(|record| record.y.iter().zip(&record.u));
        pairs.map(|(y, u)| (y, u.abs()))
    };
    let strongest = samples().fold(0.0, |most: f64, (_, u)| most.max(u));
    let mut ratios: Vec<f64> = samples()
        .filter(|(_, u)| *u > RULES.strong_input * strongest)
        .map(|(y, u)| (y / u).abs())
        .collect();
    ratios.sort_by(f64::total_cmp);
    let at = ratios.len() * RULES.settled_percentile / 100;
    ratios.get(at).copied().unwrap_or(1.0)
}

/// Moves a fixed first delay in decreasing steps while the free-run error falls.
///
/// # Errors
/// As [`fit`].
pub fn settle_fixed_delay(
    mut best: Fit,
    records: &[&Record],
    options: &FitOptions,
) -> Result<Fit, SimulateError> {
    let brief = FitOptions {
        iterations: RULES.settling,
        ..*options
    };
    // A record that starts in mid-run is scored only after the longest delay.
    let shortest = records.iter().map(|r| r.len()).min().unwrap_or(0);
    let most = i32::try_from(shortest / 4).unwrap_or(i32::MAX);
    for step in RULES.delay_steps.map(|step| step as i32) {
        loop {
            let Delay::Fixed { delays } = &best.model.delay else {
                return Ok(best);
            };
            let moved = |by: i32| {
                let mut model = best.model.clone();
                let shift =
                    |h: &u16| (i32::from(*h) + by).clamp(0, most.min(i32::from(u16::MAX))) as u16;
                let shifted: Vec<u16> = delays.iter().map(shift).collect();
                if shifted == *delays {
                    return None;
                }
                model.delay = Delay::Fixed { delays: shifted };
                fit(&model, records, &brief).ok()
            };
            let nearer = parallel::some(&[step, -step][..], |step| moved(*step))
                .into_iter()
                .filter(|fit| fit.mean_square() < best.mean_square() * (1.0 - options.tolerance))
                .min_by(|a, b| a.mean_square().total_cmp(&b.mean_square()));
            match nearer {
                Some(fit) => best = fit,
                None => break,
            }
        }
    }
    fit(&best.model, records, options)
}

/// The model with the kind of delay law of `given`, fitted from several starts.
pub(super) fn with_law_of(
    model: &Model,
    given: &Model,
    records: &[&Record],
) -> Result<Fit, SimulateError> {
    let laws: Vec<Delay> = match &given.delay {
        Delay::Fixed { .. } => vec![model.delay.clone()],
        Delay::Law(law) => {
            let with = |parameters: Vec<f64>, factor: f64| {
                let first = Delay::Law(TransportLaw {
                    parameters,
                    factors: vec![factor],
                    interpolated: true,
                    ..*law
                });
                first.for_inputs_of(&model.delay)
            };
            let factor = law.factors.first().copied().unwrap_or(1.0);
            let own = with(law.parameters.clone(), factor);
            let others = starts(model, law.spec, records).into_iter();
            let others = others.take(RULES.law_starts).map(|start| with(start, 1.0));
            std::iter::once(own).chain(others).collect()
        }
    };
    let tried = parallel::some(laws, |delay| {
        let model = Model {
            delay,
            ..model.clone()
        };
        // A law with which the free run diverges is not a starting point.
        fit(&model, records, &FitOptions::default()).ok()
    });
    let best = tried
        .into_iter()
        .min_by(|a, b| a.mean_square().total_cmp(&b.mean_square()));
    match best {
        Some(best) => Ok(best),
        None => fit(model, records, &FitOptions::default()),
    }
}
