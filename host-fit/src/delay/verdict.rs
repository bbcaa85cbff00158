//! The verdict: whether the delay depends on anything.

/// What the measured delays depend on.
#[derive(Debug, Clone, Copy, PartialEq, Eq, serde::Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum DelayVerdict {
    /// The delay depends on ỹ as the law says.
    StateDependent,
    /// No dependence on anything: a fixed delay is enough.
    Fixed,
    /// Rising and falling edges differ, and ỹ explains nothing beyond: see the effect `edge-dependent-delay`.
    EdgeDependent,
    /// Rising and falling edges differ, and within a direction the delay depends on ỹ too.
    EdgeAndStateDependent,
    /// Too few edges could be measured to say.
    TooFewEdges,
}

impl DelayVerdict {
    /// The verdict where the law was not kept.
    pub(super) fn without_law(self, law: bool) -> Self {
        match self {
            Self::StateDependent if !law => Self::Fixed,
            other => other,
        }
    }
}
