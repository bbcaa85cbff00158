//! Rules: thresholds of the tool, each with its meaning and the origin of its value.

use serde::Serialize;
use std::fmt;
use std::sync::OnceLock;
use thiserror::Error;

/// One threshold.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Rule {
    /// Name of the rule, with dashes for underscores.
    pub name: String,
    /// Value of the rule.
    pub value: Value,
    /// Unit of the value; empty for a pure number.
    pub unit: &'static str,
    /// Meaning of the rule.
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
    /// Several counts.
    Counts(Vec<u64>),
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
        Self::Counts(values.map(u64::from).to_vec())
    }
}

impl<const N: usize> From<[usize; N]> for Value {
    fn from(values: [usize; N]) -> Self {
        Self::Counts(values.map(|value| value as u64).to_vec())
    }
}

impl<const N: usize> From<[f64; N]> for Value {
    fn from(values: [f64; N]) -> Self {
        Self::List(values.to_vec())
    }
}

impl fmt::Display for Value {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Count(value) => write!(f, "{value}"),
            Self::Number(value) => write!(f, "{value}"),
            Self::Counts(values) => {
                let each: Vec<String> = values.iter().map(u64::to_string).collect();
                f.write_str(&each.join(", "))
            }
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
    /// The subject of the group's rules.
    pub about: String,
    /// The rules.
    pub rules: Vec<Rule>,
}

/// A rule with another value than the built-in one, for a run: `terms.effort = 800`.
#[derive(Clone, Debug, PartialEq)]
pub struct Change {
    /// The module.
    pub room: &'static str,
    /// The rule.
    pub name: String,
    /// The built-in value.
    pub built_in: Value,
    /// The value of this run.
    pub value: Value,
}

impl fmt::Display for Change {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self {
            room,
            name,
            built_in,
            value,
        } = self;
        write!(f, "rule {room}.{name}: {value} in place of {built_in}")
    }
}

/// Why a rule was not changed.
#[derive(Clone, Debug, PartialEq, Eq, Error)]
#[non_exhaustive]
pub enum ChangeError {
    /// Not `NAME=VALUE`.
    #[error("NAME=VALUE is needed, for example `terms.price=0.002`")]
    Shape,
    /// No such rule.
    #[error("there is no rule `{0}`; `host-fit rules` lists them")]
    Unknown(String),
    /// A name that several groups have.
    #[error("`{name}` is a rule of several groups: write {}", .full.join(" or "))]
    Ambiguous {
        /// The name.
        name: String,
        /// The names with their groups.
        full: Vec<String>,
    },
    /// A value that the rule cannot take.
    #[error("`{name}` needs {needs}")]
    Value {
        /// The name.
        name: String,
        /// Values that the rule accepts.
        needs: String,
    },
}

/// A value may be changed by up to this factor, beyond which a rule would lose its purpose.
const MOST_CHANGED: f64 = 100.0;

impl Change {
    /// The change that `NAME=VALUE` requests. NAME is `group.rule`, or the rule alone if only one group has it.
    /// `books` are the built-in values.
    ///
    /// # Errors
    /// [`ChangeError`].
    pub fn read(text: &str, books: &[Rulebook]) -> Result<Self, ChangeError> {
        let (name, value) = text.split_once('=').ok_or(ChangeError::Shape)?;
        let (name, value) = (name.trim(), value.trim());
        let found: Vec<(&'static str, &Rule)> = books
            .iter()
            .flat_map(|book| book.rules.iter().map(|rule| (book.room, rule)))
            .filter(|(room, rule)| rule.name == name || format!("{room}.{}", rule.name) == name)
            .collect();
        let (room, rule) = match found[..] {
            [] => return Err(ChangeError::Unknown(name.to_owned())),
            [one] => one,
            _ => {
                let full = found
                    .iter()
                    .map(|(room, rule)| format!("{room}.{}", rule.name));
                return Err(ChangeError::Ambiguous {
                    name: name.to_owned(),
                    full: full.collect(),
                });
            }
        };
        let value = rule
            .value
            .changed(value)
            .map_err(|needs| ChangeError::Value {
                name: format!("{room}.{}", rule.name),
                needs,
            })?;
        Ok(Self {
            room,
            name: rule.name.clone(),
            built_in: rule.value.clone(),
            value,
        })
    }
}

impl Value {
    /// The value of the same kind as `text`, or the required form.
    fn changed(&self, text: &str) -> Result<Self, String> {
        let within = |own: f64, new: f64| {
            let (least, most) = match own.abs() {
                0.0 => (0.0, MOST_CHANGED),
                own => (own / MOST_CHANGED, own * MOST_CHANGED),
            };
            let sign = if own < 0.0 { -1.0 } else { 1.0 };
            match (least..=most).contains(&(sign * new)) {
                true => Ok(new),
                false => Err(format!("a value from {} to {}", sign * least, sign * most)),
            }
        };
        let number = |text: &str| {
            let number = text.trim().parse::<f64>().ok();
            number.ok_or_else(|| format!("a number, not `{}`", text.escape_debug()))
        };
        let count = |own: u64, text: &str| match text.trim().parse::<u64>() {
            Ok(new) => Ok(within(own as f64, new as f64)? as u64),
            Err(_) => Err(format!("a whole number, not `{}`", text.escape_debug())),
        };
        let parts: Vec<&str> = text.split(',').collect();
        let of = |wanted: usize| match parts.len() == wanted {
            true => Ok(parts.iter()),
            false => Err(format!("{wanted} numbers with commas between them")),
        };
        match self {
            Self::Number(own) => Ok(Self::Number(within(*own, number(text)?)?)),
            Self::Count(own) => Ok(Self::Count(count(*own, text)?)),
            Self::Counts(own) => {
                let each = own.iter().zip(of(own.len())?);
                let each = each.map(|(own, part)| count(*own, part));
                Ok(Self::Counts(each.collect::<Result<_, _>>()?))
            }
            Self::List(own) => {
                let each = own.iter().zip(of(own.len())?);
                let each = each.map(|(own, part)| within(*own, number(part)?));
                Ok(Self::List(each.collect::<Result<_, _>>()?))
            }
        }
    }
}

/// The changes of this run.
static CHANGES: OnceLock<Vec<Change>> = OnceLock::new();

/// Changes rules for the rest of the program. It works once, before any rule was read; later calls are ignored, and
/// rules that were read before keep their values.
pub fn change_for_this_run(changes: Vec<Change>) {
    let _ = CHANGES.set(changes);
}

/// The changes of this run.
#[must_use]
pub fn changes() -> &'static [Change] {
    CHANGES.get_or_init(Vec::new)
}

/// A type of a rule's value.
pub trait Ruled: Sized {
    /// The value in this type; `None` if it is of another kind.
    fn from_value(value: &Value) -> Option<Self>;
}

impl Ruled for f64 {
    fn from_value(value: &Value) -> Option<Self> {
        match value {
            Value::Number(value) => Some(*value),
            _ => None,
        }
    }
}

macro_rules! counts {
    ($($type:ty),+) => {$(
        impl Ruled for $type {
            fn from_value(value: &Value) -> Option<Self> {
                match value {
                    Value::Count(value) => Self::try_from(*value).ok(),
                    _ => None,
                }
            }
        }

        impl<const N: usize> Ruled for [$type; N] {
            fn from_value(value: &Value) -> Option<Self> {
                let Value::Counts(values) = value else {
                    return None;
                };
                let counts = values.iter().map(|value| <$type>::try_from(*value).ok());
                counts.collect::<Option<Vec<$type>>>()?.try_into().ok()
            }
        }
    )+};
}

counts!(usize, u32, u16);

impl<const N: usize> Ruled for [f64; N] {
    fn from_value(value: &Value) -> Option<Self> {
        match value {
            Value::List(values) => values.as_slice().try_into().ok(),
            _ => None,
        }
    }
}

/// Writes a structure of rules, its built-in values, the values in force as `RULES`, and its [`Rulebook`].
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

        /// The values in force: the built-in ones, or those of this run.
        $vis static RULES: ::std::sync::LazyLock<$name> = ::std::sync::LazyLock::new(|| {
            let mut rules = $name::BUILT_IN;
            let of_room = |change: &&$crate::rules::Change| change.room == $room;
            for change in $crate::rules::changes().iter().filter(of_room) {
                $($crate::rules::take(change, stringify!($rule), &mut rules.$rule);)+
            }
            rules
        });

        impl $name {
            /// The built-in values.
            pub const BUILT_IN: Self = Self { $($rule: $value,)+ };

            /// The table of these rules.
            #[must_use]
            pub fn book(&self) -> $crate::rules::Rulebook {
                $crate::rules::Rulebook {
                    room: $room,
                    about: $crate::rules::paragraph(&[$($about),+]),
                    rules: vec![
                        $($crate::rules::rule(
                            stringify!($rule),
                            self.$rule.into(),
                            [$unit, $calibrated],
                            &[$($meaning),+],
                        ),)+
                    ],
                }
            }
        }
    };
}

/// Sets a rule if the change is for it.
pub fn take<T: Ruled>(change: &Change, rule: &str, value: &mut T) {
    if change.name == rule.replace('_', "-")
        && let Some(new) = T::from_value(&change.value)
    {
        *value = new;
    }
}

/// A line of a rulebook.
#[must_use]
pub fn rule(
    name: &str,
    value: Value,
    [unit, calibrated]: [&'static str; 2],
    meaning: &[&str],
) -> Rule {
    Rule {
        name: name.replace('_', "-"),
        value,
        unit,
        meaning: paragraph(meaning),
        calibrated,
    }
}

/// The lines of a documentation comment, joined.
#[must_use]
pub fn paragraph(lines: &[&str]) -> String {
    let lines: Vec<&str> = lines.iter().map(|line| line.trim()).collect();
    lines.join(" ")
}

#[cfg(test)]
#[expect(unreachable_pub, reason = "the items that the macro writes are public")]
mod tests {
    use super::{Change, ChangeError, Value};

    rules! {
        /// Rules of the test.
        pub struct Rules in "residual";

        /// A number.
        share: f64 = 0.02, "", "convention";
        /// A count.
        rounds: usize = 6, "", "convention";
        /// Several.
        shapes: [f64; 2] = [0.0, 8.0], "samples", "a grid";
        /// Several counts.
        grid: [usize; 2] = [12, 4], "", "a grid";
    }

    #[test]
    fn a_rule_is_changed_by_its_name_within_a_factor_of_a_hundred() {
        let books = [RULES.book()];
        assert_eq!(books[0], Rules::BUILT_IN.book());
        let changed = |text: &str| Change::read(text, &books).map(|change| change.to_string());
        let said = |text: &str| changed(text).map_err(|error| error.to_string());
        assert_eq!(
            said("share=0.04").unwrap(),
            "rule residual.share: 0.04 in place of 0.02"
        );
        assert_eq!(
            said("residual.shapes = 1,16").unwrap(),
            "rule residual.shapes: 1, 16 in place of 0, 8"
        );
        for (text, error) in [
            (
                "share",
                "NAME=VALUE is needed, for example `terms.price=0.002`",
            ),
            (
                "sharp=1",
                "there is no rule `sharp`; `host-fit rules` lists them",
            ),
            (
                "rounds=2.5",
                "`residual.rounds` needs a whole number, not `2.5`",
            ),
            (
                "rounds=0",
                "`residual.rounds` needs a value from 0.06 to 600",
            ),
            (
                "share=nan",
                "`residual.share` needs a value from 0.0002 to 2",
            ),
            (
                "shapes=1",
                "`residual.shapes` needs 2 numbers with commas between them",
            ),
        ] {
            assert_eq!(said(text).unwrap_err(), error);
        }
        let twice = [books[0].clone(), {
            let mut other = books[0].clone();
            other.room = "fit";
            other
        }];
        assert_eq!(
            Change::read("rounds=3", &twice).unwrap_err(),
            ChangeError::Ambiguous {
                name: "rounds".to_owned(),
                full: vec!["residual.rounds".to_owned(), "fit.rounds".to_owned()],
            }
        );
    }

    #[test]
    fn values_read_as_they_are_written() {
        let values = [Value::from(3_usize), 0.5.into(), [0.1, 0.2].into()];
        assert_eq!(values.map(|v| v.to_string()), ["3", "0.5", "0.1, 0.2"]);
    }
}
