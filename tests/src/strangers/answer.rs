//! One run of the program: exit code, JSON document, text.

use serde_json::Value;
use std::fs;
use std::path::Path;
use std::process::{Command, Stdio};
use std::time::{Duration, Instant};

/// Polling interval of a running program.
const POLL: Duration = Duration::from_millis(5);

/// Output of a command.
#[derive(Clone, Debug, Default)]
pub(crate) struct Answer {
    /// The command's name, for messages.
    pub(crate) command: String,
    /// Exit code; none if the program was stopped or ended by a signal.
    pub(crate) exit: Option<i32>,
    /// The JSON document; null without one.
    pub(crate) document: Value,
    /// All text output of the program.
    pub(crate) said: String,
    /// Wall-clock time, s.
    pub(crate) seconds: f64,
}

/// Runs a command of the program with `--json` and a time limit.
pub(crate) fn ask(name: &str, arguments: &[String], scratch: &Path, limit: Duration) -> Answer {
    let start = Instant::now();
    let mut answer = Answer {
        command: name.to_owned(),
        ..Answer::default()
    };
    let [out, err] = ["json", "err"].map(|end| scratch.join(format!("{name}.{end}")));
    let ran = || -> std::io::Result<Option<i32>> {
        let mut child = Command::new(crate::program())
            .args(arguments)
            .arg("--json")
            .stdin(Stdio::null())
            .stdout(fs::File::create(&out)?)
            .stderr(fs::File::create(&err)?)
            .spawn()?;
        loop {
            if let Some(status) = child.try_wait()? {
                return Ok(status.code());
            }
            if start.elapsed() > limit {
                // An error means that it has ended already.
                let _ = child.kill();
                let _ = child.wait();
                return Ok(None);
            }
            std::thread::sleep(POLL);
        }
    };
    match ran() {
        Ok(exit) => answer.exit = exit,
        Err(error) => answer.said = error.to_string(),
    }
    answer.seconds = start.elapsed().as_secs_f64();
    let document = fs::read_to_string(&out).unwrap_or_default();
    answer.document = serde_json::from_str(&document).unwrap_or(Value::Null);
    answer.said += &document;
    answer.said += &fs::read_to_string(&err).unwrap_or_default();
    // The temporary folder's name differs between runs.
    answer.said = answer.said.replace(&*scratch.to_string_lossy(), "…");
    answer
}

impl Answer {
    /// The first line of the error message.
    pub(crate) fn complaint(&self) -> String {
        let lines = self.said.lines().map(str::trim);
        let first = lines.filter(|line| line.starts_with("error")).take(1);
        let words: String = first.collect();
        match (self.exit, words.is_empty()) {
            (None, true) => format!("stopped after {:.0} s", self.seconds),
            (_, true) => "no message".to_owned(),
            _ => words.chars().take(200).collect(),
        }
    }
}
