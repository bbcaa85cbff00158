//! The identity card of an effect: all that fit, diagnosis, reports and code
//! generation know of it. What an effect is stands in its own file only.

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
    /// In what is measured; outside the recursion.
    Sensor,
}

/// How a parameter enters, for whoever searches it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Influence {
    /// The output has a derivative in it.
    Smooth,
    /// The output changes in steps (a threshold, a rounded delay).
    Stepwise,
}

/// Which sign of a parameter is physics. The range that is searched may hold
/// the other one, so that a fit can show that the physics is another.
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
    /// Lowest value that makes sense, for signals of order 1.
    pub low: f64,
    /// Highest value that makes sense.
    pub high: f64,
    /// Values from which a search should set out, for signals of order 1; those
    /// in y per sample are relative to the usual change of y over a sample.
    pub starts: &'static [f64],
    /// How it enters.
    pub influence: Influence,
    /// Which sign of it is physics.
    pub sign: Sign,
}

impl Parameter {
    /// A parameter between the values of `range`, in which the output has a
    /// derivative; one that cannot be negative keeps its sign.
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
        }
    }

    /// The same, but the output changes in steps.
    #[must_use]
    pub const fn stepwise(self) -> Self {
        Self {
            influence: Influence::Stepwise,
            ..self
        }
    }

    /// The same, but negative values are no physics, even if they are searched.
    #[must_use]
    pub const fn positive(self) -> Self {
        Self {
            sign: Sign::Positive,
            ..self
        }
    }

    /// Whether it spans orders of magnitude and is best searched in its logarithm.
    #[must_use]
    pub fn is_logarithmic(&self) -> bool {
        self.low > 0.0 && self.high > 20.0 * self.low
    }

    /// Lowest and highest value for signals of the size that `facts` say.
    #[must_use]
    pub fn range(&self, facts: &Facts<'_>) -> [f64; 2] {
        let scale = self.unit.scale(facts.y, facts.time, facts.u);
        [self.low * scale, self.high * scale]
    }
}

/// What the records and the model so far say, for ranges and starting values.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Facts<'a> {
    /// Size of y; 1 for signals of order 1, which cards are written for.
    pub y: f64,
    /// Size of u; 1 for on/off commands.
    pub u: f64,
    /// Size of times; 1 for flows that take from some 10 ms to some s, which
    /// cards are written for.
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
    /// How long the flow takes without jets to forget all but 1/e, s.
    pub time_constant: f64,
}

impl Facts<'_> {
    /// The value of y below which the share `q` (0–1) of all samples lies; 0
    /// without samples.
    #[must_use]
    pub fn quantile(&self, q: f64) -> f64 {
        let index = (q * self.sorted_y.len() as f64) as usize;
        self.sorted_y.get(index).copied().unwrap_or(0.0)
    }
}

/// A value from which a search sets out.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum StartValue {
    /// A number, for signals of order 1.
    Number(f64),
    /// The value of y below which this share of all samples lies.
    Quantile(f64),
    /// So many samples longer than the present delay.
    Delay(f64),
    /// So many times the flow's time constant.
    TimeConstants(f64),
    /// So many times the length of a record.
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
            // The usual change of y is nearer to what is sought than its size.
            Self::Number(value) if parameter.unit == Unit::YPerSample => value * facts.y_per_sample,
            Self::Number(value) => value * parameter.unit.scale(facts.y, facts.time, facts.u),
            Self::Quantile(q) => facts.quantile(q),
            Self::Delay(longer) => in_time(facts.delay + longer),
            Self::TimeConstants(times) => in_time(times * facts.time_constant / facts.period),
            Self::Records(times) => in_time(times * facts.record / facts.period),
        }
    }
}

/// Where a search of all parameters of an effect sets out.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Starts {
    /// From every combination of the parameters' own starting values.
    Grid,
    /// From these, each with one value for every parameter: they depend on each
    /// other, or on the data.
    Rows(&'static [&'static [StartValue]]),
}

/// What an effect needs to show at all, besides its channel.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Needs {
    /// Nothing.
    Nothing,
    /// An input with more than two levels.
    GradedInput,
}

impl Needs {
    /// Why the effect cannot show where the input is on/off or is not; none if it can.
    #[must_use]
    pub fn unmet(self, on_off: bool) -> Option<&'static str> {
        match self {
            Self::GradedInput if on_off => {
                Some("the input has two levels only, which any static curve maps on two")
            }
            _ => None,
        }
    }
}

/// From all parameters of an effect to a number and its unit, as a person would
/// say them.
pub type Said = fn(&[f64]) -> (f64, &'static str);

/// The parameter with which an effect vanishes as it goes to 0, and how it is said.
#[derive(Clone, Copy, Debug)]
pub struct Amplitude {
    /// The parameter's name.
    pub parameter: &'static str,
    /// The effect in a sentence: "a lag of the valve" (above 3 ms would have been seen).
    pub words: &'static str,
    /// Whether what the effect adds grows in proportion to it, all else as it is.
    pub linear: bool,
    /// Whether all other parameters vanish with it.
    pub together: bool,
    /// What people imagine more easily than the parameter; none: the parameter
    /// [as it is spoken](Unit::spoken).
    pub said: Option<Said>,
}

impl Amplitude {
    /// An amplitude to which the effect is not proportional, said in its unit.
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

    /// The same for an effect that is proportional to it.
    #[must_use]
    pub const fn linear(self) -> Self {
        Self {
            linear: true,
            ..self
        }
    }

    /// The same where all parameters vanish together.
    #[must_use]
    pub const fn together(self) -> Self {
        Self {
            together: true,
            ..self
        }
    }

    /// The same, said otherwise.
    #[must_use]
    pub const fn said(self, said: Said) -> Self {
        Self {
            said: Some(said),
            ..self
        }
    }
}

/// How the effect's Rust type is written in generated code; `T` is the type of
/// its numbers.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum RustType {
    /// `Name`: it has no numbers.
    Plain,
    /// `Name<T>`.
    Numbers,
    /// `Name<T, N>`, with N samples of memory: 3 more than the parameter with
    /// this index is long, in s.
    Buffer(usize),
}

/// What the card of a delay law says besides.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct LawCard {
    /// The law in words, with `{}` for each parameter: "{} + {}·exp(−{}·ỹ) samples".
    pub words: &'static str,
    /// Whether it holds edges of the command back, so that jets are not on/off
    /// any more. Its delays are then not meant to be rounded.
    pub shapes_command: bool,
    /// The public fields of its type, if they are the parameters as they are, in
    /// their order: generated code can then have it as a constant.
    pub fields: Option<&'static [&'static str]>,
}

impl LawCard {
    /// A law that leaves the command alone, its words yet to be said.
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
    /// How its type is written there.
    pub rust_type: RustType,
    /// Where it acts.
    pub place: Place,
    /// The physics in one line.
    pub summary: &'static str,
    /// The continuous-time equation.
    pub equation: &'static str,
    /// Its parameters, in the order of [`Physics::new`](super::Physics::new).
    pub parameters: &'static [Parameter],
    /// Where a search of the parameters sets out.
    pub starts: Starts,
    /// How large it is, if that is one number.
    pub amplitude: Option<Amplitude>,
    /// The measured channel it needs besides u and y.
    pub channel: Option<&'static str>,
    /// Whether the reference of its setting is the reading at which the sensor was calibrated, y > 0; 1 where nobody says.
    pub calibrated: bool,
    /// What else it needs to show.
    pub needs: Needs,
    /// Whether it belongs to base models, so that it is never what one lacks: a
    /// constant delay, the sensor's zero.
    pub base: bool,
    /// Whether it acts against a motion: it comes after all that drives the flow, or sets its rate.
    pub resists: bool,
    /// Delay laws: what else is known of them.
    pub law: Option<LawCard>,
    /// Where to read more.
    pub source: &'static str,
}

impl Spec {
    /// What most cards have in common; an effect's own card says what it is and what differs: its parameters are
    /// numbers, set out from every combination of their starting values, and need nothing.
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
        resists: false,
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
        // Not below a sample, not above the range.
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
        assert_eq!(Needs::Nothing.unmet(true), None);
        assert!(Needs::GradedInput.unmet(true).is_some());
        assert_eq!(Needs::GradedInput.unmet(false), None);
    }
}
