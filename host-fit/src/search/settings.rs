//! The settings of a search, with one table that documents them.

/// Settings of a search. [`SETTINGS`] describes each.
#[derive(Debug, Clone, PartialEq)]
pub struct Settings {
    /// Most evaluations of the objective.
    pub evaluations: usize,
    /// Seed of every random choice.
    pub seed: u64,
    /// Threads that evaluate. The result does not depend on it.
    pub threads: usize,
    /// Poll directions.
    pub poll: PollKind,
    /// First frame as a share of each variable's range.
    pub initial_frame: f64,
}

/// How many directions a poll tries.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum PollKind {
    /// Both signs of an orthogonal basis: 2n points.
    Ortho2N,
    /// The better-looking half of them and minus their sum: n + 1 points.
    OrthoNPlus1,
}

impl Default for Settings {
    fn default() -> Self {
        Self {
            evaluations: 20_000,
            seed: 0,
            threads: 1,
            poll: PollKind::OrthoNPlus1,
            initial_frame: 0.1,
        }
    }
}

/// One line of the settings table.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct SettingHelp {
    /// Name of the field of [`Settings`], dashes for underscores.
    pub name: &'static str,
    /// Default value as text.
    pub default: &'static str,
    /// Meaning, unit and range.
    pub help: &'static str,
}

/// Every setting with its default and meaning: the source of documentation and `--help`.
pub const SETTINGS: [SettingHelp; 5] = [
    SettingHelp {
        name: "evaluations",
        default: "20000",
        help: "most evaluations of the objective; points remembered from before cost nothing",
    },
    SettingHelp {
        name: "seed",
        default: "0",
        help: "seed of every random choice: the same seed gives the same result bit for bit",
    },
    SettingHelp {
        name: "threads",
        default: "1",
        help: "threads that evaluate candidates, at least 1; the result does not depend on it",
    },
    SettingHelp {
        name: "poll",
        default: "ortho-n-plus-1",
        help: "poll directions: ortho-2n or ortho-n-plus-1",
    },
    SettingHelp {
        name: "initial-frame",
        default: "0.1",
        help: "first poll frame as a share of each variable's range, above 0 and at most 1",
    },
];

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_table_states_the_defaults() {
        let d = Settings::default();
        let of = |name: &str| SETTINGS.iter().find(|s| s.name == name).map(|s| s.default);
        assert_eq!(of("evaluations"), Some(d.evaluations.to_string().as_str()));
        assert_eq!(of("seed"), Some(d.seed.to_string().as_str()));
        assert_eq!(of("threads"), Some(d.threads.to_string().as_str()));
        assert_eq!(
            of("initial-frame"),
            Some(d.initial_frame.to_string().as_str())
        );
        assert_eq!(d.poll, PollKind::OrthoNPlus1);
    }
}
