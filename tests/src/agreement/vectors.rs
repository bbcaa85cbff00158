//! Test vectors: commands, channels and readings, with the host's results.

use closed_loop::AHEAD;
use host_fit::model::{Law, Model, Rounding, Start};
use host_fit::simulate::{Signals, Simulator};
use model_core::Real;
use model_core::control::Pulses;
use model_core::control::pulses::Played;
use model_core::self_test::command;
use std::ops::ControlFlow;

/// Length of a free run, samples.
const SAMPLES: usize = 2400;
/// Length of a run of the law, samples.
const LAW_SAMPLES: usize = 320;

/// Inputs, all representable in single precision.
#[derive(Clone, Debug)]
pub struct Vectors {
    /// Commands in the unit of the model's records: on and off, then of part strength.
    pub u: Vec<f64>,
    /// A row for each sample.
    pub channels: Vec<Vec<f64>>,
    /// Command and reading before the run that does not start at rest.
    pub before: [f64; 2],
    /// Readings for the law; NaN for a missing one.
    pub readings: Vec<f64>,
}

fn single(x: f64) -> f64 {
    f64::from(x as f32)
}

impl Vectors {
    /// Inputs for `model`.
    #[must_use]
    pub fn of(model: &Model) -> Self {
        let footprint = model.memory();
        let levels = [0.0, 1.0, 0.25, 0.75, -0.25, 0.5, 0.0, 1.25];
        let share = |k: usize| {
            if k < 2 * SAMPLES / 3 {
                f64::from(u8::from(command(k as u32)))
            } else {
                levels[k / 70 % levels.len()]
            }
        };
        let row = |k: usize| -> Vec<f64> {
            let swing = |reference: f64| single(reference * (1.0 + 0.1 * (0.01 * k as f64).sin()));
            footprint
                .channels
                .iter()
                .map(|c| swing(c.reference))
                .collect()
        };
        let mut vectors = Self {
            u: (0..SAMPLES)
                .map(|k| single(model.command.command(share(k))))
                .collect(),
            channels: (0..SAMPLES).map(row).collect(),
            before: [single(model.command.command(1.0)), single(0.3)],
            readings: Vec::new(),
        };
        vectors.readings = vectors.law::<f64>(model).2;
        vectors
    }

    /// The readings of a free run from rest, or after [`before`](Self::before).
    #[must_use]
    pub fn run<T: Real>(&self, model: &Model, held: bool) -> Vec<f64> {
        let mut model = model.clone();
        model.start = Start::Rest;
        let columns: Vec<Vec<f64>> = (0..self.channels[0].len())
            .map(|c| self.channels.iter().map(|row| row[c]).collect())
            .collect();
        let mut signals = Signals::commanded(&model, &self.u);
        signals.channels = columns.iter().map(Vec::as_slice).collect();
        if held {
            signals.u_before = Some(model.command.share(self.before[0]));
            signals.y_before = Some(self.before[1]);
        }
        let values: Vec<T> = model.values().into_iter().map(T::from_f64).collect();
        let simulator = Simulator::with_values(&model, &values, Rounding::Samples);
        let mut y = Vec::with_capacity(self.u.len());
        simulator.run(&signals, |_, output| {
            y.push(output.measured.value());
            ControlFlow::Continue(())
        });
        y
    }

    /// The decisions, estimates and readings of the law. The readings are the law's own estimate
    /// with disturbances, or the given readings.
    #[must_use]
    pub fn law<T: Real>(&self, model: &Model) -> (Vec<bool>, Vec<f64>, Vec<f64>) {
        match &model.law {
            None => Default::default(),
            Some(Law::Maximise(law)) => {
                let pulses = Pulses {
                    train: law.train(),
                    hold: law.hold,
                };
                let mut played = Played::new();
                let on: Vec<bool> = (0..LAW_SAMPLES).map(|_| pulses.step(&mut played)).collect();
                (on, vec![0.0; LAW_SAMPLES], vec![f64::NAN; LAW_SAMPLES])
            }
            Some(Law::Track(track)) => {
                let (law, prepared, memory) =
                    (track.tracking::<T>(), model.prepare::<T>(), model.memory());
                let mut state = law.start::<_, AHEAD>(memory.at_rest(&prepared));
                let channels = memory.references::<T>();
                let (mut on, mut estimates, mut given) = (Vec::new(), Vec::new(), Vec::new());
                let mut estimate = 0.0;
                for k in 0..LAW_SAMPLES {
                    let push = if command(k as u32) { 0.125 } else { -0.125 };
                    let own = if k / 32 % 8 == 7 {
                        f64::NAN
                    } else {
                        single(estimate + push * track.residual_limit)
                    };
                    let reading = self.readings.get(k).copied().unwrap_or(own);
                    let measured = Some(T::from_f64(reading)).filter(|_| reading.is_finite());
                    let decision = law.step(&prepared, &mut state, measured, &channels);
                    estimate = decision.estimate.value();
                    on.push(decision.on);
                    estimates.push(estimate);
                    given.push(reading);
                }
                (on, estimates, given)
            }
        }
    }
}
