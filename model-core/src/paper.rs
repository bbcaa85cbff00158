//! The model with state-dependent delays of Table II of the paper, for tests.

use crate::delay::ScaledDelay;
use crate::effects::StateDependentDelay;
use crate::model::{Averaging, Params};
use crate::real::Real;
use crate::recursion::{Grading, LagConvention};
use nalgebra::{SMatrix, SVector};

type TableTwo<T> = Params<T, 5, 10, 1, ScaledDelay<StateDependentDelay<T>, [T; 1], true>, ()>;

pub(crate) fn table_two<T: Real>(convention: LagConvention) -> TableTwo<T> {
    let number = T::from_f64;
    Params {
        convention,
        averaging: Averaging {
            window: 250,
            averaged_model: false,
        },
        grading: Grading::Proportional,
        constant: T::ZERO,
        state_lags: [1, 44, 123, 479, 496],
        a: SVector::from([0.9759, 0.0141, 0.0025, -0.0042, 0.0055].map(number)),
        product_lags: [1, 73, 242, 264, 299, 335, 414, 477, 494, 500],
        b: SVector::from([number(0.0080)]),
        c: SMatrix::from([[
            -0.0228, 0.0138, 0.0621, -0.0286, -0.0186, -0.0121, -0.0035, -0.0056, 0.0189, -0.0049,
        ]
        .map(number)]),
        delay: ScaledDelay {
            law: StateDependentDelay {
                floor: number(47.35),
                rise: number(12.69),
                rate: number(20.18),
            },
            factors: [T::ONE],
        },
        effects: (),
    }
}
