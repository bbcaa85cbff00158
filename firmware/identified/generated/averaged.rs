//! Constants of an identified model. Generated; edit the model file instead.
//!
//! - tool: host-fit 0.2.0
//! - structure: averaged model, N1 = 2, N2 = 2, N3 = 2, window 250 samples, one-step lags (lag 1 is y_k)
//! - units: y is the normalised friction gain, u is 0 or 1, delays and lags are samples of 0.001 s

use model_core::checks;
use model_core::control::golden::GoldenLaw;
use model_core::frozen::{self, Frozen};
use model_core::model::{Averaging, Params, State, StateOf, matrix, vector};
use model_core::recursion::{Grading, LagConvention};
use model_core::self_test::Golden;

/// Sample period, s.
pub const SAMPLE_PERIOD_S: f32 = 0.001;
/// W, samples.
pub const WINDOW: u32 = 250;
/// Number of readings whose mean is compared with the model.
pub const READINGS: usize = WINDOW as usize;
/// Stored outputs: more than the longest lag, at least the averaging window.
pub const OUTPUTS: usize = 307;
/// Stored jet strengths: more than the longest input delay.
pub const JETS: usize = 670;
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
pub type Delay = model_core::delay::FixedDelay<[u16; 2]>;
/// The effects, in physical order.
pub type Effects = ();
/// Structure, coefficients and delay law: N1, N2, N3 as identified.
pub type Base = Params<f32, 2, 2, 2, Delay, ()>;
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
pub const STATE_LAGS: [u16; 2] = [1, 269];
/// a_i.
pub const A: [f32; 2] = [1.0027, -0.0027];
/// τ̄_j, samples.
pub const PRODUCT_LAGS: [u16; 2] = [1, 307];
/// b_l.
pub const B: [f32; 2] = [0.0009, 0.003];
/// c_j1.
pub const C1: [f32; 2] = [-0.0008, 0.0045];
/// c_j2.
pub const C2: [f32; 2] = [-0.0085, 0.001];
/// h_l, samples.
pub const DELAYS: [u16; 2] = [49, 417];

/// Longest time from a command to its first arrival at the flow, samples.
pub const FIRST_ARRIVAL: usize = checks::shortest(&DELAYS);
const _: () = {
    assert!(CONSTANT.is_finite(), "the constant is not finite");
    assert!(checks::finite(& A), "a coefficient a is not finite");
    assert!(checks::finite(& B), "a coefficient b is not finite");
    assert!(checks::finite(& C1), "a coefficient c is not finite");
    assert!(checks::finite(& C2), "a coefficient c is not finite");
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
        JETS >= DELAYS[0] as usize + READINGS,
        "an input delay reaches beyond the stored commands"
    );
    assert!(
        JETS >= DELAYS[1] as usize + READINGS,
        "an input delay reaches beyond the stored commands"
    );
};

/// Structure, coefficients and delay law.
pub const BASE: Base = Params {
    convention: CONVENTION,
    grading: GRADING,
    averaging: Averaging {
        window: WINDOW,
        averaged_model: true,
    },
    constant: CONSTANT,
    state_lags: STATE_LAGS,
    a: vector(A),
    product_lags: PRODUCT_LAGS,
    b: vector(B),
    c: matrix([C1, C2]),
    delay: model_core::delay::FixedDelay {
        delays: DELAYS,
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
pub const CHECKSUM: u32 = 0x5d67_305e;
/// Outputs of the model in the reference run, bit for bit as computed on the host.
pub const GOLDEN: Golden<32> = Golden {
    every: 32,
    expected: [
        0x0000_0000, 0x39c8_7cdf, 0x3b84_9d7e, 0x3c42_0640, 0x3cc5_1707, 0x3d27_cc0d,
        0x3d80_a0d2, 0x3db7_e48c, 0x3dfa_0c25, 0x3e22_aa21, 0x3e48_1002, 0x3e6c_7026,
        0x3e87_ec20, 0x3e99_a8ba, 0x3eab_3603, 0x3ebb_5b0c, 0x3eca_15e7, 0x3ed7_1c44,
        0x3ee3_7701, 0x3eef_5c45, 0x3efa_de47, 0x3f03_f2ee, 0x3f0b_29cd, 0x3f12_cd5b,
        0x3f19_d927, 0x3f20_9c3e, 0x3f28_f9d1, 0x3f32_9545, 0x3f3c_3cf6, 0x3f44_4192,
        0x3f49_108e, 0x3f4a_9a6b,
    ],
};

/// Longest prediction horizon of the law, samples.
pub const LOOK_AHEAD: usize = 1;
/// The kind of law: pulses, (first sample, length) each, in a period that repeats.
pub type Law = model_core::control::Pulses<[(u32, u32); 1]>;
/// The law.
pub const LAW: Law = model_core::control::Pulses {
    train: model_core::control::PulseTrain {
        period: 555,
        pulses: [(0, 237)],
    },
    hold: model_core::control::HoldTimes {
        on: 10,
        off: 10,
    },
};
const _: () = assert!(
    checks::train(LAW.train.period, & LAW.train.pulses, LAW.hold),
    "a pulse or a gap is shorter than the valve's shortest times"
);
/// Decisions of the law in its reference run, bit for bit as computed on the host.
pub const LAW_GOLDEN: GoldenLaw = GoldenLaw {
    samples: 4096,
    expected: 0x9045_7318,
};
