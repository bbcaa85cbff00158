//! The items of the designed law: `[law]` of the model file as constants.

use super::CodegenError;
use super::pieces::{count, word};
use crate::model::{Law, Maximise, Model, Track};
use crate::user_effect::number;
use closed_loop::AHEAD;
use model_core::control::HoldTimes;
use model_core::control::{Pulses, Tracking, golden};
use proc_macro2::{Literal, TokenStream};
use quote::quote;

/// Length of the law's reference run, samples: several delays, with active corrections.
const GOLDEN_SAMPLES: u32 = 4096;

/// The law; a model without a law exports the same names.
pub(super) fn items(model: &Model) -> Result<TokenStream, CodegenError> {
    let (law, expected) = match &model.law {
        None => (none(), 0),
        Some(Law::Track(track)) => (tracking(track), golden_track(model, &track.tracking())?),
        Some(Law::Maximise(law)) => {
            let pulses = Pulses {
                train: law.train(),
                hold: law.hold,
            };
            (train(law), golden::play(&pulses, GOLDEN_SAMPLES))
        }
    };
    let (samples, expected) = (Literal::u32_unsuffixed(GOLDEN_SAMPLES), word(expected));
    Ok(quote! {
        #law

        /// Decisions of the law in its reference run, bit for bit as computed on the host.
        pub const LAW_GOLDEN: GoldenLaw = GoldenLaw {
            samples: #samples,
            expected: #expected,
        };
    })
}

fn none() -> TokenStream {
    quote! {
        /// Longest prediction horizon of the law, samples.
        pub const LOOK_AHEAD: usize = 1;
        /// The kind of law: none was designed.
        pub type Law = ();
        /// No law was designed.
        pub const LAW: Law = ();
    }
}

fn hold(hold: HoldTimes) -> TokenStream {
    let (on, off) = (
        Literal::u32_unsuffixed(hold.on),
        Literal::u32_unsuffixed(hold.off),
    );
    quote!(model_core::control::HoldTimes { on: #on, off: #off })
}

fn tracking(law: &Track) -> TokenStream {
    let pair = |values: [u32; 2]| values.map(Literal::u32_unsuffixed);
    let switches = match law.switches.map(pair) {
        None => quote!(None),
        Some([cost, saved]) => quote! {
            Some(model_core::control::Switches { samples_per_switch: #cost, saved: #saved })
        },
    };
    let air = match law.air.map(pair) {
        None => quote!(None),
        Some([per_mille, saved]) => quote! {
            Some(model_core::control::Air { per_mille: #per_mille, saved: #saved })
        },
    };
    let look_ahead = count(law.look_ahead.into());
    let [reference, low, high, slope] =
        [law.reference, law.reachable[0], law.reachable[1], law.slope]
            .map(|value| number(value, ""));
    let (times, anticipation) = (hold(law.hold), hold(law.anticipation()));
    let [lead, opening, closing] =
        [law.lead, law.opening, law.closing].map(Literal::u16_unsuffixed);
    let [
        observer,
        bias_rate,
        integral_rate,
        play,
        settled,
        correction_limit,
        residual_limit,
    ] = [
        law.observer,
        law.bias_rate,
        law.integral_rate,
        law.play,
        law.settled,
        law.correction_limit,
        law.residual_limit,
    ]
    .map(|value| number(value, ""));
    quote! {
        /// Longest prediction horizon of the law, samples.
        pub const LOOK_AHEAD: usize = #look_ahead;
        /// The kind of law: it holds y at its reference.
        pub type Law = model_core::control::Tracking<f32>;
        /// The law.
        pub const LAW: Law = model_core::control::Tracking {
            reference: #reference,
            reachable: model_core::control::Reachable { low: #low, high: #high },
            slope: #slope,
            hold: #times,
            anticipation: #anticipation,
            budget: model_core::control::budget::Budget { switches: #switches, air: #air },
            lead: #lead,
            opening: #opening,
            closing: #closing,
            observer: #observer,
            bias_rate: #bias_rate,
            integral_rate: #integral_rate,
            play: #play,
            settled: #settled,
            correction_limit: #correction_limit,
            residual_limit: #residual_limit,
        };

        const _: () = {
            assert!(
                checks::law(&LAW),
                "a constant of the law is out of range, or the law's reference is outside the reachable interval"
            );
            assert!(
                LOOK_AHEAD >= checks::look_ahead(&LAW, FIRST_ARRIVAL),
                "the law's prediction horizon is shorter than the sum of dead time, valve delay and anticipation"
            );
        };
    }
}

/// Checksum of the tracking law's self-test, computed by the code that designs and simulates the law.
fn golden_track(model: &Model, law: &Tracking<f32>) -> Result<u32, CodegenError> {
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

fn train(law: &Maximise) -> TokenStream {
    let mut pulses = law.pulses.clone();
    pulses.sort_unstable();
    let pulses = pulses.into_iter().map(|(first, length)| {
        let (first, length) = (
            Literal::u32_unsuffixed(first),
            Literal::u32_unsuffixed(length),
        );
        quote!((#first, #length))
    });
    let (length, period) = (count(law.pulses.len()), Literal::u32_unsuffixed(law.period));
    let hold = hold(law.hold);
    quote! {
        /// Longest prediction horizon of the law, samples.
        pub const LOOK_AHEAD: usize = 1;
        /// The kind of law: pulses, (first sample, length) each, in a period that repeats.
        pub type Law = model_core::control::Pulses<[(u32, u32); #length]>;
        /// The law.
        pub const LAW: Law = model_core::control::Pulses {
            train: model_core::control::PulseTrain { period: #period, pulses: [#(#pulses),*] },
            hold: #hold,
        };

        const _: () = assert!(
            checks::train(LAW.train.period, &LAW.train.pulses, LAW.hold),
            "a pulse or a gap is shorter than the valve's shortest times"
        );
    }
}
