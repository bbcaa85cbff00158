//! The card of an effect: all data that fit, diagnosis, reports and code generation use. An effect is defined
//! in its own file only.

use super::Unit;

/// Where an effect acts.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Place {
    /// Between the command and the jets.
    Jet,
    /// In the transport from jets to sensor.
    Delay,
    /// In the recursion of the flow.
    Flow,
    /// In the sensor's reading, outside the recursion.
    Sensor,
}

/// When an effect acts among those of its place.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Turn {
    /// Before all others.
    First,
    /// In the order of the catalogue.
    InOrder,
    /// After all others, base terms included.
    Last,
}

/// How the output depends on a parameter.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Influence {
    /// The output is differentiable with respect to the parameter.
    Smooth,
    /// The output changes in steps (a threshold, a rounded delay).
    Stepwise,
}

/// Physically possible sign of a parameter. The search range may include the other sign, so that a fit can
/// reject the physics.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Sign {
    /// Both.
    Either,
    /// 0 or above.
    Positive,
}

/// A physical parameter of an effect.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Parameter {
    /// Name in model files and reports.
    pub name: &'static str,
    /// Unit.
    pub unit: Unit,
    /// Lowest plausible value, for signals of order 1.
    pub low: f64,
    /// Highest plausible value.
    pub high: f64,
    /// Starting values of a search, for signals of order 1; those in y per sample are relative to the usual
    /// change of y per sample.
    pub starts: &'static [f64],
    /// How it enters.
    pub influence: Influence,
    /// Physically possible sign of the parameter.
    pub sign: Sign,
    /// Value of the parameter if a model file does not contain it; `None` for a required parameter.
    pub left_out: Option<f64>,
    /// Name of a parameter of the same effect that must physically be larger; `None` if there is none.
    pub below: Option<&'static str>,
}

impl Parameter {
    /// A parameter in `range` in which the output is differentiable; a non-negative one keeps its sign.
    #[must_use]
    pub const fn new(
        name: &'static str,
        unit: Unit,
        range: [f64; 2],
        starts: &'static [f64],
    ) -> Self {
        let [low, high] = range;
        Self {
            name,
            unit,
            low,
            high,
            starts,
            influence: Influence::Smooth,
            sign: if low >= 0.0 {
                Sign::Positive
            } else {
                Sign::Either
            },
            left_out: None,
            below: None,
        }
    }

    /// The parameter is optional in model files, with this value if it is left out.
    #[must_use]
    pub const fn or_else(self, value: f64) -> Self {
        Self {
            left_out: Some(value),
            ..self
        }
    }

    /// The output changes in steps with this parameter.
    #[must_use]
    pub const fn stepwise(self) -> Self {
        Self {
            influence: Influence::Stepwise,
            ..self
        }
    }

    /// The parameter must physically be smaller than `other`. A fit may cross this limit, so that it can reject the
    /// physics.
    #[must_use]
    pub const fn below(self, other: &'static str) -> Self {
        Self {
            below: Some(other),
            ..self
        }
    }

    /// Negative values of this parameter are searched, but are not physical.
    #[must_use]
    pub const fn positive(self) -> Self {
        Self {
            sign: Sign::Positive,
            ..self
        }
    }

    /// Whether the parameter spans orders of magnitude and is searched in its logarithm.
    #[must_use]
    pub fn is_logarithmic(&self) -> bool {
        self.low > 0.0 && self.high > 20.0 * self.low
    }

    /// Lowest and highest value for signals of the size in `facts`.
    #[must_use]
    pub fn range(&self, facts: &Facts<'_>) -> [f64; 2] {
        let scale = self.unit.scale(facts.y, facts.time, facts.u);
        [self.low * scale, self.high * scale]
    }
}

/// Facts about records and model, for ranges and starting values.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Facts<'a> {
    /// Typical size of y. The values on the cards hold for a size of 1.
    pub y: f64,
    /// Typical size of u; 1 for on/off commands.
    pub u: f64,
    /// Time scale relative to that of the cards: 1 for flows with times of 10 ms to seconds.
    pub time: f64,
    /// Root mean square change of y over a sample.
    pub y_per_sample: f64,
    /// All measured y in ascending order.
    pub sorted_y: &'a [f64],
    /// The present delay of the first input, samples.
    pub delay: f64,
    /// Sample period, s.
    pub period: f64,
    /// Length of the longest record, s.
    pub record: f64,
    /// Time constant of the flow without jets, s.
    pub time_constant: f64,
}

impl Facts<'_> {
    /// Quantile of y at the fraction `q` (0–1) of all samples; 0 without samples.
    #[must_use]
    pub fn quantile(&self, q: f64) -> f64 {
        let index = (q * self.sorted_y.len() as f64) as usize;
        self.sorted_y.get(index).copied().unwrap_or(0.0)
    }
}

/// A starting value of a search.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum StartValue {
    /// A number, for signals of order 1.
    Number(f64),
    /// The quantile of y at this fraction.
    Quantile(f64),
    /// The level at this fraction of the range between the 5 and 95 % quantiles of y.
    Level(f64),
    /// The present delay plus this many samples.
    Delay(f64),
    /// A multiple of the flow's time constant.
    TimeConstants(f64),
    /// A multiple of the record length.
    Records(f64),
}

impl StartValue {
    /// The value for `parameter`, in its unit.
    #[must_use]
    pub fn value(self, parameter: &Parameter, facts: &Facts<'_>) -> f64 {
        let in_time = |samples: f64| match parameter.unit {
            Unit::Second => {
                let [_, high] = parameter.range(facts);
                (samples * facts.period).max(facts.period).min(high)
            }
            _ => samples,
        };
        match self {
            // For a parameter in y per sample, a typical change of y is a better scale than the
            // size of y.
            Self::Number(value) if parameter.unit == Unit::YPerSample => value * facts.y_per_sample,
            Self::Number(value) => value * parameter.unit.scale(facts.y, facts.time, facts.u),
            Self::Quantile(q) => facts.quantile(q),
            Self::Level(share) => {
                let [low, high] = [0.05, 0.95].map(|q| facts.quantile(q));
                low + share * (high - low)
            }
            Self::Delay(longer) => in_time(facts.delay + longer),
            Self::TimeConstants(times) => in_time(times * facts.time_constant / facts.period),
            Self::Records(times) => in_time(times * facts.record / facts.period),
        }
    }
}

/// Starting points of a search over all parameters of an effect.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Starts {
    /// All combinations of the parameters' starting values.
    Grid,
    /// A list of starting points, each with one value per parameter: for parameters that depend on each other or on the
    /// data.
    Rows(&'static [&'static [StartValue]]),
}

/// Requirements of an effect besides its channel.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Needs {
    /// Nothing.
    Nothing,
    /// An input with more than two levels.
    GradedInput,
    /// A dead time longer than the dead time of the sensor.
    DeadTime,
}

/// Dead time, in samples, up to which a response of the flow could be mistaken for a direct response of the sensor.
const AT_ONCE: f64 = 2.0;

impl Needs {
    /// Why the effect is not identifiable with this kind of input and this dead time, in samples; none if it is.
    #[must_use]
    pub fn unmet(self, on_off: bool, dead_time: f64) -> Option<&'static str> {
        match self {
            Self::DeadTime if dead_time <= AT_ONCE => Some(
                "the flow responds to the command within two samples, as fast as a pickup would",
            ),
            Self::GradedInput if on_off => Some(
                "the input has two levels only, and every static curve maps two levels to two levels",
            ),
            _ => None,
        }
    }
}

/// Conversion of all parameters of an effect to one number with its unit, for reports.
pub type Said = fn(&[f64]) -> (f64, &'static str);

/// The parameter whose value 0 removes the effect, with its wording.
#[derive(Clone, Copy, Debug)]
pub struct Amplitude {
    /// The parameter's name.
    pub parameter: &'static str,
    /// The effect in a phrase, for example "a lag of the valve" in "a lag of the valve above 3 ms would have been
    /// detected".
    pub words: &'static str,
    /// Whether the effect's contribution is proportional to this parameter while the other parameters are constant.
    pub linear: bool,
    /// Whether all other parameters are zero when this parameter is zero.
    pub together: bool,
    /// A more intuitive number than the parameter; `None` for the parameter [as spoken](Unit::spoken).
    pub said: Option<Said>,
}

impl Amplitude {
    /// An amplitude to which the effect is not proportional, in its own unit.
    #[must_use]
    pub const fn new(parameter: &'static str, words: &'static str) -> Self {
        Self {
            parameter,
            words,
            linear: false,
            together: false,
            said: None,
        }
    }

    /// The effect is proportional to this amplitude.
    #[must_use]
    pub const fn linear(self) -> Self {
        Self {
            linear: true,
            ..self
        }
    }

    /// The effect vanishes only if all its parameters do.
    #[must_use]
    pub const fn together(self) -> Self {
        Self {
            together: true,
            ..self
        }
    }

    /// Reports state another number in place of this amplitude.
    #[must_use]
    pub const fn said(self, said: Said) -> Self {
        Self {
            said: Some(said),
            ..self
        }
    }
}

/// The effect's Rust type in generated code; `T` is the number type.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum RustType {
    /// `Name`, without numbers.
    Plain,
    /// `Name<T>`.
    Numbers,
    /// `Name<T, N>` with N samples of memory: 3 more than the length in s of the parameter with this index.
    Buffer(usize),
}

/// Additional card of a delay law.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct LawCard {
    /// The law in words, with `{}` for each parameter: "{} + {}·exp(−{}·ỹ) samples".
    pub words: &'static str,
    /// Whether the law delays edges of the command separately, so that jets are no longer on/off. Its delays are then
    /// not rounded.
    pub shapes_command: bool,
    /// The public fields of the effect's type, if they are the parameters in order: generated code can then have it as
    /// a constant.
    pub fields: Option<&'static [&'static str]>,
}

impl LawCard {
    /// The card of a law that does not change the command, with empty `words`.
    pub const PLAIN: Self = Self {
        words: "",
        shapes_command: false,
        fields: None,
    };
}

/// The identity card of an effect.
#[derive(Clone, Copy, Debug)]
pub struct Spec {
    /// Name in commands, model files and reports.
    pub name: &'static str,
    /// Rust path of the effect below `model_core::effects`, for generated code.
    pub rust: &'static str,
    /// Rust type of the effect in that module.
    pub rust_type: RustType,
    /// Where it acts.
    pub place: Place,
    /// The physics in one line.
    pub summary: &'static str,
    /// The continuous-time equation.
    pub equation: &'static str,
    /// Parameters of the effect, in the order of [`Physics::new`](super::Physics::new).
    pub parameters: &'static [Parameter],
    /// Starting points of a search over the parameters.
    pub starts: Starts,
    /// Amplitude parameter of the effect, if it has one.
    pub amplitude: Option<Amplitude>,
    /// The measured channel that the effect needs in addition to u and y.
    pub channel: Option<&'static str>,
    /// Whether the effect's reference is the calibration reading of the sensor, y > 0; 1 by default.
    pub calibrated: bool,
    /// Further requirements.
    pub needs: Needs,
    /// Whether the effect is a base term, which is never reported as missing: a constant delay, the sensor's offset.
    pub base: bool,
    /// Whether the effect and a second lag of the flow give the same output for every command. Reports then
    /// always state both.
    pub lag_in_series: bool,
    /// The parameter that is a dead time of the jets, s, in series with the model's own delay. A search shortens the
    /// model's delay by it when it adds the effect.
    pub dead_time: Option<&'static str>,
    /// Whether the effect opposes or scales a motion; it is then applied after all driving effects.
    pub resists: bool,
    /// When the effect acts among those of its place.
    pub turn: Turn,
    /// Additional card of a delay law.
    pub law: Option<LawCard>,
    /// Literature source.
    pub source: &'static str,
}

impl Spec {
    /// Defaults of a card: number parameters, starting values on a grid, no requirements. An effect's card
    /// overrides them.
    pub const PLAIN: Self = Self {
        name: "",
        rust: "",
        rust_type: RustType::Numbers,
        place: Place::Jet,
        summary: "",
        equation: "",
        parameters: &[],
        starts: Starts::Grid,
        amplitude: None,
        channel: None,
        calibrated: false,
        needs: Needs::Nothing,
        base: false,
        lag_in_series: false,
        dead_time: None,
        resists: false,
        turn: Turn::InOrder,
        law: None,
        source: "",
    };

    /// The index of the parameter called `name`.
    #[must_use]
    pub fn parameter(&self, name: &str) -> Option<usize> {
        self.parameters.iter().position(|p| p.name == name)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const FACTS: Facts<'_> = Facts {
        y: 50.0,
        u: 1.0,
        time: 2.0,
        y_per_sample: 0.25,
        sorted_y: &[-1.0, 0.0, 10.0, 20.0, 50.0],
        delay: 40.0,
        period: 0.002,
        record: 20.0,
        time_constant: 0.1,
    };

    #[test]
    fn starts_follow_the_data() {
        let value = |start: StartValue, unit: Unit| {
            start.value(&Parameter::new("p", unit, [0.001, 0.5], &[]), &FACTS)
        };
        assert_eq!(value(StartValue::Number(0.1), Unit::Y), 5.0);
        assert_eq!(value(StartValue::Number(0.1), Unit::YPerSample), 0.025);
        assert_eq!(value(StartValue::Number(0.1), Unit::Second), 0.2);
        assert_eq!(value(StartValue::Quantile(0.5), Unit::Y), 10.0);
        assert_eq!(value(StartValue::Delay(-6.0), Unit::Samples), 34.0);
        assert_eq!(value(StartValue::Delay(-6.0), Unit::Second), 0.068);
        // A starting value is at least one sample and at most the upper end of the range.
        assert_eq!(value(StartValue::Delay(-60.0), Unit::Second), 0.002);
        assert_eq!(value(StartValue::Delay(1e6), Unit::Second), 1.0);
        assert!((value(StartValue::TimeConstants(2.0), Unit::Samples) - 100.0).abs() < 1e-9);
        assert!((value(StartValue::Records(0.01), Unit::Second) - 0.2).abs() < 1e-12);
    }

    #[test]
    fn what_cannot_be_negative_keeps_its_sign() {
        let free = Parameter::new("p", Unit::Y, [-1.0, 1.0], &[0.1]);
        assert_eq!(free.sign, Sign::Either);
        assert_eq!(free.positive().sign, Sign::Positive);
        let gain = Parameter::new("p", Unit::Y, [0.0, 1.0], &[0.1]);
        assert_eq!(gain.sign, Sign::Positive);
        assert_eq!(gain.range(&FACTS), [0.0, 50.0]);
    }

    #[test]
    fn needs_say_what_is_missing() {
        assert_eq!(Needs::Nothing.unmet(true, 0.0), None);
        assert!(Needs::GradedInput.unmet(true, 30.0).is_some());
        assert_eq!(Needs::GradedInput.unmet(false, 30.0), None);
        assert!(Needs::DeadTime.unmet(true, AT_ONCE).is_some());
        assert_eq!(Needs::DeadTime.unmet(true, AT_ONCE + 0.1), None);
    }
}
