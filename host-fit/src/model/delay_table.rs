//! `[delay]` of a model file: the law, its parameters by name, the factors of the inputs and whether the input is
//! interpolated.

use super::bounds::{self, Fault};
use super::{Delay, TransportLaw};
use model_core::effect::Spec;
use model_core::effects::LAWS;
use serde::{Deserialize, Deserializer, Serialize, Serializer};

/// Name of fixed delays in whole samples, which are not a law.
const FIXED: &str = "fixed";

/// The keys and values, in the order in which they are written.
pub(super) struct DelayTable(Vec<(String, toml::Value)>);

impl Serialize for DelayTable {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.collect_map(self.0.iter().map(|(key, value)| (key, value)))
    }
}

impl<'de> Deserialize<'de> for DelayTable {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        let table = toml::Table::deserialize(deserializer)?;
        Ok(Self(table.into_iter().collect()))
    }
}

/// The name of a law in files: its name without "-delay".
pub(super) fn name_of(spec: &Spec) -> &'static str {
    spec.name.strip_suffix("-delay").unwrap_or(spec.name)
}

impl DelayTable {
    pub(super) fn of(delay: &Delay) -> Self {
        let mut pairs: Vec<(String, toml::Value)> = Vec::new();
        let mut write = |key: &str, value: toml::Value| pairs.push((key.to_owned(), value));
        match delay {
            Delay::Fixed { delays } => {
                write("law", FIXED.into());
                let delays = delays.iter().map(|h| i64::from(*h).into());
                write("delays", toml::Value::Array(delays.collect()));
            }
            Delay::Law(law) => {
                write("law", name_of(law.spec).into());
                for (parameter, value) in law.spec.parameters.iter().zip(&law.parameters) {
                    write(parameter.name, (*value).into());
                }
                let factors = law.factors.iter().map(|f| (*f).into());
                write("factors", toml::Value::Array(factors.collect()));
                write("interpolated", law.interpolated.into());
            }
        }
        Self(pairs)
    }

    /// The delays of a model with this many inputs, or the wrong key with its problem.
    pub(super) fn into_delay(mut self, inputs: usize) -> Result<Delay, Fault> {
        let law = self.take("law");
        let Some(name) = law.as_ref().and_then(toml::Value::as_str) else {
            return Err(fault("law", "is missing"));
        };
        if name == FIXED {
            let delays = self.array("delays", inputs, |value| {
                value.as_integer().and_then(|h| u16::try_from(h).ok())
            })?;
            let delays = delays.ok_or_else(|| fault("delays", "is missing"))?;
            return self.nothing_left(name, Delay::Fixed { delays });
        }
        let Some(spec) = LAWS.iter().find(|spec| name_of(spec) == name) else {
            let known: Vec<&str> = LAWS.iter().map(name_of).collect();
            let problem = format!("`{name}` is not one of {FIXED}, {}", known.join(", "));
            return Err(fault("law", &problem));
        };
        let mut parameters = Vec::with_capacity(spec.parameters.len());
        for parameter in spec.parameters {
            let Some(value) = self.take(parameter.name).as_ref().and_then(number) else {
                let problem = format!("({}) is missing or not a finite number", parameter.unit);
                return Err(fault(parameter.name, &problem));
            };
            bounds::parameter(&format!("delay.{}", parameter.name), parameter, value)?;
            parameters.push(value);
        }
        let factors = self.array("factors", inputs, number)?;
        let mut law = TransportLaw {
            spec,
            parameters,
            factors: factors.unwrap_or_else(|| vec![1.0; inputs]),
            interpolated: false,
        };
        law.interpolated = match self.take("interpolated") {
            None => law.shapes_command(),
            Some(toml::Value::Boolean(interpolated)) => interpolated,
            Some(_) => return Err(fault("interpolated", "is neither true nor false")),
        };
        self.nothing_left(name, Delay::Law(law))
    }

    fn take(&mut self, key: &str) -> Option<toml::Value> {
        let index = self.0.iter().position(|(known, _)| known == key)?;
        Some(self.0.swap_remove(index).1)
    }

    /// One value for each input. `None` if the table does not have the key.
    fn array<T>(
        &mut self,
        key: &str,
        inputs: usize,
        read: impl Fn(&toml::Value) -> Option<T>,
    ) -> Result<Option<Vec<T>>, Fault> {
        let Some(value) = self.take(key) else {
            return Ok(None);
        };
        let array = value.as_array().map_or(&[][..], Vec::as_slice);
        let values: Option<Vec<T>> = array.iter().map(read).collect();
        let Some(values) = values else {
            return Err(fault(
                key,
                "contains a value that is not a number or out of range",
            ));
        };
        if values.len() != inputs {
            let found = values.len();
            let problem = format!("has {found} entries, but `coefficients.b` has {inputs}");
            return Err(fault(key, &problem));
        }
        Ok(Some(values))
    }

    fn nothing_left(&self, law: &str, delay: Delay) -> Result<Delay, Fault> {
        match self.0.first() {
            None => Ok(delay),
            Some((key, _)) => Err(fault(key, &format!("the law `{law}` has no such key"))),
        }
    }
}

fn fault(key: &str, problem: &str) -> Fault {
    (format!("delay.{key}"), problem.to_owned())
}

fn number(value: &toml::Value) -> Option<f64> {
    let integer = || value.as_integer().map(|whole| whole as f64);
    value.as_float().or_else(integer).filter(|v| v.is_finite())
}

#[cfg(test)]
mod tests {
    use super::*;
    use model_core::effects::{ConstantDelay, EdgeDependentDelay, StateDependentDelay};

    fn read(text: &str, inputs: usize) -> Result<Delay, String> {
        let table: DelayTable = toml::from_str(text).expect("TOML");
        let delay = table.into_delay(inputs);
        delay.map_err(|(key, problem)| format!("{key}: {problem}"))
    }

    #[test]
    fn every_law_survives_its_table() {
        for delay in [
            Delay::Fixed {
                delays: vec![49, 417],
            },
            Delay::of::<ConstantDelay<f64>>(&[31.4], vec![1.0, 2.5], true),
            Delay::of::<StateDependentDelay<f64>>(&[47.35, 12.69, 20.18], vec![1.0, 8.0], false),
            Delay::of::<EdgeDependentDelay<f64>>(&[0.05, 0.02], vec![1.0, 1.0], true),
        ] {
            let text = toml::to_string_pretty(&DelayTable::of(&delay)).expect("plain values");
            assert_eq!(read(&text, 2).expect(&text), delay, "{text}");
        }
    }

    /// Files as earlier versions wrote them.
    #[test]
    fn files_without_the_later_keys_are_read() {
        let papers = "law = \"state-dependent\"\ndelay_floor = 47.35\ndelay_rise = 12.69\ndelay_rate = 20\nfactors = [1.0]\n";
        let expected =
            Delay::of::<StateDependentDelay<f64>>(&[47.35, 12.69, 20.0], vec![1.0], false);
        assert_eq!(read(papers, 1), Ok(expected));
        let edges = "law = \"edge-dependent\"\nrise_delay = 0.05\nfall_delay = 0.02\n";
        let expected = Delay::of::<EdgeDependentDelay<f64>>(&[0.05, 0.02], vec![1.0; 2], true);
        assert_eq!(read(edges, 2), Ok(expected));
    }

    #[test]
    fn faults_name_the_key() {
        for (text, expected) in [
            ("delays = [1]", "delay.law"),
            ("law = \"gone\"", "`gone` is not one of fixed, constant"),
            ("law = \"fixed\"", "delay.delays"),
            ("law = \"fixed\"\ndelays = [1, 2]", "has 2 entries"),
            ("law = \"fixed\"\ndelays = [-1]", "delay.delays"),
            ("law = \"fixed\"\ndelays = [1]\nrate = 2", "delay.rate"),
            ("law = \"constant\"", "delay.delay: (samples)"),
            ("law = \"constant\"\ndelay = nan", "delay.delay"),
            (
                "law = \"constant\"\ndelay = 3\ninterpolated = 1",
                "interpolated",
            ),
            (
                "law = \"edge-dependent\"\nrise_delay = -0.1\nfall_delay = 0.1",
                "delay.rise_delay: -0.1 is negative",
            ),
        ] {
            let error = read(text, 1).expect_err(text);
            assert!(error.contains(expected), "{error} does not say {expected}");
        }
    }
}
