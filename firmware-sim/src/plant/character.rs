//! Flow dynamics with more than one time constant per direction.

use super::base::BasePlantError;

/// Dependence of a flow on its own past.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PastTerm {
    /// The lag (s, 0.005–1).
    pub delay_s: f64,
    /// Gain from the past friction to the level of the flow (-).
    pub gain: f64,
    /// Reduction of that gain under the jet (-).
    pub lost: f64,
    /// Smearing time constant of the past (s); 0 for a sharp memory.
    pub smear_s: f64,
    /// Limit of limit·tanh(past/limit), a saturation of the past (y); infinite for no saturation.
    pub limit: f64,
}

impl PastTerm {
    /// A sharp linear memory: inside the bilinear class for on/off jets.
    pub fn new(delay_s: f64, gain: f64, lost: f64) -> Self {
        Self {
            delay_s,
            gain,
            lost,
            smear_s: 0.0,
            limit: f64::INFINITY,
        }
    }

    /// The past after smearing and saturation (y).
    pub(crate) fn felt(&self, past: f64) -> f64 {
        if self.limit.is_finite() {
            self.limit * (past / self.limit).tanh()
        } else {
            past
        }
    }
}

/// The dynamics of the flow. `level(j)` is the steady level under the jet j, `rate(j)` the relaxation rate.
#[derive(Debug, Clone, PartialEq, Default)]
pub enum Character {
    /// ṡ = rate·(level − s).
    #[default]
    FirstOrder,
    /// The level contains the additional term Σ (gain − lost·j)·s(t − delay).
    Memory(Vec<PastTerm>),
    /// Inertia: time·s̈ + ṡ = rate·(level − s).
    Inertia {
        /// Time constant of the inertia (s).
        time_s: f64,
    },
    /// A second lag in series: time·ṡ = x − s, ẋ = rate·(level − x).
    SecondLag {
        /// Time constant of the second lag (s).
        time_s: f64,
    },
    /// A slow wake: level − pull·w, time·ẇ = s − w.
    Wake {
        /// Time constant of the wake (s).
        time_s: f64,
        /// Strength of the wake (-).
        pull: f64,
    },
    /// The separation rate depends on the friction: rate·(1 + slope·s) without a jet.
    RateOfFriction {
        /// Relative change of the rate per friction (1/y).
        slope: f64,
    },
}

/// Smallest separation rate, relative to that at rest.
const SLOWEST: f64 = 0.1;

impl Character {
    /// Number of continuous states in addition to the friction.
    pub(crate) fn states(&self) -> usize {
        match self {
            Self::FirstOrder | Self::RateOfFriction { .. } => 0,
            Self::Memory(terms) => terms.len(),
            Self::Inertia { .. } | Self::SecondLag { .. } | Self::Wake { .. } => 1,
        }
    }

    /// The terms that need the past.
    pub(crate) fn past(&self) -> &[PastTerm] {
        match self {
            Self::Memory(terms) => terms,
            _ => &[],
        }
    }

    /// Steady level under blowing minus the resulting friction.
    pub fn overshoot(&self) -> f64 {
        match self {
            Self::Memory(terms) => 1.0 - terms.iter().map(|t| t.gain - t.lost).sum::<f64>(),
            Self::Wake { pull, .. } => 1.0 + pull,
            Self::FirstOrder
            | Self::Inertia { .. }
            | Self::SecondLag { .. }
            | Self::RateOfFriction { .. } => 1.0,
        }
    }

    /// Factor on the separation rate at friction `s`. Below rest it keeps its value at rest: a lower rate would make
    /// the flow diverge.
    pub(crate) fn separation(&self, s: f64) -> f64 {
        match self {
            Self::RateOfFriction { slope } => (1.0 + slope * s.max(0.0)).max(SLOWEST),
            _ => 1.0,
        }
    }

    /// Names and values of the parameters, for users and scoring scripts.
    pub fn properties(&self) -> Vec<(String, f64)> {
        match self {
            Self::FirstOrder => Vec::new(),
            Self::Memory(terms) => {
                let named = |i: usize, term: &PastTerm| {
                    let name = |what: &str| match terms.len() {
                        1 => format!("memory_{what}"),
                        _ => format!("memory{}_{what}", i + 1),
                    };
                    let mut all = vec![
                        (name("delay_s"), term.delay_s),
                        (name("gain"), term.gain),
                        (name("lost"), term.lost),
                    ];
                    if term.smear_s > 0.0 {
                        all.push((name("smear_s"), term.smear_s));
                    }
                    if term.limit.is_finite() {
                        all.push((name("limit"), term.limit));
                    }
                    all
                };
                let each = terms.iter().enumerate();
                each.flat_map(|(i, term)| named(i, term)).collect()
            }
            Self::Inertia { time_s } => vec![("inertia_s".to_owned(), *time_s)],
            Self::SecondLag { time_s } => vec![("second_lag_s".to_owned(), *time_s)],
            Self::Wake { time_s, pull } => vec![
                ("wake_s".to_owned(), *time_s),
                ("wake_pull".to_owned(), *pull),
            ],
            Self::RateOfFriction { slope } => vec![("separation_slope".to_owned(), *slope)],
        }
    }

    /// Checks that the flow is physically possible.
    ///
    /// # Errors
    /// [`BasePlantError`] naming the first bad property.
    pub fn validate(&self) -> Result<(), BasePlantError> {
        let within = |property, value: f64, low: f64, high: f64, requirement| {
            // The condition is written so that NaN is rejected too.
            if value >= low && value <= high {
                return Ok(());
            }
            Err(BasePlantError {
                property,
                value,
                requirement,
            })
        };
        match self {
            Self::FirstOrder => Ok(()),
            Self::Memory(terms) => {
                for term in terms {
                    within("memory_delay_s", term.delay_s, 0.005, 1.0, "0.005 to 1 s")?;
                    within("memory_smear_s", term.smear_s, 0.0, 1.0, "0 to 1 s")?;
                    within("memory_limit", term.limit, 1e-6, f64::INFINITY, "above 0")?;
                }
                let reach = |size: fn(&PastTerm) -> f64| terms.iter().map(size).sum::<f64>();
                let requirement = "below 1 together, or the flow diverges by itself";
                within(
                    "memory_gain",
                    reach(|t| t.gain.abs()),
                    0.0,
                    0.999,
                    requirement,
                )?;
                let blown = reach(|t| (t.gain - t.lost).abs());
                within("memory_lost", blown, 0.0, 0.999, requirement)
            }
            Self::Inertia { time_s } | Self::SecondLag { time_s } | Self::Wake { time_s, .. } => {
                within("time_s", *time_s, 1e-3, 10.0, "0.001 to 10 s")
            }
            Self::RateOfFriction { slope } => {
                within("slope", *slope, -100.0, 100.0, "within ±100 per y")
            }
        }
    }
}
