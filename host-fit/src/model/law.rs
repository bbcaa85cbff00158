//! The control law that `design` writes into a model file.

use model_core::Real;
use model_core::checks;
use model_core::control::budget::Budget;
use model_core::control::{Air, HoldTimes, PulseTrain, Reachable, Switches, Tracking};
use serde::{Deserialize, Serialize};

/// A law for the valve, designed for the model it is stored with.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(tag = "goal", rename_all = "kebab-case", deny_unknown_fields)]
pub enum Law {
    /// Holds the friction at a reference.
    Track(Track),
    /// Plays the pulses with the most friction for a given price of air.
    Maximise(Maximise),
}

/// [`HoldTimes`] in a file.
#[derive(Serialize, Deserialize)]
#[serde(remote = "HoldTimes", deny_unknown_fields)]
struct HoldTable {
    on: u32,
    off: u32,
}

/// The constants of [`Tracking`], times in samples.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Track {
    /// The friction to hold, y of the flow.
    pub reference: f64,
    /// Open interval of the levels that on/off blowing can hold.
    pub reachable: [f64; 2],
    /// Fastest change of the reference, y per sample; 0 for steps.
    pub slope: f64,
    /// Shortest on and off times.
    #[serde(with = "HoldTable")]
    pub hold: HoldTimes,
    /// How far the law looks beyond the arrival of an opening and of a closing, in half samples; `None`: over half of
    /// each shortest time.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub anticipation: Option<[u32; 2]>,
    /// Samples per switch that the valve's budget allows, and largest number of saved switches.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub switches: Option<[u32; 2]>,
    /// Allowed share of air in 1/1000, and largest number of saved samples of blowing.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub air: Option<[u32; 2]>,
    /// Prediction horizon of the bias estimate, samples.
    pub lead: u16,
    /// Samples from an opening command to half the jet.
    pub opening: u16,
    /// Samples from a closing command to half the jet.
    pub closing: u16,
    /// Look-ahead memory the law needs, samples.
    pub look_ahead: u16,
    /// Share of a residual that corrects the estimate.
    pub observer: f64,
    /// Weight of a prediction error in the average of these errors, per sample.
    pub bias_rate: f64,
    /// Integral action, 1 per sample.
    pub integral_rate: f64,
    /// Dead band of the averaged prediction error, y; 0 in files without it.
    #[serde(default)]
    pub play: f64,
    /// Final rate of the integral relative to its first rate, above 0 and at most 1; 1 in files without this key.
    #[serde(default = "whole")]
    pub settled: f64,
    /// Limit of bias and integral, y.
    pub correction_limit: f64,
    /// Limit of a residual, y.
    pub residual_limit: f64,
    /// Trials in which attachment was lost, if the law was written with `--force`.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub lost: Vec<String>,
}

fn whole() -> f64 {
    1.0
}

/// A pulse train; times in samples.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Maximise {
    /// Length of the period.
    pub period: u32,
    /// First sample and length of each pulse.
    pub pulses: Vec<(u32, u32)>,
    /// Shortest on and off times.
    #[serde(with = "HoldTable")]
    pub hold: HoldTimes,
    /// Price of steady blowing for which these pulses are optimal, y.
    pub air_price: f64,
    /// Trials in which attachment was lost, if the law was written with `--force`.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub lost: Vec<String>,
}

impl Track {
    /// Time for which the law predicts beyond an arrival, in units of half a sample.
    #[must_use]
    pub fn anticipation(&self) -> HoldTimes {
        match self.anticipation {
            Some([on, off]) => HoldTimes { on, off },
            None => HoldTimes {
                on: self.hold.of(true),
                off: self.hold.of(false),
            },
        }
    }

    /// The law with numbers of type `T`.
    #[must_use]
    pub fn tracking<T: Real>(&self) -> Tracking<T> {
        let number = T::from_f64;
        Tracking {
            reference: number(self.reference),
            reachable: Reachable {
                low: number(self.reachable[0]),
                high: number(self.reachable[1]),
            },
            slope: number(self.slope),
            hold: self.hold,
            anticipation: self.anticipation(),
            budget: Budget {
                switches: self.switches.map(|[samples_per_switch, saved]| Switches {
                    samples_per_switch,
                    saved,
                }),
                air: self.air.map(|[per_mille, saved]| Air { per_mille, saved }),
            },
            lead: self.lead,
            opening: self.opening,
            closing: self.closing,
            observer: number(self.observer),
            bias_rate: number(self.bias_rate),
            integral_rate: number(self.integral_rate),
            play: number(self.play),
            settled: number(self.settled),
            correction_limit: number(self.correction_limit),
            residual_limit: number(self.residual_limit),
        }
    }
}

impl Maximise {
    /// The pulses.
    #[must_use]
    pub fn train(&self) -> PulseTrain<Vec<(u32, u32)>> {
        PulseTrain {
            period: self.period,
            pulses: self.pulses.clone(),
        }
    }
}

impl Law {
    /// Trials in which attachment was lost, by name.
    #[must_use]
    pub fn lost(&self) -> &[String] {
        match self {
            Self::Track(law) => &law.lost,
            Self::Maximise(law) => &law.lost,
        }
    }

    /// The law, with the trials in which attachment was lost.
    #[must_use]
    pub fn which_lost(mut self, trials: Vec<String>) -> Self {
        match &mut self {
            Self::Track(law) => law.lost = trials,
            Self::Maximise(law) => law.lost = trials,
        }
        self
    }

    /// The first invalid key with its problem.
    pub(super) fn fault(&self) -> Option<(String, String)> {
        let fault = |key: &str, problem: &str| Some((format!("law.{key}"), problem.to_owned()));
        match self {
            Self::Track(law) => {
                let [low, high] = law.reachable;
                if !(low < high && law.reference > low && law.reference < high) {
                    return fault("reference", "lies outside `law.reachable`");
                }
                let shares = [
                    ("observer", law.observer),
                    ("bias_rate", law.bias_rate),
                    ("integral_rate", law.integral_rate),
                ];
                if let Some((key, _)) = shares.iter().find(|(_, x)| !(0.0..=1.0).contains(x)) {
                    return fault(key, "must lie between 0 and 1");
                }
                if !(law.settled > 0.0 && law.settled <= 1.0) {
                    return fault("settled", "must be above 0 and at most 1");
                }
                let limits = [
                    ("correction_limit", law.correction_limit),
                    ("residual_limit", law.residual_limit),
                    ("slope", law.slope),
                    ("play", law.play),
                ];
                if let Some((key, _)) = limits.iter().find(|(_, x)| !(x.is_finite() && *x >= 0.0)) {
                    return fault(key, "must be a finite number, 0 or above");
                }
                if law.lead == 0 || law.lead >= law.look_ahead {
                    return fault("lead", "must be at least 1 and below `law.look_ahead`");
                }
                None
            }
            Self::Maximise(law) => {
                if law.period == 0 || law.pulses.is_empty() {
                    return fault("period", "a pulse train needs a period and a pulse");
                }
                let mut pulses = law.pulses.clone();
                pulses.sort_unstable();
                if !checks::train(law.period, &pulses, law.hold) {
                    return fault(
                        "pulses",
                        "must lie within the period, with lengths and gaps that `law.hold` permits",
                    );
                }
                if !law.air_price.is_finite() {
                    return fault("air_price", "must be a finite number");
                }
                None
            }
        }
    }
}
