//! The hot film and its cable: from the friction at the film to a reading, before noise.

use super::effect::Effect;
use super::fault::Fault;

/// In the order of the catalogue: King's law, film lag, drift of the zero, rails, pickup, rectifier.
#[derive(Debug, Clone)]
pub(crate) struct Sensor {
    /// (κ, s0)
    king: Option<(f64, f64)>,
    lag_s: Option<f64>,
    /// (amplitude, time constant)
    drift: Option<(f64, f64)>,
    rails: Option<(f64, f64)>,
    pickup: f64,
    rectifies: bool,
    freeze: Option<(f64, f64)>,
    film_in: f64,
    film_out: f64,
    last_reading: f64,
}

/// Bridge voltage over the film by King's law, E = √(1 + κ·(s + s0)^⅓); reversed flow cools no less
/// than none.
fn bridge_voltage(king_ratio: f64, king_offset: f64, s: f64) -> f64 {
    (1.0 + king_ratio * (s + king_offset).max(0.0).cbrt()).sqrt()
}

impl Sensor {
    pub(crate) fn new(effects: &[Effect], faults: &[Fault]) -> Self {
        let mut sensor = Self {
            king: None,
            lag_s: None,
            drift: None,
            rails: None,
            pickup: 0.0,
            rectifies: false,
            freeze: None,
            film_in: 0.0,
            film_out: 0.0,
            last_reading: 0.0,
        };
        for effect in effects {
            match *effect {
                Effect::HotFilmNonlinearity {
                    king_ratio,
                    king_offset,
                } => sensor.king = Some((king_ratio, king_offset)),
                Effect::HotFilmLag { time_constant } => sensor.lag_s = Some(time_constant),
                Effect::ThermalDrift {
                    amplitude,
                    time_constant,
                } => sensor.drift = Some((amplitude, time_constant)),
                Effect::SensorSaturation {
                    lower_limit,
                    upper_limit,
                } => sensor.rails = Some((lower_limit, upper_limit)),
                Effect::ElectricalPickup { gain } => sensor.pickup = gain,
                Effect::RectifyingSensor {} => sensor.rectifies = true,
                _ => {}
            }
        }
        for fault in faults {
            if let Fault::FreezingSensor { from_s, to_s } = *fault {
                sensor.freeze = Some((from_s, to_s));
            }
        }
        sensor
    }

    fn linearised(&self, s: f64) -> f64 {
        match self.king {
            Some((ratio, offset)) => {
                let zero = bridge_voltage(ratio, offset, 0.0);
                let one = bridge_voltage(ratio, offset, 1.0);
                (bridge_voltage(ratio, offset, s) - zero) / (one - zero)
            }
            None => s,
        }
    }

    /// Lets `dt` pass while what the film feels goes in a straight line to `felt`.
    pub(crate) fn advance(&mut self, dt: f64, felt: f64) {
        let Some(tau) = self.lag_s else {
            self.film_in = felt;
            return;
        };
        let (x0, x1) = (self.film_in, self.linearised(felt));
        // ẏ = (x − y)/τ for a straight x: y = x − slope·τ + (y0 − x0 + slope·τ)·e^(−t/τ).
        let behind = (x1 - x0) / dt * tau;
        self.film_out = x1 - behind + (self.film_out - x0 + behind) * (-dt / tau).exp();
        self.film_in = x1;
    }

    /// What the film feels jumps to `felt`.
    pub(crate) fn jump(&mut self, felt: f64) {
        self.film_in = match self.lag_s {
            Some(_) => self.linearised(felt),
            None => felt,
        };
    }

    /// The reading at `t` while the valve is told `command`.
    pub(crate) fn read(&mut self, t: f64, command: f64) -> f64 {
        if self.freeze.is_some_and(|(from, to)| t >= from && t < to) {
            return self.last_reading;
        }
        let film = match self.lag_s {
            Some(_) => self.film_out,
            None => self.linearised(self.film_in),
        };
        let drift = self
            .drift
            .map_or(0.0, |(a, tau)| a * (1.0 - (-t / tau).exp()));
        let mut y = film + drift;
        if let Some((low, high)) = self.rails {
            y = y.max(low).min(high);
        }
        y += self.pickup * command;
        if self.rectifies {
            y = y.abs();
        }
        self.last_reading = y;
        y
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn with(effect: Effect) -> Sensor {
        Sensor::new(&[effect], &[])
    }

    fn reading(sensor: &mut Sensor, s: f64) -> f64 {
        sensor.advance(5e-5, s);
        sensor.read(0.0, 0.0)
    }

    #[test]
    fn kings_law_keeps_zero_and_one_and_bulges_between() {
        let (ratio, offset) = (2.0, 0.1);
        let mut film = with(Effect::HotFilmNonlinearity {
            king_ratio: ratio,
            king_offset: offset,
        });
        assert!(reading(&mut film, 0.0).abs() < 1e-12);
        assert!((reading(&mut film, 1.0) - 1.0).abs() < 1e-12);
        let e = |s: f64| (1.0 + ratio * (s + offset).powf(1.0 / 3.0)).sqrt();
        let expected = (e(0.4) - e(0.0)) / (e(1.0) - e(0.0));
        assert!((reading(&mut film, 0.4) - expected).abs() < 1e-12);
        assert!(expected > 0.5, "steep where the flow is slow: {expected}");
    }

    #[test]
    fn the_film_lags_by_its_time_constant() {
        let mut film = with(Effect::HotFilmLag {
            time_constant: 0.02,
        });
        film.jump(1.0);
        for _ in 0..400 {
            film.advance(5e-5, 1.0);
        }
        assert!((film.read(0.02, 0.0) - (1.0 - (-1.0_f64).exp())).abs() < 1e-9);
    }

    #[test]
    fn the_zero_creeps_the_rails_hold_the_cable_picks_up_and_the_rectifier_folds() {
        let mut drifting = with(Effect::ThermalDrift {
            amplitude: -0.1,
            time_constant: 2.0,
        });
        assert_eq!(drifting.read(0.0, 1.0), 0.0);
        assert!((drifting.read(2.0, 0.0) + 0.1 * (1.0 - (-1.0_f64).exp())).abs() < 1e-12);

        let mut railed = with(Effect::SensorSaturation {
            lower_limit: 0.1,
            upper_limit: 0.8,
        });
        assert_eq!(reading(&mut railed, 0.0), 0.1);
        assert_eq!(reading(&mut railed, 1.0), 0.8);
        assert_eq!(reading(&mut railed, 0.5), 0.5);

        let mut cable = with(Effect::ElectricalPickup { gain: 0.07 });
        assert_eq!(cable.read(0.0, 1.0), 0.07);
        assert_eq!(cable.read(0.0, 0.0), 0.0);

        let mut folded = with(Effect::RectifyingSensor {});
        assert_eq!(reading(&mut folded, -0.3), 0.3);
    }

    #[test]
    fn a_frozen_sensor_repeats_its_last_reading() {
        let fault = Fault::FreezingSensor {
            from_s: 1.0,
            to_s: 2.0,
        };
        let mut sensor = Sensor::new(&[], &[fault]);
        sensor.advance(0.1, 0.4);
        assert_eq!(sensor.read(0.999, 0.0), 0.4);
        sensor.advance(0.1, 0.9);
        assert_eq!(sensor.read(1.5, 0.0), 0.4);
        assert_eq!(sensor.read(2.0, 0.0), 0.9);
    }
}
