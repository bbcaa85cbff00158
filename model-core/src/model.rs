//! The whole model: command in, sensor reading out, one sample at a time.

use crate::average::WindowSum;
use crate::delay::DelayLaw;
use crate::effect::{Effect, Flow, Instant};
use crate::history::{BitHistory, DelayLine, Memory, Past};
use crate::real::Real;
use crate::recursion::{Bilinear, Grading, Known, LagConvention};
use nalgebra::{ArrayStorage, SMatrix, SVector};

/// How outputs and inputs are averaged.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Averaging {
    /// W, samples, at least 2; [`WINDOW`](crate::average::WINDOW) in the paper.
    pub window: u32,
    /// Full model, eq. (4): the delay depends on ỹ of eq. (1), the input is u. Averaged model, eq. (15): the delay
    /// depends on y itself (already an average), the input is the mean of u over W samples, eq. (13).
    pub averaged_model: bool,
}

/// The constant part of a model, as the result of an identification.
///
/// Implemented by [`Params`] with sizes known at compile time and by the host with sizes known at run time;
/// [`step`] is the same function for both.
pub trait Parts<T: Real> {
    /// The delay law.
    type Delay: DelayLaw<T>;
    /// The effects, in physical order.
    type Effects: Effect<T>;
    /// Structure and coefficients.
    fn recursion(&self) -> Bilinear<'_, T>;
    /// The delay law.
    fn delay(&self) -> &Self::Delay;
    /// The effects.
    fn effects(&self) -> &Self::Effects;
    /// How signals are averaged.
    fn averaging(&self) -> Averaging;

    /// State at rest for an on/off command: `NY` outputs (more than the longest lag, and at least the
    /// averaging window), 32·`WORDS` commands.
    fn on_off_state<const NY: usize, const WORDS: usize>(&self) -> OnOffState<T, NY, WORDS, Self>
    where
        Self: Sized,
    {
        State::at_rest(self, DelayLine::new(), BitHistory::new())
    }

    /// State at rest for jets of any strength: `NY` outputs, `NJ` jet strengths.
    fn graded_state<const NY: usize, const NJ: usize>(&self) -> GradedState<T, NY, NJ, Self>
    where
        Self: Sized,
    {
        State::at_rest(self, DelayLine::new(), DelayLine::new())
    }
}

/// A coefficient vector, for generated constants.
#[must_use]
pub const fn vector<T, const N: usize>(values: [T; N]) -> SVector<T, N> {
    SVector::from_array_storage(ArrayStorage([values]))
}

/// A coefficient matrix from its columns, for generated constants.
#[must_use]
pub const fn matrix<T, const R: usize, const C: usize>(columns: [[T; R]; C]) -> SMatrix<T, R, C> {
    SMatrix::from_array_storage(ArrayStorage(columns))
}

/// A model with N1 state delays, N2 product delays and N3 inputs.
#[derive(Clone, Copy, Debug)]
pub struct Params<T: Real, const N1: usize, const N2: usize, const N3: usize, D, E> {
    /// Meaning of the lags.
    pub convention: LagConvention,
    /// Averages.
    pub averaging: Averaging,
    /// The response to jets of part strength.
    pub grading: Grading,
    /// d.
    pub constant: T,
    /// τ_i, samples.
    pub state_lags: [u16; N1],
    /// a_i.
    pub a: SVector<T, N1>,
    /// τ̄_j, samples.
    pub product_lags: [u16; N2],
    /// b_l.
    pub b: SVector<T, N3>,
    /// c_jl.
    pub c: SMatrix<T, N2, N3>,
    /// The delay law.
    pub delay: D,
    /// The effects; `()` for none, pairs for several.
    pub effects: E,
}

impl<T: Real, const N1: usize, const N2: usize, const N3: usize, D, E> Parts<T>
    for Params<T, N1, N2, N3, D, E>
where
    D: DelayLaw<T>,
    E: Effect<T>,
{
    type Delay = D;
    type Effects = E;
    #[inline]
    fn recursion(&self) -> Bilinear<'_, T> {
        Bilinear {
            convention: self.convention,
            grading: self.grading,
            constant: self.constant,
            state_lags: &self.state_lags,
            a: self.a.as_slice(),
            product_lags: &self.product_lags,
            b: self.b.as_slice(),
            c: self.c.as_slice(),
            pace: None,
        }
    }
    #[inline]
    fn delay(&self) -> &D {
        &self.delay
    }
    #[inline]
    fn effects(&self) -> &E {
        &self.effects
    }
    #[inline]
    fn averaging(&self) -> Averaging {
        self.averaging
    }
}

/// Numbers of evaluations at which a state-dependent delay had to be clamped (saturating).
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Clamps {
    /// The averaged output was below 0 and was replaced by 0.
    pub below_zero: u32,
    /// The delay exceeded the input memory and was limited to it.
    pub beyond_memory: u32,
}

/// State of a model. `Y` holds the output, `J` the jets.
#[derive(Clone, Copy, Debug)]
pub struct State<T, Y, J, D, E> {
    /// Past outputs of the flow; the newest is s_k.
    pub outputs: Y,
    /// Past jet strengths, before the delay.
    pub jets: J,
    /// Counts of clamped delays.
    pub clamps: Clamps,
    pub(crate) average: WindowSum<T>,
    pub(crate) delay: D,
    pub(crate) effects: E,
}

/// The state that model `M` needs, in memories `Y` and `J`.
pub type StateOf<T, M, Y, J> = State<
    T,
    Y,
    J,
    <<M as Parts<T>>::Delay as DelayLaw<T>>::State,
    <<M as Parts<T>>::Effects as Effect<T>>::State,
>;

/// State on the board of a model driven by an on/off command.
pub type OnOffState<T, const NY: usize, const WORDS: usize, M> =
    StateOf<T, M, DelayLine<T, NY>, BitHistory<WORDS>>;

/// State on the board of a model whose jets take any strength.
pub type GradedState<T, const NY: usize, const NJ: usize, M> =
    StateOf<T, M, DelayLine<T, NY>, DelayLine<T, NJ>>;

impl<T, Y, J, D, E> State<T, Y, J, D, E>
where
    T: Real,
    Y: Memory<T>,
    J: Memory<T>,
{
    /// The state of `model` at rest, with the given empty memories.
    pub fn at_rest<M>(model: &M, outputs: Y, jets: J) -> Self
    where
        M: Parts<T>,
        M::Delay: DelayLaw<T, State = D>,
        M::Effects: Effect<T, State = E>,
    {
        Self {
            outputs,
            jets,
            clamps: Clamps::default(),
            average: WindowSum::new(),
            delay: model.delay().start(),
            effects: model.effects().start(),
        }
    }

    /// Stores `flow` as the newest output s_{k+1}: the prediction of [`step`], or a measurement.
    #[inline(always)]
    pub fn advance(&mut self, flow: T, window: u32) {
        let terms = window.saturating_sub(1).max(1);
        let entering = self.outputs.back(0);
        let leaving = self.outputs.back(terms as usize);
        self.average.slide(entering, leaving, terms);
        self.outputs.push(flow);
    }
}

/// Inputs of a model at a sample.
#[derive(Clone, Copy, Debug)]
pub struct Input<'a, T> {
    /// The command u_k: 0 or 1 for on/off blowers.
    pub command: T,
    /// Measured channels that effects need.
    pub channels: &'a [T],
}

/// Outputs of a model at a sample.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Output<T> {
    /// Sensor reading at this sample, y_k.
    pub measured: T,
    /// Flow at this sample, s_k; equals `measured` without sensor effects.
    pub flow: T,
    /// Flow at the next sample, s_{k+1}.
    pub next: T,
    /// Jet strength that arrives now (through the first input delay).
    pub arrived: T,
}

/// Computes sample k without advancing: effects and input memory take the sample, the flow's output does not
/// advance.
///
/// Call [`State::advance`] afterwards, with `next` for a free run or with a measurement for one-step
/// prediction.
#[inline(always)]
pub fn observe<T, M, Y, J>(
    model: &M,
    state: &mut StateOf<T, M, Y, J>,
    input: &Input<'_, T>,
) -> Output<T>
where
    T: Real,
    M: Parts<T>,
    Y: Memory<T>,
    J: Memory<T>,
{
    observe_delay::<true, _, _, _, _>(model, state, input, 0, (&Known::NOTHING, usize::MAX)).0
}

/// [`observe`], and the shortest input delay. A delay longer than `within` may be reported too short: if the
/// command has been constant over the whole range of delays, the law is not evaluated. `known` are
/// precomputed terms of the recursion, with the smallest lag that they cover. If `SENSED` is false the sensor
/// is not evaluated, and the flow is returned as the reading.
#[inline(always)]
pub(crate) fn observe_delay<const SENSED: bool, T, M, Y, J>(
    model: &M,
    state: &mut StateOf<T, M, Y, J>,
    input: &Input<'_, T>,
    within: usize,
    (known, horizon): (&Known<T>, usize),
) -> (Output<T>, usize)
where
    T: Real,
    M: Parts<T>,
    Y: Past<T>,
    J: Memory<T>,
{
    let (law, effects, averaging) = (model.delay(), model.effects(), model.averaging());
    let flow = state.outputs.back(0);
    let mut at = Instant {
        command: input.command,
        flow,
        arrived: T::ZERO,
        present: T::ZERO,
        channels: input.channels,
    };
    let command = law.command(&mut state.delay, input.command);
    let jet = effects.jet(&mut state.effects, command, &at);
    state.jets.push(jet);

    let mut arriving = Arriving {
        law,
        jets: &state.jets,
        averaging,
        flow,
        average: &state.average,
        within,
        evaluated: None,
        nearest: usize::MAX,
        below_zero: false,
        beyond: false,
    };

    (at.arrived, at.present) = arriving.jet(0);
    let measured = if SENSED {
        effects.sense(&mut state.effects, flow, &at)
    } else {
        flow
    };
    let recursion = model.recursion();
    let first = at.arrived;
    let strength = |l: usize| if l == 0 { first } else { arriving.jet(l).0 };
    let mut next = recursion.next_from(known, horizon, &state.outputs, strength);
    if effects.drives() {
        let relaxation = recursion.rate(first);
        let separated = recursion.separated(first, relaxation);
        let free = || recursion.next_from(known, horizon, &state.outputs, |_| T::ZERO) - flow;
        let flow = Flow {
            now: flow,
            before: state.outputs.back(1),
            next,
            relaxation,
            separated,
            released: recursion.released(next - flow, separated, first, &free),
        };
        next = next + effects.drive(&mut state.effects, &flow, &at);
    }
    let nearest = arriving.nearest;
    let (below_zero, beyond) = (arriving.below_zero, arriving.beyond);
    if below_zero {
        state.clamps.below_zero = state.clamps.below_zero.saturating_add(1);
    }
    if beyond {
        state.clamps.beyond_memory = state.clamps.beyond_memory.saturating_add(1);
    }
    let output = Output {
        measured,
        flow,
        next,
        arrived: at.arrived,
    };
    (output, nearest)
}

/// Jets that arrive at the flow through the input delays.
struct Arriving<'a, T, L, J> {
    law: &'a L,
    jets: &'a J,
    averaging: Averaging,
    flow: T,
    average: &'a WindowSum<T>,
    /// Delays above this need not be exact.
    within: usize,
    /// The value of the delay law, once evaluated.
    evaluated: Option<T>,
    /// The shortest delay so far.
    nearest: usize,
    /// Whether the law was evaluated at a negative output.
    below_zero: bool,
    /// Whether a delay exceeded the memory.
    beyond: bool,
}

impl<T: Real, L: DelayLaw<T>, J: Memory<T>> Arriving<'_, T, L, J> {
    /// The drive of the flow until the next sample through input delay `l`, and the jet present now. If the tap lies
    /// between samples, the newer jet arrives within the interval.
    #[inline(always)]
    fn jet(&mut self, l: usize) -> (T, T) {
        let kept = self.jets.capacity();
        let farthest = kept.saturating_sub(1 + usize::from(L::INTERPOLATES));
        if !self.averaging.averaged_model
            && let Some((shortest, longest)) = self.law.range(l)
            && shortest > self.within
            && longest <= farthest
            && let Some(level) = self.jets.steady(shortest, longest)
        {
            self.nearest = self.nearest.min(shortest);
            return (level, level);
        }
        let evaluated = match self.evaluated {
            Some(evaluated) => evaluated,
            None => self.evaluate(),
        };
        let tap = self.law.tap(l, evaluated);
        self.beyond |= tap.whole > farthest;
        let whole = tap.whole.min(farthest);
        self.nearest = self.nearest.min(whole);
        let newer = self.read(whole);
        // Skipped only if value and derivatives are exactly zero: a whole-sample delay that is being fitted
        // has a derivative.
        if L::INTERPOLATES && tap.fraction != T::ZERO {
            let older = self.read(whole + 1);
            (newer + tap.fraction * (older - newer), older)
        } else {
            (newer, newer)
        }
    }

    /// Evaluates the delay law at ỹ_k of eq. (1): the W − 1 outputs before y_k, divided by W; for an averaged
    /// model at the output itself.
    #[inline(always)]
    fn evaluate(&mut self) -> T {
        let follows = if self.averaging.averaged_model {
            self.flow
        } else {
            self.average.value() / T::from_count(self.averaging.window)
        };
        self.below_zero = follows < T::ZERO;
        let evaluated = self.law.evaluate(follows.at_least(T::ZERO));
        self.evaluated = Some(evaluated);
        evaluated
    }

    #[inline(always)]
    fn read(&self, lag: usize) -> T {
        if self.averaging.averaged_model {
            self.jets.mean_back(lag, self.averaging.window)
        } else {
            self.jets.back(lag)
        }
    }
}

/// One sample of a free run: computes sample k and advances to k + 1.
#[inline]
pub fn step<T, M, Y, J>(
    model: &M,
    state: &mut StateOf<T, M, Y, J>,
    input: &Input<'_, T>,
) -> Output<T>
where
    T: Real,
    M: Parts<T>,
    Y: Memory<T>,
    J: Memory<T>,
{
    let output = observe(model, state, input);
    state.advance(output.next, model.averaging().window);
    output
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::delay::{FixedDelay, ScaledDelay};
    use crate::effect::{Physics, Setting};
    use crate::effects::{HotFilmLag, StateDependentDelay, ValveLag};
    use crate::paper::table_two;

    fn step_response<T: Real>(convention: LagConvention, samples: usize) -> T {
        let model = table_two::<T>(convention);
        let mut state = model.on_off_state::<512, 4>();
        let mut y = T::ZERO;
        let input = Input {
            command: T::ONE,
            channels: &[],
        };
        for _ in 0..=samples {
            y = step(&model, &mut state, &input).measured;
        }
        y
    }

    /// Step responses of the printed coefficients, computed independently
    /// (theory 2.2): .11 .23 .54 .79 .99 literal, .15 .27 .62 .84 1.02 one-step.
    #[test]
    fn the_papers_model_rises_as_printed() {
        let literal = [
            (100, 0.11),
            (200, 0.23),
            (500, 0.54),
            (1000, 0.79),
            (2000, 0.99),
        ];
        for (k, expected) in literal {
            let y = step_response::<f64>(LagConvention::Literal, k);
            assert!((y - expected).abs() < 0.006, "literal {k}: {y}");
        }
        let one_step = [
            (100, 0.15),
            (200, 0.27),
            (500, 0.62),
            (1000, 0.84),
            (2000, 1.02),
        ];
        for (k, expected) in one_step {
            let y = step_response::<f64>(LagConvention::OneStep, k);
            assert!((y - expected).abs() < 0.006, "one-step {k}: {y}");
        }
    }

    #[test]
    fn single_precision_follows_double() {
        let single = step_response::<f32>(LagConvention::OneStep, 5000);
        let double = step_response::<f64>(LagConvention::OneStep, 5000);
        assert!((f64::from(single) - double).abs() < 2e-4);
    }

    /// A first-order flow with a fixed delay, compared with its closed form.
    #[test]
    fn the_recursion_starts_at_zero_and_waits_for_the_delay() {
        let model = Params::<f64, 1, 1, 1, _, ()> {
            convention: LagConvention::OneStep,
            averaging: Averaging {
                window: 2,
                averaged_model: false,
            },
            grading: Grading::Proportional,
            constant: 0.0,
            state_lags: [1],
            a: SVector::from([0.5]),
            product_lags: [1],
            b: SVector::from([1.0]),
            c: SMatrix::from([[-0.25]]),
            delay: FixedDelay { delays: [2] },
            effects: (),
        };
        let mut state = model.on_off_state::<4, 1>();
        let mut run = [0.0; 6];
        for y in &mut run {
            let input = Input {
                command: 1.0,
                channels: &[],
            };
            *y = step(&model, &mut state, &input).measured;
        }
        assert_eq!(run, [0.0, 0.0, 0.0, 1.0, 1.25, 1.3125]);
    }

    #[test]
    fn effects_compose_around_the_recursion() {
        let setting = Setting {
            period: 0.001,
            channel: 0,
            reference: 1.0,
        };
        let bare = table_two::<f64>(LagConvention::OneStep);
        let model = Params {
            convention: bare.convention,
            averaging: bare.averaging,
            grading: bare.grading,
            constant: bare.constant,
            state_lags: bare.state_lags,
            a: bare.a,
            product_lags: bare.product_lags,
            b: bare.b,
            c: bare.c,
            delay: bare.delay,
            effects: (
                ValveLag::new(&[0.010, 0.020], &setting),
                (HotFilmLag::new(&[0.050], &setting), ()),
            ),
        };
        let mut state = model.graded_state::<512, 128>();
        let input = Input {
            command: 1.0,
            channels: &[],
        };
        let mut last = step(&model, &mut state, &input);
        for _ in 0..60 {
            last = step(&model, &mut state, &input);
        }
        // After 61 samples the first jet has just arrived. It was issued when the valve was starting to open.
        assert!(last.arrived > 0.0 && last.arrived < 0.2);
        for _ in 0..200 {
            last = step(&model, &mut state, &input);
        }
        // The valve is open by then; the film lags a rising friction by 50 ms.
        assert!((last.arrived - 1.0).abs() < 1e-6);
        let trailing = (last.flow - last.measured) / (last.next - last.flow);
        assert!((40.0..80.0).contains(&trailing), "{trailing} samples");
    }

    #[test]
    fn clamping_is_counted() {
        let model = Params {
            delay: ScaledDelay {
                law: StateDependentDelay {
                    floor: 100.0,
                    rise: 100.0,
                    rate: 20.0,
                },
                factors: [1.0],
            },
            ..table_two::<f64>(LagConvention::OneStep)
        };
        let mut state = model.on_off_state::<512, 4>();
        state.advance(-0.5, 250);
        state.advance(0.0, 250);
        let input = Input {
            command: 0.0,
            channels: &[],
        };
        observe(&model, &mut state, &input);
        assert_eq!(state.clamps.below_zero, 1);
        assert_eq!(state.clamps.beyond_memory, 1);
    }
}
