//! Terms: the moves of the structure search.

use super::RULES;
use crate::model::{Delay, Model};
use crate::ring::Ring;
use model_core::effect::{Effect as _, Instant, Place, Setting, Spec};
use model_core::effects::{AnyEffect, LEVEL_RATE, PATH_TERMS, SLOW_WAKE, ZERO_OFFSET};
use model_core::recursion::Grading;

/// A term that can be added to a model.
#[derive(Clone, Debug)]
pub enum Term {
    /// y at this lag (samples), alone and multiplied by the arriving jet.
    Memory(u16),
    /// y at this lag, alone.
    State(u16),
    /// y at this lag, multiplied by the arriving jet.
    Product(u16),
    /// A second first-order lag in series, time constant in samples: a flow of second order.
    Inertia(f64),
    /// A level-dependent rate of the flow; part of the base model, not a missing effect.
    LevelRate,
    /// A slow wake with this time constant (inner seconds): a memory of the flow.
    Wake(f64),
    /// A base term in the jet path or the reading, with starting values.
    Path {
        /// Card of the term.
        spec: &'static Spec,
        /// Starting values of the parameters.
        parameters: Vec<f64>,
    },
    /// The offset of the sensor; part of the base model, not a missing effect.
    Offset,
    /// A physical effect, with starting values.
    Effect {
        /// Card of the term.
        spec: &'static Spec,
        /// Starting values of the parameters.
        parameters: Vec<f64>,
        /// The response of the flow to jets of part strength, if the effect causes them.
        grading: Grading,
        /// Reference value of the effect's channel.
        reference: Option<f64>,
    },
}

impl Term {
    /// The movable lags of `model`, as terms.
    fn lags_of(model: &Model) -> Vec<Self> {
        let mut lags = [&model.state_lags[..], &model.product_lags].concat();
        lags.sort_unstable();
        lags.dedup();
        lags.retain(|lag| *lag != NEWEST && *lag != BEFORE);
        let term = |lag: u16| {
            let (state, product) = (&model.state_lags, &model.product_lags);
            match (state.contains(&lag), product.contains(&lag)) {
                (true, true) => Self::Memory(lag),
                (true, false) => Self::State(lag),
                _ => Self::Product(lag),
            }
        };
        lags.into_iter().map(term).collect()
    }

    /// The terms that turn `lean` into `model`; `None` if they differ otherwise.
    pub(super) fn all_of(model: &Model, lean: &Model) -> Option<Vec<Self>> {
        let mut terms = Vec::new();
        if model.state_lags.contains(&BEFORE) {
            terms.push(Self::Inertia(0.0));
        }
        terms.extend(Self::lags_of(model));
        for added in &model.effects {
            match added.name.as_str() {
                name if name == LEVEL_RATE.name => terms.push(Self::LevelRate),
                name if name == SLOW_WAKE.name => terms.push(Self::Wake(added.parameters[0])),
                name if name == ZERO_OFFSET.name => terms.push(Self::Offset),
                name => {
                    let mut path = PATH_TERMS.into_iter();
                    terms.extend(path.find(|spec| spec.name == name).map(|spec| Self::Path {
                        spec,
                        parameters: added.parameters.clone(),
                    }));
                }
            }
        }
        let bare = terms
            .iter()
            .fold(model.clone(), |model, term| term.taken_from(&model, lean));
        let frame = |model: &Model| {
            let names: Vec<String> = model.effects.iter().map(|e| e.name.clone()).collect();
            let lags = (model.state_lags.clone(), model.product_lags.clone());
            (
                model.convention,
                model.averaging,
                model.b.len(),
                lags,
                names,
            )
        };
        (frame(&bare) == frame(lean)).then_some(terms)
    }

    /// The effect, if the term is one.
    #[must_use]
    pub fn effect(&self) -> Option<&'static Spec> {
        match self {
            Self::Effect { spec, .. } => Some(spec),
            _ => None,
        }
    }

    /// Whether the term is at a bound of its card's range in `model`: it is then a surrogate. Delay laws are exempt,
    /// because levels that y hardly visits leave their parameters undetermined.
    pub(super) fn is_at_a_bound(&self, model: &Model) -> bool {
        let (Self::Effect { spec, .. } | Self::Path { spec, .. }) = self else {
            return false;
        };
        let added = model.effects.iter().find(|added| added.name == spec.name);
        let values = added.map_or(&[][..], |added| &added.parameters);
        let of = |name: &str| {
            let index = spec.parameters.iter().position(|card| card.name == name)?;
            values.get(index)
        };
        values.iter().zip(spec.parameters).any(|(value, card)| {
            if card.below.and_then(of).is_some_and(|other| value >= other) {
                return true;
            }
            let place = |x: f64| if card.is_logarithmic() { x.ln() } else { x };
            let (low, high) = (place(card.low), place(card.high));
            let near = RULES.bound * (high - low);
            // A low end of 0 is not a bound, because an amplitude may be small.
            let low_end = card.is_logarithmic() || card.low != 0.0;
            let at_low = low_end && place(*value) < low + near;
            card.low < card.high && (place(*value) > high - near || at_low)
        })
    }

    /// The lag, if the term is a movable one.
    #[must_use]
    pub fn lag(&self) -> Option<u16> {
        match self {
            Self::Memory(lag) | Self::State(lag) | Self::Product(lag) => Some(*lag),
            _ => None,
        }
    }

    /// A term of this kind at another lag.
    #[must_use]
    pub fn with_lag(&self, lag: u16) -> Self {
        match self {
            Self::Memory(_) => Self::Memory(lag),
            Self::State(_) => Self::State(lag),
            Self::Product(_) => Self::Product(lag),
            other => other.clone(),
        }
    }

    /// This term with another response to jets of part strength.
    #[must_use]
    pub fn with_grading(&self, grading: Grading) -> Self {
        let mut other = self.clone();
        if let Self::Effect { grading: own, .. } = &mut other {
            *own = grading;
        }
        other
    }

    /// The effect, or term with a card, with other starting values.
    #[must_use]
    pub fn with_parameters(&self, values: Vec<f64>) -> Self {
        let mut other = self.clone();
        if let Self::Effect { parameters, .. } | Self::Path { parameters, .. } = &mut other {
            *parameters = values;
        }
        other
    }

    /// Penalty of the term: number of fitted parameters and searched lags.
    #[must_use]
    pub fn cost(&self) -> usize {
        match self {
            Self::Memory(_) => 3,
            Self::State(_)
            | Self::Product(_)
            | Self::Inertia(_)
            | Self::LevelRate
            | Self::Wake(_) => 2,
            Self::Offset => 1,
            Self::Effect { spec, .. } | Self::Path { spec, .. } => {
                spec.parameters.iter().filter(|p| p.low < p.high).count()
            }
        }
    }

    /// Where a term with a card acts.
    pub(super) fn place(&self) -> Option<Place> {
        match self {
            Self::Effect { spec, .. } | Self::Path { spec, .. } => Some(spec.place),
            _ => None,
        }
    }

    /// Name of the term in progress messages and tables.
    #[must_use]
    pub fn name(&self) -> String {
        match self {
            Self::Memory(lag) => format!("memory of {lag} samples"),
            Self::State(lag) => format!("lag of {lag} samples"),
            Self::Product(lag) => format!("lag of {lag} samples while the jet is on"),
            Self::Inertia(_) => "second order".to_owned(),
            Self::LevelRate => LEVEL_RATE.name.to_owned(),
            Self::Wake(_) => SLOW_WAKE.name.to_owned(),
            Self::Offset => ZERO_OFFSET.name.to_owned(),
            Self::Effect { spec, .. } | Self::Path { spec, .. } => spec.name.to_owned(),
        }
    }

    /// Key under which a term that was tried is remembered.
    #[must_use]
    pub fn key(&self) -> (String, Option<Grading>) {
        match self {
            Self::Effect { spec, grading, .. } => (spec.name.to_owned(), Some(*grading)),
            term => match term.lag() {
                // Lags converge within a few samples of their start, so that neighbours share a key.
                Some(lag) => (term.with_lag(lag / 12).name(), None),
                None => (term.name(), None),
            },
        }
    }

    /// The kind of term: its name without the lag.
    #[must_use]
    pub fn kind(&self) -> String {
        self.with_lag(0).name()
    }

    /// Whether two lists of terms lead to the same fitted model; neighbouring lags converge.
    #[must_use]
    pub(super) fn are_alike(one: &[Self], other: &[Self]) -> bool {
        let sorted = |terms: &[Self]| {
            let mut all: Vec<(String, u16)> = terms
                .iter()
                .map(|term| (term.kind(), term.lag().unwrap_or(0)))
                .collect();
            all.sort();
            all
        };
        let (one, other) = (sorted(one), sorted(other));
        one.len() == other.len()
            && one
                .iter()
                .zip(&other)
                .all(|(a, b)| a.0 == b.0 && usize::from(a.1.abs_diff(b.1)) <= RULES.lags_apart)
    }

    /// Whether two lists differ only in lags, time constants and starting values.
    #[must_use]
    pub(super) fn are_of_one_kind(one: &[Self], other: &[Self]) -> bool {
        let sorted = |terms: &[Self]| {
            let mut all: Vec<String> = terms.iter().map(Self::kind).collect();
            all.sort();
            all
        };
        sorted(one) == sorted(other)
    }

    fn reads_states(&self) -> bool {
        matches!(self, Self::Memory(_) | Self::State(_))
    }

    fn reads_products(&self) -> bool {
        matches!(self, Self::Memory(_) | Self::Product(_))
    }

    /// The model with the term added. New lags get these `coefficients`, one per column of the term and
    /// input; missing ones are 0.
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
                model.delay_later(-self.own_delay(parameters, model.sample_period_s));
            }
            Self::Offset => {
                let level = coefficients.first().copied().unwrap_or(0.0);
                model.add(ZERO_OFFSET, &[level], None);
            }
            Self::LevelRate => {
                let slope = |i: usize| {
                    let range = &LEVEL_RATE.parameters[i];
                    let slope = coefficients.get(i).copied().unwrap_or(0.0);
                    slope.clamp(range.low, range.high)
                };
                model.add(LEVEL_RATE, &[slope(0), slope(1)], None);
            }
            Self::Wake(time_constant) => {
                let pull = coefficients.first().copied().unwrap_or(0.0);
                let range = &SLOW_WAKE.parameters[1];
                let pull = pull.clamp(range.low, range.high);
                model.add(SLOW_WAKE, &[*time_constant, pull], None);
            }
            Self::Inertia(samples) => in_series(&mut model, *samples),
            Self::Path { spec, parameters } => {
                model.add(spec, parameters, None);
                model.delay_later(-self.own_delay(parameters, model.sample_period_s));
            }
            lags => {
                let Some(lag) = lags.lag() else {
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

    /// The part of the delay that belongs to the term with these parameters, samples.
    fn own_delay(&self, parameters: &[f64], period: f64) -> f64 {
        match self {
            Self::Path { spec, .. } => mean_delay(spec, parameters, period),
            Self::Effect { spec, .. } => dead_time(spec, parameters, period),
            _ => 0.0,
        }
    }

    /// The model without the term; a delay law is replaced by that of `base`.
    #[must_use]
    pub fn taken_from(&self, model: &Model, base: &Model) -> Model {
        let mut model = model.clone();
        match self {
            Self::Effect { spec, .. } if spec.place == Place::Delay => {
                take_delay_law(&mut model, &base.delay);
            }
            Self::Path { spec, .. } | Self::Effect { spec, .. } => {
                if let Some(at) = model.effects.iter().position(|e| e.name == spec.name) {
                    let added = model.effects.remove(at);
                    let own = self.own_delay(&added.parameters, model.sample_period_s);
                    model.delay_later(own);
                }
            }
            Self::Offset => model.effects.retain(|e| e.name != ZERO_OFFSET.name),
            Self::LevelRate => model.effects.retain(|e| e.name != LEVEL_RATE.name),
            Self::Wake(_) => model.effects.retain(|e| e.name != SLOW_WAKE.name),
            Self::Inertia(_) => out_of_series(&mut model),
            lags => {
                let of = |all: &[u16]| all.iter().position(|lag| Some(*lag) == lags.lag());
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

    /// An effect for `model`, with the first starting values of its card.
    pub(super) fn unfitted(spec: &'static Spec, model: &Model) -> Self {
        Self::Effect {
            spec,
            parameters: spec.parameters.iter().map(|p| p.starts[0]).collect(),
            grading: model.grading,
            reference: None,
        }
    }

    /// The term with the parameters and the reference that it has in `model`, as starting values.
    #[must_use]
    pub(super) fn as_in(&self, model: &Model) -> Self {
        match self {
            Self::Path { spec, .. } | Self::Effect { spec, .. } => {
                let added = model.effects.iter().find(|added| added.name == spec.name);
                let Some(added) = added else {
                    return self.clone();
                };
                let mut term = self.with_parameters(added.parameters.clone());
                if let Self::Effect { reference, .. } = &mut term {
                    *reference = added.reference.or(*reference);
                }
                term
            }
            Self::Inertia(_) => second_lag_s(model).map_or_else(
                || self.clone(),
                |seconds| Self::Inertia(seconds / model.sample_period_s),
            ),
            other => other.clone(),
        }
    }

    /// Indices of the coordinates of `model` that belong to the term.
    #[must_use]
    pub(super) fn coordinates_in(&self, model: &Model) -> Vec<usize> {
        let (lag, name) = match self {
            Self::Memory(lag) | Self::State(lag) | Self::Product(lag) => (*lag, ""),
            Self::Inertia(_) => (BEFORE, ""),
            Self::LevelRate => (0, LEVEL_RATE.name),
            Self::Wake(_) => (0, SLOW_WAKE.name),
            Self::Offset => (0, ZERO_OFFSET.name),
            Self::Path { spec, .. } | Self::Effect { spec, .. } => (0, spec.name),
        };
        if !name.is_empty() {
            let all = model.coordinates().into_iter().enumerate();
            let own = all.filter(|(_, own)| own.name.split('.').next() == Some(name));
            return own.map(|(index, _)| index).collect();
        }
        let at = |lags: &[u16]| lags.iter().position(|own| *own == lag);
        let (first, inputs, products) =
            (1 + model.a.len(), model.b.len(), model.product_lags.len());
        let state = at(&model.state_lags).map(|i| 1 + i);
        let product = at(&model.product_lags);
        let product = product
            .into_iter()
            .flat_map(|i| (0..inputs).map(move |input| first + inputs + input * products + i));
        state
            .filter(|_| self.reads_states() || matches!(self, Self::Inertia(_)))
            .into_iter()
            .chain(product.filter(|_| self.reads_products() || matches!(self, Self::Inertia(_))))
            .collect()
    }

    /// The model with this term's lag moved to `lag`; `None` if another term has that lag.
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

/// Mean delay of a step through a term in the jet path, samples.
fn mean_delay(spec: &Spec, parameters: &[f64], period: f64) -> f64 {
    let setting = Setting {
        period,
        channel: 0,
        reference: 1.0,
    };
    let Some(effect) = AnyEffect::<f64, Ring<f64>>::new(spec.name, parameters, &setting) else {
        return 0.0;
    };
    let step = Instant {
        command: 1.0,
        flow: 0.0,
        arrived: 0.0,
        present: 0.0,
        channels: &[],
    };
    let mut state = effect.start();
    let missing = (0..PATH_SETTLED).map(|_| 1.0 - effect.jet(&mut state, 1.0, &step));
    missing.sum()
}

/// The effect's own dead time, samples.
fn dead_time(spec: &Spec, parameters: &[f64], period: f64) -> f64 {
    let mut cards = spec.parameters.iter();
    let at = spec
        .dead_time
        .and_then(|name| cards.position(|card| card.name == name));
    let seconds = at.and_then(|at| parameters.get(at)).copied().unwrap_or(0.0);
    seconds / period
}

/// Samples after which a step response has settled.
const PATH_SETTLED: usize = 4000;

/// Gives a model the delay law of another one, shifted to the mean of its own law, because the other law was fitted
/// with different terms.
pub(super) fn take_delay_law(model: &mut Model, law: &Delay) {
    let level = |delay: &Delay| delay.present(RULES.middle, model.sample_period_s);
    let later = level(&model.delay) - level(law);
    model.delay = law.for_inputs_of(&model.delay);
    model.delay_later(later);
}

/// The lag of one sample.
const NEWEST: u16 = 1;
const BEFORE: u16 = 2;

/// Adds a first-order lag of this many samples in series with the flow and shortens the delay accordingly.
///
/// With z the present flow and y_k = (1 − α) y_{k−1} + α z_k, the terms of the newest lag become exactly
/// those of two lags; slow memories are scaled by α.
fn in_series(model: &mut Model, samples: f64) {
    let keep = (-1.0 / samples).exp();
    let newest = |lags: &[u16]| lags.iter().position(|lag| *lag == NEWEST);
    let Some(first) = newest(&model.state_lags).filter(|_| !model.state_lags.contains(&BEFORE))
    else {
        return;
    };
    let scale = 1.0 - keep;
    let slow = model.a[first];
    model.a.iter_mut().for_each(|a| *a *= scale);
    model.a[first] = slow + keep;
    model.state_lags.push(BEFORE);
    model.a.push(-slow * keep);
    model.b.iter_mut().for_each(|b| *b *= scale);
    let count = model.product_lags.len();
    if let Some(first) = newest(&model.product_lags) {
        let columns = (0..model.b.len()).flat_map(|l| {
            let own = model.c[l * count..(l + 1) * count].iter().enumerate();
            let c = model.c[l * count + first];
            let scaled = own.map(|(i, c)| if i == first { *c } else { c * scale });
            scaled.chain([-c * keep]).collect::<Vec<f64>>()
        });
        model.c = columns.collect();
        model.product_lags.push(BEFORE);
    } else {
        model.c.iter_mut().for_each(|c| *c *= scale);
    }
    model.delay_later(-samples);
}

/// Indices of lags 1 and 2 among the lags of y, and the pole of the faster of the two first-order lags; none
/// for a model of first order.
fn faster(model: &Model) -> Option<(usize, usize, f64)> {
    let at = |lag: u16| model.state_lags.iter().position(|l| *l == lag);
    let (first, second) = (at(NEWEST)?, at(BEFORE)?);
    let (sum, product) = (model.a[first], -model.a[second]);
    // The larger root of λ² − sum·λ + product, or the modulus of complex roots.
    let spread = sum * sum / 4.0 - product;
    let keep = if spread >= 0.0 {
        sum / 2.0 - spread.sqrt()
    } else {
        product.max(0.0).sqrt()
    };
    Some((first, second, keep.clamp(0.0, 0.99)))
}

/// Time constant of the faster of the two lags of a second-order flow, s; none for a model of first order.
pub(crate) fn second_lag_s(model: &Model) -> Option<f64> {
    let (.., keep) = faster(model)?;
    (keep > 0.0).then(|| -model.sample_period_s / keep.ln())
}

/// Removes the faster lag of a second-order flow and adds its delay to that of the command.
fn out_of_series(model: &mut Model) {
    let Some((first, second, keep)) = faster(model) else {
        return;
    };
    let (sum, product) = (model.a[first], -model.a[second]);
    let at = |lags: &[u16], lag: u16| lags.iter().position(|l| *l == lag);
    let scale = 1.0 - keep;
    model.a.iter_mut().for_each(|a| *a /= scale);
    model.a[first] = 1.0 - (1.0 - sum + product) / scale;
    model.state_lags.remove(second);
    model.a.remove(second);
    model.b.iter_mut().for_each(|b| *b /= scale);
    let count = model.product_lags.len();
    if let (Some(first), Some(second)) = (
        at(&model.product_lags, NEWEST),
        at(&model.product_lags, BEFORE),
    ) {
        let columns = (0..model.b.len()).flat_map(|l| {
            let mut own: Vec<f64> = model.c[l * count..(l + 1) * count].to_vec();
            own[first] += own[second];
            own.iter_mut().for_each(|c| *c /= scale);
            own.remove(second);
            own
        });
        model.c = columns.collect();
        model.product_lags.remove(second);
    } else {
        model.c.iter_mut().for_each(|c| *c /= scale);
    }
    if keep > 0.0 {
        model.delay_later(-1.0 / keep.ln());
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::user_effect::Definition;

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
            Term::LevelRate,
            Term::Wake(0.3),
            Term::Offset,
        ] {
            let with = term.added_to(&model, &[0.01, -0.02]);
            assert_ne!(with, model, "{term:?}");
            assert_eq!(with.coordinates().len(), with.values().len());
            assert_eq!(term.taken_from(&with, &model), model, "{term:?}");
        }
    }

    #[test]
    fn lists_with_lags_that_settle_are_alike() {
        let one = [Term::Memory(200), Term::Product(60), Term::Offset];
        assert!(Term::are_alike(
            &one,
            &[Term::Offset, Term::Memory(212), Term::Product(55)]
        ));
        for other in [
            vec![Term::Memory(200), Term::Product(60)],
            vec![Term::Memory(200), Term::Product(90), Term::Offset],
            vec![Term::State(200), Term::Product(60), Term::Offset],
        ] {
            assert!(!Term::are_alike(&one, &other), "{other:?}");
        }
    }

    /// The input delay is shortened by the mean delay of the term and restored when it is removed.
    #[test]
    fn a_term_in_the_path_of_the_jets_takes_its_mean_from_the_delay() {
        let mut model = base();
        model.delay = Delay::Fixed {
            delays: vec![80, 80],
        };
        for (spec, parameters, mean) in [
            (PATH_TERMS[0], vec![0.020], 0.020 * 3.0_f64.sqrt()),
            (PATH_TERMS[1], vec![0.5, 0.020], 1.5 * 0.020),
        ] {
            let term = Term::Path {
                spec,
                parameters: parameters.clone(),
            };
            let period = model.sample_period_s;
            let own = mean_delay(spec, &parameters, period) * period;
            assert!((own - mean).abs() < 3.0 * period, "{}: {own}", spec.name);
            let with = term.added_to(&model, &[]);
            let Delay::Fixed { delays } = &with.delay else {
                panic!("still fixed");
            };
            assert!((80.0 - f64::from(delays[0]) - own / period).abs() <= 0.5);
            let found = Term::all_of(&with, &model).unwrap();
            assert_eq!(found[0].name(), spec.name);
            let without = term.taken_from(&with, &model);
            assert_eq!(without, model);
        }
    }

    /// An effect with a dead time takes it from the model's own.
    #[test]
    fn the_dead_time_of_an_effect_is_part_of_the_delay() {
        let own = Definition::from_toml(
            r#"name = "carried"
place = "jet"
summary = "a part of the dead time"
dead_time = "transit"
expression = "delayed(jet, transit)"
[[parameter]]
name = "transit"
unit = "s"
low = 0.001
high = 0.5
starts = [0.05]
"#,
            "carried",
        )
        .unwrap();
        let mut model = base();
        model.delay = Delay::Fixed {
            delays: vec![80, 80],
        };
        model.define(own).unwrap();
        let term = Term::Effect {
            spec: own.spec(),
            parameters: vec![0.030],
            grading: model.grading,
            reference: None,
        };
        let with = term.added_to(&model, &[]);
        let samples = (0.030 / model.sample_period_s).round() as u16;
        let shorter = Delay::Fixed {
            delays: vec![80 - samples; 2],
        };
        assert_eq!(with.delay, shorter);
        assert_eq!(term.taken_from(&with, &model).delay, model.delay);
    }

    /// Adding a lag to a first-order flow and removing it again restores the model.
    #[test]
    fn a_lag_in_series_is_found_again() {
        let mut model = base();
        model.delay = Delay::Fixed {
            delays: vec![40, 40],
        };
        let with = Term::Inertia(8.0).added_to(&model, &[]);
        assert_eq!((with.state_lags.len(), with.product_lags.len()), (2, 2));
        assert_eq!(
            with.delay,
            Delay::Fixed {
                delays: vec![32, 32]
            }
        );
        let again = Term::Inertia(8.0).taken_from(&with, &model);
        let close = |a: &[f64], b: &[f64]| {
            a.len() == b.len() && a.iter().zip(b).all(|(a, b)| (a - b).abs() < 1e-9)
        };
        assert!(close(&again.a, &model.a), "{:?}", again.a);
        assert!(close(&again.b, &model.b), "{:?}", again.b);
        assert!(close(&again.c, &model.c), "{:?}", again.c);
        assert_eq!(again.delay, model.delay);
    }

    #[test]
    fn a_model_is_taken_apart_into_the_terms_that_made_it() {
        let lean = base();
        let terms = [
            Term::Inertia(8.0),
            Term::Memory(200),
            Term::State(230),
            Term::Product(260),
            Term::LevelRate,
            Term::Offset,
        ];
        let model = terms
            .iter()
            .fold(lean.clone(), |m, term| term.added_to(&m, &[0.01]));
        let found = Term::all_of(&model, &lean).unwrap();
        let names = |terms: &[Term]| terms.iter().map(Term::name).collect::<Vec<_>>();
        assert_eq!(names(&found), names(&terms));
        let other = Model {
            product_lags: vec![3],
            ..lean.clone()
        };
        assert!(Term::all_of(&other, &lean).is_none());
    }

    /// A first-order flow followed by a lag of 8 samples equals the second-order recursion sample by sample.
    #[test]
    fn a_lag_in_series_is_a_second_order() {
        let model = Model {
            a: vec![0.9],
            b: vec![0.1],
            c: vec![-0.05],
            delay: Delay::Fixed { delays: vec![20] },
            ..Model::default()
        };
        let u: Vec<f64> = (0..400)
            .map(|k| f64::from(u8::from(k % 100 < 50)))
            .collect();
        let record =
            crate::data::Record::new("r", crate::data::Use::Identify, 0.001, u, vec![1.0; 400]);
        let mut later = Term::Inertia(8.0).added_to(&model, &[]);
        later.delay_later(8.0);
        let (flow, film) = (
            model.free_run(&record).unwrap(),
            later.free_run(&record).unwrap(),
        );
        let keep = (-1.0_f64 / 8.0).exp();
        let mut y = 0.0;
        for (z, film) in flow.iter().zip(&film) {
            y = keep * y + (1.0 - keep) * z;
            assert!((y - film).abs() < 1e-9, "{y} {film}");
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

    #[test]
    fn the_second_lag_of_a_flow_is_the_one_that_was_put_in_series() {
        let mut model = base();
        assert_eq!(second_lag_s(&model), None);
        in_series(&mut model, 6.0);
        let second = second_lag_s(&model).expect("a second order");
        assert!(
            (second - 6.0 * model.sample_period_s).abs() < 1e-9,
            "{second}"
        );
    }
}
