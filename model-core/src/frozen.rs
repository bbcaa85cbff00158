//! Models whose constants are part of the code.
//!
//! A step reads some twenty lags and as many coefficients. If these are known at compile time, lags become offsets
//! and coefficients immediates. The step then needs a third of the instructions of a step that looks them up.

use crate::effect::Effect;
use crate::model::{Averaging, Parts};
use crate::real::Real;
use crate::recursion::Bilinear;
use core::marker::PhantomData;

/// A type for the constants of a model; generated files contain one.
pub trait Constants<T: Real> {
    /// Structure, coefficients and delay law; its effects are not used.
    type Base: Parts<T> + 'static;
    /// Values of the structure, the coefficients and the delay law.
    const BASE: &'static Self::Base;
}

/// The model with the constants `C` and the effects `E`; without effects it has no size.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Frozen<C, E = ()> {
    constants: PhantomData<C>,
    /// The effects.
    pub effects: E,
}

impl<C, E> Frozen<C, E> {
    /// The model with its `effects` prepared.
    #[must_use]
    pub const fn new(effects: E) -> Self {
        Self {
            constants: PhantomData,
            effects,
        }
    }
}

impl<T: Real, C: Constants<T>, E: Effect<T>> Parts<T> for Frozen<C, E> {
    type Delay = <C::Base as Parts<T>>::Delay;
    type Effects = E;
    #[inline(always)]
    fn recursion(&self) -> Bilinear<'_, T> {
        C::BASE.recursion()
    }
    #[inline(always)]
    fn delay(&self) -> &Self::Delay {
        C::BASE.delay()
    }
    #[inline(always)]
    fn effects(&self) -> &E {
        &self.effects
    }
    #[inline(always)]
    fn averaging(&self) -> Averaging {
        C::BASE.averaging()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::delay::FixedDelay;
    use crate::effect::{Physics, Setting};
    use crate::effects::AmplitudeSaturation;
    use crate::model::{Input, Params, matrix, step, vector};
    use crate::recursion::{Grading, LagConvention};
    use crate::self_test::checksum;

    type Base = Params<f32, 2, 1, 1, FixedDelay<[u16; 1]>, ()>;
    const BASE: Base = Params {
        convention: LagConvention::OneStep,
        grading: Grading::Proportional,
        averaging: Averaging {
            window: 3,
            averaged_model: false,
        },
        constant: 0.01,
        state_lags: [1, 4],
        a: vector([0.875, 0.0625]),
        product_lags: [2],
        b: vector([0.25]),
        c: matrix([[-0.125]]),
        delay: FixedDelay { delays: [5] },
        effects: (),
    };
    struct Mine;
    impl Constants<f32> for Mine {
        type Base = Base;
        const BASE: &'static Base = &BASE;
    }

    #[test]
    fn a_frozen_model_is_the_model_bit_for_bit() {
        assert_eq!(size_of::<Frozen<Mine>>(), 0);
        assert_eq!(checksum(&Frozen::<Mine>::new(())), checksum(&BASE));
        let setting = Setting {
            period: 0.001,
            channel: 0,
            reference: 1.0,
        };
        let effect = AmplitudeSaturation::new(&[0.01], &setting);
        let frozen = Frozen::<Mine, _>::new(effect);
        let params = Params {
            convention: BASE.convention,
            grading: BASE.grading,
            averaging: BASE.averaging,
            constant: BASE.constant,
            state_lags: BASE.state_lags,
            a: BASE.a,
            product_lags: BASE.product_lags,
            b: BASE.b,
            c: BASE.c,
            delay: BASE.delay,
            effects: effect,
        };
        let mut states = (frozen.on_off_state::<8, 1>(), params.on_off_state::<8, 1>());
        for k in 0..500_u32 {
            let input = Input {
                command: if k / 20 % 2 == 0 { 1.0 } else { 0.0 },
                channels: &[],
            };
            let found = step(&frozen, &mut states.0, &input);
            assert_eq!(found, step(&params, &mut states.1, &input));
        }
    }
}
