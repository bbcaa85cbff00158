//! Constants of an identified model. Generated; edit the model file instead.
//!
//! - tool: host-fit 0.2.0
//! - structure: full model, N1 = 1, N2 = 1, N3 = 1, window 20 samples, one-step lags (lag 1 is y_k)
//! - command: 2.0 is no jet, 7.0 a full one; in Rust the model's input is `share(command)`
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
pub const WINDOW: u32 = 20;
/// Number of readings whose mean is compared with the model.
pub const READINGS: usize = 1;
/// Stored outputs: more than the longest lag, at least the averaging window.
pub const OUTPUTS: usize = 20;
/// Stored jet strengths: more than the longest input delay.
pub const JETS: usize = 15;
/// Measured channels that the effects need, in the order in which they are passed.
pub const CHANNELS: [&str; 0] = [];
/// Usual values of the channels, in their units.
pub const REFERENCES: [f32; 0] = [];
/// The command in the unit of the records as a fraction of a full jet: 2.0 is no jet, 7.0 a full jet.
///
/// `Identified` and its state take this fraction, not the command.
#[must_use]
pub fn share(command: f32) -> f32 {
    ((f64::from(command) - 2f64) / 5f64) as f32
}
/// Past outputs.
pub type Outputs = model_core::history::DelayLine<f32, OUTPUTS>;
/// Past jet strengths.
pub type Jets = model_core::history::BitHistory<{ JETS.div_ceil(32) }>;

/// The delay law.
pub type Delay = model_core::delay::FixedDelay<[u16; 1]>;
/// The effects, in physical order.
pub type Effects = ();
/// Structure, coefficients and delay law: N1, N2, N3 as identified.
pub type Base = Params<f32, 1, 1, 1, Delay, ()>;
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
pub const STATE_LAGS: [u16; 1] = [1];
/// a_i.
pub const A: [f32; 1] = [0.98];
/// τ̄_j, samples.
pub const PRODUCT_LAGS: [u16; 1] = [1];
/// b_l.
pub const B: [f32; 1] = [0.03];
/// c_j1.
pub const C1: [f32; 1] = [-0.01];
/// h_l, samples.
pub const DELAYS: [u16; 1] = [12];

/// Longest time from a command to its first arrival at the flow, samples.
pub const FIRST_ARRIVAL: usize = checks::shortest(&DELAYS);
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
        JETS >= DELAYS[0] as usize + READINGS,
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
pub const CHECKSUM: u32 = 0x4a51_5937;
/// Outputs of the model in the reference run, bit for bit as computed on the host.
pub const GOLDEN: Golden<32> = Golden {
    every: 32,
    expected: [
        0x3ee0_f75f, 0x3f49_d99e, 0x3f6b_91a5, 0x3f78_4a94, 0x3f7d_176f, 0x3f7e_e71c,
        0x3f7f_960b, 0x3f7f_d808, 0x3f2e_52f9, 0x3eb6_a6a7, 0x3e3f_602b, 0x3dc8_8464,
        0x3d52_185c, 0x3cdc_2179, 0x3ee6_e5d4, 0x3f4a_f816, 0x3f6b_fdbb, 0x3f78_735b,
        0x3f7d_26d4, 0x3f7e_ece5, 0x3f2d_e72a, 0x3eb6_35b5, 0x3e3e_e9d4, 0x3dc8_085f,
        0x3ef6_86a8, 0x3f4d_eada, 0x3f6d_1a80, 0x3f78_decd, 0x3f2b_2074, 0x3eb3_4d0e,
        0x3f17_2235, 0x3f58_6ee7,
    ],
};

/// Longest prediction horizon of the law, samples.
pub const LOOK_AHEAD: usize = 1;
/// The kind of law: none was designed.
pub type Law = ();
/// No law was designed.
pub const LAW: Law = ();
/// Decisions of the law in its reference run, bit for bit as computed on the host.
pub const LAW_GOLDEN: GoldenLaw = GoldenLaw {
    samples: 4096,
    expected: 0x0000_0000,
};
