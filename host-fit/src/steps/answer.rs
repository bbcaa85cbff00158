//! The answer of a step: verdict, evidence, confidence, next command.

use serde::Serialize;

/// Placeholder of the model file in [`Answer::next`], replaced by [`Answer::with_files`].
pub const MODEL: &str = "model.toml";
/// Placeholder of the data set in [`Answer::next`], replaced by [`Answer::with_files`].
pub const DATASET: &str = "DATASET";

/// The usual name of an extended model in [`Answer::next`].
const BETTER: &str = "better.toml";

/// A name for the extension of `model` that does not overwrite it: `better.toml`, then `better-2.toml` …
fn better_than(model: &str) -> String {
    let file = model.rsplit('/').next().unwrap_or(model);
    let number = file.strip_prefix("better").and_then(|rest| {
        let number = rest.trim_matches('\'').strip_suffix(".toml")?;
        match number.strip_prefix('-') {
            Some(digits) => digits.parse::<u32>().ok(),
            None => number.is_empty().then_some(1),
        }
    });
    match number {
        Some(number) => format!("better-{}.toml", number.saturating_add(1)),
        None => BETTER.to_owned(),
    }
}

/// Tone of a verdict.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Tone {
    /// Complete: no further step is needed.
    Good,
    /// Something was found.
    #[default]
    Finding,
    /// Something is wrong or remains unexplained.
    Warning,
}

/// A result in four parts that are read at once. The terminal, the report page, the workbench and the JSON document
/// all print this value, so its words are written in one place.
///
/// ```
/// use host_fit::steps::{Answer, Tone};
///
/// let answer = Answer::new(Tone::Finding, "plenum-droop is missing")
///     .evidence("RMSE 0.0273 → 0.0104.")
///     .next("host-fit compare model.toml DATASET")
///     .with_files("fit.toml", "ramp");
/// assert_eq!(answer.words().lines().next(), Some("plenum-droop is missing"));
/// assert!(answer.sentence().ends_with("Next: `host-fit compare fit.toml ramp`."));
/// ```
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize)]
pub struct Answer {
    /// Kind of result.
    pub tone: Tone,
    /// The result in three to eight words, without a full stop.
    pub verdict: String,
    /// One number with the number to which it is compared.
    pub evidence: String,
    /// The confidence with its test; empty if nothing was tested.
    pub confidence: String,
    /// The next command; empty without one.
    pub next: String,
    /// Limitations of the result, one each.
    pub notes: Vec<String>,
}

impl Answer {
    /// A verdict without evidence yet.
    #[must_use]
    pub fn new(tone: Tone, verdict: impl Into<String>) -> Self {
        Self {
            tone,
            verdict: verdict.into(),
            ..Self::default()
        }
    }

    /// Sets the evidence.
    #[must_use]
    pub fn evidence(mut self, text: impl Into<String>) -> Self {
        self.evidence = text.into();
        self
    }

    /// Sets the confidence.
    #[must_use]
    pub fn confidence(mut self, text: impl Into<String>) -> Self {
        self.confidence = text.into();
        self
    }

    /// Sets the next command.
    #[must_use]
    pub fn next(mut self, command: impl Into<String>) -> Self {
        self.next = command.into();
        self
    }

    /// Adds a note; an empty one is ignored.
    pub fn note(&mut self, text: impl Into<String>) {
        let text = text.into();
        if !text.trim().is_empty() {
            self.notes.push(text.trim().to_owned());
        }
    }

    /// Replaces the placeholders in the next command by the user's files, quoted for a shell.
    #[must_use]
    pub fn with_files(mut self, model: &str, dataset: &str) -> Self {
        let words = self.next.split(' ').map(|word| match word {
            MODEL => model.to_owned(),
            DATASET => dataset.to_owned(),
            BETTER => better_than(model),
            other => other.to_owned(),
        });
        self.next = words.collect::<Vec<_>>().join(" ");
        self
    }

    /// The labelled parts that are not empty, without the verdict.
    #[must_use]
    pub fn parts(&self) -> Vec<(&'static str, &str)> {
        let all = [
            ("Evidence", self.evidence.as_str()),
            ("Confidence", self.confidence.as_str()),
            ("Next", self.next.as_str()),
        ];
        all.into_iter()
            .filter(|(_, text)| !text.is_empty())
            .collect()
    }

    /// The answer as lines for a terminal: the verdict, then each part and each note, wrapped at 100 columns. The
    /// command is never wrapped, so that it can be copied.
    #[must_use]
    pub fn words(&self) -> String {
        let mut text = self.verdict.clone();
        let notes = self.notes.iter().map(|note| ("Note", note.as_str()));
        for (label, part) in self.parts().into_iter().chain(notes) {
            let lines = match label {
                "Next" => vec![part.to_owned()],
                _ => wrapped(part, COLUMNS - INDENT),
            };
            for (index, line) in lines.iter().enumerate() {
                let head = match index {
                    0 => format!("{label}:"),
                    _ => String::new(),
                };
                text.push_str(&format!("\n  {head:<11} {line}"));
            }
        }
        text
    }

    /// The answer as consecutive sentences, for a JSON document.
    #[must_use]
    pub fn sentence(&self) -> String {
        let mut text = format!("{}.", self.verdict);
        for part in [&self.evidence, &self.confidence]
            .into_iter()
            .chain(&self.notes)
        {
            if !part.is_empty() {
                text.push_str(&format!(" {part}"));
            }
        }
        if !self.next.is_empty() {
            text.push_str(&format!(" Next: `{}`.", self.next));
        }
        text
    }
}

/// Columns of a terminal line.
const COLUMNS: usize = 100;
/// Columns before the text of a part.
const INDENT: usize = 14;

/// Words in lines of at most `columns` characters; a longer word has a line of its own.
fn wrapped(text: &str, columns: usize) -> Vec<String> {
    let mut lines: Vec<String> = Vec::new();
    // A number stays with its unit, and an abbreviation with its number.
    let kept = text.replace(" %", "\u{a0}%").replace("RMSE ", "RMSE\u{a0}");
    for word in kept.split(' ').filter(|word| !word.is_empty()) {
        match lines.last_mut() {
            Some(line) if line.chars().count() + 1 + word.chars().count() <= columns => {
                line.push(' ');
                line.push_str(word);
            }
            _ => lines.push(word.to_owned()),
        }
    }
    lines
        .iter()
        .map(|line| line.replace('\u{a0}', " "))
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_whole_words_are_replaced_by_files() {
        let extend = |model| {
            let next = Answer::default().next("host-fit extend model.toml DATASET -o better.toml");
            next.with_files(model, "ramp").next
        };
        assert!(extend("fit.toml").ends_with("-o better.toml"));
        assert!(extend("out/better.toml").ends_with("-o better-2.toml"));
        assert!(extend("better-2.toml").ends_with("-o better-3.toml"));
        let next = Answer::default().next("host-fit extend model.toml DATASET -o my-model.toml");
        let next = next.with_files("a.toml", "'my data'").next;
        assert_eq!(next, "host-fit extend a.toml 'my data' -o my-model.toml");
    }

    #[test]
    fn long_parts_are_wrapped_and_commands_are_not() {
        let answer = Answer::new(Tone::Finding, "x")
            .evidence("word ".repeat(40))
            .next("command ".repeat(20).trim());
        let words = answer.words();
        let lines: Vec<&str> = words.lines().collect();
        assert!(lines.len() >= 4, "{words}");
        let (command, text) = lines.split_last().unwrap();
        assert!(command.contains(&"command ".repeat(19)));
        assert!(
            text.iter().all(|line| line.chars().count() <= 100),
            "{words}"
        );
        assert!(text[2].starts_with("              word"));
    }

    #[test]
    fn empty_parts_are_not_printed() {
        let mut answer = Answer::new(Tone::Good, "no effect is missing");
        answer.note(" ");
        assert_eq!(answer.words(), "no effect is missing");
        assert_eq!(answer.sentence(), "no effect is missing.");
    }
}
