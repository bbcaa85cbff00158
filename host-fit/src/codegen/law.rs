//! The items of the designed law: `[law]` of the model file as constants.

use super::CodegenError;
use super::layout::number;
use crate::model::{Delay, Law, Maximise, Model, Track};
use closed_loop::AHEAD;
use model_core::control::{Tracking, golden};
use std::fmt::Write as _;

/// Length of the law's golden run, samples: several delays, corrections at work.
const GOLDEN_SAMPLES: u32 = 4096;

pub(super) fn imports(law: &Law) -> Vec<String> {
    match law {
        Law::Track(track) => {
            let mut named = vec!["HoldTimes", "Reachable", "Tracking", "TrackingState"];
            if track.air.is_some() {
                named.push("Air");
            }
            if track.switches.is_some() {
                named.push("Switches");
            }
            named.sort_unstable();
            vec![
                "use model_core::control::budget::Budget;".to_owned(),
                "use model_core::control::golden::GoldenLaw;".to_owned(),
                format!("use model_core::control::{{{}}};", named.join(", ")),
            ]
        }
        Law::Maximise(_) => vec!["use model_core::control::{HoldTimes, PulseTrain};".to_owned()],
    }
}

pub(super) fn items(out: &mut String, model: &Model, law: &Law) -> Result<(), CodegenError> {
    match law {
        Law::Track(track) => tracking(out, model, track),
        Law::Maximise(pulses) => {
            train(out, pulses);
            Ok(())
        }
    }
}

fn tracking(out: &mut String, model: &Model, track: &Track) -> Result<(), CodegenError> {
    let budget = match (track.switches, track.air) {
        (None, None) => "Budget {
        switches: None,
        air: None,
    }"
        .to_owned(),
        (switches, air) => {
            let switches = switches.map_or("None".to_owned(), |[cost, saved]| {
                format!(
                    "Some(Switches {{
            samples_per_switch: {cost},
            saved: {saved},
        }})"
                )
            });
            let air = air.map_or("None".to_owned(), |[per_mille, saved]| {
                format!(
                    "Some(Air {{
            per_mille: {per_mille},
            saved: {saved},
        }})"
                )
            });
            format!(
                "Budget {{
        switches: {switches},
        air: {air},
    }}"
            )
        }
    };
    // The first input to arrive is the one that counts.
    let first_arrival = match &model.delay {
        Delay::Fixed { .. } => " checks::shortest(&DELAYS)",
        // What is held back is in `opening` and `closing`.
        Delay::Law(law) if law.interpolated => {
            " (checks::smallest(&DELAY_FACTORS) * DELAY_RANGE[1]) as usize"
        }
        Delay::Law(_) => " (checks::smallest(&DELAY_FACTORS) * DELAY_RANGE[1] + 0.5) as usize",
    };
    let expected = golden_value(model, &track.tracking())?;
    let _ = write!(
        out,
        "
/// Longest time from a command to its first arrival, samples.
pub const FIRST_ARRIVAL: usize ={first_arrival};
/// Samples that the law looks ahead at most.
pub const LOOK_AHEAD: usize = {look_ahead};
/// The law: it holds the friction at its reference.
pub const LAW: Tracking<f32> = Tracking {{
    reference: {reference},
    reachable: Reachable {{
        low: {low},
        high: {high},
    }},
    slope: {slope},
    hold: HoldTimes {{ on: {on}, off: {off} }},
    budget: {budget},
    lead: {lead},
    opening: {opening},
    closing: {closing},
    observer: {observer},
    bias_rate: {bias_rate},
    integral_rate: {integral_rate},
    correction_limit: {correction_limit},
    residual_limit: {residual_limit},
}};
/// What the law remembers, its model included.
pub type LawState = TrackingState<f32, IdentifiedState, LOOK_AHEAD>;

const _: () = {{
    assert!(
        checks::law(&LAW),
        \"a constant of the law is out of range, or its reference is out of reach\"
    );
    assert!(
        LOOK_AHEAD >= checks::look_ahead(&LAW, FIRST_ARRIVAL),
        \"the law looks ahead less far than delay, valve and half a hold time\"
    );
}};

/// The law and its model at rest.
#[must_use]
pub fn law_state(model: &Identified) -> LawState {{
    LAW.start(state(model))
}}

/// What the law decides in its golden run, bit for bit, as the host computed it.
pub const LAW_GOLDEN: GoldenLaw = GoldenLaw {{
    samples: {GOLDEN_SAMPLES},
    expected: 0x{:04x}_{:04x},
}};
",
        expected >> 16,
        expected & 0xffff,
        look_ahead = track.look_ahead,
        reference = number(track.reference),
        low = number(track.reachable[0]),
        high = number(track.reachable[1]),
        slope = number(track.slope),
        on = track.hold.on,
        off = track.hold.off,
        lead = track.lead,
        opening = track.opening,
        closing = track.closing,
        observer = number(track.observer),
        bias_rate = number(track.bias_rate),
        integral_rate = number(track.integral_rate),
        correction_limit = number(track.correction_limit),
        residual_limit = number(track.residual_limit),
    );
    Ok(())
}

/// By the code that designs and simulates the law.
fn golden_value(model: &Model, law: &Tracking<f32>) -> Result<u32, CodegenError> {
    let prepared = model.prepare::<f32>();
    let longest = u16::try_from(model.longest_delay()).unwrap_or(u16::MAX);
    law.validate::<_, AHEAD>(&prepared, longest)?;
    let memory = model.memory();
    golden::run(
        law,
        &prepared,
        law.start::<_, AHEAD>(memory.at_rest(&prepared)),
        &memory.references(),
        GOLDEN_SAMPLES,
    )
    .ok_or(CodegenError::Unstable {
        samples: GOLDEN_SAMPLES,
    })
}

fn train(out: &mut String, law: &Maximise) {
    let mut pulses = law.pulses.clone();
    pulses.sort_unstable();
    let pulses: Vec<String> = pulses
        .iter()
        .map(|(first, length)| format!("({first}, {length})"))
        .collect();
    let _ = write!(
        out,
        "
/// The valve's shortest on and off times, samples.
pub const HOLD: HoldTimes = HoldTimes {{ on: {on}, off: {off} }};
/// The law: a train of pulses, (first sample, length) each, that repeats.
pub const LAW: PulseTrain<[(u32, u32); {count}]> = PulseTrain {{
    period: {period},
    pulses: [{pulses}],
}};

const _: () = assert!(
    checks::train(LAW.period, &LAW.pulses, HOLD),
    \"a pulse or a gap is shorter than the valve's shortest times\"
);
",
        on = law.hold.on,
        off = law.hold.off,
        count = law.pulses.len(),
        period = law.period,
        pulses = pulses.join(", "),
    );
}
