//! A jet that is weaker after a short rest.

use rand::RngExt;
use rand_chacha::ChaCha8Rng;

use super::pulses::Pulses;
use super::strength::{StrengthLaw, jet};
use super::{Hidden, Port, Truth};
use crate::plant::base::{BasePlant, log_uniform};
use crate::plant::effects::{Card, Limits, Physics};
use crate::plant::part::{Part, Place, Surroundings};

/// Strength 1 − loss·exp(−rest/recovery), rest the pause before the pulse.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ShortRest {
    /// Loss without any rest (-).
    pub loss: f64,
    /// Rest after which 63 % have recovered (s).
    pub recovery: f64,
}

impl Physics for ShortRest {
    const NAME: &'static str = "short-rest";
    const PLACE: Place = Place::Plenum;
    const PARAMETERS: &'static [Card<Self>] = &[
        Card::new("loss", "-", Limits::FINITE, |e| &mut e.loss),
        Card::new("recovery", "s", Limits::TIME, |e| &mut e.recovery),
    ];

    fn draw(_base: &BasePlant, rng: &mut ChaCha8Rng) -> Self {
        Self {
            loss: rng.random_range(0.35..0.65),
            recovery: log_uniform(rng, 0.06, 0.20),
        }
    }

    fn part(&self, _surroundings: &Surroundings<'_>) -> Part {
        jet(*self)
    }
}

impl Hidden for ShortRest {
    fn truth(&self) -> Truth {
        Truth::new(Port::Jet, &["rest before"])
    }
}

impl StrengthLaw for ShortRest {
    fn strength(&self, pulses: &Pulses, _t: f64) -> f64 {
        1.0 - self.loss * (-pulses.rest_before() / self.recovery).exp()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::plant::beyond::strength::bench::strengths;

    #[test]
    fn the_rest_before_decides_for_the_whole_pulse() {
        let law = ShortRest {
            loss: 0.5,
            recovery: 0.1,
        };
        let seen = strengths(law.at_rest(), &[0.1, 0.2, 0.25, 0.9], &[0.15, 0.26, 0.85]);
        let short = 1.0 - 0.5 * (-0.5_f64).exp();
        assert_eq!(seen[0], 1.0);
        assert!((seen[1] - short).abs() < 1e-9 && (seen[2] - short).abs() < 1e-9);
    }
}
