//! Constants of an identified model. Generated; edit the model file instead.
//!
//! - tool: host-fit 0.2.0
//! - structure: full model, N1 = 5, N2 = 10, N3 = 1, window 250 samples, one-step lags (lag 1 is y_k)
//! - effects: supply-line-ringing, state-dependent-delay, late-spring, warm-film
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
pub const CHANNELS: [&str; 1] = ["temperature"];
/// Usual values of the channels, in their units.
pub const REFERENCES: [f32; 1] = [20.0];
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

/// supply-line-ringing.
pub type Effect1 = user_supply_line_ringing::SupplyLineRinging;
/// late-spring.
pub type Effect2 = user_late_spring::LateSpring;
/// warm-film.
pub type Effect3 = user_warm_film::WarmFilm;
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
/// supply-line-ringing: gain (-), frequency (Hz), decay_time (s).
pub const EFFECT1: [f32; 3] = [0.4, 18.0, 0.06];
/// late-spring: stiffness (-), delay (s), threshold (y).
pub const EFFECT2: [f32; 3] = [0.3, 0.0213, 0.2];
/// warm-film: sensitivity (1/K), warming_time (s).
pub const EFFECT3: [f32; 2] = [0.03, 0.4];

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
    let effect1: Effect1 = Effect1::new(&EFFECT1, &SETTING);
    let effect2: Effect2 = Effect2::new(&EFFECT2, &SETTING);
    let effect3: Effect3 = Effect3::new(
        &EFFECT3,
        &model_core::effect::Setting {
            channel: 0,
            reference: REFERENCES[0],
            ..SETTING
        },
    );
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
        0x0000_0000, 0x3c4c_0fd2, 0x3dff_07ac, 0x3e0a_066d, 0x3e31_b99b, 0x3e4c_2c90,
        0x3e20_597e, 0x3e40_ccb3, 0x3e41_15a4, 0x3de2_30ac, 0x3dd2_0330, 0x3da6_a437,
        0x3d90_7cd2, 0x3d63_0556, 0x3d36_f3dc, 0x3dec_2039, 0x3e18_ef21, 0x3e01_5d71,
        0x3e2a_c7fb, 0x3e39_564f, 0x3e5c_050e, 0x3dbe_b857, 0x3dd1_4a09, 0x3da8_1296,
        0x3da5_95e1, 0x3e14_7475, 0x3e63_a326, 0x3e38_6326, 0x3e55_e259, 0x3d8a_01e9,
        0x3dab_a0b4, 0x3df1_51e7,
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

/// supply-line-ringing: the air in the supply line rings when the valves open.
///
/// `j = jet * (1.0 - gain * exp(-since_edge / decay_time) * cos(6.283185307179586 * frequency * since_edge))`
pub mod user_supply_line_ringing {
    use model_core::Real;
    use model_core::clock::Clock;
    use model_core::effect::{Effect, Instant, Setting};
    /// Prepared for a sample period.
    #[derive(Clone, Copy, Debug, PartialEq)]
    pub struct SupplyLineRinging {
        p_gain: f32,
        p_decay_time: f32,
        k11: f32,
        period: f32,
    }
    /// The state of the effect.
    #[derive(Clone, Copy, Debug, PartialEq)]
    pub struct State {
        clock: Clock<f32>,
    }
    impl SupplyLineRinging {
        /// Prepares the effect.
        #[must_use]
        pub fn new(parameters: &[f32; 3], setting: &Setting<f32>) -> Self {
            let [p_gain, p_frequency, p_decay_time] = *parameters;
            let k11 = 6.2831855_f32 * p_frequency;
            Self {
                p_gain,
                p_decay_time,
                k11,
                period: setting.period,
            }
        }
    }
    impl Effect<f32> for SupplyLineRinging {
        type State = State;
        fn start(&self) -> State {
            State { clock: Clock::new() }
        }
        fn jet(&self, state: &mut State, signal: f32, at: &Instant<'_, f32>) -> f32 {
            state.clock.tick(at.command);
            let v0 = signal;
            let v3 = state.clock.since_edge(self.period);
            let v4 = -v3;
            let v6 = v4 / self.p_decay_time;
            let v7 = Real::exp(v6);
            let v8 = self.p_gain * v7;
            let v12 = self.k11 * v3;
            let v13 = Real::cos(v12);
            let v14 = v8 * v13;
            let v15 = 1.0_f32 - v14;
            v0 * v15
        }
    }
}

/// late-spring: every operation that an expression can hold.
///
/// `level ← level + 0.01 * (y - level); adds let late = delayed(y, delay); let pull = -stiffness * (late.abs().sqrt() + cbrt(late)) * relaxation; let push = if late > threshold && !(y <= 0.0) || t == 0.0 { pull } else { 0.1 * pull }; let calm = stiffness < 0.5; push.max(-0.01).min(0.01) * (if calm { 1.0 } else { 0.5 }) + 0.001 * sin(level - arrived * u)`
pub mod user_late_spring {
    use model_core::Real;
    use model_core::clock::Clock;
    use model_core::delay::Tap;
    use model_core::effect::{Effect, Flow, Instant, Setting};
    use model_core::history::{DelayLine, Memory};
    /// Prepared for a sample period.
    #[derive(Clone, Copy, Debug, PartialEq)]
    pub struct LateSpring {
        tap0: Tap<f32>,
        k9: f32,
        p_threshold: f32,
        k31: f32,
        k35: f32,
        period: f32,
    }
    /// The state of the effect.
    #[derive(Clone, Copy, Debug, PartialEq)]
    pub struct State {
        clock: Clock<f32>,
        s_level: f32,
        line0: DelayLine<f32, 23>,
    }
    impl LateSpring {
        /// Prepares the effect.
        #[must_use]
        pub fn new(parameters: &[f32; 3], setting: &Setting<f32>) -> Self {
            let [p_stiffness, p_delay, p_threshold] = *parameters;
            let k9 = -p_stiffness;
            let k30 = p_stiffness < 0.5_f32;
            let k31 = -0.01_f32;
            let k35 = if k30 { 1.0_f32 } else { 0.5_f32 };
            Self {
                tap0: Tap::between(Real::at_most(p_delay / setting.period, 2046.0_f32)),
                k9,
                p_threshold,
                k31,
                k35,
                period: setting.period,
            }
        }
    }
    impl Effect<f32> for LateSpring {
        type State = State;
        fn start(&self) -> State {
            State {
                clock: Clock::new(),
                s_level: 0.0,
                line0: DelayLine::new(),
            }
        }
        fn drives(&self) -> bool {
            true
        }
        fn drive(
            &self,
            state: &mut State,
            flow: &Flow<f32>,
            at: &Instant<'_, f32>,
        ) -> f32 {
            state.clock.tick(at.command);
            let v0 = state.s_level;
            let v2 = at.flow;
            let v3 = v2 - v0;
            let v4 = 0.01_f32 * v3;
            let v5 = v0 + v4;
            state.line0.push(v2);
            let v7 = self.tap0.read(&state.line0);
            let v10 = Real::abs(v7);
            let v11 = Real::sqrt(v10);
            let v12 = Real::cbrt(v7);
            let v13 = v11 + v12;
            let v14 = self.k9 * v13;
            let v15 = flow.relaxation;
            let v16 = v14 * v15;
            let v18 = v7 > self.p_threshold;
            let v20 = v2 <= 0.0_f32;
            let v21 = !v20;
            let v22 = v18 && v21;
            let v23 = state.clock.time(self.period);
            let v24 = v23 == 0.0_f32;
            let v25 = v22 || v24;
            let v27 = 0.1_f32 * v16;
            let v28 = if v25 { v16 } else { v27 };
            let v32 = Real::at_least(v28, self.k31);
            let v33 = Real::at_most(v32, 0.01_f32);
            let v36 = v33 * self.k35;
            let v38 = at.arrived;
            let v39 = at.command;
            let v40 = v38 * v39;
            let v41 = v5 - v40;
            let v42 = Real::sin(v41);
            let v43 = 0.001_f32 * v42;
            let v44 = v36 + v43;
            state.s_level = v5;
            v44
        }
    }
}

/// warm-film: the film, itself slow to warm, shows more friction in colder air.
///
/// `film ← let share = 1.0 - exp(-period / warming_time); film + (temperature - film) * share; y = reading * (1.0 - sensitivity * (film - reference))`
pub mod user_warm_film {
    use model_core::Real;
    use model_core::effect::{Effect, Instant, Setting};
    /// Prepared for a sample period.
    #[derive(Clone, Copy, Debug, PartialEq)]
    pub struct WarmFilm {
        k6: f32,
        p_sensitivity: f32,
        channel: usize,
        reference: f32,
    }
    /// The state of the effect.
    #[derive(Clone, Copy, Debug, PartialEq)]
    pub struct State {
        s_film: f32,
    }
    impl WarmFilm {
        /// Prepares the effect.
        #[must_use]
        pub fn new(parameters: &[f32; 2], setting: &Setting<f32>) -> Self {
            let [p_sensitivity, p_warming_time] = *parameters;
            let k2 = -setting.period;
            let k4 = k2 / p_warming_time;
            let k5 = Real::exp(k4);
            let k6 = 1.0_f32 - k5;
            Self {
                k6,
                p_sensitivity,
                channel: setting.channel,
                reference: setting.reference,
            }
        }
    }
    impl Effect<f32> for WarmFilm {
        type State = State;
        fn start(&self) -> State {
            State { s_film: 20.0 }
        }
        fn sense(&self, state: &mut State, signal: f32, at: &Instant<'_, f32>) -> f32 {
            let v7 = state.s_film;
            let v8 = at.channels.get(self.channel).copied().unwrap_or(self.reference);
            let v9 = v8 - v7;
            let v10 = v9 * self.k6;
            let v11 = v7 + v10;
            let v12 = signal;
            let v15 = v11 - self.reference;
            let v16 = self.p_sensitivity * v15;
            let v17 = 1.0_f32 - v16;
            let v18 = v12 * v17;
            state.s_film = v11;
            v18
        }
    }
}
