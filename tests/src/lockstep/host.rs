//! The host's side of a lockstep run: the firmware's loop around the model file.

use closed_loop::AHEAD;
use firmware::cases::{RELAY, armed, settings, step};
use firmware::controller::Controller;
use firmware::law::{Designed, Driven, Smoothing};
use host_fit::model::{Law, Model, Prepared};
use host_fit::ring::Ring;
use host_fit::simulate::HostState;
use model_core::average::WindowSum;
use model_core::control::Pulses;
use model_core::history::{Memory as _, Past as _, Reaching as _};

/// One sample of a loop: prediction and decision, from the counts of sensor and
/// measured channel.
type Step = Box<dyn FnMut(u16, u16) -> (f32, bool)>;

/// The readings' moving average, window chosen at run time.
struct Mean {
    window: u32,
    past: Ring<f32>,
    sum: WindowSum<f32>,
}

impl Smoothing for Mean {
    fn smooth(&mut self, y: f32) -> f32 {
        if self.window <= 1 {
            return y;
        }
        let leaving = self.past.back(self.window as usize - 1);
        self.past.push(y);
        self.sum.slide(y, leaving, self.window);
        self.sum.value() / self.window as f32
    }
}

/// The board's loop with `model` itself in place of its constants.
#[must_use]
pub fn steps(model: &Model) -> Step {
    match &model.law {
        None => around(model, RELAY),
        Some(Law::Track(law)) => around(model, law.tracking::<f32>()),
        Some(Law::Maximise(law)) => around(
            model,
            Pulses {
                train: law.train(),
                hold: law.hold,
            },
        ),
    }
}

fn around<D>(model: &Model, design: D) -> Step
where
    D: Designed<Prepared<f32>, Ring<f32>, Ring<f32>, AHEAD> + 'static,
{
    let memory = model.memory();
    let prepared = model.prepare::<f32>();
    let at_rest: HostState<f32> = memory.at_rest(&prepared);
    let window = if model.averaging.averaged_model {
        model.averaging.window
    } else {
        1
    };
    let mean = Mean {
        window,
        past: Ring::reaching(window as usize),
        sum: WindowSum::new(),
    };
    let law: Driven<D, _, _, _, _, AHEAD> = Driven::new(design, prepared, at_rest, mean);
    let references: Vec<f32> = memory.references();
    let mut controller: Controller<_> =
        armed(settings(&references, model.sample_period_s as f32), law);
    Box::new(move |counts, channel| step(&mut controller, counts, channel))
}
