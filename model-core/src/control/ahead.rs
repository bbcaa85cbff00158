//! Look-ahead: runs the model from the present without copying its history.

use crate::history::{Memory, Past};
use crate::model::{Clamps, Input, Output, Parts, State, StateOf, observe_delay};
use crate::real::Real;
use crate::recursion::{Bilinear, Known};

/// Lags of at least this length read only the past during a look-ahead; their terms are summed once.
const NEAR: usize = 64;

/// A signal's past with up to `A` predicted samples in front.
#[derive(Debug)]
pub struct Ahead<'a, T, P, const A: usize> {
    past: &'a P,
    ahead: &'a mut [T; A],
    newest: T,
    filled: usize,
}

impl<T: Real, P: Past<T>, const A: usize> Ahead<'_, T, P, A> {
    /// Appends a predicted sample; ignored if the memory is full.
    #[inline(always)]
    fn push(&mut self, value: T) {
        if let Some(slot) = self.ahead.get_mut(self.filled) {
            *slot = value;
            self.newest = value;
            self.filled += 1;
        }
    }
}

impl<T: Real, P: Past<T>, const A: usize> Past<T> for Ahead<'_, T, P, A> {
    #[inline(always)]
    fn back(&self, lag: usize) -> T {
        // For a constant lag the compiler removes all but one of these branches.
        if lag == 0 {
            self.newest
        } else if lag >= A || lag >= self.filled {
            self.past.back(lag.wrapping_sub(self.filled))
        } else {
            let index = self.filled.wrapping_sub(1 + lag);
            self.ahead.get(index).copied().unwrap_or(T::ZERO)
        }
    }
}

/// Cache for the look-ahead: for each of the next 64 samples, the sum of the terms with longer lags,
/// which read only the past. One sum is recomputed per sample.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Foreknown<T> {
    terms: [Known<T>; NEAR],
    /// Index of the present sample's sums.
    present: usize,
    complete: bool,
}

impl<T: Real> Foreknown<T> {
    /// An empty cache.
    #[must_use]
    pub const fn new() -> Self {
        Self {
            terms: [Known::NOTHING; NEAR],
            present: 0,
            complete: false,
        }
    }

    /// Fills the cache at the first sample; returns whether this is the first sample.
    pub(crate) fn begin(&mut self, recursion: &Bilinear<'_, T>, outputs: &impl Past<T>) -> bool {
        let begins = !self.complete;
        if begins {
            self.advance(recursion, outputs);
        }
        begins
    }

    /// Advances to a new present sample, whose past is `outputs`.
    #[inline(always)]
    fn advance(&mut self, recursion: &Bilinear<'_, T>, outputs: &impl Past<T>) {
        self.present = (self.present + 1) % NEAR;
        let from = if self.complete { NEAR - 1 } else { 0 };
        for ahead in from..NEAR {
            if let Some(slot) = self.terms.get_mut((self.present + ahead) % NEAR) {
                *slot = recursion.known(outputs, NEAR, ahead);
            }
        }
        self.complete = true;
    }
}

impl<T: Real> Default for Foreknown<T> {
    fn default() -> Self {
        Self::new()
    }
}

/// Runs `model` from `state` under `input` until `enough` returns true, for at most as many samples as there
/// is `room`.
///
/// `enough` receives each predicted sample: its number from 0, the predicted flow (without sensor effects, which
/// may cost more than the rest), and whether an input issued now has arrived. `foreknown` belongs to `state` and
/// must be advanced by this function at every sample. The prediction equals that of [`step`](crate::step) up to the
/// last digits. It costs at most one model step per predicted sample; only the past of the jets is copied.
#[inline(always)]
pub fn run<T, M, Y, J, const A: usize>(
    model: &M,
    state: &StateOf<T, M, Y, J>,
    foreknown: &mut Foreknown<T>,
    room: &mut [T; A],
    input: &Input<'_, T>,
    mut enough: impl FnMut(usize, &Output<T>, bool) -> bool,
) where
    T: Real,
    M: Parts<T>,
    Y: Memory<T>,
    J: Memory<T>,
{
    let recursion = model.recursion();
    foreknown.advance(&recursion, &state.outputs);
    let mut ahead: StateOf<T, M, Ahead<'_, T, Y, A>, J> = State {
        outputs: Ahead {
            past: &state.outputs,
            ahead: room,
            newest: state.outputs.back(0),
            filled: 0,
        },
        jets: state.jets.clone(),
        clamps: Clamps::default(),
        average: state.average,
        delay: state.delay.clone(),
        effects: state.effects.clone(),
    };
    let terms = model.averaging().window.saturating_sub(1).max(1) as usize;
    let mut arrived = false;
    for i in 0..A {
        let known = match foreknown.terms.get((foreknown.present + i) % NEAR) {
            Some(known) if i < NEAR => *known,
            _ => recursion.known(&ahead.outputs, NEAR, 0),
        };
        // i + 1 inputs have been issued ahead; a delay of up to i samples reads one of them.
        let within = if arrived { 0 } else { i };
        let known = (&known, NEAR);
        let (output, delay) =
            observe_delay::<false, _, _, _, _>(model, &mut ahead, input, within, known);
        arrived |= delay <= i;
        let leaving = ahead.outputs.back(terms);
        ahead.average.lean(output.flow, leaving);
        ahead.outputs.push(output.next);
        if enough(i, &output, arrived) {
            break;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::delay::ScaledDelay;
    use crate::effect::{Physics, Setting};
    use crate::effects::{PlenumDroop, StateDependentDelay, ValveLag};
    use crate::model::{Averaging, Params, matrix, step, vector};
    use crate::recursion::{Grading, LagConvention};

    /// Covers effects with memory, a varying delay, lags on both sides of the cache, and predictions beyond it.
    #[test]
    fn it_foresees_what_the_model_does() {
        let setting = Setting {
            period: 0.001,
            channel: 0,
            reference: 1.0,
        };
        let model = Params::<f64, 2, 1, 1, _, _> {
            convention: LagConvention::OneStep,
            averaging: Averaging {
                window: 50,
                averaged_model: false,
            },
            grading: Grading::Interpolated,
            constant: 0.0,
            state_lags: [1, 80],
            a: vector([0.97, 0.01]),
            product_lags: [70],
            b: vector([0.03]),
            c: matrix([[-0.01]]),
            delay: ScaledDelay::<_, _, true> {
                law: StateDependentDelay {
                    floor: 20.0,
                    rise: 15.0,
                    rate: 5.0,
                },
                factors: [1.0],
            },
            effects: (
                ValveLag::new(&[0.004, 0.008], &setting),
                PlenumDroop::new(&[0.5, 1.0], &setting),
            ),
        };
        let mut state = model.graded_state::<90, 40>();
        let (mut foreknown, mut room) = (Foreknown::new(), [0.0; 100]);
        for k in 0..700_u32 {
            let input = Input {
                command: f64::from(u8::from(k / 90 % 2 == 0)),
                channels: &[],
            };
            let other = Input {
                command: 1.0 - input.command,
                channels: &[],
            };
            let mut copy = state;
            run(
                &model,
                &state,
                &mut foreknown,
                &mut room,
                &other,
                |i, output, _| {
                    let stepped = step(&model, &mut copy, &other);
                    assert!((stepped.next - output.next).abs() < 1e-12, "{k} {i}");
                    i + 1 == k as usize % 100
                },
            );
            step(&model, &mut state, &input);
            assert!(state.outputs.back(0).is_finite());
        }
    }
}
