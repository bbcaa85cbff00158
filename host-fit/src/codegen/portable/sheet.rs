//! The description of a model that the generators of all languages share.

use super::piece::{Made, Piece};
use super::plain::comment;
use crate::codegen::{CodegenError, spec_of};
use crate::model::{Delay, Footprint, Law, Model};
use crate::simulate::held_samples;
use crate::user_effect::form::form;
use crate::user_effect::program::{Op, Program, Signal};
use model_core::Real;
use model_core::effect::Place;
use model_core::model::Parts;
use model_core::recursion::{Grading, SHORTEST_MEMORY};

/// An effect of the model.
pub(super) struct Effect {
    pub(super) piece: Piece,
    pub(super) place: Place,
    pub(super) name: String,
    pub(super) summary: String,
    /// Name, value and unit of each parameter.
    pub(super) parameters: Vec<(String, f64, String)>,
    pub(super) reference: f64,
}

/// A delay that follows a law.
pub(super) struct Transport {
    pub(super) effect: Effect,
    /// The conversion of the command by a law that delays edges separately.
    pub(super) command: Option<Piece>,
    pub(super) factors: Vec<f64>,
    pub(super) rounded: bool,
}

pub(super) struct Sheet<'a> {
    pub(super) model: &'a Model,
    pub(super) header: Vec<String>,
    pub(super) memory: Footprint,
    /// Lags of the coefficients a_i and c_jl, counted back from y_k, samples.
    pub(super) state_back: Vec<usize>,
    pub(super) product_back: Vec<usize>,
    /// c_jl, a row for each input.
    pub(super) rows: Vec<Vec<f64>>,
    pub(super) effects: Vec<Effect>,
    pub(super) transport: Option<Transport>,
    /// Whether the delay depends on the averaged output.
    pub(super) follows: bool,
    pub(super) drives: bool,
    pub(super) clocked: bool,
    /// The rates of the separated and the attached flow, per sample, and the lag below which terms count for these
    /// rates; none for all terms.
    pub(super) pace: (f64, f64, Option<usize>),
    /// Samples that are simulated before a run that does not begin at rest.
    pub(super) held: usize,
    /// Reading of the sensor at rest.
    pub(super) zero: f64,
}

impl<'a> Sheet<'a> {
    /// The model's data in numbers of type `T`.
    pub(super) fn new<T: Real>(model: &'a Model) -> Result<Self, CodegenError> {
        let period_s = model.sample_period_s;
        let channels = model.channels();
        let mut effects = Vec::new();
        for (i, added) in model.effects.iter().enumerate() {
            let spec = spec_of(model, added)?;
            let program: &'static Program = match model.definition(&added.name) {
                Some(definition) => definition.program(),
                None => {
                    &form(spec.name)
                        .ok_or_else(|| without_form(spec.name))?
                        .value
                }
            };
            let prefix = format!("FX{}", i + 1);
            let channel = channels
                .iter()
                .position(|c| added.channel.as_ref() == Some(c));
            let names = spec.parameters.iter().map(|p| p.name.to_owned());
            let piece = Piece::new::<T>(
                program,
                &Made {
                    prefix: &prefix,
                    owner: &prefix,
                    names: names.collect(),
                    values: &added.parameters,
                    period_s,
                    channel: channel.unwrap_or(0),
                    reference: added.reference(),
                },
            );
            let cards = spec.parameters.iter().zip(&added.parameters);
            effects.push(Effect {
                piece,
                place: spec.place,
                name: spec.name.to_owned(),
                summary: comment(spec.summary),
                parameters: cards
                    .map(|(p, v)| (format!("{prefix}_{}", p.name.to_uppercase()), *v, unit(p)))
                    .collect(),
                reference: added.reference(),
            });
        }
        let transport = match &model.delay {
            Delay::Fixed { .. } => None,
            Delay::Law(law) => {
                let form = form(law.spec.name).ok_or_else(|| without_form(law.spec.name))?;
                let made = |prefix| Made {
                    prefix,
                    owner: "H",
                    names: law
                        .spec
                        .parameters
                        .iter()
                        .map(|p| p.name.to_owned())
                        .collect(),
                    values: &law.parameters,
                    period_s,
                    channel: 0,
                    reference: 1.0,
                };
                let cards = law.spec.parameters.iter().zip(&law.parameters);
                let command = form.command.as_ref();
                Some(Transport {
                    effect: Effect {
                        piece: Piece::new::<T>(&form.value, &made("H")),
                        place: Place::Delay,
                        name: law.spec.name.to_owned(),
                        summary: comment(law.spec.summary),
                        parameters: cards
                            .map(|(p, v)| (format!("H_{}", p.name.to_uppercase()), *v, unit(p)))
                            .collect(),
                        reference: 1.0,
                    },
                    command: command.map(|program| Piece::new::<T>(program, &made("E"))),
                    factors: law.factors.clone(),
                    rounded: !law.interpolated,
                })
            }
        };
        let follows = transport
            .as_ref()
            .is_some_and(|t| t.effect.piece.program.reads(Op::Signal(Signal::Own)));
        let back = |lags: &[u16]| -> Vec<usize> {
            let each = lags.iter().map(|lag| model.convention.behind_newest(*lag));
            each.collect()
        };
        let n2 = model.product_lags.len();
        let rows = (0..model.b.len()).map(|l| model.c.iter().copied().skip(l * n2).take(n2));
        let prepared = model.prepare::<T>();
        let pace = prepared.recursion().pace();
        let (off, on, order) = (pace.off.value(), pace.on.value(), pace.order);
        let clocked = effects
            .iter()
            .any(|e| e.piece.reads(Signal::Time) || e.piece.reads(Signal::SinceEdge));
        Ok(Self {
            model,
            header: crate::codegen::header_lines(model)
                .iter()
                // Files in other languages begin with their own lines in place of the first two.
                .skip(2)
                .map(|l| comment(l))
                .collect(),
            memory: model.memory(),
            state_back: back(&model.state_lags),
            product_back: back(&model.product_lags),
            rows: rows.map(Iterator::collect).collect(),
            drives: effects.iter().any(|e| e.place == Place::Flow),
            effects,
            transport,
            follows,
            clocked,
            pace: (off, on, (order == SHORTEST_MEMORY).then_some(order)),
            held: held_samples(model),
            zero: model.zero_among(&model.values()),
        })
    }

    /// Effects at a place.
    pub(super) fn at(&self, place: Place) -> impl Iterator<Item = &Effect> {
        self.effects
            .iter()
            .filter(move |effect| effect.place == place)
    }

    /// Whether jets of part strength have another response than in eq. (3): the flow relaxes
    /// towards a separate level.
    pub(super) fn graded(&self) -> bool {
        self.model.grading != Grading::Proportional && self.model.b.len() == 1
    }

    /// The delay law, its effect on the command, and the effects: all items that have names.
    pub(super) fn pieces(&self) -> impl Iterator<Item = &Piece> {
        let law = self.transport.iter();
        let law = law.flat_map(|t| t.command.iter().chain([&t.effect.piece]));
        law.chain(self.effects.iter().map(|effect| &effect.piece))
    }

    /// Cards of the delay law and the effects.
    pub(super) fn cards(&self) -> impl Iterator<Item = &Effect> {
        let law = self.transport.iter().map(|t| &t.effect);
        law.chain(&self.effects)
    }

    pub(super) fn law(&self) -> Option<&Law> {
        self.model.law.as_ref()
    }
}

fn unit(parameter: &model_core::effect::Parameter) -> String {
    comment(&parameter.unit.to_string())
}

fn without_form(name: &str) -> CodegenError {
    CodegenError::NoForm {
        name: name.to_owned(),
    }
}
