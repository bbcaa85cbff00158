//! What can be added to a model: the moves of the search.

use crate::model::Model;
use model_core::effect::{Place, Spec};
use model_core::effects::ZERO_OFFSET;
use model_core::recursion::Grading;

/// An addition to a model.
#[derive(Clone, Debug)]
pub enum Term {
    /// The flow feels y of so many samples ago, alone and times the arriving jet.
    Memory(u16),
    /// Alone.
    State(u16),
    /// Times the arriving jet.
    Product(u16),
    /// A flow of second order: lags of two samples.
    Inertia,
    /// The sensor's zero, which is no missing physics.
    Offset,
    /// A physical effect, with the values from which it is fitted.
    Effect {
        /// Its card.
        spec: &'static Spec,
        /// Parameters from which to set out.
        parameters: Vec<f64>,
        /// How the flow takes jets of part strength, if the effect makes them.
        grading: Grading,
        /// The reference of its channel.
        reference: Option<f64>,
    },
}

impl Term {
    /// The effect, if it is one.
    #[must_use]
    pub fn effect(&self) -> Option<&'static Spec> {
        match self {
            Self::Effect { spec, .. } => Some(spec),
            _ => None,
        }
    }

    /// The lag, if it is one that can move.
    #[must_use]
    pub fn lag(&self) -> Option<u16> {
        match self {
            Self::Memory(lag) | Self::State(lag) | Self::Product(lag) => Some(*lag),
            _ => None,
        }
    }

    /// The same kind of lag elsewhere.
    #[must_use]
    pub fn with_lag(&self, lag: u16) -> Self {
        match self {
            Self::Memory(_) => Self::Memory(lag),
            Self::State(_) => Self::State(lag),
            Self::Product(_) => Self::Product(lag),
            other => other.clone(),
        }
    }

    /// What it costs: the parameters that are fitted and the places that are searched.
    #[must_use]
    pub fn cost(&self) -> usize {
        match self {
            Self::Memory(_) => 3,
            Self::State(_) | Self::Product(_) | Self::Inertia => 2,
            Self::Offset => 1,
            Self::Effect { spec, .. } => spec.parameters.iter().filter(|p| p.low < p.high).count(),
        }
    }

    /// What it is called in progress lines and tables.
    #[must_use]
    pub fn name(&self) -> String {
        match self {
            Self::Memory(lag) => format!("memory of {lag} samples"),
            Self::State(lag) => format!("lag of {lag} samples"),
            Self::Product(lag) => format!("lag of {lag} samples under the jet"),
            Self::Inertia => "second order".to_owned(),
            Self::Offset => ZERO_OFFSET.name.to_owned(),
            Self::Effect { spec, .. } => spec.name.to_owned(),
        }
    }

    /// Whether two terms are the same for a search that has tried one of them.
    #[must_use]
    pub fn key(&self) -> (String, Option<Grading>) {
        match self {
            Self::Effect { spec, grading, .. } => (spec.name.to_owned(), Some(*grading)),
            term => match term.lag() {
                // Lags settle within a few samples of where they set out.
                Some(lag) => (term.with_lag(lag / 12).name(), None),
                None => (term.name(), None),
            },
        }
    }

    fn reads_states(&self) -> bool {
        matches!(self, Self::Memory(_) | Self::State(_) | Self::Inertia)
    }

    fn reads_products(&self) -> bool {
        matches!(self, Self::Memory(_) | Self::Product(_) | Self::Inertia)
    }

    /// The lag it reads in the recursion.
    fn place(&self) -> Option<u16> {
        match self {
            Self::Inertia => Some(2),
            term => term.lag(),
        }
    }

    /// The model with it. Coefficients of new lags are `coefficients`, one for each
    /// column of the term, for every input; missing ones are 0.
    #[must_use]
    pub fn added_to(&self, model: &Model, coefficients: &[f64]) -> Model {
        let mut model = model.clone();
        match self {
            Self::Effect {
                spec,
                parameters,
                grading,
                reference,
            } => {
                model.add(spec, parameters, *reference);
                model.grading = *grading;
            }
            Self::Offset => {
                let level = coefficients.first().copied().unwrap_or(0.0);
                model.add(ZERO_OFFSET, &[level], None);
            }
            lags => {
                let Some(lag) = lags.place() else {
                    return model;
                };
                let mut given = coefficients.iter().copied();
                if lags.reads_states() && !model.state_lags.contains(&lag) {
                    model.state_lags.push(lag);
                    model.a.push(given.next().unwrap_or(0.0));
                }
                if lags.reads_products() && !model.product_lags.contains(&lag) {
                    let c = given.next().unwrap_or(0.0);
                    let before = model.product_lags.len();
                    model.product_lags.push(lag);
                    let columns = (0..model.b.len()).flat_map(|l| {
                        let own = model.c.get(l * before..(l + 1) * before).unwrap_or(&[]);
                        own.iter().copied().chain([c]).collect::<Vec<f64>>()
                    });
                    model.c = columns.collect();
                }
            }
        }
        model
    }

    /// The model without it; a delay law goes back to that of `base`.
    #[must_use]
    pub fn taken_from(&self, model: &Model, base: &Model) -> Model {
        let mut model = model.clone();
        match self {
            Self::Effect { spec, .. } if spec.place == Place::Delay => {
                model.delay = base.delay.clone();
            }
            Self::Effect { spec, .. } => model.effects.retain(|e| e.name != spec.name),
            Self::Offset => model.effects.retain(|e| e.name != ZERO_OFFSET.name),
            lags => {
                let of = |all: &[u16]| all.iter().position(|lag| Some(*lag) == lags.place());
                if lags.reads_states()
                    && let Some(i) = of(&model.state_lags)
                {
                    model.state_lags.remove(i);
                    model.a.remove(i);
                }
                if lags.reads_products()
                    && let Some(i) = of(&model.product_lags)
                {
                    let count = model.product_lags.len();
                    model.product_lags.remove(i);
                    let mut index = 0;
                    model.c.retain(|_| {
                        index += 1;
                        (index - 1) % count != i
                    });
                }
            }
        }
        model
    }

    /// The model with this term's lag moved to `lag`; `None` where it is already, or
    /// another term is.
    #[must_use]
    pub fn moved_in(&self, model: &Model, lag: u16) -> Option<Model> {
        let old = self.lag().filter(|old| *old != lag)?;
        let mut model = model.clone();
        let shift = |lags: &mut Vec<u16>, wanted: bool| {
            if wanted && lags.contains(&lag) {
                return None;
            }
            let own = lags.iter_mut().filter(|own| wanted && **own == old);
            own.for_each(|own| *own = lag);
            Some(())
        };
        shift(&mut model.state_lags, self.reads_states())?;
        shift(&mut model.product_lags, self.reads_products())?;
        Some(model)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn base() -> Model {
        Model {
            a: vec![0.9],
            b: vec![0.1, 0.2],
            c: vec![0.3, 0.4],
            ..Model::default()
        }
    }

    #[test]
    fn a_term_that_is_taken_away_again_leaves_the_model_as_it_was() {
        let model = base();
        for term in [
            Term::Memory(200),
            Term::State(30),
            Term::Product(40),
            Term::Inertia,
            Term::Offset,
        ] {
            let with = term.added_to(&model, &[0.01, -0.02]);
            assert_ne!(with, model, "{term:?}");
            assert_eq!(with.coordinates().len(), with.values().len());
            assert_eq!(term.taken_from(&with, &model), model, "{term:?}");
        }
    }

    #[test]
    fn columns_of_products_stay_with_their_inputs() {
        let with = Term::Memory(200).added_to(&base(), &[0.01, -0.02]);
        assert_eq!(with.a, [0.9, 0.01]);
        assert_eq!(with.c, [0.3, -0.02, 0.4, -0.02]);
        let moved = Term::Memory(200).moved_in(&with, 205).unwrap();
        assert_eq!((moved.state_lags[1], moved.product_lags[1]), (205, 205));
        assert!(Term::Memory(200).moved_in(&with, 1).is_none());
    }
}
