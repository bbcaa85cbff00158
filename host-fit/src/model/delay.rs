//! The input delays of a model: fixed, or by a law of the catalogue.

use model_core::Real;
use model_core::delay::Transport;
use model_core::effect::{Physics, Setting, Spec};
use model_core::effects::{self, AnyTransport, ConstantDelay};

/// The input delays of a model.
#[derive(Clone, Debug, PartialEq)]
pub enum Delay {
    /// h_l, whole samples, eq. (3).
    Fixed {
        /// h_l, samples.
        delays: Vec<u16>,
    },
    /// h_l = f_l · h with the delay h of a law.
    Law(TransportLaw),
}

/// A delay law with its values.
#[derive(Clone, Debug)]
pub struct TransportLaw {
    /// The law's card.
    pub spec: &'static Spec,
    /// Parameters of the law, in the order and units of the card.
    pub parameters: Vec<f64>,
    /// f_l, one factor for each input.
    pub factors: Vec<f64>,
    /// Whether the input is interpolated between samples, instead of rounding the delay as in eq. (4).
    pub interpolated: bool,
}

impl PartialEq for TransportLaw {
    fn eq(&self, other: &Self) -> bool {
        self.spec.name == other.spec.name
            && self.parameters == other.parameters
            && self.factors == other.factors
            && self.interpolated == other.interpolated
    }
}

/// The setting of a delay law: only the sample period matters.
pub(super) fn setting<T: Real>(period: T) -> Setting<T> {
    Setting {
        period,
        channel: 0,
        reference: T::ONE,
    }
}

impl TransportLaw {
    /// The law prepared for a sample period of `period_s` s.
    #[must_use]
    pub fn transport(&self, period_s: f64) -> Option<AnyTransport<f64>> {
        AnyTransport::new(self.spec.name, &self.parameters, &setting(period_s))
    }

    /// The shortest and the longest delay of the law, samples; without bounds, the delay of the flow without
    /// jets.
    #[must_use]
    pub fn range(&self, period_s: f64) -> [f64; 2] {
        let Some(law) = self.transport(period_s) else {
            return [0.0; 2];
        };
        law.bounds().unwrap_or_else(|| [law.delay(0.0); 2])
    }

    /// Whether the law delays edges of the command separately, so that jets are no longer on/off.
    #[must_use]
    pub fn shapes_command(&self) -> bool {
        self.spec.law.is_some_and(|law| law.shapes_command)
    }
}

impl Delay {
    /// The delays h_l = f_l · h by the law `L`.
    #[must_use]
    pub fn of<L: Physics<f64> + Transport<f64>>(
        parameters: &[f64],
        factors: Vec<f64>,
        interpolated: bool,
    ) -> Self {
        // A law outside the catalogue has a card as well.
        let spec = effects::law(L::SPEC.name).unwrap_or(const { &L::SPEC });
        Self::Law(TransportLaw {
            spec,
            parameters: parameters.to_vec(),
            factors,
            interpolated,
        })
    }

    /// The law with its values if it is the law `L`.
    #[must_use]
    pub fn law<L: Physics<f64> + Transport<f64>>(&self) -> Option<&TransportLaw> {
        match self {
            Self::Law(law) if law.spec.name == L::SPEC.name => Some(law),
            _ => None,
        }
    }

    /// Whether `other` follows the same law.
    #[must_use]
    pub fn is_alike(&self, other: &Self) -> bool {
        match (self, other) {
            (Self::Fixed { .. }, Self::Fixed { .. }) => true,
            (Self::Law(own), Self::Law(other)) => own.spec.name == other.spec.name,
            _ => false,
        }
    }

    /// Whether the delay depends on the averaged y.
    #[must_use]
    pub fn follows_y(&self) -> bool {
        match self {
            Self::Fixed { .. } => false,
            Self::Law(law) => law.spec.name != <ConstantDelay<f64> as Physics<f64>>::SPEC.name,
        }
    }

    /// The name of the law in the catalogue of effects; none if base models have it.
    #[must_use]
    pub fn effect_name(&self) -> Option<&'static str> {
        match self {
            Self::Law(law) if effects::spec(law.spec.name).is_some() => Some(law.spec.name),
            Self::Fixed { .. } | Self::Law(_) => None,
        }
    }

    /// The delays of the inputs relative to the first.
    #[must_use]
    pub fn factors(&self) -> Vec<f64> {
        match self {
            Self::Fixed { delays } => {
                let first = f64::from(delays.first().copied().unwrap_or(1).max(1));
                delays.iter().map(|h| f64::from(*h) / first).collect()
            }
            Self::Law(law) => law.factors.clone(),
        }
    }

    /// This delay for as many inputs as `other` has, with the same ratios between the inputs.
    #[must_use]
    pub(crate) fn for_inputs_of(&self, other: &Self) -> Self {
        match (self, other) {
            (Self::Law(own), _) => {
                let first = |factors: &[f64]| factors.first().copied().unwrap_or(1.0);
                let (others, factor) = (other.factors(), first(&own.factors));
                // If the first input has no delay, all inputs get the same delay.
                let ratio = |f: &f64| match first(&others) {
                    0.0 => 1.0,
                    first => f / first,
                };
                Self::Law(TransportLaw {
                    factors: others.iter().map(|f| factor * ratio(f)).collect(),
                    ..own.clone()
                })
            }
            (Self::Fixed { delays }, Self::Fixed { delays: others }) => {
                let first = |delays: &[u16]| delays.first().copied().unwrap_or(0);
                let (own, other) = (first(delays), first(others));
                let later = |h: &u16| h.saturating_sub(other).saturating_add(own);
                Self::Fixed {
                    delays: others.iter().map(later).collect(),
                }
            }
            (Self::Fixed { delays }, Self::Law(law)) => {
                let own = f64::from(delays.first().copied().unwrap_or(0));
                let first = law.factors.first().copied().unwrap_or(1.0);
                let scaled = |f: &f64| (own * f / first).round().clamp(0.0, 65_535.0) as u16;
                Self::Fixed {
                    delays: law.factors.iter().map(scaled).collect(),
                }
            }
        }
    }

    /// The longest delay, samples, at a sample period of `period_s` s. An edge that is delayed separately arrives
    /// between two samples.
    #[must_use]
    pub(super) fn longest(&self, period_s: f64) -> f64 {
        match self {
            Self::Fixed { delays } => delays.iter().copied().max().unwrap_or(0).into(),
            Self::Law(law) => {
                let Some(transport) = law.transport(period_s) else {
                    return 0.0;
                };
                let factor = law.factors.iter().copied().fold(0.0, f64::max);
                let [_, longest] = law.range(period_s);
                let [rising, falling] = transport.held_back();
                factor * longest + rising.max(falling) + f64::from(u8::from(law.shapes_command()))
            }
        }
    }

    /// The first input's delay at the averaged output `output`, samples: the mean of rising and falling
    /// edges.
    #[must_use]
    pub fn present(&self, output: f64, period_s: f64) -> f64 {
        match self {
            Self::Fixed { delays } => delays.first().copied().unwrap_or(0).into(),
            Self::Law(law) => {
                let Some(transport) = law.transport(period_s) else {
                    return 0.0;
                };
                let factor = law.factors.first().copied().unwrap_or(1.0);
                let [rising, falling] = transport.held_back();
                factor * transport.delay(output) + 0.5 * (rising + falling)
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use model_core::effects::{ConstantDelay, EdgeDependentDelay, StateDependentDelay};

    #[test]
    fn a_law_knows_its_longest_and_its_present_delay() {
        let law = Delay::of::<StateDependentDelay<f64>>(&[40.0, 10.0, 4.0], vec![1.0, 2.0], true);
        assert_eq!(law.longest(0.001), 100.0);
        assert!((law.present(0.5, 0.001) - (40.0 + 10.0 * (-2.0_f64).exp())).abs() < 1e-12);
        assert_eq!(law.effect_name(), Some("state-dependent-delay"));
        assert!(law.law::<EdgeDependentDelay<f64>>().is_none());

        let edges = Delay::of::<EdgeDependentDelay<f64>>(&[0.050, 0.020], vec![1.0], true);
        assert!((edges.longest(0.001) - 51.0).abs() < 1e-9);
        assert!((edges.present(0.5, 0.001) - 35.0).abs() < 1e-9);

        let constant = Delay::of::<ConstantDelay<f64>>(&[31.4], vec![1.0], true);
        assert_eq!(constant.longest(0.001), 31.4);
        assert_eq!(constant.effect_name(), None);
        let fixed = Delay::Fixed {
            delays: vec![49, 98],
        };
        assert_eq!(fixed.factors(), [1.0, 2.0]);
        // The delay gets the factors of another delay.
        let own = constant.for_inputs_of(&fixed);
        assert_eq!(own.factors(), [1.0, 2.0]);
        let own = Delay::Fixed { delays: vec![9] }.for_inputs_of(&fixed);
        assert_eq!(
            own,
            Delay::Fixed {
                delays: vec![9, 58]
            }
        );
    }
}
