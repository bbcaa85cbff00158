//! The base plant: the flow to which hidden effects are added.

use rand::RngExt;
use rand_chacha::ChaCha8Rng;
use thiserror::Error;

/// A base plant property outside its physical range.
#[derive(Debug, Clone, Copy, PartialEq, Error)]
#[error("the base plant's `{property}` is {value}; it must be {requirement}")]
pub struct BasePlantError {
    /// Name of the property.
    pub property: &'static str,
    /// Value of the property.
    pub value: f64,
    /// Allowed range.
    pub requirement: &'static str,
}

/// Delay of the flow's response to the jet.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum FlowDelay {
    /// A constant transport delay, s (0–0.5).
    Fixed {
        /// Transport delay (s).
        delay_s: f64,
    },
    /// h(ỹ) = floor + rise·exp(−rate·ỹ), ỹ the mean friction of the last 250 ms, evaluated when the
    /// jet *arrives* (law (2) of the ECC 2016 paper, in seconds instead of samples).
    StateDependent {
        /// Delay of the attached flow, p0 (s).
        floor_s: f64,
        /// Extra delay of the fully separated flow, p1 (s).
        rise_s: f64,
        /// Rate at which the extra delay decreases with the mean friction, p2 (1/y).
        rate: f64,
    },
    /// h(ỹ) = floor + rise·max(1 − ỹ/level, 0): linear down to a minimum.
    Clamped {
        /// Delay of the attached flow (s).
        floor_s: f64,
        /// Extra delay of the fully separated flow (s).
        rise_s: f64,
        /// Mean friction above which the delay is constant (y).
        level: f64,
    },
    /// Different delays of rising and falling edges.
    EdgeDependent {
        /// Delay of a rising edge (s).
        rise_s: f64,
        /// Delay of a falling edge (s).
        fall_s: f64,
    },
}

impl FlowDelay {
    /// The delay at mean friction `mean` (s), the mean of both edges if they differ; negative friction counts
    /// as 0.
    pub fn at(self, mean: f64) -> f64 {
        match self {
            Self::Fixed { delay_s } => delay_s,
            Self::StateDependent {
                floor_s,
                rise_s,
                rate,
            } => floor_s + rise_s * (-rate * mean.max(0.0)).exp(),
            Self::Clamped {
                floor_s,
                rise_s,
                level,
            } => floor_s + rise_s * (1.0 - mean.max(0.0) / level).max(0.0),
            Self::EdgeDependent { rise_s, fall_s } => (rise_s + fall_s) / 2.0,
        }
    }

    /// The law with every delay multiplied by `factor`.
    #[must_use]
    pub fn scaled(self, factor: f64) -> Self {
        match self {
            Self::Fixed { delay_s } => Self::Fixed {
                delay_s: factor * delay_s,
            },
            Self::StateDependent {
                floor_s,
                rise_s,
                rate,
            } => Self::StateDependent {
                floor_s: factor * floor_s,
                rise_s: factor * rise_s,
                rate,
            },
            Self::Clamped {
                floor_s,
                rise_s,
                level,
            } => Self::Clamped {
                floor_s: factor * floor_s,
                rise_s: factor * rise_s,
                level,
            },
            Self::EdgeDependent { rise_s, fall_s } => Self::EdgeDependent {
                rise_s: factor * rise_s,
                fall_s: factor * fall_s,
            },
        }
    }
}

/// Response of the flow's *rate* to jets between off and on. For on/off jets all three are equal; jets of
/// part strength (a lagging valve, a drooping plenum) distinguish them.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum RateLaw {
    /// The rate is the attaching one while a jet of at least half strength arrives, otherwise the
    /// separating one; the equilibrium is gain × jet.
    #[default]
    Switched,
    /// The rate is interpolated linearly in the jet, the equilibrium is gain × jet.
    Interpolated,
    /// The *velocity* of the friction is interpolated linearly in the jet, which keeps the flow
    /// inside the bilinear class for every jet strength.
    Bilinear,
}

/// Separated flow behind a ramp with fluidic actuation: ṡ = rate(j)·(gain·j − s), j the arriving jet.
///
/// Attachment and separation have time constants of their own, which the bilinear class contains
/// exactly (the term u·y) as long as the jet is on/off.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct BasePlant {
    /// Time constant of attachment, while the jet arrives (s, 0.001–10).
    pub attach_s: f64,
    /// Time constant of separation, without a jet (s, 0.001–10).
    pub separate_s: f64,
    /// Steady friction under steady blowing (y).
    pub gain: f64,
    /// Transport delay.
    pub delay: FlowDelay,
    /// Rate of the flow for jets between off and on.
    pub rate_law: RateLaw,
}

/// Log-uniform draw: every octave of the range is equally likely.
pub(crate) fn log_uniform(rng: &mut ChaCha8Rng, low: f64, high: f64) -> f64 {
    rng.random_range(low.ln()..high.ln()).exp()
}

impl BasePlant {
    /// A random base plant with time constants of 20–150 ms that differ by at least a quarter, a
    /// gain of 0.85–1.15 and a state-dependent delay between 20 and 60 ms.
    ///
    /// rise·rate stays below 0.2 s so that the delay never grows faster than time (|dỹ/dt| ≤ 4 /s).
    pub fn draw(rng: &mut ChaCha8Rng) -> Self {
        let (attach_s, separate_s) = loop {
            let a = log_uniform(rng, 0.020, 0.150);
            let b = log_uniform(rng, 0.020, 0.150);
            if (a / b).ln().abs() > 1.25_f64.ln() {
                break (a, b);
            }
        };
        let floor_s = rng.random_range(0.020..0.045);
        let rise_s = rng.random_range(0.006..0.015);
        let rate = log_uniform(rng, 3.0, 20.0_f64.min(0.2 / rise_s));
        Self {
            attach_s,
            separate_s,
            gain: rng.random_range(0.85..1.15),
            delay: FlowDelay::StateDependent {
                floor_s,
                rise_s,
                rate,
            },
            rate_law: RateLaw::default(),
        }
    }

    /// Checks that the rig is physically possible.
    ///
    /// # Errors
    /// [`BasePlantError`] naming the first bad property.
    pub fn validate(&self) -> Result<(), BasePlantError> {
        let within = |property, value: f64, low: f64, high: f64, requirement| {
            // The condition is written so that NaN is rejected too.
            if value >= low && value <= high {
                Ok(())
            } else {
                Err(BasePlantError {
                    property,
                    value,
                    requirement,
                })
            }
        };
        let time = |property, value| within(property, value, 1e-3, 10.0, "0.001 to 10 s");
        let delay = |property, value| within(property, value, 0.0, 0.5, "0 to 0.5 s");
        time("attach_s", self.attach_s)?;
        time("separate_s", self.separate_s)?;
        within("gain", self.gain, -100.0, 100.0, "within ±100")?;
        match self.delay {
            FlowDelay::Fixed { delay_s } => delay("delay_s", delay_s),
            FlowDelay::StateDependent {
                floor_s,
                rise_s,
                rate,
            } => {
                delay("floor_s", floor_s)?;
                delay("rise_s", rise_s)?;
                within("rate", rate, 0.0, 1000.0, "0 to 1000 per y")
            }
            FlowDelay::Clamped {
                floor_s,
                rise_s,
                level,
            } => {
                delay("floor_s", floor_s)?;
                delay("rise_s", rise_s)?;
                within("level", level, 1e-9, 1e9, "above 0")
            }
            FlowDelay::EdgeDependent { rise_s, fall_s } => {
                delay("rise_s", rise_s)?;
                delay("fall_s", fall_s)
            }
        }
    }

    /// This rig with a constant delay, drawn from 20–60 ms.
    pub fn with_fixed_delay(mut self, rng: &mut ChaCha8Rng) -> Self {
        self.delay = FlowDelay::Fixed {
            delay_s: rng.random_range(0.020..0.060),
        };
        self
    }

    /// This rig with equal time constants for attachment and separation. Graded commands need this linear base, because
    /// they have no sharp boundary between the two.
    pub fn with_one_time_constant(mut self) -> Self {
        self.separate_s = self.attach_s;
        self
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::SeedableRng;

    #[test]
    fn draws_stay_in_their_ranges_and_repeat() {
        let mut rng = ChaCha8Rng::seed_from_u64(1);
        for _ in 0..500 {
            let base = BasePlant::draw(&mut rng);
            for tau in [base.attach_s, base.separate_s] {
                assert!((0.020..=0.150).contains(&tau));
            }
            let FlowDelay::StateDependent {
                floor_s,
                rise_s,
                rate,
            } = base.delay
            else {
                panic!("the base plant has a state-dependent delay");
            };
            assert!(floor_s >= 0.020 && floor_s + rise_s <= 0.060);
            assert!(rise_s * rate <= 0.2 + 1e-12);
            base.validate().unwrap();
        }
        let mut bad = BasePlant::draw(&mut rng);
        bad.separate_s = f64::NAN;
        let message = bad.validate().unwrap_err().to_string();
        assert!(message.contains("`separate_s`"), "{message}");
        let once = BasePlant::draw(&mut ChaCha8Rng::seed_from_u64(9));
        assert_eq!(once, BasePlant::draw(&mut ChaCha8Rng::seed_from_u64(9)));
    }
}
