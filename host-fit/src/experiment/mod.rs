//! Experiment design for model discrimination.
//!
//! T-optimality (Atkinson & Fedorov 1975): the command within the valve's limits that maximises the
//! difference of the models' free runs relative to the noise, Σ(ŷ_A − ŷ_B)²/σ².

mod command;
mod rules;
mod separation;

pub use rules::{RULES, Rules};
pub use separation::Separation;

use crate::model::Model;
use crate::output::{OutputError, write_atomic};
use crate::parallel;
use crate::simulate::Signals;
use command::{Openings, families, mutate};
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use std::path::Path;
use thiserror::Error;

/// Limits of the valve and of the record length.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Limits {
    /// Shortest opening, s.
    pub min_on_s: f64,
    /// Shortest closure, s.
    pub min_off_s: f64,
    /// Length of the record, s.
    pub duration_s: f64,
}

impl Default for Limits {
    /// Shortest times of 20 ms on and off, and a record of 10 s.
    fn default() -> Self {
        Self {
            min_on_s: 0.02,
            min_off_s: 0.02,
            duration_s: 10.0,
        }
    }
}

/// A discriminating command with its separation of the models.
#[derive(Clone, Debug, PartialEq)]
pub struct Experiment {
    /// The command in words.
    pub description: String,
    /// Sample period, s.
    pub sample_period_s: f64,
    /// The command per sample, 0 or 1.
    pub u: Vec<f64>,
    /// √(Σ(ŷ_A − ŷ_B)²/σ²) of the two closest models, in standard deviations of white noise of the given
    /// size.
    pub separation_sigmas: f64,
    /// Root mean square difference of the two closest models, divided by the noise, dB.
    pub separation_db: f64,
}

/// Why there is no separating experiment.
#[derive(Clone, Debug, Error, PartialEq)]
#[non_exhaustive]
pub enum ExperimentError {
    /// Fewer than two models.
    #[error(
        "{0} model given; a separating experiment needs at least two. Give the models that fit the data equally well."
    )]
    TooFewModels(usize),
    /// The models run at different rates.
    #[error(
        "the models have different sample periods ({0} s and {1} s). Identify them from the same data set."
    )]
    Periods(f64, f64),
    /// No command satisfies the limits.
    #[error(
        "no command fits: min-on {min_on} s, min-off {min_off} s, duration {duration} s, noise {noise}. All must be positive and a run must hold at least four of the shortest pulses."
    )]
    Limits {
        /// Shortest opening, s.
        min_on: f64,
        /// Shortest closure, s.
        min_off: f64,
        /// Length, s.
        duration: f64,
        /// Noise, y.
        noise: f64,
    },
    /// At least one model diverges under every command.
    #[error(
        "a model diverges under every command that was tried. Identify that model again with fewer lags or with `--objective free-run`."
    )]
    Unstable,
}

/// Searches square waves, single pulses, pairs of pulses, random on/off sequences and variations of the best
/// for the command with the largest difference between `models`; `noise_rmse` is the expected noise level, in
/// y.
///
/// # Errors
/// [`ExperimentError`].
pub fn separating(
    models: &[Model],
    noise_rmse: f64,
    limits: &Limits,
    seed: u64,
) -> Result<Experiment, ExperimentError> {
    let [first, rest @ ..] = models else {
        return Err(ExperimentError::TooFewModels(0));
    };
    if rest.is_empty() {
        return Err(ExperimentError::TooFewModels(1));
    }
    let period = first.sample_period_s;
    if let Some(other) = rest.iter().find(|m| m.sample_period_s != period) {
        return Err(ExperimentError::Periods(period, other.sample_period_s));
    }
    let fits = [limits.min_on_s, limits.min_off_s, noise_rmse]
        .iter()
        .all(|x| *x > 0.0)
        && limits.duration_s.is_finite()
        && limits.duration_s <= 1e6 * period
        && limits.duration_s >= 4.0 * (limits.min_on_s + limits.min_off_s).max(2.0 * period);
    let refused = ExperimentError::Limits {
        min_on: limits.min_on_s,
        min_off: limits.min_off_s,
        duration: limits.duration_s,
        noise: noise_rmse,
    };
    if !fits {
        return Err(refused);
    }
    let samples = (limits.duration_s / period).round() as usize;
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let plans = families(limits, &mut rng);
    let score = |plan: &Openings| separation(models, &plan.command(period, samples)) / noise_rmse;
    let mut best = pick(plans, &score).ok_or(refused)?;
    for _ in 0..RULES.rounds {
        let variations = (0..RULES.variations)
            .map(|_| mutate(&best.0, limits, &mut rng))
            .collect();
        if let Some(better) = pick(variations, &score).filter(|new| new.1 > best.1) {
            best = better;
        }
    }
    let (plan, separation_sigmas) = best;
    if separation_sigmas < 0.0 {
        return Err(ExperimentError::Unstable);
    }
    let rms = separation_sigmas / (samples as f64).sqrt();
    Ok(Experiment {
        description: plan.description.clone(),
        sample_period_s: period,
        u: plan.command(period, samples),
        separation_sigmas,
        separation_db: 20.0 * rms.max(1e-12).log10(),
    })
}

/// The best plan; of equally good plans the first.
fn pick(
    plans: Vec<Openings>,
    score: &(dyn Fn(&Openings) -> f64 + Sync),
) -> Option<(Openings, f64)> {
    let scores: Vec<f64> = parallel::each(&plans, score);
    plans
        .into_iter()
        .zip(scores)
        .reduce(|best, next| if next.1 > best.1 { next } else { best })
}

/// √Σ(ŷ_A − ŷ_B)² of the closest two models; −1 if a model diverges.
fn separation(models: &[Model], u: &[f64]) -> f64 {
    let runs: Option<Vec<Vec<f64>>> = models.iter().map(|model| run(model, u)).collect();
    let Some(runs) = runs else { return -1.0 };
    let mut least = f64::INFINITY;
    for (i, a) in runs.iter().enumerate() {
        for b in &runs[i + 1..] {
            let sum: f64 = a.iter().zip(b).map(|(a, b)| (a - b) * (a - b)).sum();
            least = least.min(sum.sqrt());
        }
    }
    least
}

/// The free run from rest, every channel at its reference; `None` if it diverges.
fn run(model: &Model, u: &[f64]) -> Option<Vec<f64>> {
    let references: Vec<Vec<f64>> = model
        .memory()
        .references()
        .into_iter()
        .map(|reference| vec![reference; u.len()])
        .collect();
    let signals = Signals {
        channels: references.iter().map(Vec::as_slice).collect(),
        ..Signals::commanded(model, u)
    };
    model.run_free(&signals).ok()
}

impl Experiment {
    /// The experiment in a sentence.
    #[must_use]
    pub fn words(&self) -> String {
        format!(
            "{} separates the models by {:.0} standard deviations of the noise ({:+.0} dB per sample).",
            self.description, self.separation_sigmas, self.separation_db
        )
    }

    /// Writes the command as a CSV file with the columns `t` (s) and `u`.
    ///
    /// # Errors
    /// [`OutputError`]; nothing is left behind.
    pub fn write_csv(&self, path: &Path) -> Result<(), OutputError> {
        write_atomic(path, |file| {
            writeln!(file, "t,u")?;
            for (k, u) in self.u.iter().enumerate() {
                // Times are multiples of the sample period, rounded to remove binary representation
                // errors.
                let t = (k as f64 * self.sample_period_s * 1e9).round() / 1e9;
                writeln!(file, "{t},{u}")?;
            }
            Ok(())
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::residual::plants::{base, records};
    use model_core::effects::spec;

    fn with(base: &Model, name: &str, parameters: &[f64]) -> Model {
        let mut model = base.clone();
        model.add(spec(name).expect("in the catalogue"), parameters, None);
        model
    }

    #[test]
    fn a_starting_vortex_and_a_droop_are_separated_within_the_valves_limits() {
        let records = records(&[], &[], 1);
        let base = base(&records);
        let models = [
            with(&base, "starting-vortex", &[0.3, 0.05]),
            with(&base, "plenum-droop", &[1.0, 0.3]),
        ];
        let limits = Limits {
            min_on_s: 0.05,
            min_off_s: 0.03,
            duration_s: 6.0,
        };
        let found = separating(&models, 0.01, &limits, 1).expect("an experiment");
        assert_eq!(found, separating(&models, 0.01, &limits, 1).expect("again"));
        assert_eq!(found.u.len(), 6000);
        let mut dwell = 1;
        for pair in found.u.windows(2) {
            if pair[0] == pair[1] {
                dwell += 1;
                continue;
            }
            assert!(dwell >= if pair[0] == 1.0 { 50 } else { 30 }, "{dwell}");
            dwell = 1;
        }
        // The proposed command is better than the square wave of the paper.
        let square: Vec<f64> = (0..6000).map(|k| f64::from(k % 250 < 125)).collect();
        let usual = separation(&models, &square) / 0.01;
        println!("{} (4 Hz 50 %: {usual:.0})", found.words());
        assert!(found.separation_sigmas > usual);

        let folder = tempfile::tempdir().expect("a folder");
        let path = folder.path().join("command.csv");
        found.write_csv(&path).expect("written");
        let text = std::fs::read_to_string(&path).expect("there");
        assert!(text.starts_with("t,u\n0,0\n0.001,"));
    }

    #[test]
    fn nothing_is_proposed_that_does_not_distinguish() {
        let base = base(&records(&[], &[], 1));
        let with = |gain| with(&base, "starting-vortex", &[gain, 0.05]);
        let proposed = |noise| {
            let models = vec![with(0.3), with(0.301)];
            Separation::of(models, vec!["a".to_owned()], noise, 1)
        };
        let sigmas = proposed(1e-6)
            .expect("no noise")
            .experiment
            .separation_sigmas;
        // At these noise levels the separation is two and four standard deviations.
        assert!(proposed(1e-6 * sigmas / 2.0).is_none());
        assert!(proposed(1e-6 * sigmas / 4.0).is_some());
    }

    #[test]
    fn impossible_requests_are_refused() {
        let base = base(&records(&[], &[], 1));
        let limits = Limits::default();
        let one = std::slice::from_ref(&base);
        assert_eq!(
            separating(one, 0.01, &limits, 0),
            Err(ExperimentError::TooFewModels(1))
        );
        let short = Limits {
            duration_s: 0.1,
            ..limits
        };
        let two = [base.clone(), base];
        assert!(matches!(
            separating(&two, 0.01, &short, 0),
            Err(ExperimentError::Limits { .. })
        ));
        assert!(matches!(
            separating(&two, f64::NAN, &limits, 0),
            Err(ExperimentError::Limits { .. })
        ));
    }
}
