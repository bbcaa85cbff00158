//! Hidden effects in front of and behind a published flow.
//!
//! Their equations are those of the catalogue's cards, implemented independently in continuous time. Sizes
//! are drawn so that each changes the reading by several times the noise.

use super::STEP_S;
use rand::RngExt;
use rand_chacha::ChaCha8Rng;
use std::collections::VecDeque;
use std::f64::consts::E;

/// A hidden effect with its parameters and its state.
#[derive(Clone, Debug)]
pub struct Hidden {
    /// Name of the effect in the catalogue.
    pub name: &'static str,
    /// Parameters as the catalogue's card names them, in SI units.
    pub parameters: Vec<(&'static str, f64)>,
    kind: Kind,
    state: f64,
    before: f64,
    echo: VecDeque<f64>,
}

#[derive(Clone, Copy, Debug, PartialEq)]
enum Kind {
    ValveLag,
    PlenumDroop,
    EchoPath,
    StartingVortex,
    StoppingVortex,
    HotFilmLag,
    HotFilmNonlinearity,
    ThermalDrift,
    ElectricalPickup,
    SensorSaturation,
}

type Range = (&'static str, f64, f64);

const KINDS: [(Kind, &str, &[Range]); 10] = [
    (
        Kind::ValveLag,
        "valve-lag",
        &[
            ("opening_time", 0.008, 0.015),
            ("closing_time", 0.020, 0.040),
        ],
    ),
    (
        Kind::PlenumDroop,
        "plenum-droop",
        &[("recovery_time", 0.5, 1.5), ("depletion_rate", 0.3, 0.8)],
    ),
    (
        Kind::EchoPath,
        "echo-path",
        &[("gain", 0.12, 0.3), ("echo_delay", 0.08, 0.2)],
    ),
    (
        Kind::StartingVortex,
        "starting-vortex",
        &[("gain", 0.5, 1.2), ("decay_time", 0.03, 0.1)],
    ),
    (
        Kind::StoppingVortex,
        "stopping-vortex",
        &[("gain", 0.4, 0.9), ("decay_time", 0.03, 0.1)],
    ),
    (
        Kind::HotFilmLag,
        "hot-film-lag",
        &[("time_constant", 0.015, 0.040)],
    ),
    (
        Kind::HotFilmNonlinearity,
        "hot-film-nonlinearity",
        &[("king_ratio", 1.0, 4.0), ("king_offset", 0.1, 0.3)],
    ),
    (
        Kind::ThermalDrift,
        "thermal-drift",
        &[("amplitude", 0.08, 0.2), ("time_constant", 2.0, 5.0)],
    ),
    (
        Kind::ElectricalPickup,
        "electrical-pickup",
        &[("gain", 0.05, 0.15)],
    ),
    (
        Kind::SensorSaturation,
        "sensor-saturation",
        &[("lower_limit", -0.5, -0.4), ("upper_limit", 0.6, 0.8)],
    ),
];

impl Hidden {
    /// Names of all effects that can be hidden.
    #[must_use]
    pub fn names() -> [&'static str; KINDS.len()] {
        KINDS.map(|(_, name, _)| name)
    }

    /// The effect of that name with random parameters; `None` for an unknown name.
    #[must_use]
    pub fn draw(name: &str, rng: &mut ChaCha8Rng) -> Option<Self> {
        let (kind, name, ranges) = KINDS.into_iter().find(|(_, own, _)| *own == name)?;
        let drawn = ranges.iter();
        let parameters: Vec<(&'static str, f64)> = drawn
            .map(|(name, low, high)| (*name, rng.random_range(*low..*high)))
            .collect();
        let echo = match kind {
            Kind::EchoPath => (parameters[1].1 / STEP_S).round() as usize,
            _ => 0,
        };
        Some(Self {
            name,
            parameters,
            kind,
            state: if kind == Kind::PlenumDroop { 1.0 } else { 0.0 },
            before: 0.0,
            echo: VecDeque::from(vec![0.0; echo]),
        })
    }

    /// The effect in its initial state.
    #[must_use]
    pub fn at_rest(&self) -> Self {
        let mut rested = self.clone();
        rested.state = if self.kind == Kind::PlenumDroop {
            1.0
        } else {
            0.0
        };
        rested.before = 0.0;
        rested.echo.iter_mut().for_each(|jet| *jet = 0.0);
        rested
    }

    fn parameter(&self, index: usize) -> f64 {
        self.parameters.get(index).map_or(0.0, |(_, value)| *value)
    }

    /// Jet strength after the effect, for `jet` before it; advances one step.
    pub fn jet(&mut self, jet: f64) -> f64 {
        let (one, two) = (self.parameter(0), self.parameter(1));
        match self.kind {
            Kind::ValveLag => {
                let time = if jet > self.state { one } else { two };
                self.state += STEP_S / time * (jet - self.state);
                self.state
            }
            Kind::PlenumDroop => {
                self.state += STEP_S * ((1.0 - self.state) / one - two * jet * self.state);
                jet * self.state
            }
            Kind::EchoPath => {
                self.echo.push_back(jet);
                jet + one * self.echo.pop_front().unwrap_or(0.0)
            }
            Kind::StartingVortex | Kind::StoppingVortex => {
                let sign = if self.kind == Kind::StartingVortex {
                    1.0
                } else {
                    -1.0
                };
                let change = (sign * (jet - self.before)).max(0.0);
                self.before = jet;
                self.state += change - STEP_S / two * self.state;
                jet + sign * one * self.state
            }
            _ => jet,
        }
    }

    /// Reading after the effect; advances one step. `command` is the level at the valve, `time_s` the time in
    /// the record.
    pub fn reading(&mut self, reading: f64, command: f64, time_s: f64) -> f64 {
        let (one, two) = (self.parameter(0), self.parameter(1));
        match self.kind {
            Kind::HotFilmLag => {
                self.state += STEP_S / one * (reading - self.state);
                self.state
            }
            Kind::HotFilmNonlinearity => {
                let voltage = |s: f64| (1.0 + one * (s + two).max(0.0).cbrt()).sqrt();
                (voltage(reading) - voltage(0.0)) / (voltage(1.0) - voltage(0.0))
            }
            Kind::ThermalDrift => reading + one * (1.0 - E.powf(-time_s / two)),
            Kind::ElectricalPickup => reading + one * command,
            Kind::SensorSaturation => reading.clamp(one, two),
            _ => reading,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::SeedableRng;

    #[test]
    fn every_effect_changes_a_square_wave_and_none_runs_away() {
        for name in Hidden::names() {
            let mut hidden = Hidden::draw(name, &mut ChaCha8Rng::seed_from_u64(3)).unwrap();
            let (mut changed, mut plain, mut flow) = (0.0_f64, 0.0, 0.0);
            for k in 0..50_000 {
                let u = f64::from(u8::from(k / 2000 % 2 == 1));
                // The flow has a time constant of 20 ms and is run without and with the effect.
                plain += STEP_S / 0.02 * (u - plain);
                flow += STEP_S / 0.02 * (hidden.jet(u) - flow);
                let y = hidden.reading(flow, u, f64::from(k) * STEP_S);
                changed = changed.max((y - plain).abs());
            }
            assert!((0.04..2.5).contains(&changed), "{name}: {changed}");
            let again = hidden.at_rest();
            assert_eq!(again.parameters, hidden.parameters);
        }
        assert!(Hidden::draw("gremlin", &mut ChaCha8Rng::seed_from_u64(3)).is_none());
    }

    #[test]
    fn a_film_lags_by_its_time_constant() {
        let mut film = Hidden::draw("hot-film-lag", &mut ChaCha8Rng::seed_from_u64(1)).unwrap();
        let steps = (film.parameter(0) / STEP_S).round() as usize;
        let y = (0..steps).fold(0.0, |_, _| film.reading(1.0, 0.0, 0.0));
        assert!((y - (1.0 - 1.0 / E)).abs() < 0.01, "{y}");
    }
}
