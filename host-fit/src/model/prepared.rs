//! A model in one number type, ready to run.

use super::delay::setting;
use super::{Chain, Delay, HostEffect, Model};
use model_core::Real;
use model_core::delay::{DelayLaw, FixedDelay, Tap, Transport};
use model_core::effect::Setting;
use model_core::effects::{AnyTransport, AnyTransportState};
use model_core::model::{Averaging, Parts};
use model_core::recursion::{Bilinear, Grading, LagConvention, Pace};

/// A model prepared for running with numbers of type `T`.
#[derive(Clone, Debug)]
pub struct Prepared<T: Real> {
    convention: LagConvention,
    averaging: Averaging,
    state_lags: Vec<u16>,
    product_lags: Vec<u16>,
    grading: Grading,
    constant: T,
    a: Vec<T>,
    b: Vec<T>,
    c: Vec<T>,
    /// Cached result of `pace`; `None` only during construction.
    pace: Option<Pace<T>>,
    delay: AnyDelay<T>,
    /// Whether the delay depends on ỹ.
    follows: bool,
    effects: Chain<T>,
}

impl<T: Real> Prepared<T> {
    /// Whether the delay depends on the averaged output ỹ of eq. (1); otherwise ỹ need not be computed.
    #[inline(always)]
    pub(crate) fn follows_average(&self) -> bool {
        self.follows
    }
}

impl<T: Real> Parts<T> for Prepared<T> {
    type Delay = AnyDelay<T>;
    type Effects = Chain<T>;
    #[inline(always)]
    fn recursion(&self) -> Bilinear<'_, T> {
        Bilinear {
            convention: self.convention,
            grading: self.grading,
            constant: self.constant,
            state_lags: &self.state_lags,
            a: &self.a,
            product_lags: &self.product_lags,
            b: &self.b,
            c: &self.c,
            pace: self.pace.as_ref(),
        }
    }
    #[inline(always)]
    fn delay(&self) -> &AnyDelay<T> {
        &self.delay
    }
    #[inline(always)]
    fn effects(&self) -> &Chain<T> {
        &self.effects
    }
    #[inline(always)]
    fn averaging(&self) -> Averaging {
        self.averaging
    }
}

/// Treatment of delays between samples.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Rounding {
    /// As in the model: rounded to whole samples, eq. (4), or interpolated.
    Samples,
    /// Always interpolated: makes the free run differentiable in the law's parameters.
    None,
}

/// Input delays, their kind chosen at run time.
#[derive(Clone, Debug)]
pub enum AnyDelay<T: Real> {
    /// Constant whole samples.
    Fixed(FixedDelay<Vec<u16>>),
    /// Delays by a law of the catalogue.
    Law {
        /// The law.
        law: AnyTransport<T>,
        /// One factor for each input.
        factors: Vec<T>,
        /// Whether the delays are rounded to whole samples.
        rounded: bool,
        /// For each input the nearest and the farthest sample that the delay can read, if known.
        ranges: Vec<Option<(usize, usize)>>,
    },
}

impl<T: Real> DelayLaw<T> for AnyDelay<T> {
    type State = Option<AnyTransportState<T>>;
    const INTERPOLATES: bool = true;
    fn start(&self) -> Self::State {
        match self {
            Self::Fixed(_) => None,
            Self::Law { law, .. } => Some(law.start()),
        }
    }
    #[inline(always)]
    fn command(&self, state: &mut Self::State, command: T) -> T {
        match (self, state) {
            (Self::Law { law, .. }, Some(state)) => law.command(state, command),
            _ => command,
        }
    }
    #[inline(always)]
    fn evaluate(&self, output: T) -> T {
        match self {
            Self::Fixed(law) => law.evaluate(output),
            Self::Law { law, .. } => law.delay(output),
        }
    }
    #[inline(always)]
    fn range(&self, l: usize) -> Option<(usize, usize)> {
        match self {
            Self::Fixed(_) => None,
            Self::Law { ranges, .. } => *ranges.get(l)?,
        }
    }
    #[inline(always)]
    fn tap(&self, l: usize, evaluated: T) -> Tap<T> {
        match self {
            Self::Fixed(law) => law.tap(l, evaluated),
            Self::Law {
                factors, rounded, ..
            } => {
                let factor = factors.get(l).copied().unwrap_or(T::ONE);
                Tap::at(factor * evaluated, *rounded)
            }
        }
    }
}

/// The nearest and the farthest sample that an input with this factor can read, rounded or not; `None` for a
/// law without bounds.
fn range<T: Real>(law: &AnyTransport<T>, factor: f64) -> Option<(usize, usize)> {
    let [shortest, longest] = law.bounds()?.map(|delay| factor * delay.value());
    let known = shortest >= 0.0 && longest.is_finite();
    // One more sample is included on either side, because single precision may round to the next
    // whole sample.
    known.then(|| ((shortest as usize).saturating_sub(1), longest as usize + 2))
}

impl Model {
    /// The model with numbers of type `T`.
    #[must_use]
    pub fn prepare<T: Real>(&self) -> Prepared<T> {
        let values: Vec<T> = self.values().into_iter().map(T::from_f64).collect();
        self.prepare_with(&values, Rounding::Samples)
    }

    /// The model with other parameter values, in the order of
    /// [`coordinates`](Self::coordinates); missing ones count as 0.
    #[must_use]
    pub fn prepare_with<T: Real>(&self, values: &[T], rounding: Rounding) -> Prepared<T> {
        let mut rest = values.iter().copied();
        let mut next = || rest.next().unwrap_or(T::ZERO);
        let mut many = |n: usize| -> Vec<T> { (0..n).map(|_| next()).collect() };
        let constant = many(1)[0];
        let a = many(self.a.len());
        let b = many(self.b.len());
        let c = many(self.c.len());
        let period = T::from_f64(self.sample_period_s);
        let delay = match &self.delay {
            Delay::Fixed { delays } => AnyDelay::Fixed(FixedDelay {
                delays: delays.clone(),
            }),
            Delay::Law(chosen) => {
                let parameters = many(chosen.parameters.len());
                let law = AnyTransport::new(chosen.spec.name, &parameters, &setting(period));
                let factors = chosen.factors.iter().map(|f| T::from_f64(*f));
                match law {
                    Some(law) => AnyDelay::Law {
                        ranges: chosen.factors.iter().map(|f| range(&law, *f)).collect(),
                        law,
                        factors: factors.collect(),
                        rounded: !chosen.interpolated && rounding == Rounding::Samples,
                    },
                    // This case cannot occur: `Delay::of` and files allow only laws of the
                    // catalogue.
                    None => AnyDelay::Fixed(FixedDelay {
                        delays: vec![0; chosen.factors.len()],
                    }),
                }
            }
        };
        let follows = match &delay {
            AnyDelay::Fixed(_) => false,
            AnyDelay::Law { law, .. } => law.bounds().is_none_or(|[least, most]| least != most),
        };
        let channels = self.channels();
        let effects: Vec<HostEffect<T>> = self
            .effects
            .iter()
            .filter_map(|added| {
                let index = |name: &String| channels.iter().position(|c| c == name);
                let setting = Setting {
                    period,
                    channel: added.channel.as_ref().and_then(index).unwrap_or(0),
                    reference: T::from_f64(added.reference()),
                };
                let parameters = many(added.parameters.len());
                HostEffect::new(self, added, &parameters, &setting)
            })
            .collect();
        let mut prepared = Prepared {
            convention: self.convention,
            averaging: self.averaging,
            state_lags: self.state_lags.clone(),
            product_lags: self.product_lags.clone(),
            grading: self.grading,
            constant,
            a,
            b,
            c,
            pace: None,
            follows: follows && !self.averaging.averaged_model,
            delay,
            effects: Chain::new(effects),
        };
        prepared.pace = Some(prepared.recursion().pace());
        prepared
    }
}
