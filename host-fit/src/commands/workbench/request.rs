//! Requests of the page: a command of the program with its options.
//!
//! A request is parsed by the command line's parser, so that options, limits and messages are the same and
//! the command shown is the one that runs. File names are chosen by the server: options that name files are
//! rejected.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use serde::Deserialize;
use serde_json::{Number, Value};
use workbench::Refusal;

use crate::commands::page::quoted;

/// A command.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub(super) enum Command {
    Identify,
    Diagnose,
    Discover,
    Extend,
    Design,
    Import,
}

impl Command {
    pub(super) fn name(self) -> &'static str {
        match self {
            Self::Identify => "identify",
            Self::Diagnose => "diagnose",
            Self::Discover => "discover",
            Self::Extend => "extend",
            Self::Design => "design",
            Self::Import => "import",
        }
    }

    /// The command's options without those that name files.
    fn options(self) -> impl Iterator<Item = &'static str> {
        let all = match self {
            Self::Identify => {
                "averaged delay effect evaluations interpolated lags max-lag n1 n2 n3 objective \
                 seed threads"
            }
            Self::Diagnose => "most-effects seed",
            Self::Discover => "terms without",
            Self::Extend => "effect",
            Self::Design => {
                "air-price force goal horizon least-air max-air max-switches min-off min-on pulses \
                 ramp seed target"
            }
            Self::Import => {
                "channel fill-gaps graded hold-out-from ignore-time mean-of missing no-channels period split-by \
                 t t-scale title u u-before u-offset u-scale u-threshold validate y y-offset y-scale"
            }
        };
        all.split_whitespace()
    }

    /// Whether the command starts from a model.
    pub(super) fn needs_a_model(self) -> bool {
        !matches!(self, Self::Identify | Self::Import)
    }
}

/// The value of an option.
#[derive(Debug, Clone, PartialEq, Deserialize)]
#[serde(untagged)]
enum Given {
    Switch(bool),
    Number(Number),
    Text(String),
    Several(Vec<String>),
}

/// A command with its options.
#[derive(Debug, Clone, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Request {
    pub(super) command: Command,
    /// The model that the command starts from.
    #[serde(default)]
    pub(super) model: Option<u32>,
    /// Files that were uploaded, for `import`.
    #[serde(default)]
    pub(super) files: Vec<String>,
    #[serde(default)]
    options: BTreeMap<String, Option<Given>>,
}

impl Request {
    /// Reads a request.
    pub(super) fn read(request: &Value) -> Result<Self, String> {
        let read =
            Self::deserialize(request).map_err(|e| format!("the request cannot be read: {e}"))?;
        let is_known = |name: &&String| read.command.options().any(|known| known == *name);
        if let Some(other) = read.options.keys().find(|name| !is_known(name)) {
            return Err(format!(
                "`{}` does not accept the option `{other}` here",
                read.command.name()
            ));
        }
        match (read.command.needs_a_model(), read.model) {
            (true, None) => Err("`model` is missing: the number of a model".to_owned()),
            (false, Some(_)) => Err(format!("`{}` accepts no `model`", read.command.name())),
            _ => Ok(read),
        }
    }

    /// The options as words of the command line, without empty ones.
    pub(super) fn options(&self) -> Vec<String> {
        let mut words = Vec::new();
        for (name, given) in &self.options {
            match given {
                None | Some(Given::Switch(false)) => {}
                Some(Given::Switch(true)) => words.push(format!("--{name}")),
                Some(Given::Number(number)) => words.push(format!("--{name}={number}")),
                Some(Given::Text(text)) if text.is_empty() => {}
                Some(Given::Text(text)) => words.push(format!("--{name}={text}")),
                Some(Given::Several(each)) => {
                    words.extend(each.iter().map(|text| format!("--{name}={text}")));
                }
            }
        }
        words
    }
}

/// A command with the files that it reads and writes.
#[derive(Debug, Clone)]
pub(super) struct Line {
    command: Command,
    words: Vec<String>,
}

impl Line {
    /// `files` come first and are never parsed as options.
    pub(super) fn new(command: Command, files: &[PathBuf], rest: Vec<String>) -> Self {
        let file = |path: &PathBuf| match path.to_string_lossy() {
            text if text.starts_with('-') => format!("./{text}"),
            text => text.into_owned(),
        };
        let mut words: Vec<String> = files.iter().map(file).collect();
        words.extend(rest);
        Self { command, words }
    }

    /// Adds an option that names a file.
    pub(super) fn file(mut self, option: &str, path: &Path) -> Self {
        self.words.push(format!("--{option}={}", path.display()));
        self
    }

    /// The command that compares a model with a data set.
    pub(super) fn compare(model: &Path, data: &Path) -> String {
        let words = [model, data].map(|path| quoted(&path.to_string_lossy()));
        format!("host-fit compare {} --report=report.html", words.join(" "))
    }

    /// The line as a user would type it.
    pub(super) fn text(&self) -> String {
        let words = self.words.iter().map(|word| quoted(word));
        let all = ["host-fit".to_owned(), self.command.name().to_owned()];
        all.into_iter().chain(words).collect::<Vec<_>>().join(" ")
    }

    /// The line parsed as arguments `A`.
    pub(super) fn parse<A: clap::Args>(&self) -> Result<A, Refusal> {
        let parser = clap::Command::new(self.command.name())
            .no_binary_name(true)
            .disable_help_flag(true);
        let told = |error: clap::Error| {
            let text = error.to_string();
            let first = text.split("\n\n").next().unwrap_or_default();
            let words = first.split_whitespace().collect::<Vec<_>>().join(" ");
            Refusal(words.trim_start_matches("error: ").to_owned())
        };
        let matches = A::augment_args(parser)
            .try_get_matches_from(&self.words)
            .map_err(told)?;
        A::from_arg_matches(&matches).map_err(told)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::commands::{design, identify};
    use serde_json::json;

    fn line(value: Value) -> Result<Line, String> {
        let request = Request::read(&value)?;
        let (from, set) = (PathBuf::from("a.toml"), PathBuf::from("my set"));
        let files = match request.command {
            Command::Identify => vec![set],
            _ => vec![from, set],
        };
        Ok(Line::new(request.command, &files, request.options()).file("output", "b.toml".as_ref()))
    }

    #[test]
    fn a_request_is_the_command_that_it_shows() {
        let asked = json!({"command": "identify", "options": {"delay": "fixed", "n1": 2, "n2": null, "seed": 3, "interpolated": false}});
        let asked = line(asked).unwrap();
        assert_eq!(
            asked.text(),
            "host-fit identify 'my set' --delay=fixed --n1=2 --seed=3 --output=b.toml"
        );
        assert!(asked.parse::<identify::Args>().is_ok());
        let asked = json!({"command": "design", "model": 1, "options": {"target": -0.5, "least-air": true}});
        let asked = line(asked).unwrap();
        assert_eq!(
            asked.text(),
            "host-fit design a.toml 'my set' --least-air --target=-0.5 --output=b.toml"
        );
        assert!(asked.parse::<design::Args>().is_ok());
    }

    #[test]
    fn limits_and_messages_are_those_of_the_command_line() {
        let asked = json!({"command": "identify", "options": {"n1": 0}});
        let error = line(asked)
            .unwrap()
            .parse::<identify::Args>()
            .unwrap_err()
            .0;
        assert!(
            error.contains("'--n1") && error.contains("from 1 to 100") && !error.contains('\n'),
            "{error}"
        );
    }

    #[test]
    fn nothing_names_a_file_or_leaves_its_option() {
        for wrong in [
            json!({"command": "delete"}),
            json!({"command": "identify", "options": {"output": "/etc/passwd"}}),
            json!({"command": "identify", "options": {"report": "/etc/passwd"}}),
            json!({"command": "extend", "model": 1, "options": {"effect-file": "/etc/passwd"}}),
            json!({"command": "design", "model": 1, "options": {"csv": "/etc/passwd"}}),
            json!({"command": "import", "options": {"like": "/etc"}}),
            json!({"command": "identify", "model": 1}),
            json!({"command": "diagnose"}),
            json!([]),
        ] {
            assert!(Request::read(&wrong).is_err(), "{wrong}");
        }
        // A value that looks like an option remains a value.
        let asked = json!({"command": "identify", "options": {"effect": ["--output=/etc/passwd"]}});
        let asked = line(asked).unwrap();
        assert!(
            asked
                .text()
                .ends_with("--effect=--output=/etc/passwd --output=b.toml")
        );
        assert!(asked.parse::<identify::Args>().is_ok());
    }
}
