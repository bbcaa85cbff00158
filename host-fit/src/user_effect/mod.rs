//! A user's own effect: a small TOML file with an expression in Rust syntax
//! over named signals and named parameters.
//!
//! It is fitted, diagnosed, simulated and generated like an effect of the
//! catalogue: [`Definition::spec`] is its identity card, [`UserEffect`] runs it
//! on the host, `rust_module` writes it for the board with the same
//! operations in the same order. `docs/user-effects.md` describes the file.

mod expression;
mod fault_place;
pub(crate) mod form;
mod interpreter;
pub(crate) mod program;
mod rust;
mod source;

pub use interpreter::{UserEffect, UserState};
pub(crate) use rust::{line_lengths, number, rust_module};
pub use rust::{module_name, type_name};

use model_core::effect::{Place, Spec};
use program::Program;
use source::Refusal;
pub(crate) use source::Source;
use std::path::{Path, PathBuf};
use std::sync::{Mutex, PoisonError};
use thiserror::Error;

/// Why a user effect was rejected.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum DefinitionError {
    /// The file could not be read.
    #[error("{}: cannot read the effect file: {source}. Check the path and its permissions.", path.display())]
    Unreadable {
        /// The file.
        path: PathBuf,
        /// Why.
        source: std::io::Error,
    },
    /// The file is not an effect file.
    #[error(
        "{place}, line {line}, column {column}: {problem}. An effect file has `name`, `place`, `summary`, \
         `expression`, and tables `[[parameter]]` and `[[state]]`; docs/user-effects.md shows two."
    )]
    Syntax {
        /// The file.
        place: String,
        /// Line of the file, from 1.
        line: usize,
        /// Column of the line, from 1.
        column: usize,
        /// The problem.
        problem: String,
    },
    /// A key has an invalid value.
    #[error("{place}: key `{key}`: {problem}. Correct the key.")]
    Key {
        /// The file.
        place: String,
        /// The key.
        key: String,
        /// The problem.
        problem: String,
    },
    /// An invalid expression.
    #[error("{place}: key `{key}`, line {line}, column {column} of the expression: {problem}.")]
    Expression {
        /// The file.
        place: String,
        /// The key.
        key: String,
        /// Line in the expression, from 1.
        line: usize,
        /// Column in that line, in characters from 1.
        column: usize,
        /// The problem.
        problem: String,
    },
}

/// A user's own effect, checked and compiled.
///
/// Definitions live as long as the program, because catalogue entries are `'static` and the rest of the tool then
/// needs one kind only. The memory of a definition is never freed; equal definitions share it.
#[derive(Debug)]
pub struct Definition {
    source: Source,
    spec: Spec,
    program: Program,
}

/// Summary of an effect file that was [checked](Definition::check).
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Checked {
    /// The effect's name.
    pub name: String,
    /// The physics in one line.
    pub summary: String,
}

impl PartialEq for Definition {
    fn eq(&self, other: &Self) -> bool {
        self.source == other.source
    }
}

impl Definition {
    /// Reads an effect file.
    ///
    /// # Errors
    /// [`DefinitionError`] names the file, the key and the column.
    pub fn load(path: &Path) -> Result<&'static Self, DefinitionError> {
        let text = std::fs::read_to_string(path).map_err(|source| DefinitionError::Unreadable {
            path: path.to_owned(),
            source,
        })?;
        Self::from_toml(&text, &path.display().to_string())
    }

    /// Reads the text of an effect file; `place` names it in errors.
    ///
    /// # Errors
    /// As [`load`](Self::load).
    pub fn from_toml(text: &str, place: &str) -> Result<&'static Self, DefinitionError> {
        Self::from_source(read(text, place)?, place, "")
    }

    /// Checks the text of an effect file without storing it, so that it can be called at every keystroke.
    ///
    /// # Errors
    /// As [`load`](Self::load).
    pub fn check(text: &str, place: &str) -> Result<Checked, DefinitionError> {
        let source = read(text, place)?;
        compiled(&source, place, "")?;
        Ok(Checked {
            name: source.name,
            summary: source.summary,
        })
    }

    /// Checks and compiles; `prefix` is put before the keys in errors.
    pub(crate) fn from_source(
        source: Source,
        place: &str,
        prefix: &str,
    ) -> Result<&'static Self, DefinitionError> {
        static KNOWN: Mutex<Vec<&'static Definition>> = Mutex::new(Vec::new());
        let program = compiled(&source, place, prefix)?;
        let mut known = KNOWN.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some(same) = known.iter().find(|known| known.source == source) {
            return Ok(same);
        }
        let definition = Self {
            spec: source.spec(&program),
            source,
            program,
        };
        let definition: &'static Self = Box::leak(Box::new(definition));
        known.push(definition);
        Ok(definition)
    }

    /// Card of the effect, as for effects of the catalogue.
    #[must_use]
    pub fn spec(&'static self) -> &'static Spec {
        &self.spec
    }

    /// Whether the effect's parameters scale with the units of y and time, like those of the catalogue. Its ranges and
    /// starting values are then for y of order 1 and samples of 1 ms.
    #[must_use]
    pub fn scales(&self) -> bool {
        self.source.scales
    }

    /// Whether the effect is the tool's own for a measured channel.
    pub(crate) fn is_of_a_channel(&self) -> bool {
        self.scales() && self.spec.channel.is_some()
    }

    /// Whether the effect is a measured input: a channel with a response of its own.
    pub(crate) fn is_measured_input(&self) -> bool {
        self.is_of_a_channel() && self.spec.place == Place::Sensor && self.source.has_states()
    }

    /// Whether a base without the effect has another gain, dead time and time constant: a measured input, or a
    /// relaxation rate that a channel changes.
    pub(crate) fn biases_the_base(&self) -> bool {
        self.is_measured_input() || self.is_of_a_channel() && self.spec.place == Place::Flow
    }

    /// Operations of the effect at a sample.
    pub(crate) fn program(&self) -> &Program {
        &self.program
    }

    pub(crate) fn source(&self) -> &Source {
        &self.source
    }
}

/// The contents of an effect file.
fn read(text: &str, place: &str) -> Result<Source, DefinitionError> {
    toml::from_str(text).map_err(|error| {
        let start = error.span().map_or(0, |span| span.start);
        let before = text.get(..start).unwrap_or("");
        let line = before.rsplit('\n').next().unwrap_or("");
        DefinitionError::Syntax {
            place: place.to_owned(),
            line: before.matches('\n').count() + 1,
            column: line.chars().count() + 1,
            problem: error.message().to_owned(),
        }
    })
}

/// The program of an effect; `prefix` is put before the keys in errors.
fn compiled(source: &Source, place: &str, prefix: &str) -> Result<Program, DefinitionError> {
    let program = source.compile();
    // Otherwise the text of every parsed expression is kept until the thread ends. No token outlives the compilation.
    proc_macro2::extra::invalidate_current_thread_spans();
    program.map_err(|refusal| match refusal {
        Refusal::Key(key, problem) => DefinitionError::Key {
            place: place.to_owned(),
            key: format!("{prefix}{key}"),
            problem,
        },
        Refusal::Expression(key, fault) => DefinitionError::Expression {
            place: place.to_owned(),
            key: format!("{prefix}{key}"),
            line: fault.line,
            column: fault.column,
            problem: fault.problem,
        },
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::dual::Dual;
    use crate::ring::Ring;
    use model_core::Real;
    use model_core::effect::{Effect, Flow, Influence, Instant, Setting};
    use model_core::effects::AnyEffect;
    use proptest::prelude::*;

    const PICKUP: &str = r#"
name = "own-pickup"
place = "sensor"
summary = "the command shows in the reading at once"
expression = "reading + gain * u"
parameter = [{ name = "gain", unit = "y", low = -0.5, high = 0.5, starts = [0.05] }]
"#;

    const VALVE: &str = r#"
name = "own-valve"
place = "jet"
summary = "the valve opens and closes gradually"
expression = "opening"
parameter = [
    { name = "opening_time", unit = "s", low = 0.001, high = 0.05, starts = [0.004, 0.015] },
    { name = "closing_time", unit = "s", low = 0.001, high = 0.1, starts = [0.004, 0.025] },
]
[[state]]
name = "opening"
update = """
let time = if jet > opening { opening_time } else { closing_time };
opening + (jet - opening) * (1.0 - exp(-period / time))"""
"#;

    const ECHO: &str = r#"
name = "own-echo"
place = "jet"
summary = "the jet arrives a second time, later"
expression = "jet + gain * delayed(jet, echo_delay)"
parameter = [
    { name = "gain", unit = "-", low = -1.0, high = 1.0, starts = [0.2] },
    { name = "echo_delay", unit = "s", low = 0.02, high = 0.5, starts = [0.05] },
]
"#;

    const CUBIC: &str = r#"
name = "own-cubic"
place = "flow"
summary = "a restoring force with the cube of the friction"
expression = "-(cubic * relaxation) * (y * y * y)"
parameter = [{ name = "cubic", unit = "1/y²", low = 0.0, high = 5.0, starts = [0.1] }]
"#;

    const TABLE: &str = r#"
name = "own-table"
place = "sensor"
summary = "the reading is bent"
expression = "reading + table(reading, -0.5, low, 0.25, 0.0, 1.0, high)"
parameter = [
    { name = "low", unit = "y", low = -1.0, high = 1.0, starts = [0.1] },
    { name = "high", unit = "y", low = -1.0, high = 1.0, starts = [0.1] },
]
"#;

    const DRIFT: &str = r#"
name = "own-drift"
place = "jet"
summary = "the jets come later and later"
expression = "delayed(jet, early + drift * t, 0.08)"
parameter = [
    { name = "early", unit = "s", low = 0.0, high = 0.1, starts = [0.01] },
    { name = "drift", unit = "-", low = -1.0, high = 1.0, starts = [0.1] },
]
"#;

    fn definition(text: &str) -> &'static Definition {
        match Definition::from_toml(text, "own.toml") {
            Ok(definition) => definition,
            Err(error) => panic!("{error}"),
        }
    }

    fn setting<T: Real>() -> Setting<T> {
        Setting {
            period: T::from_f64(0.001),
            channel: 0,
            reference: T::from_f64(10.0),
        }
    }

    /// Response of an effect to an on/off command and a friction that follows it.
    fn response<T: Real, E: Effect<T>>(effect: &E) -> Vec<T> {
        let mut state = effect.start();
        let mut y = T::ZERO;
        let mut before = T::ZERO;
        (0..400)
            .map(|k| {
                let u = if k / 37 % 2 == 1 { T::ONE } else { T::ZERO };
                let channel = [T::from_f64(10.0 + f64::from(k) * 0.01)];
                let at = Instant {
                    command: u,
                    flow: y,
                    arrived: u,
                    present: u,
                    channels: &channel,
                };
                let flow = Flow {
                    now: y,
                    before,
                    next: y,
                    relaxation: T::from_f64(0.05),
                    separated: T::ONE - u,
                    released: T::ZERO,
                };
                let jet = effect.jet(&mut state, u, &at);
                let reading = effect.sense(&mut state, y, &at);
                let drive = effect.drive(&mut state, &flow, &at);
                before = y;
                y = y + (jet - y) * T::from_f64(0.05) + drive * T::from_f64(0.01);
                reading + y
            })
            .collect()
    }

    fn same_bits<T: Real>(name: &str, own: &str, parameters: &[f64], bits: impl Fn(T) -> u64) {
        let values: Vec<T> = parameters.iter().map(|p| T::from_f64(*p)).collect();
        let known =
            AnyEffect::<T, Ring<T>>::new(name, &values, &setting()).expect("in the catalogue");
        let own = UserEffect::new(definition(own), &values, &setting());
        let pairs = response(&known).into_iter().zip(response(&own));
        for (k, (known, own)) in pairs.enumerate() {
            assert_eq!(bits(known), bits(own), "{name}, sample {k}");
        }
    }

    #[test]
    fn effects_of_the_catalogue_written_again_give_the_same_bits() {
        let cases: [(&str, &str, &[f64]); 3] = [
            ("valve-lag", VALVE, &[0.012, 0.033]),
            ("echo-path", ECHO, &[-0.31, 0.0477]),
            ("amplitude-saturation", CUBIC, &[0.8]),
        ];
        for (name, own, parameters) in cases {
            same_bits::<f64>(name, own, parameters, f64::to_bits);
            same_bits::<f32>(name, own, parameters, |x| x.to_bits().into());
        }
    }

    #[test]
    fn derivatives_are_those_of_finite_differences() {
        for (own, parameters) in [
            (PICKUP, &[0.07][..]),
            (VALVE, &[0.012, 0.033]),
            (ECHO, &[-0.31, 0.0477]),
            (CUBIC, &[0.8]),
            (TABLE, &[0.2, -0.1]),
            (DRIFT, &[0.0123, 0.1007]),
        ] {
            let own = definition(own);
            let run = |values: &[f64]| response(&UserEffect::new(own, values, &setting()));
            for index in 0..parameters.len() {
                let mut duals: Vec<Dual<4>> =
                    parameters.iter().map(|p| Dual::constant(*p)).collect();
                duals[index] = duals[index].with_slope(0, 1.0);
                let exact = response(&UserEffect::new(own, &duals, &setting()));
                let step = 1e-7;
                let moved = |by: f64| {
                    let mut moved = parameters.to_vec();
                    moved[index] += by;
                    run(&moved)
                };
                let secants = moved(step).into_iter().zip(moved(-step));
                for (k, (dual, (high, low))) in exact.iter().zip(secants).enumerate() {
                    let secant = (high - low) / (2.0 * step);
                    let error = (dual.partials()[0] - secant).abs();
                    assert!(
                        error < 1e-6 * (1.0 + secant.abs()),
                        "{} {index} {k}: {} {secant}",
                        own.spec().name,
                        dual.partials()[0]
                    );
                }
            }
        }
    }

    #[test]
    fn clocks_channels_and_conditions_mean_what_they_say() {
        let text = r#"
name = "clocks"
place = "sensor"
summary = "every signal a sensor has"
channel = "temperature"
expression = """
let late = t >= 2.0 * period && !(since_edge > 1.5 * period);
if late || u == 1.0 { t + since_edge } else { (temperature - reference).min(0.0) + last }"""
[[state]]
name = "last"
start = 0.5
update = "reading"
"#;
        let effect = UserEffect::new(definition(text), &[], &setting::<f64>());
        let mut state = effect.start();
        let seen: Vec<f64> = [0.0, 1.0, 1.0, 0.0, 0.0, 0.0]
            .iter()
            .enumerate()
            .map(|(k, u)| {
                let at = Instant {
                    command: *u,
                    flow: 0.0,
                    arrived: 0.0,
                    present: 0.0,
                    channels: &[9.0],
                };
                effect.sense(&mut state, k as f64, &at)
            })
            .collect();
        let ms = 0.001;
        assert_eq!(
            seen,
            [-1.0, ms, 2.0 * ms + ms, 3.0 * ms, 4.0 * ms + ms, 4.0]
        );
    }

    #[test]
    fn parameters_that_act_in_steps_are_known_to() {
        let text = VALVE.replace("jet > opening", "jet > 10.0 * closing_time");
        let spec = definition(&text.replace("own-valve", "threshold")).spec();
        assert_eq!(spec.parameters[0].influence, Influence::Smooth);
        assert_eq!(spec.parameters[1].influence, Influence::Stepwise);
        let spec = definition(VALVE).spec();
        assert_eq!(spec.parameters[1].influence, Influence::Smooth);
    }

    #[test]
    fn a_table_goes_straight_from_point_to_point_and_stays_level_beyond() {
        let effect = UserEffect::new(definition(TABLE), &[0.3, -0.6], &setting::<f64>());
        let mut state = effect.start();
        let at = Instant {
            command: 0.0,
            flow: 0.0,
            arrived: 0.0,
            present: 0.0,
            channels: &[],
        };
        for (reading, bend) in [
            (-2.0, 0.3),
            (-0.5, 0.3),
            (-0.125, 0.15),
            (0.25, 0.0),
            (0.5, -0.2),
            (1.0, -0.6),
            (7.0, -0.6),
        ] {
            let seen = effect.sense(&mut state, reading, &at);
            assert!((seen - reading - bend).abs() < 1e-12, "{reading}: {seen}");
        }
    }

    /// A delay that grows by a tenth of the time: a signal sent at t arrives at 1.1 t, up to the longest
    /// delay.
    #[test]
    fn a_delay_that_changes_is_followed_up_to_its_longest() {
        let effect = UserEffect::new(definition(DRIFT), &[0.01, 0.1], &setting::<f64>());
        let mut state = effect.start();
        for k in 0..2000_u32 {
            let now = f64::from(k) * 0.001;
            let at = Instant {
                command: 0.0,
                flow: 0.0,
                arrived: 0.0,
                present: 0.0,
                channels: &[],
            };
            let seen = effect.jet(&mut state, now, &at);
            let delay = (0.01 + 0.1 * now).min(0.08);
            assert!(
                (seen - (now - delay).max(0.0)).abs() < 1e-3,
                "{now}: {seen}"
            );
        }
    }

    #[test]
    fn equal_definitions_share_their_memory() {
        assert!(std::ptr::eq(definition(PICKUP), definition(PICKUP)));
    }

    fn refusal(expression: &str) -> String {
        let text = PICKUP.replace("reading + gain * u", expression);
        let error = Definition::from_toml(&text, "own.toml").expect_err(expression);
        error.to_string()
    }

    #[test]
    fn what_is_outside_the_language_is_refused_with_its_column() {
        for (expression, column, why) in [
            (
                "reading + gian * u",
                11,
                "`gian` is not defined here; the defined names are u, y",
            ),
            ("reading + gain % u", 16, "`%`"),
            ("reading + gain * u as f32", 20, "`as`"),
            ("reading + gain * tan(u)", 18, "no function `tan`"),
            ("gain + max(reading)", 8, "takes 2 argument(s), here are 1"),
            ("gain + delayed(reading, y)", 25, "must be constant"),
            ("gain + delayed(1, 0.1)", 8, "cannot be delayed"),
            (
                "gain + delayed(u, y, t)",
                22,
                "the longest delay must be a constant",
            ),
            ("gain + table(y, 0.0, 1.0)", 8, "at least two points"),
            (
                "gain + table(y, 0.0, 1.0, 0.0, 2.0)",
                27,
                "in ascending order",
            ),
            (
                "gain + table(y, u, 1.0, 2.0, 2.0)",
                25,
                "in ascending order",
            ),
            ("gain * if u > 0.0 { 1.0 }", 8, "needs an `else`"),
            (
                "if u { gain } else { 0.0 }",
                4,
                "a condition is needed here, but this is a number",
            ),
            (
                "gain + (u > 0.5)",
                8,
                "a number is needed here, but this is a condition",
            ),
            ("if u > 0.5 { gain } else { 0.0 } * y", 1, "in parentheses"),
            ("let y = gain; y", 5, "is already defined"),
            ("let a = gain;", 1, "there must be a value"),
            ("gain * 2.0f32", 8, "without `f32`"),
            ("gain * 1e300", 8, "single precision"),
            ("gain * std::f32::consts::PI", 11, "`:`"),
            ("gain * y[0]", 9, "brackets"),
            ("gain * *y", 8, "outside the language"),
            ("gain * y.0", 8, "outside the language"),
            ("gain * y = 3", 1, "outside the language"),
            ("gain += y", 6, "outside the language"),
            ("unsafe { gain }", 1, "`unsafe`"),
            ("gain * (y", 8, "not valid Rust syntax"),
            ("gain * 'a'", 8, "outside the language"),
            ("gain * !y", 9, "a condition is needed"),
            ("gain < y < u", 1, "Rust's grammar says"),
            ("gain +", 1, "Rust's grammar says"),
            ("", 1, "a value is missing here"),
        ] {
            let text = refusal(expression);
            assert!(
                text.starts_with("own.toml: key `expression`, line 1, column "),
                "{text}"
            );
            assert!(text.contains(why), "{expression}: {text}");
            let free = why == "Rust's grammar says" || expression.starts_with("gain * (y");
            assert!(
                free || text.contains(&format!("column {column} ")),
                "{expression}: {text}"
            );
        }
    }

    #[test]
    fn faults_of_keys_are_named() {
        for (from, to, expected) in [
            ("own-pickup", "Own Pickup", "key `name`"),
            ("own-pickup", "valve-lag", "already in the catalogue"),
            ("low = -0.5", "low = 0.5", "key `parameter.gain`"),
            ("starts = [0.05]", "starts = [0.7]", "`starts`"),
            ("starts = [0.05]", "starts = []", "`starts`"),
            ("low = -0.5", "low = nan", "`low` and `high`"),
            ("name = \"gain\"", "name = \"u\"", "is already defined"),
            ("name = \"gain\"", "name = \"fn\"", "is not a valid name"),
            (
                "place = \"sensor\"",
                "place = \"delay\"",
                "line 3, column 9",
            ),
            ("gain * u", "0.1 * u", "no influence"),
            ("place", "channel = \"temperature\"\nplace", "no influence"),
            ("unit = \"y\"", "units = \"y\"", "units"),
        ] {
            let text = PICKUP.replacen(from, to, 1);
            assert_ne!(text, PICKUP);
            let error = Definition::from_toml(&text, "own.toml")
                .expect_err(to)
                .to_string();
            assert!(
                error.starts_with("own.toml") && error.contains(expected),
                "{to}: {error}"
            );
        }
    }

    /// All nesting constructs of Rust's grammar at the largest allowed length, on a test's small stack.
    #[test]
    fn nothing_nests_deeper_than_the_stack() {
        for opening in [
            "(",
            "{",
            "-",
            "!",
            "&",
            "*",
            "|",
            "||",
            "&&",
            "..",
            "<",
            "return ",
            "if ",
            "if u ",
            "let ",
            "u = ",
            "else ",
            "u . ",
            "u < ",
            "break ",
            "move ",
            "if u > 0.5 {1} else ",
            "let a = ",
            "if let ",
            "u(",
            "u{",
            "- - ! ",
            "&mut ",
            "u <<",
            "u..",
        ] {
            for times in [8, 30, 60, 100, 190, 399, 5000] {
                refusal(&format!("{}1", opening.repeat(times)));
            }
        }
    }

    proptest! {
        #[test]
        fn no_text_makes_the_reader_panic(text in "\\PC{0,80}") {
            let source = PICKUP.replace("reading + gain * u", &text.replace(['"', '\\'], ""));
            let _ = Definition::from_toml(&source, "own.toml");
            let _ = Definition::from_toml(&text, "own.toml");
        }

        #[test]
        fn no_sentence_of_the_language_makes_it_panic(
            words in prop::collection::vec(
                prop::sample::select(vec![
                    "u", "y", "reading", "gain", "1.5", "0", "+", "-", "*", "/", "(", ")", "{", "}",
                    "if", "else", "let", "a", "=", ";", "<", ">=", "==", "&&", "||", "!", ",", ".",
                    "max", "abs", "delayed", "sqrt", "t", "since_edge", "period", "&", "|",
                ]),
                0..40,
            )
        ) {
            let source = PICKUP.replace("reading + gain * u", &words.join(" "));
            if let Ok(definition) = Definition::from_toml(&source, "own.toml") {
                let effect = UserEffect::new(definition, &[0.1_f32], &setting());
                prop_assert_eq!(response(&effect).len(), 400);
                prop_assert!(!rust_module(definition, &[0.1], &setting()).is_empty());
            }
        }
    }
}
