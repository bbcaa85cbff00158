//! A model's parameters as one vector, for optimisation and differentiation.

use super::{Added, Delay, Model};
use model_core::Real;
use model_core::effect::{Influence, Parameter};
use model_core::effects::ZERO_OFFSET;

/// Kind of a coordinate of the parameter vector.
#[derive(Clone, Debug, PartialEq)]
pub enum Kind {
    /// d, a_i, b_l or c_jl, which are linear in the recursion.
    Linear,
    /// A parameter of the delay law.
    Delay(Parameter),
    /// A parameter of the effect with this index in [`Model::effects`].
    Effect(usize, Parameter),
}

/// One coordinate of the parameter vector.
#[derive(Clone, Debug, PartialEq)]
pub struct Coordinate {
    /// Readable name: `a1`, `c21`, `valve-lag.opening_time`.
    pub name: String,
    /// Kind of the coordinate.
    pub kind: Kind,
}

impl Coordinate {
    /// The catalogue's entry, for parameters of delay laws and effects.
    #[must_use]
    pub fn parameter(&self) -> Option<&Parameter> {
        match &self.kind {
            Kind::Linear => None,
            Kind::Delay(parameter) | Kind::Effect(_, parameter) => Some(parameter),
        }
    }

    /// Whether the free run is differentiable with respect to the coordinate.
    #[must_use]
    pub fn is_smooth(&self) -> bool {
        self.parameter()
            .is_none_or(|parameter| parameter.influence == Influence::Smooth)
    }
}

impl Model {
    fn parameters_of(&self, name: &str) -> &'static [Parameter] {
        self.spec(name).map_or(&[], |spec| spec.parameters)
    }

    /// The coordinates of the parameter vector: d, a, b, c (by columns), the delay law's, then each effect's.
    #[must_use]
    pub fn coordinates(&self) -> Vec<Coordinate> {
        let linear = |name: String| Coordinate {
            name,
            kind: Kind::Linear,
        };
        let mut all = vec![linear("d".to_owned())];
        all.extend((1..=self.a.len()).map(|i| linear(format!("a{i}"))));
        all.extend((1..=self.b.len()).map(|l| linear(format!("b{l}"))));
        let lags = self.product_lags.len();
        all.extend((0..self.c.len()).map(|i| linear(format!("c{}{}", i % lags + 1, i / lags + 1))));
        if let Delay::Law(law) = &self.delay {
            all.extend(law.spec.parameters.iter().map(|parameter| Coordinate {
                name: format!("{}.{}", law.spec.name, parameter.name),
                kind: Kind::Delay(*parameter),
            }));
        }
        for (index, added) in self.effects.iter().enumerate() {
            let parameters = self.parameters_of(&added.name);
            all.extend(parameters.iter().map(|parameter| Coordinate {
                name: format!("{}.{}", added.name, parameter.name),
                kind: Kind::Effect(index, *parameter),
            }));
        }
        all
    }

    /// Number of parameters as a report states it: those of [`values`](Self::values) that are not 0.
    #[must_use]
    pub fn parameter_count(&self) -> usize {
        self.values().iter().filter(|value| **value != 0.0).count()
    }

    /// The parameter vector, in the order of [`coordinates`](Self::coordinates).
    #[must_use]
    pub fn values(&self) -> Vec<f64> {
        let mut values = vec![self.constant];
        values.extend(&self.a);
        values.extend(&self.b);
        values.extend(&self.c);
        if let Delay::Law(law) = &self.delay {
            values.extend(&law.parameters);
        }
        values.extend(self.effects.iter().flat_map(|added| &added.parameters));
        values
    }

    /// The sensor's offset, in units of y, within a parameter vector in the order of
    /// [`coordinates`](Self::coordinates); 0 for a model without an offset.
    #[must_use]
    pub fn zero_among<T: Real>(&self, values: &[T]) -> T {
        let Some(own) = self.effects.iter().position(|e| e.name == ZERO_OFFSET.name) else {
            return T::ZERO;
        };
        let from = self.effects[own..].iter().map(|e| e.parameters.len());
        let index = values.len().checked_sub(from.sum());
        let value = index.and_then(|index| values.get(index));
        value.copied().unwrap_or(T::ZERO)
    }

    /// The model with another parameter vector; parameters without a new value stay.
    #[must_use]
    pub fn with_values(&self, values: &[f64]) -> Self {
        let mut model = self.clone();
        let mut rest = values.iter().copied();
        let mut set = |slot: &mut f64| {
            if let Some(value) = rest.next() {
                *slot = value;
            }
        };
        set(&mut model.constant);
        model.a.iter_mut().for_each(&mut set);
        model.b.iter_mut().for_each(&mut set);
        model.c.iter_mut().for_each(&mut set);
        if let Delay::Law(law) = &mut model.delay {
            law.parameters.iter_mut().for_each(&mut set);
        }
        let parameters = |added: &mut Added| added.parameters.iter_mut().for_each(&mut set);
        model.effects.iter_mut().for_each(parameters);
        model
    }
}
