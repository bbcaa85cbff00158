//! Peak memory of every command, against the limit of `--memory`.

use crate::Task;
use crate::shell::{output, program, root, run, target};
use anyhow::{Context, Result, bail, ensure};
use serde::Deserialize;
use std::fs;
use std::path::PathBuf;
use std::process::Command;

pub(crate) const TASK: Task = Task {
    name: "memory",
    does: "measures the peak memory of every command on bundled, large and hostile input, and prints the table of \
         docs/testing.md; --seconds N: time limit of a command (default 300)",
    run: memory,
};

/// Default limit of a command, bytes.
const LIMIT: f64 = 2e9;

/// The expected end of a command.
#[derive(Clone, Copy, Debug)]
enum End {
    /// A result, or the time limit.
    Result,
    /// An error that contains these words.
    Refusal(&'static str),
}

use End::{Refusal, Result as Done};

/// A message of the memory limit.
const TOO_MUCH: End = Refusal("of memory, but 2.0 GB are allowed");

/// Input, command and its end. SET stands for the bundled set of 8 records with 10 000 samples.
const ROWS: &[(&str, &str, End)] = &[
    ("bundled data", "demo --out demo", Done),
    (
        "8 × 10 000 samples",
        "import SET/step.csv SET/sq4-50.csv SET/sq4-80.csv SET/sq8-50.csv SET/sq8-80.csv SET/sq2-30.csv SET/random-a.csv SET/random-b.csv -o out --force",
        Done,
    ),
    ("8 × 10 000 samples", "delay SET --out delays", Done),
    (
        "8 × 10 000 samples",
        "identify SET -o model.toml --n1 1 --n2 1 --evaluations 500",
        Done,
    ),
    (
        "8 × 10 000 samples",
        "identify SET -o other.toml --report page.html",
        Done,
    ),
    (
        "8 × 10 000 samples",
        "compare model.toml SET --report page.html",
        Done,
    ),
    (
        "8 × 10 000 samples",
        "diagnose model.toml SET -o found.toml --report page.html",
        Done,
    ),
    (
        "8 × 10 000 samples",
        "discover model.toml SET -o term.toml --report page.html",
        Done,
    ),
    (
        "8 × 10 000 samples",
        "extend model.toml SET --effect plenum-droop -o more.toml --report page.html",
        Done,
    ),
    (
        "8 × 10 000 samples",
        "design model.toml SET --target 0.3 --force -o law.toml --report page.html",
        Done,
    ),
    (
        "8 × 10 000 samples",
        "simulate model.toml SET/step.csv -o run.csv",
        Done,
    ),
    ("8 × 10 000 samples", "codegen model.toml -o flow.rs", Done),
    ("10⁶ rows", "compare model.toml million", Done),
    (
        "10⁶ rows",
        "diagnose model.toml million -o found.toml",
        Done,
    ),
    ("10⁶ rows", "identify million -o other.toml", Done),
    ("10⁷ rows", "import most/long.csv -o out --force", Done),
    (
        "10⁷ rows",
        "average most/long.csv --period 10 --out averaged",
        Done,
    ),
    (
        "10⁷ rows",
        "simulate model.toml most/long.csv -o run.csv",
        Done,
    ),
    ("10⁷ rows", "compare model.toml most", TOO_MUCH),
    ("10⁷ rows", "identify most -o other.toml", TOO_MUCH),
    (
        "10⁷ rows",
        "diagnose model.toml most -o found.toml",
        TOO_MUCH,
    ),
    (
        "10⁷ rows",
        "discover model.toml most -o term.toml",
        TOO_MUCH,
    ),
    (
        "10⁷ rows",
        "design model.toml most --target 0.3 -o law.toml",
        TOO_MUCH,
    ),
    (
        "2 · 10⁷ rows",
        "import more/long.csv -o out --force",
        TOO_MUCH,
    ),
    (
        "4099 columns × 2000",
        "import most.csv -o out --force",
        Done,
    ),
    (
        "16 384 columns",
        "import wide.csv -o out --force",
        Refusal("at most 4096 are allowed"),
    ),
    (
        "16 385 columns",
        "import wider.csv -o out --force",
        Refusal("at most 16384 are allowed"),
    ),
    (
        "10⁶ columns",
        "import header.csv -o out --force",
        Refusal("header.csv"),
    ),
    (
        "a line of 300 MB",
        "import line.csv -o out --force",
        Refusal("line.csv"),
    ),
    (
        "`.mat` of 16 GB, cut short",
        "import short.mat -o out --force",
        Refusal("damaged or cut short"),
    ),
    (
        "`.mat` of 16 GB, packed to 9 MB",
        "import bomb.mat -o out --force",
        TOO_MUCH,
    ),
    (
        "`.npz` of 16 GB, packed to 70 MB",
        "import bomb.npz -o out --force",
        Refusal("needs 16.1 GB of memory"),
    ),
];

/// What the helper measured.
#[derive(Debug, Deserialize)]
struct Measured {
    /// Exit code; none if the time limit was reached.
    code: Option<i32>,
    /// End of the error output.
    said: String,
    seconds: f64,
    /// Largest resident memory, bytes.
    bytes: f64,
}

fn memory(arguments: &[String]) -> Result<()> {
    let seconds = match arguments {
        [] => "300",
        [name, seconds] if name == "--seconds" => seconds,
        _ => bail!("the only option is --seconds N"),
    };
    let program = PathBuf::from(program()?.get_program());
    let python = crate::setup::python()?;
    let helper = root().join("xtask/src/memory/measure.py");
    let folder = target().join("memory");
    fs::create_dir_all(&folder)?;
    let call = || {
        let mut call = Command::new(python);
        call.arg(&helper).current_dir(&folder);
        call
    };
    // The input takes minutes and 1.5 GB, so it is kept.
    let made = folder.join("made");
    if !made.exists() {
        run(call().args(["make", "."])).context("the input")?;
        fs::write(made, "")?;
    }
    let set = root().join("data/hidden-ramp");
    println!("| input | command | peak, MB | time, s | end |");
    println!("|---|---|---|---|---|");
    let mut wrong = Vec::new();
    for (input, line, end) in ROWS {
        let name = line.split(' ').next().unwrap_or_default();
        let words = line
            .split_whitespace()
            .map(|word| word.replace("SET", &set.to_string_lossy()));
        let text = output(call().args(["run", seconds]).arg(&program).args(words))?;
        let found: Measured = serde_json::from_str(&text).context("the helper's answer")?;
        let (ended, as_expected) = found.end(*end);
        println!(
            "| {input} | `{name}` | {:.0} | {:.1} | {ended} |",
            found.bytes / 1e6,
            found.seconds
        );
        if found.bytes > LIMIT || !as_expected {
            wrong.push(format!("{line} ({input}): {found:?}"));
        }
    }
    ensure!(
        wrong.is_empty(),
        "above the limit, or not the expected end:\n{}",
        wrong.join("\n")
    );
    Ok(())
}

impl Measured {
    /// The end in words, and whether it is the expected one.
    fn end(&self, expected: End) -> (String, bool) {
        match (self.code, expected) {
            (Some(0), end) => ("result".to_owned(), matches!(end, Done)),
            (None, end) => ("stopped at the time limit".to_owned(), matches!(end, Done)),
            (Some(1), Refusal(words)) if self.said.contains(words) => ("refused".to_owned(), true),
            // `extend` refuses an effect that does not lower the error; that is an answer.
            (Some(1), Done) if self.said.contains("nothing was written") => {
                ("result".to_owned(), true)
            }
            (Some(code), _) => (format!("exit code {code}"), false),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_abort_or_another_message_is_not_a_refusal() {
        let end = |code, said: &str, expected| {
            let measured = Measured {
                code,
                said: said.to_owned(),
                seconds: 1.0,
                bytes: 1e6,
            };
            measured.end(expected).1
        };
        assert!(end(Some(0), "", Done));
        assert!(!end(Some(0), "", TOO_MUCH));
        let said = "error: it needs 3.0 GB of memory, but 2.0 GB are allowed";
        assert!(end(Some(1), said, TOO_MUCH));
        assert!(!end(Some(1), "error: no such file", TOO_MUCH));
        assert!(!end(Some(134), said, TOO_MUCH));
        assert!(!end(None, "", TOO_MUCH));
    }
}
