//! What the page may ask for as work, and the command that does the same.

use host_fit::steps::{DelayKind, IdentifyRequest};
use serde::Deserialize;

/// A piece of work.
#[derive(Debug, Clone, PartialEq, Deserialize)]
#[serde(tag = "action", rename_all = "kebab-case", deny_unknown_fields)]
pub(super) enum Request {
    Identify {
        #[serde(default)]
        delay: Option<Delay>,
        #[serde(default)]
        n1: Option<u16>,
        #[serde(default)]
        n2: Option<u16>,
        #[serde(default)]
        max_lag: Option<u16>,
        #[serde(default)]
        evaluations: Option<u32>,
        #[serde(default)]
        seed: u64,
    },
    Diagnose {
        model: u32,
        #[serde(default)]
        seed: u64,
    },
    Extend {
        model: u32,
        effect: String,
    },
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub(super) enum Delay {
    Fixed,
    StateDependent,
}

impl Request {
    /// Reads and checks a request.
    pub(super) fn read(request: &serde_json::Value) -> Result<Self, String> {
        let read =
            Self::deserialize(request).map_err(|e| format!("the request cannot be read: {e}"))?;
        if let Self::Identify {
            n1,
            n2,
            max_lag,
            evaluations,
            ..
        } = &read
        {
            for (name, value, range) in [
                ("state lags", n1.map(u32::from), 1..=100),
                ("product lags", n2.map(u32::from), 0..=100),
                ("the longest lag", max_lag.map(u32::from), 1..=20_000),
                ("evaluations", *evaluations, 1..=1_000_000),
            ] {
                if value.is_some_and(|v| !range.contains(&v)) {
                    return Err(format!(
                        "{name}: a number from {} to {} is needed",
                        range.start(),
                        range.end()
                    ));
                }
            }
        }
        Ok(read)
    }

    /// What it is called while it runs.
    pub(super) fn name(&self) -> String {
        match self {
            Self::Identify { .. } => "identifying".to_owned(),
            Self::Diagnose { model, .. } => format!("diagnosing model {model}"),
            Self::Extend { model, effect } => format!("adding {effect} to model {model}"),
        }
    }

    /// The request of the library, for an identification.
    pub(super) fn identify(&self) -> Option<IdentifyRequest> {
        let Self::Identify {
            delay,
            n1,
            n2,
            max_lag,
            evaluations,
            seed,
        } = self
        else {
            return None;
        };
        let base = IdentifyRequest::default();
        Some(IdentifyRequest {
            delay: delay.map(|delay| match delay {
                Delay::Fixed => DelayKind::Fixed,
                Delay::StateDependent => DelayKind::StateDependent,
            }),
            n1: *n1,
            n2: *n2,
            max_lag: *max_lag,
            // The command's default.
            evaluations: evaluations.map_or(20_000, |e| e as usize),
            seed: *seed,
            ..base
        })
    }

    /// The command that does the same: `data` and `from` are the files it reads, `to` the one it writes.
    pub(super) fn command(&self, data: &str, from: &str, to: &str) -> String {
        match self {
            Self::Identify {
                delay,
                n1,
                n2,
                max_lag,
                evaluations,
                seed,
            } => {
                let mut text = format!("host-fit identify {data} -o {to}");
                if let Some(delay) = delay {
                    text.push_str(match delay {
                        Delay::Fixed => " --delay fixed",
                        Delay::StateDependent => " --delay state-dependent",
                    });
                }
                for (option, value) in [
                    ("n1", n1.map(u32::from)),
                    ("n2", n2.map(u32::from)),
                    ("max-lag", max_lag.map(u32::from)),
                    ("evaluations", *evaluations),
                ] {
                    if let Some(value) = value {
                        text.push_str(&format!(" --{option} {value}"));
                    }
                }
                if *seed != 0 {
                    text.push_str(&format!(" --seed {seed}"));
                }
                text
            }
            Self::Diagnose { seed, .. } => match seed {
                0 => format!("host-fit diagnose {from} {data}"),
                _ => format!("host-fit diagnose {from} {data} --seed {seed}"),
            },
            Self::Extend { effect, .. } => {
                format!("host-fit extend {from} {data} --effect {effect} -o {to}")
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::json;

    #[test]
    fn a_request_reads_as_the_command_that_it_is() {
        let of = |value| Request::read(&value).map(|r| r.command("set", "a.toml", "b.toml"));
        assert_eq!(
            of(json!({"action": "identify", "delay": "fixed", "n1": 2, "n2": null, "seed": 3}))
                .unwrap(),
            "host-fit identify set -o b.toml --delay fixed --n1 2 --seed 3"
        );
        assert_eq!(
            of(json!({"action": "extend", "model": 1, "effect": "jet-lag"})).unwrap(),
            "host-fit extend a.toml set --effect jet-lag -o b.toml"
        );
        for wrong in [
            json!({"action": "delete"}),
            json!({"action": "identify", "n1": 0}),
            json!({"action": "identify", "n1": 2, "output": "/etc/passwd"}),
            json!({"action": "diagnose"}),
            json!([]),
        ] {
            assert!(of(wrong.clone()).is_err(), "{wrong}");
        }
    }
}
