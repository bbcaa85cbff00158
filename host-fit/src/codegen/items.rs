//! The items of the generated file that every model has.

use super::delay::Written;
use super::pieces::{count, lags, listed, with_units};
use super::{CodegenError, spec_of};
use crate::model::{Added, CommandRange, Footprint, Model};
use crate::user_effect::{number, rust_module};
use model_core::effect::{RustType, Setting};
use model_core::effects::LONGEST_BUFFER;
use model_core::recursion::{Grading, LagConvention};
use proc_macro2::{Ident, Literal, TokenStream};
use quote::{format_ident, quote};

pub(super) fn imports(law: &Written) -> TokenStream {
    let frozen = law.is_constant.then(|| {
        quote!(
            use model_core::frozen::{self, Frozen};
        )
    });
    quote! {
        use model_core::checks;
        use model_core::control::golden::GoldenLaw;
        #frozen
        use model_core::model::{Averaging, Params, State, StateOf, matrix, vector};
        use model_core::recursion::{Grading, LagConvention};
        use model_core::self_test::Golden;
    }
}

pub(super) fn sizes(model: &Model, memory: &Footprint) -> TokenStream {
    let period = number(model.sample_period_s, "");
    let window = Literal::u32_unsuffixed(model.averaging.window);
    let readings = if model.averaging.averaged_model {
        quote!(WINDOW as usize)
    } else {
        quote!(1)
    };
    let (outputs, jets) = (count(memory.outputs), count(memory.jets));
    let kept = if memory.graded {
        quote!(model_core::history::DelayLine<f32, JETS>)
    } else {
        quote!(model_core::history::BitHistory<{ JETS.div_ceil(32) }>)
    };
    let names = memory.channels.iter().map(|channel| channel.name.as_str());
    let references: Vec<f64> = memory.references();
    let (channels, references) = (count(references.len()), listed(&references));
    let command = command(model.command);
    quote! {
        /// Sample period, s.
        pub const SAMPLE_PERIOD_S: f32 = #period;
        /// W, samples.
        pub const WINDOW: u32 = #window;
        /// Number of readings whose mean is compared with the model.
        pub const READINGS: usize = #readings;
        /// Stored outputs: more than the longest lag, at least the averaging window.
        pub const OUTPUTS: usize = #outputs;
        /// Stored jet strengths: more than the longest input delay.
        pub const JETS: usize = #jets;
        /// Measured channels that the effects need, in the order in which they are passed.
        pub const CHANNELS: [&str; #channels] = [#(#names),*];
        /// Usual values of the channels, in their units.
        pub const REFERENCES: [f32; #channels] = #references;
        #command
        /// Past outputs.
        pub type Outputs = model_core::history::DelayLine<f32, OUTPUTS>;
        /// Past jet strengths.
        pub type Jets = #kept;
    }
}

/// The range of the command and its conversion; the other languages convert at every step.
fn command(range: CommandRange) -> TokenStream {
    let (off, full) = (range.off, range.full);
    let (off_value, size) = (double(off), double(full - off));
    let share = if range.is_unit() {
        quote!(command)
    } else {
        quote!(((f64::from(command) - #off_value) / #size) as f32)
    };
    let doc = format!(
        " The command in the unit of the records as a fraction of a full jet: {off:?} is no jet, {full:?} a full jet."
    );
    quote! {
        #[doc = #doc]
        ///
        /// `Identified` and its state take this fraction, not the command.
        #[must_use]
        pub fn share(command: f32) -> f32 {
            #share
        }
    }
}

/// A number in double precision, in parentheses if it is negative.
fn double(value: f64) -> TokenStream {
    let size = Literal::f64_suffixed(value.abs());
    if value.is_sign_negative() {
        quote!((-#size))
    } else {
        quote!(#size)
    }
}

pub(super) fn types(model: &Model, law: &Written) -> Result<TokenStream, CodegenError> {
    let each = model.effects.iter().enumerate().map(|(i, added)| {
        let (doc, name) = (format!(" {}.", added.name), effect(i, "Effect"));
        let kind = effect_type(model, added)?;
        Ok(quote! {
            #[doc = #doc]
            pub type #name = #kind;
        })
    });
    let each: Vec<TokenStream> = each.collect::<Result<_, CodegenError>>()?;
    let chain = nested(model.effects.len(), "Effect");
    let sizes = [model.a.len(), model.product_lags.len(), model.b.len()].map(count);
    let kind = &law.kind;
    let identified = if law.is_constant {
        quote! {
            /// Structure, coefficients and delay law: N1, N2, N3 as identified.
            pub type Base = Params<f32, #(#sizes),*, Delay, ()>;
            /// The model: its constants are part of the code.
            pub type Identified = Frozen<Constants, Effects>;
        }
    } else {
        quote! {
            /// The model: N1, N2, N3 as identified.
            pub type Identified = Params<f32, #(#sizes),*, Delay, Effects>;
        }
    };
    Ok(quote! {
        #(#each)*
        /// The delay law.
        pub type Delay = #kind;
        /// The effects, in physical order.
        pub type Effects = #chain;
        #identified
        /// The state of the model.
        pub type IdentifiedState = StateOf<f32, Identified, Outputs, Jets>;
    })
}

fn effect_type(model: &Model, added: &Added) -> Result<TokenStream, CodegenError> {
    let spec = spec_of(model, added)?;
    let path = path(spec.rust)?;
    if model.definition(spec.name).is_some() {
        return Ok(path);
    }
    let path = quote!(model_core::effects::#path);
    Ok(match spec.rust_type {
        RustType::Plain => path,
        RustType::Numbers => quote!(#path<f32>),
        RustType::Buffer(time) => {
            let length = count(buffer(model, added, time));
            quote!(#path<f32, #length>)
        }
    })
}

fn path(text: &str) -> Result<TokenStream, CodegenError> {
    text.parse().map_err(|_| CodegenError::UnknownEffect {
        name: text.to_owned(),
    })
}

/// Number of samples that an effect stores if its memory lasts as long as its parameter with index
/// `time`.
pub(super) fn buffer(model: &Model, added: &Added, time: usize) -> usize {
    let time = added.parameters.get(time).copied().unwrap_or(0.0) / model.sample_period_s;
    (time as usize).saturating_add(3).min(LONGEST_BUFFER)
}

pub(super) fn coefficients(model: &Model, law: &Written) -> TokenStream {
    let (n1, n2, n3) = (model.a.len(), model.product_lags.len(), model.b.len());
    let [one, two, three] = [n1, n2, n3].map(count);
    let (state_lags, product_lags) = (lags(&model.state_lags), lags(&model.product_lags));
    let (a, b, constant) = (
        listed(&model.a),
        listed(&model.b),
        number(model.constant, ""),
    );
    let columns = (0..n3).map(|l| {
        let column: Vec<f64> = model.c.iter().copied().skip(l * n2).take(n2).collect();
        let (doc, name) = (format!(" c_j{}.", l + 1), effect(l, "C"));
        let column = listed(&column);
        quote! {
            #[doc = #doc]
            pub const #name: [f32; #two] = #column;
        }
    });
    let parameters = model.effects.iter().enumerate().filter_map(|(i, added)| {
        let spec = model.spec(&added.name)?;
        let doc = format!(" {}: {}.", spec.name, with_units(spec));
        let (name, length) = (effect(i, "EFFECT"), count(added.parameters.len()));
        let values = listed(&added.parameters);
        Some(quote! {
            #[doc = #doc]
            pub const #name: [f32; #length] = #values;
        })
    });
    let delays = &law.constants;
    let convention = match model.convention {
        LagConvention::Literal => quote!(LagConvention::Literal),
        LagConvention::OneStep => quote!(LagConvention::OneStep),
    };
    let grading = match model.grading {
        Grading::Proportional => quote!(Grading::Proportional),
        Grading::Interpolated => quote!(Grading::Interpolated),
        Grading::Switched => quote!(Grading::Switched),
    };
    quote! {
        /// Convention of the lags.
        pub const CONVENTION: LagConvention = #convention;
        /// The response to jets of part strength.
        pub const GRADING: Grading = #grading;
        /// d, the constant drive of the flow without jets.
        pub const CONSTANT: f32 = #constant;
        /// τ_i, samples.
        pub const STATE_LAGS: [u16; #one] = #state_lags;
        /// a_i.
        pub const A: [f32; #one] = #a;
        /// τ̄_j, samples.
        pub const PRODUCT_LAGS: [u16; #two] = #product_lags;
        /// b_l.
        pub const B: [f32; #three] = #b;
        #(#columns)*
        #delays
        #(#parameters)*
    }
}

pub(super) fn compile_time_checks(model: &Model, law: &Written) -> TokenStream {
    let columns = (0..model.b.len()).map(|l| effect(l, "C"));
    let (longest, first) = (&law.longest, &law.first_arrival);
    quote! {
        /// Longest time from a command to its first arrival at the flow, samples.
        pub const FIRST_ARRIVAL: usize = #first;

        const _: () = {
            assert!(CONSTANT.is_finite(), "the constant is not finite");
            assert!(checks::finite(&A), "a coefficient a is not finite");
            assert!(checks::finite(&B), "a coefficient b is not finite");
            #(assert!(checks::finite(&#columns), "a coefficient c is not finite");)*
            assert!(
                OUTPUTS >= checks::outputs_for(&STATE_LAGS, CONVENTION),
                "a state lag reaches beyond the stored outputs"
            );
            assert!(
                OUTPUTS >= checks::outputs_for(&PRODUCT_LAGS, CONVENTION),
                "a product lag reaches beyond the stored outputs"
            );
            assert!(
                OUTPUTS >= WINDOW as usize,
                "the averaging window reaches beyond the stored outputs"
            );
            #(assert!(
                JETS >= #longest + READINGS,
                "an input delay reaches beyond the stored commands"
            );)*
        };
    }
}

pub(super) fn constructors(model: &Model, law: &Written) -> TokenStream {
    let made = if model.effects.is_empty() {
        quote!(())
    } else {
        quote!(effects())
    };
    let columns = (0..model.b.len()).map(|l| effect(l, "C"));
    let (value, averaged) = (&law.value, model.averaging.averaged_model);
    let params = |effects: TokenStream| {
        quote! {
            Params {
                convention: CONVENTION,
                grading: GRADING,
                averaging: Averaging { window: WINDOW, averaged_model: #averaged },
                constant: CONSTANT,
                state_lags: STATE_LAGS,
                a: vector(A),
                product_lags: PRODUCT_LAGS,
                b: vector(B),
                c: matrix([#(#columns),*]),
                delay: #value,
                effects: #effects,
            }
        }
    };
    let needs_setting = !model.effects.is_empty() || !law.is_constant;
    let setting = needs_setting.then(|| {
        quote! {
            const SETTING: model_core::effect::Setting<f32> = model_core::effect::Setting {
                period: SAMPLE_PERIOD_S,
                channel: 0,
                reference: 1.0,
            };
        }
    });
    let (base, body) = if law.is_constant {
        let base = params(quote!(()));
        let base = quote! {
            /// Structure, coefficients and delay law.
            pub const BASE: Base = #base;

            /// Where the model finds its constants.
            #[derive(Clone, Copy, Debug)]
            pub struct Constants;

            impl frozen::Constants<f32> for Constants {
                type Base = Base;
                const BASE: &'static Base = &BASE;
            }
        };
        (Some(base), quote!(Frozen::new(#made)))
    } else {
        (None, params(made))
    };
    let effects = (!model.effects.is_empty()).then(|| prepared(model));
    quote! {
        #base
        #setting
        #effects

        /// The model, its effects prepared for the sample period.
        #[must_use]
        pub fn model() -> Identified {
            #body
        }

        /// The state at rest.
        #[must_use]
        pub fn state(model: &Identified) -> IdentifiedState {
            State::at_rest(model, Outputs::new(), Jets::new())
        }
    }
}

/// The function that prepares the effects.
fn prepared(model: &Model) -> TokenStream {
    let channels = model.channels();
    let each = model.effects.iter().enumerate().map(|(i, added)| {
        let (name, kind) = (effect(i, "effect"), effect(i, "Effect"));
        let values = effect(i, "EFFECT");
        let used = channels
            .iter()
            .position(|name| added.channel.as_ref() == Some(name));
        let setting = match (used.map(count), added.reference) {
            (None, None) => quote!(&SETTING),
            (None, Some(reference)) => {
                let reference = reference as f32;
                quote! {
                    &model_core::effect::Setting {
                        reference: #reference,
                        ..SETTING
                    }
                }
            }
            (Some(channel), _) => quote! {
                &model_core::effect::Setting {
                    channel: #channel,
                    reference: REFERENCES[#channel],
                    ..SETTING
                }
            },
        };
        // A user effect has its own `new`.
        let new = if model.definition(&added.name).is_some() {
            quote!(#kind::new)
        } else {
            quote!(model_core::effect::Physics::new)
        };
        quote!(let #name: #kind = #new(&#values, #setting);)
    });
    let chain = nested(model.effects.len(), "effect");
    quote! {
        fn effects() -> Effects {
            #(#each)*
            #chain
        }
    }
}

/// The user's own effects in full, because `model-core` does not contain them.
pub(super) fn own_effects(model: &Model) -> Vec<TokenStream> {
    let own = model.effects.iter().filter_map(|added| {
        let definition = model.definition(&added.name)?;
        Some(rust_module(
            definition,
            &added.parameters,
            &setting(model, added),
        ))
    });
    own.collect()
}

/// The arguments of a user effect.
pub(super) fn setting(model: &Model, added: &Added) -> Setting<f32> {
    Setting {
        period: model.sample_period_s as f32,
        channel: 0,
        reference: added.reference() as f32,
    }
}

/// `name` and the number of an effect or input, from 1.
fn effect(index: usize, name: &str) -> Ident {
    format_ident!("{name}{}", index + 1)
}

/// `(name1, (name2, ()))`.
fn nested(effects: usize, name: &str) -> TokenStream {
    (0..effects).rev().fold(quote!(()), |chain, i| {
        let name = effect(i, name);
        quote!((#name, #chain))
    })
}
