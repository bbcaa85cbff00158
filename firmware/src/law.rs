//! Interface of a control law with its model.

use core::fmt;
use model_core::average::MovingAverage;
use model_core::control::golden::GoldenLaw;
use model_core::history::Memory;
use model_core::model::StateOf;
use model_core::{Input, Parts, step};
use wire::reply::Settings;

/// The action of a law at a sample.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Action {
    /// Requested valve position.
    pub open: bool,
    /// Predicted reading of the model at this sample.
    pub predicted: f32,
    /// Reading minus `predicted`.
    pub residual: f32,
}

/// A change of the settings of a running law.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Change {
    /// The target, y of the flow.
    Target(f32),
    /// The air budget, in 1/1000 of the time.
    Air(u16),
}

/// Why a change was not made.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Unchanged {
    /// Outside its bounds.
    Outside,
    /// The preceding change is not complete.
    Pending,
    /// The law does not have this setting.
    NoSetting,
    /// No law is running.
    NotRunning,
}

/// A law with its model. Called once per sample, armed or not, so that the model knows all issued commands.
pub trait Law {
    /// Decides from the reading y and the measured channels; the valve follows the returned position.
    fn act(&mut self, y: f32, channels: &[f32]) -> Action;
    /// Records a sample at which the valve is at `open`, whatever the law would have decided.
    fn follow(&mut self, open: bool, y: f32, channels: &[f32]) -> Action;
    /// y*, the law's reference; NaN for a law without a reference.
    fn reference(&self) -> f32;
    /// The settings that may be changed.
    fn settings(&self) -> Settings;
    /// Changes a setting of the running law.
    ///
    /// # Errors
    /// [`Unchanged`]; the settings stay as they were.
    fn change(&mut self, change: Change) -> Result<(), Unchanged>;
    /// Returns to the settings of the design.
    fn restore(&mut self);
}

/// The parameters of a law for model `M`, memories `Y` and `J`, and a look-ahead of `A` samples, such as
/// `LAW` in a generated file.
#[diagnostic::on_unimplemented(
    message = "a board cannot run `{Self}` as a law",
    note = "a model gets a law from `host-fit design`"
)]
pub trait Designed<M: Parts<f32>, Y: Memory<f32>, J: Memory<f32>, const A: usize>: Clone {
    /// State of the law.
    type State;

    /// The initial state, with the model at `model`.
    fn start(&self, model: &StateOf<f32, M, Y, J>) -> Self::State;

    /// The valve position. `alone` is the free-running model, which knows the commands issued while the law
    /// was idle.
    fn act(
        &self,
        state: &mut Self::State,
        model: &M,
        alone: &StateOf<f32, M, Y, J>,
        y: f32,
        channels: &[f32],
    ) -> bool;

    /// Records a sample at which the law does not control the valve.
    fn idle(&self, state: &mut Self::State);

    /// y* at this sample; NaN for a law without a reference.
    fn reference(&self, state: &Self::State) -> f32;

    /// The settings that may be changed.
    fn settings(&self) -> Settings {
        Settings::NONE
    }

    /// Changes a setting.
    ///
    /// # Errors
    /// [`Unchanged`]; the settings stay as they were.
    fn change(&mut self, _state: &mut Self::State, _change: Change) -> Result<(), Unchanged> {
        Err(Unchanged::NoSetting)
    }

    /// Whether the law reproduces its reference run.
    fn holds(
        &self,
        golden: &GoldenLaw,
        model: &M,
        state: StateOf<f32, M, Y, J>,
        channels: &[f32],
    ) -> bool;
}

/// Filter of the reading for the comparison with the model's output.
pub trait Smoothing {
    /// Takes a reading and returns the value to compare.
    fn smooth(&mut self, y: f32) -> f32;
}

/// The reading's moving average, for averaged models, eq. (12); with `W` = 1 the
/// reading itself.
impl<const W: usize> Smoothing for MovingAverage<f32, W> {
    #[inline]
    fn smooth(&mut self, y: f32) -> f32 {
        if W > 1 { self.push(y) } else { y }
    }
}

/// A law with its model, and a second, free-running model.
#[derive(Clone)]
pub struct Driven<D, M, Y, J, S, const A: usize>
where
    D: Designed<M, Y, J, A>,
    M: Parts<f32>,
    Y: Memory<f32>,
    J: Memory<f32>,
{
    design: D,
    /// The law with the settings in use.
    running: D,
    state: D::State,
    model: M,
    /// The free-running model. The law's own model may follow a faulty sensor.
    alone: StateOf<f32, M, Y, J>,
    smoothing: S,
}

/// The type of law `$law` with the model of a generated file.
macro_rules! driven {
    ($law:ty, $($model:tt)+) => {
        $crate::law::Driven<
            $law,
            $($model)+::Identified,
            $($model)+::Outputs,
            $($model)+::Jets,
            ::model_core::average::MovingAverage<f32, { $($model)+::READINGS }>,
            { $($model)+::LOOK_AHEAD },
        >
    };
}
pub(crate) use driven;

impl<D, M, Y, J, S, const A: usize> Driven<D, M, Y, J, S, A>
where
    D: Designed<M, Y, J, A>,
    M: Parts<f32>,
    Y: Memory<f32>,
    J: Memory<f32>,
    S: Smoothing,
{
    /// The law with the valve closed and the model in the state `at_rest`.
    pub fn new(design: D, model: M, at_rest: StateOf<f32, M, Y, J>, smoothing: S) -> Self {
        Self {
            state: design.start(&at_rest),
            running: design.clone(),
            design,
            model,
            alone: at_rest,
            smoothing,
        }
    }

    /// Prediction of the free-running model for a sample, and the deviation of `y` from it.
    #[inline]
    fn issue(&mut self, open: bool, y: f32, channels: &[f32]) -> Action {
        let input = Input {
            command: if open { 1.0 } else { 0.0 },
            channels,
        };
        let predicted = step(&self.model, &mut self.alone, &input).measured;
        Action {
            open,
            predicted,
            residual: self.smoothing.smooth(y) - predicted,
        }
    }
}

impl<D, M, Y, J, S, const A: usize> Law for Driven<D, M, Y, J, S, A>
where
    D: Designed<M, Y, J, A>,
    M: Parts<f32>,
    Y: Memory<f32>,
    J: Memory<f32>,
    S: Smoothing,
{
    #[inline]
    fn act(&mut self, y: f32, channels: &[f32]) -> Action {
        let open = self
            .running
            .act(&mut self.state, &self.model, &self.alone, y, channels);
        self.issue(open, y, channels)
    }

    #[inline]
    fn follow(&mut self, open: bool, y: f32, channels: &[f32]) -> Action {
        self.running.idle(&mut self.state);
        self.issue(open, y, channels)
    }

    fn reference(&self) -> f32 {
        self.running.reference(&self.state)
    }

    fn settings(&self) -> Settings {
        self.running.settings()
    }

    #[inline(never)]
    fn change(&mut self, change: Change) -> Result<(), Unchanged> {
        self.running.change(&mut self.state, change)
    }

    fn restore(&mut self) {
        self.running = self.design.clone();
    }
}

impl<D, M, Y, J, S, const A: usize> fmt::Debug for Driven<D, M, Y, J, S, A>
where
    D: Designed<M, Y, J, A> + fmt::Debug,
    M: Parts<f32>,
    Y: Memory<f32>,
    J: Memory<f32>,
{
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Driven")
            .field("design", &self.design)
            .finish_non_exhaustive()
    }
}
