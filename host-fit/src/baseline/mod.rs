//! Baselines: three standard linear models fitted to the same records, for comparison.

mod arx;
mod initial;
mod process;
mod projection;
mod refine;
mod response;
mod series;
mod starts;

pub use arx::Arx;
pub use process::{FirstOrder, Recursion, SecondOrder};

use crate::data::Record;
use refine::Fitted;
use serde::Serialize;
use series::{Scaling, Series};
use std::ops::Range;

/// The shortest record that a baseline is fitted to, samples.
const SHORTEST: usize = 8;

/// Three linear models of the same records; `None` where one could not be fitted.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct Baselines {
    /// First order with dead time.
    pub fopdt: Option<FirstOrder>,
    /// Second order with dead time.
    pub sopdt: Option<SecondOrder>,
    /// ARX(2,2), if it is stable.
    pub arx: Option<Arx>,
}

/// FIT of the three baselines on the same scored samples, in percent. Serialises to `"baselines"` of `identify` and
/// `compare`.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct BaselineFits {
    /// FIT of the first order with dead time.
    pub fopdt: Option<f64>,
    /// FIT of the second order with dead time.
    pub sopdt: Option<f64>,
    /// FIT of ARX(2,2).
    pub arx: Option<f64>,
}

impl Baselines {
    /// Fits all three baselines to `learning`. All are `None` if u or y is constant, or if no record has 8 samples.
    #[must_use]
    pub fn fit(learning: &[&Record]) -> Self {
        let Some(fitted) = WithDeadTime::to(learning) else {
            return Self::default();
        };
        let near: Vec<f64> = [fitted.first, fitted.second]
            .iter()
            .filter_map(|fitted| Some(fitted.as_ref()?.at.dead_time))
            .collect();
        let first = fitted.first.as_ref();
        Self {
            fopdt: first
                .and_then(|first| FirstOrder::of(first, &fitted.scaling, fitted.sample_period_s)),
            sopdt: fitted.second_order(),
            arx: arx::fit(
                &fitted.series,
                &fitted.scaling,
                fitted.longest_dead_time,
                &near,
            ),
        }
    }

    /// Fits the second order with dead time alone: [`sopdt`](Self::sopdt) of [`fit`](Self::fit).
    #[must_use]
    pub fn second_order(learning: &[&Record]) -> Option<SecondOrder> {
        WithDeadTime::to(learning)?.second_order()
    }

    /// FIT of each baseline over the scored samples of `records` together, in percent. Samples before `scored.start`
    /// are simulated but not scored. `None` without a baseline, if a run is not finite, or if the scored y is constant.
    #[must_use]
    pub fn fit_percent(&self, records: &[(&Record, Range<usize>)]) -> BaselineFits {
        BaselineFits {
            fopdt: self
                .fopdt
                .and_then(|model| fit_percent(records, |record| model.simulate(record))),
            sopdt: self
                .sopdt
                .and_then(|model| fit_percent(records, |record| model.simulate(record))),
            arx: self
                .arx
                .and_then(|model| fit_percent(records, |record| model.simulate(record))),
        }
    }

    /// One line for each baseline, with its FIT and its times.
    ///
    /// > baseline: first order with dead time 94.4 % (dead time 3.10 s, time constant 206 s)
    #[must_use]
    pub fn words(&self, fits: &BaselineFits) -> Vec<String> {
        let mut lines = Vec::new();
        let mut say = |name: &str, fit: Option<f64>, rest: Option<String>| {
            lines.push(match (fit, rest) {
                (Some(fit), Some(rest)) => format!("baseline: {name} {fit:.1} % ({rest})"),
                _ => format!("baseline: {name}: none"),
            });
        };
        let fopdt = self.fopdt.map(|model| model.to_string());
        say("first order with dead time", fits.fopdt, fopdt);
        let sopdt = self.sopdt.map(|model| model.to_string());
        say("second order with dead time", fits.sopdt, sopdt);
        let arx = self.arx.map(|model| model.to_string());
        let name = match arx {
            Some(_) => "ARX(2,2)",
            None => "ARX(2,2), not stable on these records",
        };
        say(name, fits.arx, arx);
        lines
    }
}

/// The two models with dead time in scaled records.
struct WithDeadTime {
    series: Vec<Series>,
    scaling: Scaling,
    sample_period_s: f64,
    longest_dead_time: usize,
    first: Option<Fitted>,
    second: Option<Fitted>,
}

impl WithDeadTime {
    /// `None` if u or y is constant, or if no record is long enough.
    fn to(learning: &[&Record]) -> Option<Self> {
        let long: Vec<&Record> = learning
            .iter()
            .copied()
            .filter(|r| r.len() >= SHORTEST && r.y.len() == r.len() && r.sample_period_s > 0.0)
            .collect();
        let scaling = Scaling::of(&long)?;
        let sample_period_s = long.first()?.sample_period_s;
        let series: Vec<Series> = long.iter().map(|record| scaling.scaled(record)).collect();
        let longest = series.iter().map(Series::len).max().unwrap_or(0);
        let longest_dead_time = longest / 3;
        let (first, second) = process::fit(&series, longest_dead_time);
        Some(Self {
            series,
            scaling,
            sample_period_s,
            longest_dead_time,
            first,
            second,
        })
    }

    fn second_order(&self) -> Option<SecondOrder> {
        SecondOrder::of(self.second.as_ref()?, &self.scaling, self.sample_period_s)
    }
}

impl BaselineFits {
    /// The highest FIT and the name of its baseline.
    #[must_use]
    pub fn best(&self) -> Option<(&'static str, f64)> {
        let all = [
            ("first order with dead time", self.fopdt),
            ("second order with dead time", self.sopdt),
            ("ARX(2,2)", self.arx),
        ];
        let there = all.into_iter().filter_map(|(name, fit)| Some((name, fit?)));
        there.max_by(|a, b| a.1.total_cmp(&b.1))
    }
}

/// FIT, eq. (10), of free runs over the scored samples of all records together, in percent.
fn fit_percent(
    records: &[(&Record, Range<usize>)],
    simulate: impl Fn(&Record) -> Option<Vec<f64>>,
) -> Option<f64> {
    let scored = || records.iter().flat_map(|(r, scored)| part(&r.y, scored));
    let count = scored().count();
    let mean = scored().sum::<f64>() / count as f64;
    let spread = scored().map(|y| (y - mean).powi(2)).sum::<f64>();
    if count == 0 || spread.is_nan() || spread <= 0.0 {
        return None;
    }
    let mut error = 0.0;
    for (record, scored) in records {
        let run = simulate(record)?;
        let both = part(&record.y, scored).zip(part(&run, scored));
        error += both.map(|(y, run)| (y - run).powi(2)).sum::<f64>();
    }
    let fit = 100.0 * (1.0 - (error / spread).sqrt());
    fit.is_finite().then_some(fit)
}

fn part<'a>(values: &'a [f64], scored: &Range<usize>) -> impl Iterator<Item = &'a f64> + use<'a> {
    let count = scored.end.saturating_sub(scored.start);
    values.iter().skip(scored.start).take(count)
}

#[cfg(test)]
mod tests;
