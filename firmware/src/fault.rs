//! Faults that close the valves.

/// A reason to close the valves, latched until the operator disarms.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum Fault {
    /// A sample was not finished when the next one was due.
    Overrun,
    /// The reading is not finite.
    NotFinite,
    /// The sensor is at the lower or upper end of its range.
    AtRail,
    /// The sensor has not changed for too long.
    Stuck,
    /// A measured channel is not finite or at an end of its range.
    Channel,
    /// The residual exceeds its limit.
    Residual,
    /// The host that plays a command has been silent for too long.
    Link,
    /// The watchdog restarted the board.
    Watchdog,
    /// The constants or the model's reference run differ from the generated ones.
    SelfTest,
    /// A host set the running law to a value outside its bounds.
    Setting,
}

impl Fault {
    /// All faults.
    pub const ALL: [Self; 10] = [
        Self::Overrun,
        Self::NotFinite,
        Self::AtRail,
        Self::Stuck,
        Self::Channel,
        Self::Residual,
        Self::Link,
        Self::Watchdog,
        Self::SelfTest,
        Self::Setting,
    ];

    /// Name of the fault in the status line.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Overrun => "overrun",
            Self::NotFinite => "not-finite",
            Self::AtRail => "at-rail",
            Self::Stuck => "stuck",
            Self::Channel => "channel",
            Self::Residual => "residual",
            Self::Link => "link",
            Self::Watchdog => "watchdog",
            Self::SelfTest => "self-test",
            Self::Setting => "setting",
        }
    }
}

#[cfg(feature = "defmt")]
impl defmt::Format for Fault {
    fn format(&self, formatter: defmt::Formatter<'_>) {
        defmt::write!(formatter, "{=str}", self.name());
    }
}
