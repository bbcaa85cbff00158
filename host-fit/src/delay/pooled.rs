//! One plant with one dead time, fitted to all edges of all records, with the time scales and the
//! command before each record.

use super::dead_time::{DeadTime, correlation_of_neighbours, dead_time, widened_variance};
use super::linear::{Free, Refined, Series, coarse, evaluate, fit, refine};
use super::plant::Plant;
use super::rules::RULES;
use crate::data::Record;
use crate::noise::white_noise;
use numerics::linalg::dot;

/// Samples of the refinement; longer records are decimated as far as the time constants allow.
const FIT_SAMPLES: usize = 12_000;

/// Result of the pooled fit.
#[derive(Debug, Clone)]
pub(crate) struct Pooled {
    /// Smallest and largest command.
    pub(crate) range: (f64, f64),
    /// The plant.
    pub(crate) plant: Plant,
    /// K, units of y per unit of u.
    pub(crate) gain: f64,
    /// The dead time over all edges; the mean of both directions if they differ.
    pub(crate) dead_time: DeadTime,
    /// Variance of the residual per sample, widened for its autocorrelation.
    pub(crate) noise: f64,
    /// Whether the plant's residual is close to the noise.
    pub(crate) describes: bool,
    /// Whether the response of y to the command is significant.
    pub(crate) responds: bool,
    /// The longest delay that is searched, samples.
    pub(crate) max_delay: f64,
    /// Correlation of neighbouring residuals.
    pub(crate) correlation: f64,
    /// Correlation of neighbouring samples of the disturbance for which records are prewhitened.
    pub(crate) whitening: f64,
}

/// The levels of a command: smallest and largest over all records.
fn command_range(records: &[&Record]) -> (f64, f64) {
    records
        .iter()
        .flat_map(|r| r.u.iter())
        .fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), &u| {
            (l.min(u), h.max(u))
        })
}

/// Median time between changes of the command, and from the last to the end of the record, samples.
pub(crate) fn spacing(records: &[&Record]) -> usize {
    let mut times = Vec::new();
    for record in records {
        let mut last = 0;
        for (k, pair) in record.u.windows(2).enumerate() {
            if pair[0] != pair[1] {
                times.push(k + 1 - last);
                last = k + 1;
            }
        }
        times.push(record.u.len() - last);
    }
    let middle = times.len() / 2;
    if times.is_empty() {
        return 1;
    }
    *times.select_nth_unstable(middle).1
}

impl Pooled {
    /// Fits one plant to `records`, which are prewhitened for a disturbance with this `correlation` of neighbouring
    /// samples. `None` where the command never changes.
    pub(crate) fn of(
        records: &[&Record],
        max_delay: Option<usize>,
        correlation: f64,
    ) -> Option<Self> {
        let range = command_range(records);
        let middle = f64::midpoint(range.0, range.1);
        let spacing = spacing(records);
        let max_delay = max_delay.unwrap_or_else(|| longest_delay(records)) as f64;
        let all: Vec<Series> = records
            .iter()
            .map(|r| Series::new(r, middle))
            .filter(|s| !s.switching.changes.is_empty())
            .collect();
        let starts = coarse(&all, max_delay, spacing, correlation);
        let samples: usize = all.iter().map(|s| s.y.len()).sum();
        let shortest = starts
            .iter()
            .map(Plant::mean_sum)
            .fold(f64::INFINITY, f64::min);
        let factor = samples
            .div_ceil(FIT_SAMPLES)
            .min(((shortest / 10.0) as usize).max(1))
            .min((spacing / 8).max(1));
        let scale = factor as f64;
        let picked = all.iter().map(|s| s.picked(factor));
        let picked: Vec<Series> = picked
            .map(|s| s.whitened(correlation.powf(scale)))
            .collect();
        let starts: Vec<Plant> = starts.iter().map(|p| p.slower(1.0 / scale)).collect();
        let fits = fit(&picked, &starts, max_delay / scale);
        let (fits, free) = with_directions(&picked, fits, max_delay / scale);
        let (estimate, chosen) =
            dead_time(&picked, &fits, free, max_delay / scale, RULES.clock / scale)?;
        let whole: Vec<Series> = all.iter().map(|s| s.whitened(correlation)).collect();
        let at = evaluate(&whole, fits.get(chosen)?.at.plant.slower(scale))?;
        let noise = widened_variance(&at);
        let spread: f64 = whole.iter().map(|s| dot(&s.y, &s.y)).sum();
        let white = white_noise(records.iter().map(|record| record.y.as_slice()))
            * (1.0 + correlation * correlation)
            * samples as f64;
        Some(Self {
            range,
            plant: at.plant,
            gain: at.gain,
            dead_time: estimate.scaled(scale),
            noise,
            responds: at.explained > RULES.detection * noise,
            max_delay,
            describes: at.rss
                <= RULES.noise_allowed.powi(2) * white + RULES.plant_fits.powi(2) * spread,
            correlation: correlation_of_neighbours(&at),
            whitening: correlation,
        })
    }

    /// Middle of the range of u: above it the command is on.
    fn middle(&self) -> f64 {
        f64::midpoint(self.range.0, self.range.1)
    }

    /// A record with the command before it, prewhitened.
    pub(crate) fn series(&self, record: &Record) -> Series {
        Series::new(record, self.middle()).whitened(self.whitening)
    }
}

/// The longest delay that the records can show, samples: from the first change of the command to their end.
pub(crate) fn longest_delay(records: &[&Record]) -> usize {
    let seen = records.iter().map(|r| {
        let first =
            r.u.windows(2)
                .position(|w| w[0] != w[1])
                .map_or(0, |k| k + 1);
        r.u.len() - first
    });
    seen.max()
        .unwrap_or(0)
        .saturating_sub(RULES.least_side)
        .max(1)
}

/// The fits. Dynamics, and then dead times, differ between opening and closing if that is significantly better.
fn with_directions(series: &[Series], fits: Vec<Refined>, max_delay: f64) -> (Vec<Refined>, Free) {
    let changes = series.iter().flat_map(|s| &s.switching.changes);
    let rising = changes.clone().filter(|c| c.rising).count();
    let mut free = Free::DELAY;
    let mut known = fits;
    if rising == 0 || rising == changes.count() {
        return (known, free);
    }
    let own_dynamics = Free {
        dynamics: true,
        ..free
    };
    let own_delays = Free {
        delays: true,
        ..own_dynamics
    };
    let least = |fits: &[Refined]| fits.iter().map(|f| f.at.rss).fold(f64::INFINITY, f64::min);
    for more in [own_dynamics, own_delays] {
        let next: Vec<Refined> = known
            .iter()
            .filter_map(|fit| {
                let order = !fit.at.plant.is_first_order();
                refine(series, fit.at.plant, more.with_order(order), max_delay)
            })
            .collect();
        let Some(best) = next.iter().min_by(|a, b| a.at.rss.total_cmp(&b.at.rss)) else {
            break;
        };
        // Additional parameters may follow a disturbance and make the residual whiter. The geometric mean of
        // the variances with and without them is used.
        let before = known
            .iter()
            .min_by(|a, b| a.at.rss.total_cmp(&b.at.rss))
            .map_or(f64::INFINITY, |f| widened_variance(&f.at));
        let noise = (before * widened_variance(&best.at)).sqrt();
        let fall = (least(&known) - best.at.rss) / noise;
        if fall > RULES.detection {
            (known, free) = (next, more);
        }
    }
    (known, free)
}
