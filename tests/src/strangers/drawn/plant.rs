//! Linear plants in continuous time: lags in series behind a dead time, perhaps with a resonance or an integrator, with
//! ten steps per sample.

use super::normal;
use rand_chacha::ChaCha8Rng;

/// Steps per sample.
const STEPS: usize = 10;

/// Dynamics after the lags in series.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Last {
    Nothing,
    /// ẍ = ω²·(d − x) − 2·ζ·ω·ẋ, ω = 2π/period.
    Resonance {
        period: f64,
        damping: f64,
    },
    /// ẋ = (d − ½)/100: a tank with a constant outflow.
    Integrator,
}

/// A dead time and lags in series; times in samples.
#[derive(Clone, Debug)]
pub(super) struct Plant {
    pub(super) lags: Vec<f64>,
    pub(super) last: Last,
    pub(super) dead_time: f64,
    pub(super) gain: f64,
    /// y at rest without command.
    pub(super) level: f64,
    /// The command before the first sample, long enough to be at rest.
    pub(super) before: f64,
}

/// The state of a running plant.
struct Running<'a> {
    plant: &'a Plant,
    states: Vec<f64>,
    /// x and ẋ of the dynamics after the lags.
    last: [f64; 2],
    /// Commands of the steps within the dead time, oldest first.
    under_way: std::collections::VecDeque<f64>,
}

impl<'a> Running<'a> {
    fn new(plant: &'a Plant) -> Self {
        let steps = (plant.dead_time * STEPS as f64).round() as usize;
        Self {
            plant,
            states: vec![plant.before; plant.lags.len()],
            last: match plant.last {
                Last::Integrator => [0.0; 2],
                Last::Nothing | Last::Resonance { .. } => [plant.before, 0.0],
            },
            under_way: std::iter::repeat_n(plant.before, steps).collect(),
        }
    }

    fn y(&self) -> f64 {
        self.plant.level + self.plant.gain * self.last[0]
    }

    /// A sample with this command.
    fn step(&mut self, u: f64) {
        for _ in 0..STEPS {
            self.under_way.push_back(u);
            let mut drive = self.under_way.pop_front().unwrap_or(u);
            for (state, lag) in self.states.iter_mut().zip(&self.plant.lags) {
                *state += (drive - *state) * -(-1.0 / (STEPS as f64 * lag)).exp_m1();
                drive = *state;
            }
            let step = 1.0 / STEPS as f64;
            let [x, rate] = &mut self.last;
            match self.plant.last {
                Last::Nothing => *x = drive,
                Last::Resonance { period, damping } => {
                    let omega = std::f64::consts::TAU / period;
                    *rate += step * omega * (omega * (drive - *x) - 2.0 * damping * *rate);
                    *x += step * *rate;
                }
                Last::Integrator => *x += step * (drive - 0.5) / 100.0,
            }
        }
    }
}

impl Plant {
    /// y without noise, sampled before the command of the sample acts.
    pub(super) fn answer(&self, u: &[f64]) -> Vec<f64> {
        let mut running = Running::new(self);
        let sample = |u: &f64| {
            let y = running.y();
            running.step(*u);
            y
        };
        u.iter().map(sample).collect()
    }

    /// Command and y of `n` samples under a thermostat. It reads y with white noise of standard deviation `noise`
    /// and switches at half of the gain plus and minus `hysteresis` (in units of the gain).
    pub(super) fn thermostat(
        &self,
        n: usize,
        hysteresis: f64,
        noise: f64,
        rng: &mut ChaCha8Rng,
    ) -> (Vec<f64>, Vec<f64>) {
        let mut running = Running::new(self);
        let mut on = 0.0;
        let sample = |_| {
            let y = running.y() + noise * normal(rng);
            let beside = (y - self.level) / self.gain - 0.5;
            if beside.abs() > hysteresis {
                on = f64::from(u8::from(beside < 0.0));
            }
            running.step(on);
            (on, y)
        };
        (0..n).map(sample).unzip()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::SeedableRng;

    fn plant() -> Plant {
        Plant {
            lags: vec![20.0],
            last: Last::Nothing,
            dead_time: 7.5,
            gain: -3.0,
            level: 10.0,
            before: 0.0,
        }
    }

    /// y = y₀ + K (1 − exp(−(t − L)/T)) behind a step at t = 0.
    #[test]
    fn a_step_is_answered_after_the_dead_time_with_the_lag() {
        let y = plant().answer(&[1.0; 100]);
        for (sample, y) in y.into_iter().enumerate() {
            let since = (sample as f64 - 7.5).max(0.0);
            let known = 10.0 - 3.0 * -(-since / 20.0).exp_m1();
            assert!((y - known).abs() < 1e-9, "{sample}: {y}, {known}");
        }
    }

    /// The overshoot is exp(−π·ζ/√(1 − ζ²)); an integrator moves by (1 − ½)/100 a sample.
    #[test]
    fn a_resonance_overshoots_and_an_integrator_does_not_end() {
        let last = Last::Resonance {
            period: 60.0,
            damping: 0.3,
        };
        let rings = Plant {
            last,
            lags: Vec::new(),
            ..plant()
        };
        let most = rings
            .answer(&[1.0; 400])
            .into_iter()
            .fold(f64::INFINITY, f64::min);
        assert!((most - (10.0 - 3.0 * 1.372)).abs() < 0.05, "{most}");
        let tank = Plant {
            last: Last::Integrator,
            ..plant()
        };
        let y = tank.answer(&[1.0; 400]);
        assert!(
            (y[399] - y[299] + 1.5).abs() < 1e-6,
            "{} {}",
            y[299],
            y[399]
        );
    }

    #[test]
    fn it_rests_under_the_command_before() {
        let at_rest = Plant {
            before: 1.0,
            lags: vec![20.0, 5.0, 5.0],
            ..plant()
        };
        assert!(
            (at_rest.answer(&[1.0; 50]).iter()).all(|y| (y - 7.0).abs() < 1e-12),
            "the command has not changed"
        );
        assert!((at_rest.answer(&[0.0; 900])[899] - 10.0).abs() < 1e-9);
    }

    #[test]
    fn a_thermostat_holds_half_of_the_gain() {
        let mut rng = ChaCha8Rng::seed_from_u64(1);
        let (u, y) = plant().thermostat(2000, 0.05, 0.0, &mut rng);
        let mean = y[1000..].iter().sum::<f64>() / 1000.0;
        assert!((mean - 8.5).abs() < 0.3, "{mean}");
        let switched = u.windows(2).filter(|pair| pair[0] != pair[1]).count();
        assert!(switched > 10, "{switched}");
    }
}
