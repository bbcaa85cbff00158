//! The split of an error in sentences.

use super::coordinate::FailureCoordinate;
use super::rules::RULES;
use super::{Dependence, Failures, NoiseSource, Where};

impl Failures {
    /// Sentences for a person, the most important first.
    #[must_use]
    pub fn describe(&self) -> Vec<String> {
        let floor = match self.noise_source {
            NoiseSource::Measured => "the noise level (`y_sd`)",
            NoiseSource::Repeats => {
                "a noise level (estimated from repeats of the command, because there is no `y_sd`)"
            }
            NoiseSource::Scatter => {
                "a noise level (estimated from sample-to-sample scatter, because there is no `y_sd`; slow noise is not included)"
            }
        };
        let (rmse, noise) = (number(self.rmse), number(self.noise_rmse));
        if !self.above_noise {
            return vec![format!(
                "The residual (RMSE {rmse}) is at {floor}, {noise}."
            )];
        }
        let excess = 1.0 - (self.noise_rmse / self.rmse).powi(2);
        let mut sentences = vec![format!(
            "RMSE {rmse} against {floor} of {noise}: {} of the squared error is model error above the noise.",
            percent(excess)
        )];
        let said: Vec<&Where> = self
            .by
            .iter()
            .filter(|w| w.explained_fraction >= RULES.worth_saying)
            .take(RULES.most_said)
            .collect();
        if said.is_empty() {
            sentences.push(
                "The model error does not depend on any coordinate that was tried.".to_owned(),
            );
        }
        sentences.extend(said.into_iter().map(sentence));
        if self.bias.abs() > RULES.worth_saying_bias * self.rmse {
            let direction = if self.bias > 0.0 { "low" } else { "high" };
            sentences.push(format!(
                "On average the model is {} too {direction}.",
                number(self.bias.abs())
            ));
        }
        sentences
    }
}

/// The sentence about one coordinate.
fn sentence(found: &Where) -> String {
    let explained = percent(found.explained_fraction);
    let coordinate = &found.coordinate;
    let mut text = match found.concentration {
        Some(held)
            if held.share > RULES.worth_saying_interval * held.of_samples
                && !coordinate.is_cycle() =>
        {
            let place = coordinate.stretch(held.from, held.to);
            let more = if *coordinate == FailureCoordinate::FrequencyBand {
                format!("{} of y's own energy", percent(held.of_samples))
            } else {
                format!("{} of the time", percent(held.of_samples))
            };
            format!(
                "{} of the model error lies {place} ({more})",
                quarters(held.share)
            )
        }
        _ => format!(
            "The error is largest {} (RMSE {})",
            coordinate.stretch(found.worst_from, found.worst_to),
            number(found.worst_rmse)
        ),
    };
    if let Some(trend) = found.trend {
        let verb = if trend.correlation > 0.0 {
            "grows"
        } else {
            "shrinks"
        };
        let dwell = if trend.rest {
            "the preceding rest"
        } else {
            "the length of the preceding pulse"
        };
        text.push_str(&format!(" and {verb} with {dwell}"));
    }
    if found.bias.abs() > RULES.worth_saying_worst_bias * found.worst_rmse {
        let direction = if found.bias > 0.0 { "low" } else { "high" };
        text.push_str(&format!(
            "; where it is largest, the model is {} too {direction}",
            number(found.bias.abs())
        ));
    }
    let how = match found.dependence {
        Some(Dependence::Proportion) => ", in proportion to y",
        Some(Dependence::Size) => ", but only its magnitude, not its sign",
        Some(Dependence::Dwell) => ", together with the length of the preceding rest or pulse",
        Some(Dependence::Mean) | None => "",
    };
    format!("{text}. The {coordinate} explains {explained} of the model error{how}.")
}

fn percent(fraction: f64) -> String {
    format!("{:.0} %", 100.0 * fraction.clamp(0.0, 1.0))
}

/// A share, as a common fraction in words where possible.
fn quarters(share: f64) -> String {
    if (0.72..0.80).contains(&share) {
        "Three quarters".to_owned()
    } else {
        percent(share)
    }
}

/// Three significant digits.
fn number(value: f64) -> String {
    crate::picture::significant(value, 3)
}
