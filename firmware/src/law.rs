//! What decides the valve's position from the reading.

use model_core::average::MovingAverage;
use model_core::history::Memory;
use model_core::model::StateOf;
use model_core::{Input, Parts, step};

/// What a law says at a sample.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Action {
    /// Where it wants the valve.
    pub open: bool,
    /// What the model said the sensor would show at this sample.
    pub predicted: f32,
    /// Reading minus `predicted`.
    pub residual: f32,
}

/// A law with its model. Called once a sample, armed or not, so that the model
/// knows what has been issued.
pub trait Law {
    /// Decides with the reading y; the valve will do what is returned.
    fn act(&mut self, y: f32) -> Action;
    /// Takes note of a sample at which the valve stays shut.
    fn idle(&mut self, y: f32) -> Action;
}

/// What of the reading is compared with the model's output.
pub trait Smoothing {
    /// Takes a reading and gives what to compare.
    fn smooth(&mut self, y: f32) -> f32;
}

/// The reading itself, for full models.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Direct;

impl Smoothing for Direct {
    #[inline]
    fn smooth(&mut self, y: f32) -> f32 {
        y
    }
}

/// Its moving average, for averaged models, eq. (12).
impl<const W: usize> Smoothing for MovingAverage<f32, W> {
    #[inline]
    fn smooth(&mut self, y: f32) -> f32 {
        self.push(y)
    }
}

/// Thresholds and hold times of a [`Relay`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RelaySettings {
    /// Opens below, y.
    pub opens_below: f32,
    /// Shuts above, y.
    pub shuts_above: f32,
    /// Shortest time open, samples.
    pub min_on: u32,
    /// Shortest time shut, samples.
    pub min_off: u32,
}

/// A relay with hysteresis and hold times; the model runs beside it. The plain
/// law, for bringing up a rig.
#[derive(Clone)]
pub struct Relay<M: Parts<f32>, Y, J, S> {
    model: M,
    state: StateOf<f32, M, Y, J>,
    smoothing: S,
    settings: RelaySettings,
    open: bool,
    /// Samples since the last switch, saturating.
    held: u32,
}

impl<M, Y, J, S> Relay<M, Y, J, S>
where
    M: Parts<f32>,
    Y: Memory<f32>,
    J: Memory<f32>,
    S: Smoothing,
{
    /// Shut, with the model in `state`.
    pub fn new(
        model: M,
        state: StateOf<f32, M, Y, J>,
        smoothing: S,
        settings: RelaySettings,
    ) -> Self {
        Self {
            model,
            state,
            smoothing,
            settings,
            open: false,
            held: u32::MAX,
        }
    }

    #[inline]
    fn issue(&mut self, open: bool, y: f32) -> Action {
        self.held = if open == self.open {
            self.held.saturating_add(1)
        } else {
            1
        };
        self.open = open;
        let input = Input {
            command: if open { 1.0 } else { 0.0 },
            channels: &[],
        };
        let predicted = step(&self.model, &mut self.state, &input).measured;
        Action {
            open,
            predicted,
            residual: self.smoothing.smooth(y) - predicted,
        }
    }
}

impl<M, Y, J, S> Law for Relay<M, Y, J, S>
where
    M: Parts<f32>,
    Y: Memory<f32>,
    J: Memory<f32>,
    S: Smoothing,
{
    #[inline]
    fn act(&mut self, y: f32) -> Action {
        let settings = &self.settings;
        let shortest = if self.open {
            settings.min_on
        } else {
            settings.min_off
        };
        let open = if self.held < shortest {
            self.open
        } else if self.open {
            y <= settings.shuts_above
        } else {
            y < settings.opens_below
        };
        self.issue(open, y)
    }

    #[inline]
    fn idle(&mut self, y: f32) -> Action {
        self.issue(false, y)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use identified::full;

    #[test]
    fn hold_times_are_kept_under_any_reading() {
        let settings = RelaySettings {
            opens_below: 0.45,
            shuts_above: 0.55,
            min_on: 15,
            min_off: 10,
        };
        let model = full::model();
        let mut relay = Relay::new(model, full::state(&model), Direct, settings);
        let mut seed = 7_u32;
        let (mut open, mut held, mut switches) = (false, u32::MAX, 0);
        for _ in 0..20_000 {
            seed = seed.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            let action = relay.act((seed >> 8) as f32 / (1 << 24) as f32);
            if action.open == open {
                held = held.saturating_add(1);
            } else {
                assert!(held >= if open { 15 } else { 10 }, "{held}");
                (open, held, switches) = (action.open, 1, switches + 1);
            }
        }
        assert!(switches > 500);
    }
}
