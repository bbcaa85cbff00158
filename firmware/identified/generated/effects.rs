//! Constants of an identified model. Generated; edit the model file instead.
//!
//! - tool: host-fit 0.2.0
//! - structure: full model, N1 = 5, N2 = 10, N3 = 1, window 250 samples, one-step lags (lag 1 is y_k)
//! - effects: valve-lag, state-dependent-delay, amplitude-saturation, hot-film-nonlinearity
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
pub type Jets = model_core::history::DelayLine<f32, JETS>;

/// valve-lag.
pub type Effect1 = model_core::effects::valve_lag::ValveLag<f32>;
/// amplitude-saturation.
pub type Effect2 = model_core::effects::amplitude_saturation::AmplitudeSaturation<f32>;
/// hot-film-nonlinearity.
pub type Effect3 = model_core::effects::hot_film_nonlinearity::HotFilmNonlinearity<f32>;
/// The delay law.
pub type Delay = model_core::delay::ScaledDelay<
    model_core::effects::state_dependent_delay::StateDependentDelay<f32>,
    [f32; 1],
    true,
>;
/// The effects, in physical order.
pub type Effects = (Effect1, (Effect2, (Effect3, ())));
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
/// valve-lag: opening_time (s), closing_time (s).
pub const EFFECT1: [f32; 2] = [0.004, 0.009];
/// amplitude-saturation: cubic (1/y²).
pub const EFFECT2: [f32; 1] = [0.2];
/// hot-film-nonlinearity: king_ratio (-), king_offset (y).
pub const EFFECT3: [f32; 2] = [1.0, 0.1];

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
const SETTING: model_core::effect::Setting<f32> = model_core::effect::Setting {
    period: SAMPLE_PERIOD_S,
    channel: 0,
    reference: 1.0,
};
fn effects() -> Effects {
    let effect1: Effect1 = model_core::effect::Physics::new(&EFFECT1, &SETTING);
    let effect2: Effect2 = model_core::effect::Physics::new(&EFFECT2, &SETTING);
    let effect3: Effect3 = model_core::effect::Physics::new(&EFFECT3, &SETTING);
    (effect1, (effect2, (effect3, ())))
}
/// The model, its effects prepared for the sample period.
#[must_use]
pub fn model() -> Identified {
    Frozen::new(effects())
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
        0x0000_0000, 0x3cd1_becc, 0x3e90_3a6c, 0x3eb1_02aa, 0x3ecf_bffc, 0x3ee7_53f7,
        0x3ef9_d6a6, 0x3f04_3cee, 0x3f09_ee63, 0x3f09_d586, 0x3ef6_ee92, 0x3ee2_1500,
        0x3ecf_4f31, 0x3ebf_73b6, 0x3eaf_d804, 0x3ee2_d892, 0x3f04_a0f6, 0x3f04_a4a8,
        0x3f05_c6c0, 0x3f06_82db, 0x3f0a_30e5, 0x3f08_0643, 0x3ef7_c23c, 0x3ee6_bdb3,
        0x3ed8_32fe, 0x3f07_0d98, 0x3f15_84b2, 0x3f1a_e778, 0x3f24_882b, 0x3f1d_15e8,
        0x3f0e_3622, 0x3f11_9a6b,
    ],
};

/// Longest prediction horizon of the law, samples.
pub const LOOK_AHEAD: usize = 78;
/// The kind of law: it holds y at its reference.
pub type Law = model_core::control::Tracking<f32>;
/// The law.
pub const LAW: Law = model_core::control::Tracking {
    reference: 0.6,
    reachable: model_core::control::Reachable {
        low: 0.0,
        high: 0.9139403,
    },
    slope: 0.002,
    hold: model_core::control::HoldTimes {
        on: 18,
        off: 15,
    },
    anticipation: model_core::control::HoldTimes {
        on: 13,
        off: 8,
    },
    budget: model_core::control::budget::Budget {
        switches: Some(model_core::control::Switches {
            samples_per_switch: 25,
            saved: 10,
        }),
        air: Some(model_core::control::Air {
            per_mille: 900,
            saved: 1000,
        }),
    },
    lead: 47,
    opening: 2,
    closing: 6,
    observer: 0.0056497175,
    bias_rate: 0.0006382979,
    integral_rate: 0.0008510638,
    play: 0.0,
    settled: 1.0,
    correction_limit: 0.27418208,
    residual_limit: 0.9139403,
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
    expected: 0x109c_5221,
};
