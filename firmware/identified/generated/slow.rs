//! Constants of an identified model. Generated; edit the model file instead.
//!
//! - tool: host-fit 0.2.0
//! - structure: full model, N1 = 5, N2 = 10, N3 = 1, window 250 samples, one-step lags (lag 1 is y_k)
//! - effects: state-dependent-delay
//! - units: y is the normalised friction gain, u is 0 or 1, delays and lags are samples of 0.01 s

use model_core::checks;
use model_core::control::golden::GoldenLaw;
use model_core::frozen::{self, Frozen};
use model_core::model::{Averaging, Params, State, StateOf, matrix, vector};
use model_core::recursion::{Grading, LagConvention};
use model_core::self_test::Golden;

/// Sample period, s.
pub const SAMPLE_PERIOD_S: f32 = 0.01;
/// W, samples.
pub const WINDOW: u32 = 250;
/// Number of readings whose mean is compared with the model.
pub const READINGS: usize = 1;
/// Stored outputs: more than the longest lag, at least the averaging window.
pub const OUTPUTS: usize = 500;
/// Stored jet strengths: more than the longest input delay.
pub const JETS: usize = 63;
/// Measured channels that the effects need, in the order in which they are passed.
pub const CHANNELS: [&str; 0] = [];
/// Usual values of the channels, in their units.
pub const REFERENCES: [f32; 0] = [];
/// The command in the unit of the records as a fraction of a full jet: 0.0 is no jet, 1.0 a full jet.
///
/// `Identified` and its state take this fraction, not the command.
#[must_use]
pub fn share(command: f32) -> f32 {
    command
}
/// Past outputs.
pub type Outputs = model_core::history::DelayLine<f32, OUTPUTS>;
/// Past jet strengths.
pub type Jets = model_core::history::BitHistory<{ JETS.div_ceil(32) }>;

/// The delay law.
pub type Delay = model_core::delay::ScaledDelay<
    model_core::effects::state_dependent_delay::StateDependentDelay<f32>,
    [f32; 1],
    true,
>;
/// The effects, in physical order.
pub type Effects = ();
/// Structure, coefficients and delay law: N1, N2, N3 as identified.
pub type Base = Params<f32, 5, 10, 1, Delay, ()>;
/// The model: its constants are part of the code.
pub type Identified = Frozen<Constants, Effects>;
/// The state of the model.
pub type IdentifiedState = StateOf<f32, Identified, Outputs, Jets>;

/// Convention of the lags.
pub const CONVENTION: LagConvention = LagConvention::OneStep;
/// The response to jets of part strength.
pub const GRADING: Grading = Grading::Proportional;
/// d, the constant drive of the flow without jets.
pub const CONSTANT: f32 = 0.0;
/// τ_i, samples.
pub const STATE_LAGS: [u16; 5] = [1, 44, 123, 479, 496];
/// a_i.
pub const A: [f32; 5] = [0.9759, 0.0141, 0.0025, -0.0042, 0.0055];
/// τ̄_j, samples.
pub const PRODUCT_LAGS: [u16; 10] = [1, 73, 242, 264, 299, 335, 414, 477, 494, 500];
/// b_l.
pub const B: [f32; 1] = [0.008];
/// c_j1.
pub const C1: [f32; 10] = [
    -0.0228,
    0.0138,
    0.0621,
    -0.0286,
    -0.0186,
    -0.0121,
    -0.0035,
    -0.0056,
    0.0189,
    -0.0049,
];
/// state-dependent-delay: delay_floor (samples), delay_rise (samples), delay_rate (1/y).
pub const DELAY_PARAMETERS: [f32; 3] = [47.35, 12.69, 20.18];
/// Shortest and longest delay of the law, samples.
pub const DELAY_RANGE: [f32; 2] = [47.35, 60.04];
/// f_l, the delays of the inputs relative to the law's.
pub const DELAY_FACTORS: [f32; 1] = [1.0];

/// Longest time from a command to its first arrival at the flow, samples.
pub const FIRST_ARRIVAL: usize = (checks::smallest(&DELAY_FACTORS) * DELAY_RANGE[1]
    + 0.5) as usize;
const _: () = {
    assert!(CONSTANT.is_finite(), "the constant is not finite");
    assert!(checks::finite(& A), "a coefficient a is not finite");
    assert!(checks::finite(& B), "a coefficient b is not finite");
    assert!(checks::finite(& C1), "a coefficient c is not finite");
    assert!(
        OUTPUTS >= checks::outputs_for(& STATE_LAGS, CONVENTION),
        "a state lag reaches beyond the stored outputs"
    );
    assert!(
        OUTPUTS >= checks::outputs_for(& PRODUCT_LAGS, CONVENTION),
        "a product lag reaches beyond the stored outputs"
    );
    assert!(
        OUTPUTS >= WINDOW as usize,
        "the averaging window reaches beyond the stored outputs"
    );
    assert!(
        JETS >= (DELAY_FACTORS[0] * DELAY_RANGE[1] + 0.5) as usize + READINGS,
        "an input delay reaches beyond the stored commands"
    );
};

/// Structure, coefficients and delay law.
pub const BASE: Base = Params {
    convention: CONVENTION,
    grading: GRADING,
    averaging: Averaging {
        window: WINDOW,
        averaged_model: false,
    },
    constant: CONSTANT,
    state_lags: STATE_LAGS,
    a: vector(A),
    product_lags: PRODUCT_LAGS,
    b: vector(B),
    c: matrix([C1]),
    delay: model_core::delay::ScaledDelay {
        law: model_core::effects::state_dependent_delay::StateDependentDelay {
            floor: DELAY_PARAMETERS[0],
            rise: DELAY_PARAMETERS[1],
            rate: DELAY_PARAMETERS[2],
        },
        factors: DELAY_FACTORS,
    },
    effects: (),
};
/// Where the model finds its constants.
#[derive(Clone, Copy, Debug)]
pub struct Constants;
impl frozen::Constants<f32> for Constants {
    type Base = Base;
    const BASE: &'static Base = &BASE;
}
/// The model, its effects prepared for the sample period.
#[must_use]
pub fn model() -> Identified {
    Frozen::new(())
}
/// The state at rest.
#[must_use]
pub fn state(model: &Identified) -> IdentifiedState {
    State::at_rest(model, Outputs::new(), Jets::new())
}

/// CRC-32 of structure and coefficients, for the start-up self-test.
pub const CHECKSUM: u32 = 0xbe4d_6d44;
/// Outputs of the model in the reference run, bit for bit as computed on the host.
pub const GOLDEN: Golden<32> = Golden {
    every: 32,
    expected: [
        0x0000_0000, 0x3cbb_8800, 0x3e0e_27ef, 0x3e38_07e6, 0x3e67_4c44, 0x3e86_d7df,
        0x3e97_d88c, 0x3ea6_3a26, 0x3eb2_481d, 0x3ea1_63c2, 0x3e8b_304d, 0x3e74_c13c,
        0x3e59_d994, 0x3e42_c2df, 0x3e2c_fa63, 0x3e89_235a, 0x3ea6_dcea, 0x3e9b_9433,
        0x3ea3_8c9d, 0x3ea7_844e, 0x3eb2_707d, 0x3ea4_167d, 0x3e91_0ac5, 0x3e82_a06c,
        0x3e70_d6ec, 0x3eae_b776, 0x3ec9_5725, 0x3eda_6855, 0x3ef5_b0af, 0x3ed7_e95b,
        0x3ebb_ef9d, 0x3eca_d5c6,
    ],
};

/// Longest prediction horizon of the law, samples.
pub const LOOK_AHEAD: usize = 73;
/// The kind of law: it holds y at its reference.
pub type Law = model_core::control::Tracking<f32>;
/// The law.
pub const LAW: Law = model_core::control::Tracking {
    reference: 0.8,
    reachable: model_core::control::Reachable {
        low: 0.0,
        high: 1.0666124,
    },
    slope: 0.0,
    hold: model_core::control::HoldTimes {
        on: 20,
        off: 20,
    },
    anticipation: model_core::control::HoldTimes {
        on: 20,
        off: 20,
    },
    budget: model_core::control::budget::Budget {
        switches: None,
        air: None,
    },
    lead: 47,
    opening: 0,
    closing: 0,
    observer: 0.0006361676,
    bias_rate: 0.0006382979,
    integral_rate: 0.0008510638,
    play: 0.010718844,
    settled: 1.0,
    correction_limit: 0.31998372,
    residual_limit: 1.0666124,
};
const _: () = {
    assert!(
        checks::law(& LAW),
        "a constant of the law is out of range, or the law's reference is outside the reachable interval"
    );
    assert!(
        LOOK_AHEAD >= checks::look_ahead(& LAW, FIRST_ARRIVAL),
        "the law's prediction horizon is shorter than the sum of dead time, valve delay and anticipation"
    );
};
/// Decisions of the law in its reference run, bit for bit as computed on the host.
pub const LAW_GOLDEN: GoldenLaw = GoldenLaw {
    samples: 4096,
    expected: 0xb032_17f9,
};
