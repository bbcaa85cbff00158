//! The verdict on the delay: constant, or dependent on a quantity.

/// The dependence of the measured delays.
#[derive(Debug, Clone, Copy, PartialEq, Eq, serde::Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum DelayVerdict {
    /// The delay depends on ỹ according to the law.
    StateDependent,
    /// No significant dependence: a fixed delay is enough.
    Fixed,
    /// Rising and falling edges differ, and ỹ explains nothing more: see the effect `edge-dependent-delay`.
    EdgeDependent,
    /// Rising and falling edges differ, and within a direction the delay also depends on ỹ.
    EdgeAndStateDependent,
    /// Too few edges were measured for a test.
    TooFewEdges,
}

impl DelayVerdict {
    /// The verdict after the law was rejected.
    pub(super) fn without_law(self, law: bool) -> Self {
        match self {
            Self::StateDependent if !law => Self::Fixed,
            other => other,
        }
    }
}
