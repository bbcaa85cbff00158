//! Conversion between the user's units and the search's inner units.
//!
//! Cards are written for y of order 1, u up to 1 and a sample period of 1 ms. Records are scaled to that
//! before anything is fitted, and the final model is scaled back: names stay, parameters change with their
//! units.

use super::RULES;
use crate::data::Record;
use crate::fit::RULES as FIT;
use crate::model::{Added, CommandRange, Delay, Model, Start};
use crate::preparation::Preparation;
use model_core::effect::{Place, Spec, Unit};
use model_core::effects::ZERO_OFFSET;

/// The sample period that cards are written for, s.
const PERIOD_S: f64 = 0.001;

/// The inner units, expressed in the user's units.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Units {
    /// Sensor reading that corresponds to y = 0 in inner units.
    pub zero: f64,
    /// Inner unit of y.
    pub y: f64,
    /// The commands that correspond to 0 (no jet) and 1 (full jet) in inner units.
    pub command: CommandRange,
    /// Inner unit of time.
    pub time: f64,
}

impl Units {
    /// Identity.
    pub const NONE: Self = Self {
        zero: 0.0,
        y: 1.0,
        command: CommandRange::UNIT,
        time: 1.0,
    };

    /// The units of prepared records for a search that starts from `model`. Effects of the user that do not
    /// scale are written in the user's units, which are then kept.
    #[must_use]
    pub fn of(model: &Model, prepared: &Preparation) -> Self {
        // If the model has effects on the jet, its definition of a full jet is kept, because these
        // effects are written for it.
        let command = if model.command.is_unit() && !has_jet_effects(model) {
            prepared.command
        } else {
            model.command
        };
        if !model.definitions.iter().all(|own| own.scales()) {
            return Self {
                command: model.command,
                ..Self::NONE
            };
        }
        let zero = prepared.zero;
        let records = &prepared.records;
        let mut sizes: Vec<f64> = records
            .iter()
            .flat_map(|r| r.y.iter().map(|y| (y - zero).abs()))
            .filter(|size| size.is_finite())
            .collect();
        sizes.sort_by(f64::total_cmp);
        let full = sizes
            .get((RULES.full * sizes.len() as f64) as usize)
            .copied();
        let or_one = |x: f64| if x > 0.0 && x.is_finite() { x } else { 1.0 };
        Self {
            zero,
            y: or_one(full.unwrap_or(1.0)),
            command,
            time: or_one(model.sample_period_s / PERIOD_S),
        }
    }

    /// Records in inner units.
    #[must_use]
    pub fn records_in(&self, records: &[Record]) -> Vec<Record> {
        records.iter().map(|r| self.record_in(r)).collect()
    }

    /// A record in inner units.
    #[must_use]
    pub fn record_in(&self, record: &Record) -> Record {
        let y = |series: &[f64]| series.iter().map(|y| (y - self.zero) / self.y).collect();
        let u = |u: &f64| self.command.share(*u);
        Record {
            sample_period_s: record.sample_period_s / self.time,
            t0: record.t0 / self.time,
            u: record.u.iter().map(u).collect(),
            u_before: record.u_before.as_ref().map(u),
            y: y(&record.y),
            followed: y(&record.followed),
            y_before: record.y_before.map(|y| (y - self.zero) / self.y),
            y_sd: record
                .y_sd
                .as_ref()
                .map(|sd| sd.iter().map(|sd| sd / self.y).collect()),
            y_min: record.y_min.as_deref().map(y),
            y_max: record.y_max.as_deref().map(y),
            ..record.clone()
        }
    }

    fn scaled(&self, spec: &Spec, values: &[f64], inward: bool) -> Vec<f64> {
        let pairs = spec.parameters.iter().zip(values);
        pairs
            .map(|(parameter, value)| {
                let scale = parameter.unit.scale(self.y, self.time, 1.0);
                if inward { value / scale } else { value * scale }
            })
            .collect()
    }

    /// A model with everything but its offset scaled.
    fn scale(&self, model: &Model, inward: bool) -> Model {
        let by = |x: f64| if inward { 1.0 / x } else { x };
        let (y, time) = (by(self.y), by(self.time));
        let mut model = model.clone();
        model.sample_period_s *= time;
        model.constant *= y;
        model.b.iter_mut().for_each(|b| *b *= y);
        if let Delay::Law(law) = &mut model.delay {
            law.parameters = self.scaled(law.spec, &law.parameters, inward);
        }
        for i in 0..model.effects.len() {
            if let Some(spec) = model.spec(&model.effects[i].name) {
                let added = &mut model.effects[i];
                added.parameters = self.scaled(spec, &added.parameters, inward);
                if spec.calibrated {
                    // A reference that equals the card's is not written.
                    let reference = added.reference() * y;
                    added.reference = Some(reference).filter(|r| (r - 1.0).abs() > 1e-9);
                }
            }
        }
        model
    }

    /// A model in inner units, its sensor's offset included.
    #[must_use]
    pub fn model_in(&self, model: &Model) -> Model {
        let mut model = self.scale(&self.commanded_in(model), true);
        // If y is of order one, it is friction, and the calibration of the card holds; otherwise the calibration is the
        // size of y.
        let of_order_one = (FIT.order_one_low..FIT.order_one_high).contains(&self.y);
        model.calibrated_at = of_order_one.then(|| 1.0 / self.y);
        self.move_zero(&mut model, -self.zero / self.y);
        model
    }

    /// A model in the user's units.
    #[must_use]
    pub fn model_out(&self, model: &Model) -> Model {
        let mut model = self.scale(model, false);
        model.command = self.command;
        model.calibrated_at = None;
        self.move_zero(&mut model, self.zero);
        model
    }

    /// A model whose commands are fractions of a full jet: scale and offset of other commands are moved into the
    /// coefficients.
    fn commanded_in(&self, model: &Model) -> Model {
        let mut inner = model.clone();
        inner.command = CommandRange::UNIT;
        if model.command == self.command {
            return inner;
        }
        // u = off + size·share, where u is a fraction of the model's own full jet.
        let off = model.command.share(self.command.off);
        let size = model.command.share(self.command.full) - off;
        let count = model.product_lags.len();
        for (l, b) in model.b.iter().enumerate() {
            inner.constant += off * b;
            inner.b[l] = size * b;
            for (j, lag) in model.product_lags.iter().enumerate() {
                let c = model.c[l * count + j];
                inner.c[l * count + j] = size * c;
                if off != 0.0 {
                    match inner.state_lags.iter().position(|own| own == lag) {
                        Some(own) => inner.a[own] += off * c,
                        None => {
                            inner.state_lags.push(*lag);
                            inner.a.push(off * c);
                        }
                    }
                }
            }
        }
        inner
    }

    /// A parameter's value in the user's units.
    #[must_use]
    pub fn value_out(&self, unit: Unit, value: f64) -> f64 {
        self.zero_in(unit) + value * unit.scale(self.y, self.time, 1.0)
    }

    /// A parameter's value in inner units.
    #[must_use]
    pub(crate) fn value_in(&self, unit: Unit, value: f64) -> f64 {
        (value - self.zero_in(unit)) / unit.scale(self.y, self.time, 1.0)
    }

    /// What a value in this unit is if it is 0 in inner units.
    fn zero_in(&self, unit: Unit) -> f64 {
        if unit == Unit::Reading {
            self.zero
        } else {
            0.0
        }
    }

    /// Adds `by` to the offset of a model's readings.
    fn move_zero(&self, model: &mut Model, by: f64) {
        if by == 0.0 {
            return;
        }
        if model.start == Start::Measured && model.effects.is_empty() {
            // The recursion works on the sensor's reading, so its constant takes up the shift.
            let kept: f64 = 1.0 - model.a.iter().sum::<f64>();
            model.constant += by * kept;
            let count = model.product_lags.len();
            for (l, b) in model.b.iter_mut().enumerate() {
                let column = model.c.iter().skip(l * count).take(count);
                *b -= by * column.sum::<f64>();
            }
            return;
        }
        let is_zero = |added: &Added| added.name == ZERO_OFFSET.name;
        let zero = match model.effects.iter().position(is_zero) {
            Some(zero) => {
                let offset = &mut model.effects[zero].parameters;
                offset.iter_mut().for_each(|level| *level += by);
                zero
            }
            None => {
                model.add(ZERO_OFFSET, &[by], None);
                model.effects.iter().position(is_zero).unwrap_or(0)
            }
        };
        // The sensor's later effects act on the reading.
        for later in zero + 1..model.effects.len() {
            let card = model.spec(&model.effects[later].name);
            let parameters = card.map_or(&[][..], |card| card.parameters);
            for (parameter, value) in parameters.iter().zip(&mut model.effects[later].parameters) {
                if parameter.unit == Unit::Reading {
                    *value += by;
                }
            }
        }
    }
}

/// `model` with 0 as its level at rest and a sensor offset in its place, which changes no reading. A model that starts in
/// mid-run has the offset in its constant, and a loop that starts with a history of 0 would begin far from rest. Models
/// with effects, or with a delay that depends on y, are not changed: their levels have a meaning.
#[must_use]
pub(crate) fn resting_at_zero(model: &Model) -> Model {
    let mut resting = model.clone();
    let kept = 1.0 - model.a.iter().sum::<f64>();
    let movable = model.start == Start::Measured
        && model.effects.is_empty()
        && !model.delay.follows_y()
        && kept > 0.0;
    let level = model.constant / kept;
    if movable && level.is_finite() && level != 0.0 {
        Units::NONE.move_zero(&mut resting, -level);
        resting.add(ZERO_OFFSET, &[level], None);
    }
    resting
}

/// Whether a model has effects on the jet.
fn has_jet_effects(model: &Model) -> bool {
    let place = |name: &str| model.spec(name).map(|spec| spec.place);
    let mut own = model.effects.iter();
    own.any(|added| place(&added.name) == Some(Place::Jet))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::data::Use;
    use model_core::effects::{StateDependentDelay, spec};

    fn record(a: f64, b: f64, c: f64) -> Record {
        let u: Vec<f64> = (0..4000)
            .map(|k| f64::from(u8::from(k > 600 && k / 300 % 2 == 1)))
            .collect();
        let mut s = 0.0;
        let y = u
            .iter()
            .map(|u| {
                s += 0.02 * (u - s);
                a * s + b
            })
            .collect();
        Record::new("r", Use::Identify, c * 0.001, u, y)
    }

    /// A model of records in mid-run rests at 21 degrees; moved, it rests at 0 with this offset and reads the same.
    #[test]
    fn a_model_in_mid_run_rests_at_zero_without_other_readings() {
        let mut warm = Model {
            start: Start::Measured,
            constant: 21.0 * 0.03,
            a: vec![0.97],
            b: vec![1.2],
            product_lags: vec![1],
            c: vec![-0.004],
            ..Model::default()
        };
        let resting = resting_at_zero(&warm);
        assert!(resting.constant.abs() < 1e-12);
        let zero = resting.zero_among(&resting.values());
        assert!((zero - 21.0).abs() < 1e-12, "{zero}");
        let (mut read, mut moved) = (40.0_f64, 40.0 - zero);
        for k in 0..500 {
            let u = f64::from(u8::from(k / 60 % 2 == 1));
            let step = |m: &Model, y: f64| m.constant + m.a[0] * y + (m.b[0] + m.c[0] * y) * u;
            (read, moved) = (step(&warm, read), step(&resting, moved));
            assert!((read - moved - zero).abs() < 1e-9, "{k}");
        }
        // Levels that have a meaning are not moved.
        warm.add(
            spec("hot-film-lag").expect("in the catalogue"),
            &[20.0],
            None,
        );
        assert_eq!(resting_at_zero(&warm), warm);
    }

    /// Records in different user units are equal in inner units.
    #[test]
    fn records_look_alike_from_within() {
        let seen = |a: f64, b: f64, c: f64| {
            let record = record(a, b, c);
            let model = Model {
                sample_period_s: record.sample_period_s,
                ..Model::default()
            };
            let units = Units::of(&model, &Preparation::of(std::slice::from_ref(&record)));
            units.record_in(&record)
        };
        let plain = seen(1.0, 0.0, 1.0);
        for (a, b, c) in [(50.0, 0.0, 1.0), (0.02, 3.0, 1.0), (1.0, -7.0, 20.0)] {
            let other = seen(a, b, c);
            assert!((other.sample_period_s - plain.sample_period_s).abs() < 1e-12);
            let apart = other.y.iter().zip(&plain.y).map(|(x, y)| (x - y).abs());
            assert!(apart.fold(0.0, f64::max) < 1e-9, "{a} {b} {c}");
        }
    }

    /// A model for commands in volts gives the same run in inner units.
    #[test]
    fn commands_in_other_units_go_into_the_coefficients() {
        let mut record = record(1.0, 0.0, 1.0);
        record.u.iter_mut().for_each(|u| *u = 5.0 - 3.0 * *u);
        let model = Model {
            a: vec![0.98],
            b: vec![0.01],
            c: vec![-0.002],
            constant: -0.02,
            start: Start::Measured,
            ..Model::default()
        };
        let units = Units::of(&model, &Preparation::of(std::slice::from_ref(&record)));
        assert_eq!((units.command.off, units.command.full), (5.0, 2.0));
        let inner = units.model_in(&model);
        let inside = inner.free_run(&units.record_in(&record)).unwrap();
        for outer in [&model, &units.model_out(&inner)] {
            let outside = outer.free_run(&record).unwrap();
            for (outside, inside) in outside.iter().zip(&inside) {
                assert!((outside - units.zero - units.y * inside).abs() < 1e-9);
            }
        }
    }

    /// A film's calibration is the card's if y is friction, and scales with y in other units.
    #[test]
    fn king_s_law_keeps_what_it_was_calibrated_at() {
        let film = spec("hot-film-nonlinearity").unwrap();
        let added = |full: f64| {
            let record = record(full, 0.0, 1.0);
            let units = Units::of(
                &Model::default(),
                &Preparation::of(std::slice::from_ref(&record)),
            );
            let mut inner = units.model_in(&Model::default());
            inner.b = vec![0.02];
            inner.a = vec![0.98];
            inner.add(film, &[3.0, 0.1], None);
            let outer = units.model_out(&inner);
            let text = outer.to_toml();
            assert_eq!(Model::from_toml(&text, "m").expect("own file"), outer);
            outer.effects[0].reference
        };
        assert_eq!(added(1.3), None);
        let volts = added(5.0).expect("not the card's");
        assert!((volts - 5.0).abs() < 0.1, "{volts}");
    }

    /// Scaling a model to inner units and back leaves its run unchanged.
    #[test]
    fn models_survive_the_way_in_and_out() {
        let record = record(40.0, 12.0, 20.0);
        let mut model = Model {
            sample_period_s: record.sample_period_s,
            a: vec![0.98],
            b: vec![0.9],
            c: vec![-0.002],
            delay: Delay::of::<StateDependentDelay<f64>>(&[20.0, 8.0, 0.1], vec![1.0], true),
            ..Model::default()
        };
        model.add(spec("hot-film-lag").unwrap(), &[0.3], None);
        model.add(spec("amplitude-saturation").unwrap(), &[1e-5], None);
        model.add(spec("hot-film-nonlinearity").unwrap(), &[3.0, 0.1], None);
        model.add(ZERO_OFFSET, &[12.0], None);
        // Below the highest reading, which contains the offset.
        model.add(spec("sensor-saturation").unwrap(), &[0.0, 45.0], None);
        assert!(record.y.iter().any(|y| *y > 46.0));
        let units = Units::of(&model, &Preparation::of(std::slice::from_ref(&record)));
        let inner = units.model_in(&model);
        let limit = units.value_out(Unit::Reading, inner.effects.last().unwrap().parameters[1]);
        assert!((limit - 45.0).abs() < 1e-9);
        let run = model.free_run(&record).unwrap();
        let inside = inner.free_run(&units.record_in(&record)).unwrap();
        for (outer, inner) in run.iter().zip(&inside) {
            assert!((outer - (units.zero + units.y * inner)).abs() < 1e-6);
        }
        let back = units.model_out(&inner).free_run(&record).unwrap();
        for (one, other) in run.iter().zip(&back) {
            assert!((one - other).abs() < 1e-9);
        }
    }

    /// An effect found in inner units on a model that starts from measurements runs in the user's units; the
    /// offset becomes the sensor's.
    #[test]
    fn effects_that_were_found_inside_run_outside_as_they_do_there() {
        let record = record(40.0, 300.0, 20.0);
        let inner = record.y.len() / 2..;
        let record = Record {
            u: record.u[inner.clone()].to_vec(),
            y: record.y[inner].to_vec(),
            ..record
        };
        let model = Model {
            sample_period_s: record.sample_period_s,
            start: Start::Measured,
            ..Model::default()
        };
        let units = Units::of(&model, &Preparation::of(std::slice::from_ref(&record)));
        assert!(units.zero > 0.0);
        let mut found = Model {
            a: vec![0.98],
            b: vec![0.02],
            c: vec![-0.002],
            delay: Delay::of::<StateDependentDelay<f64>>(&[20.0, 8.0, 0.1], vec![1.0], true),
            ..units.model_in(&model)
        };
        found.constant = 0.001;
        found.effects.clear();
        found.add(spec("amplitude-saturation").unwrap(), &[0.01], None);
        let inside = found.free_run(&units.record_in(&record)).unwrap();
        let outside = units.model_out(&found).free_run(&record).unwrap();
        for (outer, inner) in outside.iter().zip(&inside) {
            assert!((outer - (units.zero + units.y * inner)).abs() < 1e-6);
        }
    }
}
