//! Wording of an error relative to the noise level, shared by all steps.

use super::{Answer, NamedComparison, Tone, verdict::times};
use crate::analysis::{Correlation, Residuals, correlations};
use crate::baseline::BaselineFits;
use crate::data::{Record, Use};
use crate::diagnose::RULES;
use crate::indicators::{ErrorKind, Indicators, Scores};
use crate::order;
use crate::picture::significant;
use crate::residual::Failures;
use statrs::distribution::{ContinuousCDF, StudentsT};

/// "2.64 × the noise level (RMSE 0.0273, FIT 92.7 %)"; without the ratio if there is no `y_sd`.
pub(super) fn beside_noise(all: &Indicators) -> String {
    let noise = all.noise_rmse.filter(|noise| *noise > 0.0);
    let rmse = significant(all.rmse, 3);
    match noise {
        Some(noise) => format!(
            "{} × the noise level (RMSE {rmse}, FIT {:.1} %)",
            times(all.rmse / noise),
            all.fit_percent
        ),
        None => format!("RMSE {rmse} (FIT {:.1} %)", all.fit_percent),
    }
}

/// Share of a cross-correlation that chance alone leaves outside its 95 % band.
const EXPECTED: f64 = 0.05;

/// The residual test of an output-error model: the share of lags at which the cross-correlation of u and the residual
/// lies outside its 95 % band. The autocorrelation is not tested here, because measurement noise may be coloured.
fn residual_test((_, cross): &(Correlation, Correlation), above_noise: bool) -> String {
    let small = match cross.outside > 2.0 * EXPECTED && !above_noise {
        true => " The model lacks a response to u that is smaller than the noise.",
        false => "",
    };
    format!(
        "Residual test: {:.0} % of the cross-correlation with u lies outside its 95 % band ({:.0} % expected of a complete \
         model).{small}",
        100.0 * cross.outside,
        100.0 * EXPECTED
    )
}

/// The answer of a comparison; `finished` is the next command if no error exceeds the noise level.
pub(super) fn compared(
    finished: impl Fn() -> String,
    scores: &Scores,
    failures: &Failures,
    records: &[Record],
    runs: &[Vec<f64>],
) -> Answer {
    let Some(all) = scores.held_out() else {
        return Answer::new(Tone::Warning, "there is no record to compare with");
    };
    let error = ErrorKind::of(all.role).name();
    let answer = if failures.above_noise {
        Answer::new(
            Tone::Warning,
            format!("the {error} exceeds the noise level"),
        )
        .next("host-fit diagnose model.toml DATASET --report diagnosis.html")
    } else {
        Answer::new(Tone::Good, format!("the {error} is at the noise level")).next(finished())
    };
    let mut answer = answer
        .evidence(format!(
            "The {error} of the free run is {}.",
            beside_noise(all)
        ))
        .confidence(residual_test(
            &correlations(&Residuals::of(records, runs)),
            failures.above_noise,
        ));
    if let Some(steady) = failures.oscillation {
        answer.note(steady.to_string());
    }
    answer
}

/// The answer of an identification; `parameters` are those of the model.
pub(super) fn identified(scores: &Scores, fits: &BaselineFits, parameters: usize) -> Answer {
    let Some(all) = scores.held_out() else {
        return Answer::new(
            Tone::Warning,
            "the model cannot be validated: no record can be scored",
        );
    };
    let error = ErrorKind::of(all.role).name();
    let baseline = fits.best().map_or_else(String::new, |(name, fit)| {
        format!(" The best linear baseline ({name}) reaches FIT {fit:.1} %.")
    });
    let answer = Answer::new(
        Tone::Finding,
        format!("model identified, FIT {:.1} %", all.fit_percent),
    )
    .evidence(format!(
        "The {error} of the free run is {}, with {parameters} parameters.{baseline}",
        beside_noise(all)
    ))
    .next("host-fit diagnose model.toml DATASET --report diagnosis.html");
    answer.confidence(match all.role {
        Use::Validate => "The structure was chosen on these validation records, so this error is optimistic.",
        Use::Identify => {
            "Not independent: no record is marked `validate`, so this is the error on the estimation \
            records."
        }
    })
}

/// The answer of an extension by `effects`; `finished` is the next command if the error does not exceed the noise level,
/// otherwise `None`.
pub(super) fn extended(
    effects: &str,
    finished: Option<String>,
    before: Option<&Indicators>,
    after: Option<&Indicators>,
) -> Answer {
    let Some(after) = after else {
        return Answer::new(
            Tone::Warning,
            "the model cannot be validated: no record can be scored",
        );
    };
    let error = ErrorKind::of(after.role).name();
    let was = before.map_or_else(
        || "It diverged before".to_owned(),
        |before| format!("It was {} before", beside_noise(before)),
    );
    let is_lower = before.is_none_or(|before| (1.0 + RULES.alike) * after.rmse < before.rmse);
    let (tone, change) = match is_lower {
        true => (Tone::Finding, "is lower"),
        false => (Tone::Warning, "is not lower"),
    };
    Answer::new(tone, format!("{effects} added, the {error} {change}"))
        .evidence(format!(
            "The {error} of the free run is {}. {was}.",
            beside_noise(after)
        ))
        .confidence("A refit is not a significance test; `host-fit diagnose` gives the p-value.")
        .next(finished.unwrap_or_else(|| {
            "host-fit diagnose model.toml DATASET --report diagnosis.html".to_owned()
        }))
}

/// Models with a validation error, or an estimation error if there are no validation records, in ascending order of it.
pub(super) fn ascending(models: &[NamedComparison]) -> Vec<(&NamedComparison, &Indicators)> {
    let judged = models.iter();
    let judged = judged.filter_map(|one| Some((one, one.comparison.scores.held_out()?)));
    let mut judged: Vec<(&NamedComparison, &Indicators)> = judged.collect();
    order::ascending(&mut judged, |one| one.1.rmse);
    judged
}

/// The answer of several models side by side: the best one first. `finished` is the next command if the error of that
/// model does not exceed the noise level.
pub(super) fn ranked(models: &[NamedComparison], finished: impl Fn(&str) -> String) -> Answer {
    let judged = ascending(models);
    let Some((first, best)) = judged.first() else {
        return Answer::new(Tone::Warning, "there is no record to compare with");
    };
    let name = &first.model;
    let error = ErrorKind::of(best.role).name();
    let next = judged.get(1).map_or_else(String::new, |(other, second)| {
        format!(" Next best: {}, {}.", other.model, beside_noise(second))
    });
    Answer::new(Tone::Finding, format!("{name} has the lowest {error}"))
        .evidence(format!("Free run of {name}: {}.{next}", beside_noise(best)))
        .confidence(
            judged
                .get(1)
                .map_or_else(String::new, |(second, _)| paired(first, second, best.role)),
        )
        .next(match first.comparison.failures.above_noise {
            true => "host-fit diagnose model.toml DATASET --report diagnosis.html".to_owned(),
            false => finished(name),
        })
}

/// The ratio of the errors of two models, paired over the records with this use: its geometric mean with the 95 % interval
/// (Student's t of the logarithms). The ratio is used because the errors of all models are larger on livelier records.
fn paired(best: &NamedComparison, second: &NamedComparison, role: Use) -> String {
    let records = |of: &NamedComparison| -> Vec<f64> {
        let all = of.comparison.scores.records.iter();
        all.filter(|record| record.role == role)
            .map(|record| record.rmse)
            .collect()
    };
    let (own, other) = (records(best), records(second));
    let ratios = own
        .iter()
        .zip(&other)
        .map(|(own, other)| (other / own).ln());
    let logarithms: Vec<f64> = ratios.collect();
    let kind = ErrorKind::of(role).records();
    let count = logarithms.len();
    let n = count as f64;
    if count < 2 {
        return "One record alone gives no interval of the difference.".to_owned();
    }
    let mean = logarithms.iter().sum::<f64>() / n;
    let variance = logarithms.iter().map(|x| (x - mean).powi(2)).sum::<f64>() / (n - 1.0);
    let Ok(students) = StudentsT::new(0.0, 1.0, n - 1.0) else {
        return String::new();
    };
    let half = students.inverse_cdf(0.975) * (variance / n).sqrt();
    if !half.is_finite() {
        return String::new();
    }
    let verdict = match mean > half {
        true => "the two models are distinguishable",
        false => "the two models are not distinguishable on these records",
    };
    format!(
        "The RMSE of {} is {} times that of {} (mean over {count} {kind}, paired; 95 % interval {} … {}): {verdict}.",
        second.model,
        times(mean.exp()),
        best.model,
        times((mean - half).exp()),
        times((mean + half).exp())
    )
}
