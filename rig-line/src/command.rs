//! On/off commands as run lengths.

use std::path::Path;

use recordings::InputFile;

use crate::error::LineError;

/// An on/off command.
#[derive(Clone, Debug, PartialEq)]
pub struct Command {
    /// Origin of the command, for messages and files.
    pub name: String,
    /// Sampling period, s.
    pub sample_period_s: f64,
    /// Run lengths in samples, alternating, closed first (may be 0).
    pub runs: Vec<u32>,
}

impl Command {
    /// Reads the columns t and u of a CSV file; u must be 0 or 1.
    ///
    /// # Errors
    /// [`LineError`] when the file cannot be read or the command is not on/off.
    pub fn load(path: &Path) -> Result<Self, LineError> {
        let file = InputFile::load(path, None)?;
        let name = path
            .file_stem()
            .map_or_else(|| "command".into(), |s| s.to_string_lossy().into_owned());
        if let Some(k) = file.u.iter().position(|u| *u != 0.0 && *u != 1.0) {
            return Err(LineError::Command {
                command: file.place(Some(k)).in_column("u").to_string(),
                reason: "the valve accepts 0 and 1 only; play an on/off command".into(),
            });
        }
        let levels = file.u.iter().map(|u| *u == 1.0);
        Ok(Self::new(&name, file.sample_period_s, levels))
    }

    /// The command from levels.
    pub fn new(name: &str, sample_period_s: f64, levels: impl IntoIterator<Item = bool>) -> Self {
        let mut runs = vec![0];
        let mut now = false;
        for level in levels {
            if level != now {
                runs.push(0);
                now = level;
            }
            if let Some(last) = runs.last_mut() {
                *last += 1;
            }
        }
        Self {
            name: name.to_owned(),
            sample_period_s,
            runs,
        }
    }

    /// The command with a final rest, so that the valve has been closed for `rest` samples when it repeats.
    #[must_use]
    pub fn with_rest(mut self, rest: u32) -> Self {
        let tail = if self.runs.len().is_multiple_of(2) {
            self.runs.push(0);
            0
        } else {
            self.runs.last().copied().unwrap_or(0)
        };
        if let Some(last) = self.runs.last_mut() {
            *last += rest.saturating_sub(tail);
        }
        self
    }

    /// Length of the command, samples.
    #[must_use]
    pub fn samples(&self) -> u64 {
        self.runs.iter().map(|run| u64::from(*run)).sum()
    }

    /// Whether the valve is open, sample by sample.
    pub fn levels(&self) -> impl Iterator<Item = bool> + '_ {
        let runs = self.runs.iter().enumerate();
        runs.flat_map(|(i, run)| (0..*run).map(move |_| i % 2 == 1))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn levels_become_runs_and_runs_levels() {
        for text in ["0011101", "1", "0", "1100", "01"] {
            let levels: Vec<bool> = text.bytes().map(|b| b == b'1').collect();
            let command = Command::new("x", 0.001, levels.clone());
            assert_eq!(command.levels().collect::<Vec<_>>(), levels, "{text}");
            let rested = command.clone().with_rest(5);
            let tail = rested.levels().collect::<Vec<_>>();
            assert!(tail.starts_with(&levels) && tail.ends_with(&[false; 5]));
            assert_eq!(rested.clone().with_rest(5), rested);
        }
    }

    #[test]
    fn a_file_that_is_no_on_off_command_is_refused_with_its_line() {
        let folder = tempfile::tempdir().expect("a folder");
        let path = folder.path().join("half.csv");
        std::fs::write(&path, "t,u\n0,0\n0.001,0.5\n").expect("written");
        let error = Command::load(&path).expect_err("refused").to_string();
        assert!(
            error.contains("half.csv") && error.contains("0 and 1"),
            "{error}"
        );
        assert!(error.contains('3'), "{error}");
        std::fs::write(&path, "t,u\n0,0\n0.001,1\n0.002,1\n").expect("written");
        let command = Command::load(&path).expect("a command");
        assert_eq!(
            (command.name.as_str(), &command.runs[..]),
            ("half", &[1, 2][..])
        );
    }
}
