//! Nuisances: deviations that are neither flow nor effect nor noise, and must not be diagnosed as an effect.

use std::fmt::Write as _;

use rand::RngExt;
use rand_chacha::ChaCha8Rng;

use crate::named;
use crate::plant::effects::{Physics, ThermalDrift};

named! {
    /// A kind of nuisance.
    pub enum Nuisance {
        /// The sensor has an offset of a few per cent.
        Offset = "offset",
        /// The records start in mid-run.
        MidRun = "mid-run",
        /// The offset drifts over the whole session.
        Drift = "drift",
        /// Commands have levels between off and on.
        Graded = "graded",
    }
}

/// The nuisances of a rig, with their sizes.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct Nuisances {
    /// Sensor offset (y).
    pub offset: f64,
    /// Unrecorded samples before each record.
    pub lead_samples: usize,
    /// Drift of the offset over the session (y).
    pub drift: f64,
    /// Whether commands have levels between off and on.
    pub graded: bool,
}

impl Nuisances {
    pub(super) fn draw(kinds: &[Nuisance], rng: &mut ChaCha8Rng) -> Self {
        let mut all = Self::default();
        let mut signed = |low: f64, high: f64| {
            let size = rng.random_range(low..high);
            if rng.random_bool(0.5) { size } else { -size }
        };
        for kind in kinds {
            match kind {
                Nuisance::Offset => all.offset = signed(0.02, 0.08),
                Nuisance::MidRun => all.lead_samples = signed(1200.0, 3000.0).abs() as usize,
                Nuisance::Drift => all.drift = signed(0.03, 0.10),
                Nuisance::Graded => all.graded = true,
            }
        }
        all
    }

    /// The effect of the catalogue that correctly names one of the nuisances.
    pub(super) fn effect(&self) -> Option<&'static str> {
        (self.drift != 0.0).then_some(ThermalDrift::NAME)
    }

    /// The sensor's offset at sample `k` of a session of `samples` (y).
    pub(crate) fn zero(&self, k: usize, samples: usize) -> f64 {
        self.offset + self.drift * k as f64 / samples as f64
    }

    /// The table `[nuisances]`; empty without any.
    pub(super) fn to_toml(self) -> String {
        if self == Self::default() {
            return String::new();
        }
        let mut text = "\n[nuisances]\n".to_owned();
        // Writing to a String cannot fail.
        let _ = writeln!(
            text,
            "offset = {}\nlead_samples = {}\ndrift = {}\ngraded = {}",
            self.offset, self.lead_samples, self.drift, self.graded
        );
        text
    }
}
