//! Coordinates: the signals that a term may depend on at its place.

use crate::terms::Units;
use model_core::effect::Unit;

/// The coordinate of a term. Times in s.
#[derive(Clone, Debug, PartialEq)]
pub enum Coordinate {
    /// The friction of the flow.
    Y,
    /// The sensor's reading before the term.
    Reading,
    /// y this long ago, s.
    PastY(f64),
    /// Mean of y over this time.
    MeanY(f64),
    /// Time since the last rising edge of the command.
    SinceRisingEdge,
    /// Time since the last falling edge of the command.
    SinceFallingEdge,
    /// Duration of the rest before the last pulse.
    RestBefore,
    /// Duration of the last pulse, or of the present one so far.
    PulseLength,
    /// Number of pulses so far, the present one included.
    PulseNumber,
    /// Total blowing time within this window.
    Blowing(f64),
    /// The command after a first-order low-pass filter.
    MemoryOfU(f64),
    /// y after a first-order low-pass filter.
    MemoryOfY(f64),
    /// |ẏ| after a first-order low-pass filter.
    MemoryOfRate(f64),
    /// Time since the start of the record.
    Time,
    /// A measured channel minus its mean.
    Channel(String),
}

/// A state variable of an effect file.
pub(crate) struct State {
    pub(crate) name: &'static str,
    pub(crate) start: f64,
    pub(crate) update: String,
}

/// Time assumed since the last edge before the record: 10 000 samples, i.e. 10 s at 1 kHz.
const LONG_AGO_S: f64 = 10.0;
/// Parameter name of a fitted filter time constant.
pub(crate) const FADING: &str = "fading_time";

impl Coordinate {
    /// The coordinate in words, as in documents.
    #[must_use]
    pub fn words(&self) -> String {
        let seconds = |t: &f64| crate::picture::significant(*t, 2);
        match self {
            Self::Y => "y".to_owned(),
            Self::Reading => "reading".to_owned(),
            Self::PastY(t) => format!("past y ({} s)", seconds(t)),
            Self::MeanY(t) => format!("mean y ({} s)", seconds(t)),
            Self::SinceRisingEdge => "since rising edge".to_owned(),
            Self::SinceFallingEdge => "since falling edge".to_owned(),
            Self::RestBefore => "rest before".to_owned(),
            Self::PulseLength => "pulse length".to_owned(),
            Self::PulseNumber => "pulse number".to_owned(),
            Self::Blowing(t) => format!("blowing in the last {} s", seconds(t)),
            Self::MemoryOfU(t) => format!("memory of u ({} s)", seconds(t)),
            Self::MemoryOfY(t) => format!("memory of y ({} s)", seconds(t)),
            Self::MemoryOfRate(t) => format!("memory of rate ({} s)", seconds(t)),
            Self::Time => "time in record".to_owned(),
            Self::Channel(name) => name.clone(),
        }
    }

    /// Words of the coordinate without times, joined by `-`: part of a term's name.
    pub(crate) fn slug(&self) -> String {
        let words = self.words();
        let kind = words.split(" (").next().unwrap_or(&words);
        let kind = kind.split(" in the last").next().unwrap_or(kind);
        let letter = |c: char| match c {
            'a'..='z' | '0'..='9' => c,
            'A'..='Z' => c.to_ascii_lowercase(),
            _ => '-',
        };
        let slug: String = kind.chars().map(letter).collect();
        let parts: Vec<&str> = slug.split('-').filter(|part| !part.is_empty()).collect();
        parts.join("-")
    }

    /// Unit of the coordinate.
    #[must_use]
    pub fn unit(&self) -> Unit {
        match self {
            Self::Y | Self::Reading | Self::PastY(_) | Self::MeanY(_) | Self::MemoryOfY(_) => {
                Unit::Y
            }
            Self::SinceRisingEdge
            | Self::SinceFallingEdge
            | Self::RestBefore
            | Self::PulseLength
            | Self::Blowing(_)
            | Self::Time => Unit::Second,
            Self::MemoryOfRate(_) => Unit::Other("y/s"),
            Self::PulseNumber | Self::MemoryOfU(_) => Unit::None,
            Self::Channel(_) => Unit::Other("above its mean"),
        }
    }

    /// One inner unit of the coordinate in the user's units.
    pub(crate) fn scale(&self, units: &Units) -> f64 {
        match self {
            Self::MemoryOfU(_) => 1.0,
            Self::MemoryOfRate(_) => units.y / units.time,
            Self::Blowing(_) => units.time,
            _ => self.unit().scale(units.y, units.time, 1.0),
        }
    }

    /// The coordinate in the user's units.
    pub(crate) fn out(&self, units: &Units) -> Self {
        let mut other = self.clone();
        if let Some(time) = other.time_mut() {
            *time *= units.time;
        }
        other
    }

    fn time_mut(&mut self) -> Option<&mut f64> {
        match self {
            Self::PastY(t)
            | Self::MeanY(t)
            | Self::Blowing(t)
            | Self::MemoryOfU(t)
            | Self::MemoryOfY(t)
            | Self::MemoryOfRate(t) => Some(t),
            _ => None,
        }
    }

    /// Whether the coordinate's memory is at most `longest`.
    pub(crate) fn fits(&self, longest: f64) -> bool {
        match self {
            Self::PastY(t) | Self::MeanY(t) | Self::Blowing(t) => *t <= longest,
            _ => true,
        }
    }

    /// Whether the coordinate has a time constant from a grid.
    pub(crate) fn has_time(&self) -> bool {
        self.clone().time_mut().is_some()
    }

    /// The coordinate with its time constant multiplied by `factor`; `None` without a time constant.
    pub(crate) fn with_time_times(&self, factor: f64) -> Option<Self> {
        let mut other = self.clone();
        *other.time_mut()? *= factor;
        Some(other)
    }

    /// Time constant of the coordinate's filter, if that can be fitted.
    pub(crate) fn fading(&self) -> Option<f64> {
        match self {
            Self::MemoryOfU(t) | Self::MemoryOfY(t) | Self::MemoryOfRate(t) => Some(*t),
            _ => None,
        }
    }

    /// The coordinate with another filter time constant.
    pub(crate) fn with_fading(&self, time: f64) -> Self {
        let mut other = self.clone();
        if self.fading().is_some()
            && let Some(own) = other.time_mut()
        {
            *own = time;
        }
        other
    }

    /// Name of the channel that the coordinate reads.
    pub(crate) fn channel(&self) -> Option<&str> {
        match self {
            Self::Channel(name) => Some(name),
            _ => None,
        }
    }

    /// The coordinate as an expression of an effect file.
    pub(crate) fn expression(&self) -> String {
        match self {
            Self::Y => "y".to_owned(),
            Self::Reading => "reading".to_owned(),
            Self::PastY(t) => format!("delayed(y, {t:?})"),
            Self::MeanY(_) => "mean".to_owned(),
            Self::SinceRisingEdge => "since_rise".to_owned(),
            Self::SinceFallingEdge => "since_fall".to_owned(),
            Self::RestBefore => "rest".to_owned(),
            Self::PulseLength => "length".to_owned(),
            Self::PulseNumber => "number".to_owned(),
            Self::Blowing(_) => "blown".to_owned(),
            Self::MemoryOfU(_) | Self::MemoryOfY(_) | Self::MemoryOfRate(_) => "memory".to_owned(),
            Self::Time => "t".to_owned(),
            Self::Channel(name) => format!("({name} - reference)"),
        }
    }

    /// State variables of the coordinate. The command counts as on above `on`; with `fitted`, the time constant is a
    /// parameter.
    pub(crate) fn states(&self, on: f64, time: f64, fitted: bool) -> Vec<State> {
        let rises = format!("u > {on:?} && was_on < 0.5");
        let falls = format!("u <= {on:?} && was_on > 0.5");
        let long_ago = LONG_AGO_S * time;
        // This state must be updated last, so that the other states use its value of the previous
        // sample.
        let was_on = || State {
            name: "was_on",
            start: 0.0,
            update: format!("if u > {on:?} {{ 1.0 }} else {{ 0.0 }}"),
        };
        let state = |name, start, update| State {
            name,
            start,
            update,
        };
        let since = |name, edge: &str| {
            let update = format!("if {edge} {{ 0.0 }} else {{ {name} + period }}");
            state(name, long_ago, update)
        };
        let fading = |signal: &str, t: &f64| {
            let time = if fitted {
                FADING.to_owned()
            } else {
                format!("{t:?}")
            };
            let update = format!("memory + ({signal} - memory) * (1.0 - exp(-period / {time}))");
            state("memory", 0.0, update)
        };
        match self {
            Self::Y | Self::Reading | Self::PastY(_) | Self::Time | Self::Channel(_) => Vec::new(),
            Self::MeanY(t) => {
                let update = format!("mean + (y - delayed(y, {t:?})) * (period / {t:?})");
                vec![state("mean", 0.0, update)]
            }
            Self::Blowing(t) => {
                let scale = 2.0 * on;
                let update = format!("blown + (u - delayed(u, {t:?})) * (period / {scale:?})");
                vec![state("blown", 0.0, update)]
            }
            Self::SinceRisingEdge => vec![since("since_rise", &rises), was_on()],
            Self::SinceFallingEdge => vec![since("since_fall", &falls), was_on()],
            Self::RestBefore => {
                let update = format!("if {rises} {{ since_fall }} else {{ rest }}");
                let rest = state("rest", long_ago, update);
                vec![rest, since("since_fall", &falls), was_on()]
            }
            Self::PulseLength => {
                let update = format!(
                    "if {rises} {{ period }} else {{ if u > {on:?} {{ length + period }} else {{ length }} }}"
                );
                vec![state("length", 0.0, update), was_on()]
            }
            Self::PulseNumber => {
                let update = format!("if {rises} {{ number + 1.0 }} else {{ number }}");
                vec![state("number", 0.0, update), was_on()]
            }
            Self::MemoryOfU(t) => vec![fading("u", t)],
            Self::MemoryOfY(t) => vec![fading("y", t)],
            Self::MemoryOfRate(t) => {
                let was = state("was", 0.0, "y".to_owned());
                vec![fading("abs(y - was) / period", t), was]
            }
        }
    }
}

/// Longest memory in records of `longest` seconds, both at 1 kHz.
pub(crate) fn remembered(longest: f64) -> f64 {
    (0.25 * longest).min(2.0)
}

/// All coordinates to screen: time constants are multiples of the flow's, limited by the record length
/// `longest` in seconds.
pub(crate) fn coordinates(
    time_constant: f64,
    longest: f64,
    channels: &[String],
) -> Vec<Coordinate> {
    let times = |multiples: &[f64], most: f64| -> Vec<f64> {
        let all = multiples.iter().map(|m| m * time_constant);
        all.filter(|t| *t <= most).collect()
    };
    let remembered = remembered(longest);
    let mut all = vec![
        Coordinate::Y,
        Coordinate::SinceRisingEdge,
        Coordinate::SinceFallingEdge,
        Coordinate::RestBefore,
        Coordinate::PulseLength,
        Coordinate::PulseNumber,
        Coordinate::Time,
    ];
    let with = |of: fn(f64) -> Coordinate, times: Vec<f64>| times.into_iter().map(of);
    all.extend(with(
        Coordinate::PastY,
        times(&[2.0, 5.0, 12.0], remembered),
    ));
    all.extend(with(Coordinate::MeanY, times(&[10.0], remembered)));
    all.extend(with(
        Coordinate::Blowing,
        times(&[3.0, 8.0, 24.0], remembered),
    ));
    let slow = 0.5 * longest;
    all.extend(with(
        Coordinate::MemoryOfU,
        times(&[2.0, 6.0, 20.0, 60.0], slow),
    ));
    all.extend(with(Coordinate::MemoryOfY, times(&[3.0, 10.0, 40.0], slow)));
    all.extend(with(
        Coordinate::MemoryOfRate,
        times(&[2.0, 8.0, 30.0], slow),
    ));
    all.extend(channels.iter().cloned().map(Coordinate::Channel));
    all
}
