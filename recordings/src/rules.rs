//! Rules: thresholds of the tool, each with its meaning and the origin of its value.

use serde::Serialize;

/// One threshold.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Rule {
    /// Its name, dashes for underscores.
    pub name: String,
    /// Its value.
    pub value: Value,
    /// Unit of the value; empty for a pure number.
    pub unit: &'static str,
    /// Its meaning.
    pub meaning: String,
    /// Origin of the value: the data it was tuned on, the test that covers it, or a convention.
    pub calibrated: &'static str,
}

/// The value of a rule: one number, or a list of them.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[serde(untagged)]
pub enum Value {
    /// A count.
    Count(u64),
    /// A number.
    Number(f64),
    /// Several.
    List(Vec<f64>),
}

impl From<f64> for Value {
    fn from(value: f64) -> Self {
        Self::Number(value)
    }
}

impl From<usize> for Value {
    fn from(value: usize) -> Self {
        Self::Count(value as u64)
    }
}

impl From<u32> for Value {
    fn from(value: u32) -> Self {
        Self::Count(value.into())
    }
}

impl From<u16> for Value {
    fn from(value: u16) -> Self {
        Self::Count(value.into())
    }
}

impl<const N: usize> From<[u32; N]> for Value {
    fn from(values: [u32; N]) -> Self {
        values.map(f64::from).into()
    }
}

impl<const N: usize> From<[usize; N]> for Value {
    fn from(values: [usize; N]) -> Self {
        values.map(|value| value as f64).into()
    }
}

impl<const N: usize> From<[f64; N]> for Value {
    fn from(values: [f64; N]) -> Self {
        Self::List(values.to_vec())
    }
}

impl std::fmt::Display for Value {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Self::Count(value) => write!(f, "{value}"),
            Self::Number(value) => write!(f, "{value}"),
            Self::List(values) => {
                let each: Vec<String> = values.iter().map(f64::to_string).collect();
                f.write_str(&each.join(", "))
            }
        }
    }
}

/// The rules of one module.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Rulebook {
    /// The module of `host-fit`, or a crate.
    pub room: &'static str,
    /// The subject of its rules.
    pub about: String,
    /// The rules.
    pub rules: Vec<Rule>,
}

/// Writes a structure of rules, its values in force as the constant `RULES`, and its [`Rulebook`].
///
/// ```
/// recordings::rules! {
///     /// When a residual counts as more than noise.
///     pub struct Rules in "residual";
///
///     /// An excess counts when it stands this many standard errors above 0.
///     standard_errors: f64 = 3.0, "standard errors", "convention: one false alarm in 700";
/// }
///
/// assert_eq!(RULES.standard_errors, 3.0);
/// let book = RULES.book();
/// assert_eq!(book.about, "When a residual counts as more than noise.");
/// assert_eq!(book.rules[0].name, "standard-errors");
/// ```
#[macro_export]
macro_rules! rules {
    (
        $(#[doc = $about:literal])+
        $vis:vis struct $name:ident in $room:literal;
        $(
            $(#[doc = $meaning:literal])+
            $rule:ident: $type:ty = $value:expr, $unit:literal, $calibrated:literal;
        )+
    ) => {
        $(#[doc = $about])+
        #[derive(Clone, Debug, PartialEq)]
        $vis struct $name {
            $(
                $(#[doc = $meaning])+
                #[doc = concat!("\n\nUnit: ", $unit, ".\n\nCalibrated: ", $calibrated, ".")]
                pub $rule: $type,
            )+
        }

        /// The values in force.
        $vis const RULES: $name = $name { $($rule: $value,)+ };

        impl $name {
            /// The table of these rules.
            #[must_use]
            pub fn book(&self) -> $crate::rules::Rulebook {
                $crate::rules::Rulebook {
                    room: $room,
                    about: $crate::rules::paragraph(&[$($about),+]),
                    rules: vec![
                        $($crate::rules::Rule {
                            name: stringify!($rule).replace('_', "-"),
                            value: self.$rule.into(),
                            unit: $unit,
                            meaning: $crate::rules::paragraph(&[$($meaning),+]),
                            calibrated: $calibrated,
                        },)+
                    ],
                }
            }
        }
    };
}

/// The lines of a documentation comment, joined.
#[must_use]
pub fn paragraph(lines: &[&str]) -> String {
    let lines: Vec<&str> = lines.iter().map(|line| line.trim()).collect();
    lines.join(" ")
}

#[cfg(test)]
mod tests {
    use super::Value;

    #[test]
    fn values_read_as_they_are_written() {
        let values = [Value::from(3_usize), 0.5.into(), [0.1, 0.2].into()];
        assert_eq!(values.map(|v| v.to_string()), ["3", "0.5", "0.1, 0.2"]);
    }
}
