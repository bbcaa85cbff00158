//! Random effects: visible, physically sensible, neither tiny nor extreme.
//!
//! The ranges were fixed from the physics (flow times 20–150 ms, friction of order 1) before any
//! diagnosis was run on these plants.

use rand::RngExt;
use rand_chacha::ChaCha8Rng;

use super::SAMPLE_PERIOD_S;
use super::base::{BasePlant, log_uniform};
use super::effect::{Effect, EffectError};

fn signed(rng: &mut ChaCha8Rng, low: f64, high: f64) -> f64 {
    let size = rng.random_range(low..high);
    if rng.random_bool(0.5) { size } else { -size }
}

impl Effect {
    /// The effect `name` with random parameters that suit the rig `base`.
    ///
    /// # Errors
    /// [`EffectError::UnknownEffect`] when the catalogue has no such name.
    pub fn draw(name: &str, base: &BasePlant, rng: &mut ChaCha8Rng) -> Result<Self, EffectError> {
        let slow = base.attach_s.max(base.separate_s);
        let fast = base.attach_s.min(base.separate_s);
        Ok(match name {
            "state-dependent-delay" => {
                let delay_rise = rng.random_range(10.0..20.0);
                Self::StateDependentDelay {
                    delay_floor: rng.random_range(20.0..40.0),
                    delay_rise,
                    delay_rate: rng.random_range(2.0..10.0_f64.min(200.0 / delay_rise)),
                }
            }
            "edge-dependent-delay" => loop {
                let rise_delay = rng.random_range(0.020..0.060);
                let fall_delay = rng.random_range(0.020..0.060);
                let difference: f64 = rise_delay - fall_delay;
                if difference.abs() > 0.008 {
                    break Self::EdgeDependentDelay {
                        rise_delay,
                        fall_delay,
                    };
                }
            },
            "valve-lag" => Self::ValveLag {
                opening_time: log_uniform(rng, 0.005, 0.025),
                closing_time: log_uniform(rng, 0.008, 0.050),
            },
            "plenum-droop" => {
                let recovery_time = log_uniform(rng, 0.3, 2.5);
                // Pressure lost under steady blowing.
                let lost = rng.random_range(0.15..0.40);
                Self::PlenumDroop {
                    recovery_time,
                    depletion_rate: lost / ((1.0 - lost) * recovery_time),
                }
            }
            "free-stream-variation" => Self::FreeStreamVariation {
                gain: signed(rng, 1.0, 3.0),
            },
            "echo-path" => Self::EchoPath {
                gain: signed(rng, 0.15, 0.45),
                echo_delay: log_uniform(rng, 0.060, 0.350),
            },
            "starting-vortex" => Self::StartingVortex {
                gain: rng.random_range(0.4..1.0),
                decay_time: log_uniform(rng, 0.020, 0.080),
            },
            "stopping-vortex" => Self::StoppingVortex {
                gain: rng.random_range(0.4..1.0),
                decay_time: log_uniform(rng, 0.020, 0.080),
            },
            "attachment-hysteresis" => {
                let lower_threshold = rng.random_range(0.25..0.40) * base.gain;
                Self::AttachmentHysteresis {
                    upper_threshold: rng.random_range(0.55..0.75) * base.gain,
                    lower_threshold,
                    // Without a jet the lock must let go: gain below the lower threshold.
                    gain: rng.random_range(0.5..0.75) * lower_threshold,
                }
            }
            "amplitude-saturation" => Self::AmplitudeSaturation {
                cubic: rng.random_range(0.2..0.8),
            },
            "vortex-shedding" => Self::VortexShedding {
                frequency: log_uniform(rng, 5.0, 30.0),
                damping_ratio: rng.random_range(0.06..0.25),
                gain: rng.random_range(0.12..0.30),
            },
            "hot-film-nonlinearity" => Self::HotFilmNonlinearity {
                king_ratio: log_uniform(rng, 0.4, 4.0),
                king_offset: log_uniform(rng, 0.02, 0.2),
            },
            "hot-film-lag" => Self::HotFilmLag {
                time_constant: log_uniform(rng, 0.010, 0.100),
            },
            "thermal-drift" => Self::ThermalDrift {
                amplitude: signed(rng, 0.08, 0.25),
                time_constant: log_uniform(rng, 1.0, 6.0),
            },
            "sensor-saturation" => Self::SensorSaturation {
                lower_limit: rng.random_range(0.04..0.12),
                upper_limit: rng.random_range(0.65..0.85) * base.gain,
            },
            "electrical-pickup" => Self::ElectricalPickup {
                gain: signed(rng, 0.06, 0.25),
            },
            "dry-friction" => Self::DryFriction {
                // It sticks this far from the equilibrium of the slower motion.
                level: rng.random_range(0.10..0.25) * SAMPLE_PERIOD_S / slow,
            },
            "quadratic-drag" => Self::QuadraticDrag {
                // Resistance against the fastest motion, relative to the flow's own.
                coefficient: rng.random_range(0.5..1.5) * fast / SAMPLE_PERIOD_S,
            },
            "rectifying-sensor" => Self::RectifyingSensor {},
            "input-nonlinearity" => loop {
                let quadratic = signed(rng, 0.20, 0.50);
                let cubic = signed(rng, 0.08, 0.25);
                // A valve opened further never blows less.
                let steepness = |v: f64| 1.0 + v * (2.0 * quadratic + 3.0 * v * cubic);
                if steepness(0.5).min(steepness(1.0)) > 0.15 {
                    break Self::InputNonlinearity { quadratic, cubic };
                }
            },
            "bouc-wen-hysteresis" => Self::BoucWenHysteresis {
                stiffness: 1.0,
                beta: rng.random_range(2.0..6.0),
                gamma: rng.random_range(0.0..2.0),
                alpha: rng.random_range(0.5..1.2),
            },
            _ => return Err(EffectError::UnknownEffect(name.to_owned())),
        })
    }

    /// Whether `other` acts on the same part of the rig so that the two exclude each other.
    pub fn excludes(&self, other: &Self) -> bool {
        let about_delay = |e: &Self| {
            matches!(
                e,
                Self::StateDependentDelay { .. } | Self::EdgeDependentDelay { .. }
            )
        };
        self.name() == other.name() || (about_delay(self) && about_delay(other))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::plant::Fault;
    use rand::SeedableRng;

    #[test]
    fn every_draw_is_valid_and_repeats() {
        for name in Effect::NAMES {
            for seed in 0..200 {
                let mut rng = ChaCha8Rng::seed_from_u64(seed);
                let base = BasePlant::draw(&mut rng);
                let effect = Effect::draw(name, &base, &mut rng.clone()).unwrap();
                assert_eq!(effect.name(), *name);
                effect.validate().unwrap();
                assert_eq!(effect, Effect::draw(name, &base, &mut rng).unwrap());
            }
        }
        for name in Fault::NAMES {
            let fault = Fault::draw(name, &mut ChaCha8Rng::seed_from_u64(1)).unwrap();
            assert_eq!(fault.name(), *name);
        }
    }
}
