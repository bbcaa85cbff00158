//! Generated constants of the input delays of a model.

use super::pieces::{count, lags, listed, with_units};
use crate::model::{Delay, Model, TransportLaw};
use proc_macro2::TokenStream;
use quote::{format_ident, quote};

/// The input delays as Rust.
pub(super) struct Written {
    /// The type of the law.
    pub(super) kind: TokenStream,
    /// Constants of the law.
    pub(super) constants: TokenStream,
    /// The law as an expression of these constants.
    pub(super) value: TokenStream,
    /// Whether `value` is a constant: some laws are computed at the place of use, for the sample period.
    pub(super) is_constant: bool,
    /// The longest delay of each input, samples.
    pub(super) longest: Vec<TokenStream>,
    /// Longest time from a command to its first arrival at the flow, samples; the input with the shortest delay
    /// determines it.
    pub(super) first_arrival: TokenStream,
}

pub(super) fn written(model: &Model) -> Written {
    match &model.delay {
        Delay::Fixed { delays } => fixed(delays),
        Delay::Law(law) => of_law(model, law),
    }
}

fn fixed(delays: &[u16]) -> Written {
    let (inputs, values) = (count(delays.len()), lags(delays));
    Written {
        kind: quote!(model_core::delay::FixedDelay<[u16; #inputs]>),
        constants: quote! {
            /// h_l, samples.
            pub const DELAYS: [u16; #inputs] = #values;
        },
        value: quote!(model_core::delay::FixedDelay { delays: DELAYS }),
        is_constant: true,
        longest: (0..delays.len())
            .map(count)
            .map(|l| quote!(DELAYS[#l] as usize))
            .collect(),
        first_arrival: quote!(checks::shortest(&DELAYS)),
    }
}

fn of_law(model: &Model, law: &TransportLaw) -> Written {
    let doc = format!(" {}: {}.", law.spec.name, with_units(law.spec));
    let (length, values) = (count(law.parameters.len()), listed(&law.parameters));
    let range = listed(&law.range(model.sample_period_s));
    let (inputs, factors) = (count(law.factors.len()), listed(&law.factors));
    let path: Vec<_> = law
        .spec
        .rust
        .split("::")
        .map(|name| format_ident!("{name}"))
        .collect();
    let path = quote!(model_core::effects #(::#path)*);
    let rounded = !law.interpolated;
    let rounding = rounded.then(|| quote!(+ 0.5));
    let fields = law.spec.law.and_then(|card| card.fields);
    let prepared = match fields {
        None => quote!(model_core::effect::Physics::new(
            &DELAY_PARAMETERS,
            &SETTING
        )),
        Some(fields) => {
            let each = fields.iter().enumerate().map(|(i, field)| {
                let (field, i) = (format_ident!("{field}"), count(i));
                quote!(#field: DELAY_PARAMETERS[#i])
            });
            quote!(#path { #(#each),* })
        }
    };
    Written {
        kind: quote!(model_core::delay::ScaledDelay<#path<f32>, [f32; #inputs], #rounded>),
        constants: quote! {
            #[doc = #doc]
            pub const DELAY_PARAMETERS: [f32; #length] = #values;
            /// Shortest and longest delay of the law, samples.
            pub const DELAY_RANGE: [f32; 2] = #range;
            /// f_l, the delays of the inputs relative to the law's.
            pub const DELAY_FACTORS: [f32; #inputs] = #factors;
        },
        value: quote!(model_core::delay::ScaledDelay { law: #prepared, factors: DELAY_FACTORS }),
        is_constant: fields.is_some(),
        longest: (0..law.factors.len())
            .map(count)
            .map(|l| quote!((DELAY_FACTORS[#l] * DELAY_RANGE[1] + 0.5) as usize))
            .collect(),
        // The delays of the edges are in `opening` and `closing`.
        first_arrival: quote! {
            (checks::smallest(&DELAY_FACTORS) * DELAY_RANGE[1] #rounding) as usize
        },
    }
}
