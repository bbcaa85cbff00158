//! Which curves are worth a refit: every way to enter a place by every coordinate,
//! to first order, beside everything that the base can do.

use super::RULES;
use super::coordinate::{Coordinate, coordinates, remembered};
use super::place::{Entry, Place};
use super::term::{Shape, Term};
use crate::data::Record;
use crate::model::Model;
use crate::terms::{Screen, Search, Tangent};
use crate::user_effect::Definition;
use model_core::effects::ZERO_OFFSET;
use rayon::prelude::*;

/// A curve that was screened.
pub(super) struct Screened {
    /// With the values that the screening promises.
    pub(super) term: Term,
    /// Half the logarithm of what it leaves of the held-out mean square error, and the
    /// price of its points: below 0 is worth it.
    pub(super) score: f64,
    /// Share of the held-out error energy that it takes.
    pub(super) held_out: f64,
    /// Size of a change, rms of its values, that would have been worth it.
    pub(super) smallest: f64,
}

/// The command is on above this, inner units.
pub(super) const ON: f64 = 0.5;
/// Times of coordinates are multiples of the flow's, which is taken within these bounds, s at 1 kHz.
const FASTEST_S: f64 = 0.005;
const SLOWEST_S: f64 = 0.2;
/// A time that was found is looked for again at so many times it.
const NEARBY: [f64; 6] = [0.5, 0.63, 0.79, 1.26, 1.59, 2.0];
/// Times of the first look lie two to three apart; a closer one looks at these times them too.
const BETWEEN: [f64; 2] = [0.63, 1.59];
/// Samples that show where a coordinate spends its time.
const SHOWN: usize = 20_000;

/// The values of a coordinate over the records, as a model sees them; `None` if it
/// cannot be had there.
fn values_of(coordinate: &Coordinate, model: &Model, records: &[&Record]) -> Option<Vec<Vec<f64>>> {
    let mut probe = model.clone();
    // It comes after the probe and would be added to it.
    probe.effects.retain(|added| added.name != ZERO_OFFSET.name);
    let mut text = format!(
        "name = \"probe-of-a-coordinate\"\nplace = \"sensor\"\nsummary = \"a coordinate\"\nexpression = \"{}\"\n",
        coordinate.expression()
    );
    if let Some(channel) = coordinate.channel() {
        text += &format!("channel = \"{channel}\"\n");
    }
    for state in coordinate.states(ON, 1.0, false) {
        text += &format!(
            "[[state]]\nname = \"{}\"\nstart = {:?}\nupdate = \"{}\"\n",
            state.name, state.start, state.update
        );
    }
    let definition = Definition::from_toml(&text, "a coordinate").ok()?;
    probe.define(definition).ok()?;
    probe.add(definition.spec(), &[], reference(coordinate, records));
    let runs = records.iter().map(|record| probe.free_run(record).ok());
    runs.collect()
}

/// The mean of the channel that a coordinate reads.
pub(super) fn reference(coordinate: &Coordinate, records: &[&Record]) -> Option<f64> {
    let channel = coordinate.channel()?;
    let values = || {
        let series = records.iter().filter_map(|r| r.channels.get(channel));
        series.flatten()
    };
    Some(values().sum::<f64>() / values().count().max(1) as f64)
}

/// Where a coordinate spends equal times, and which of these places it is at most.
fn points(mut values: Vec<f64>) -> Option<(Vec<f64>, usize)> {
    values.retain(|x| x.is_finite());
    values.sort_by(f64::total_cmp);
    let last = values.len().checked_sub(1)?;
    let at = |share: f64| values[(share * last as f64).round() as usize];
    let (low, high) = (at(RULES.beyond), at(1.0 - RULES.beyond));
    if high - low <= 1e-6 * low.abs().max(high.abs()).max(1e-6) {
        return None;
    }
    // Rests of a fraction of a second and one of ten: what is apart is a matter of place.
    let least = (0.01 * (at(0.5) - low)).max(1e-6 * (high - low));
    let count = RULES.points;
    let mut x: Vec<f64> = vec![low];
    for i in 1..count {
        let along = i as f64 / (count - 1) as f64;
        let place = at(RULES.beyond + along * (1.0 - 2.0 * RULES.beyond));
        let last = x[x.len() - 1];
        if place - last > (RULES.apart * (last - low)).max(least) {
            x.push(place);
        }
    }
    if x.len() < RULES.fewest_points {
        return None;
    }
    let median = at(0.5);
    let nearest = (0..x.len()).min_by(|a, b| {
        let from = |i: &usize| (x[*i] - median).abs();
        from(a).total_cmp(&from(b))
    })?;
    Some((x, nearest))
}

/// By how much the model's own delay is made shorter for a term, s: a delay may shrink as well.
pub(super) fn room(entry: Entry, model: &Model) -> f64 {
    match entry {
        Entry::Delay => {
            let period = model.sample_period_s;
            let present = model.delay.present(0.5, period).floor();
            (0.8 * present).floor().clamp(0.0, 20.0) * period
        }
        _ => 0.0,
    }
}

/// A model that curves are screened beside.
pub(super) struct Context<'a> {
    screen: Screen<'a>,
    model: &'a Model,
    learning: Vec<&'a Record>,
    /// Length of the longest record, s.
    longest: f64,
    /// Which term is looked for.
    number: usize,
}

impl<'a> Context<'a> {
    /// `None` if the model diverges.
    pub(super) fn new(search: &Search<'a>, model: &'a Model, number: usize) -> Option<Self> {
        let learning = search.judge.learning(0);
        let longest = learning.iter().map(|r| r.len()).max().unwrap_or(0) as f64;
        Some(Self {
            screen: Screen::new(search.judge, model)?,
            model,
            learning,
            longest: longest * model.sample_period_s,
            number,
        })
    }

    /// Every curve that enters in one of these ways, the most promising first.
    pub(super) fn all(&self, entries: &[Entry]) -> Vec<Screened> {
        self.curves(self.coordinates(), entries)
    }

    /// The same with times in smaller steps.
    pub(super) fn closer(&self, entries: &[Entry]) -> Vec<Screened> {
        let mut all = self.coordinates();
        let between: Vec<_> = all
            .iter()
            .flat_map(|one| self.times(one, &BETWEEN))
            .collect();
        all.extend(between);
        self.curves(all, entries)
    }

    /// A coordinate with its time multiplied by each of these, where the records are long enough.
    fn times(&self, coordinate: &Coordinate, factors: &[f64]) -> Vec<Coordinate> {
        let longest = remembered(self.longest);
        let others = factors
            .iter()
            .filter_map(|factor| coordinate.with_time_times(*factor));
        others.filter(|other| other.fits(longest)).collect()
    }

    fn coordinates(&self) -> Vec<Coordinate> {
        let first = self.learning.first();
        let channels: Vec<String> = first
            .map(|record| record.channels.keys().cloned().collect())
            .unwrap_or_default();
        let time_constant = self.model.time_constant().clamp(FASTEST_S, SLOWEST_S);
        coordinates(time_constant, self.longest, &channels)
    }

    /// The same term with its time nearby.
    pub(super) fn near(&self, term: &Term) -> Vec<Screened> {
        self.curves(self.times(&term.coordinate, &NEARBY), &[term.entry])
    }

    /// What a term changes in the free run, to first order.
    pub(super) fn direction(&self, term: &Term) -> Option<Vec<f64>> {
        let reference = reference(&term.coordinate, &self.learning);
        let with = term.added_to(self.model, reference)?;
        Some(self.screen.tangent(&with, &term.name())?.direction)
    }

    /// The screening itself.
    pub(super) fn screen(&self) -> &Screen<'a> {
        &self.screen
    }

    fn curves(&self, coordinates: Vec<Coordinate>, entries: &[Entry]) -> Vec<Screened> {
        let each = coordinates.into_par_iter().map(|coordinate| {
            let Some(series) = values_of(&coordinate, self.model, &self.learning) else {
                return Vec::new();
            };
            let screened = |entry: &Entry| {
                let coordinate = match (&coordinate, entry.place()) {
                    // The sensor sees the reading.
                    (Coordinate::Y, Place::Sensor) => Coordinate::Reading,
                    (other, _) => other.clone(),
                };
                self.curve(*entry, coordinate, &series)
            };
            entries.iter().filter_map(screened).collect::<Vec<_>>()
        });
        let mut curves: Vec<Screened> = each.flatten().collect();
        curves.sort_by(|a, b| a.score.total_cmp(&b.score));
        curves
    }

    fn curve(&self, entry: Entry, coordinate: Coordinate, series: &[Vec<f64>]) -> Option<Screened> {
        // A jet knows its coordinate only while it blows.
        let of_jet = entry == Entry::Jet;
        let pairs = series.iter().zip(&self.learning);
        let shown: Vec<f64> = pairs
            .flat_map(|(series, record)| {
                let pairs = series.iter().zip(&record.u);
                let kept = pairs.filter(move |(_, u)| !of_jet || **u > ON);
                kept.map(|(x, _)| *x)
            })
            .collect();
        let stride = shown.len().div_ceil(SHOWN).max(1);
        let (x, pinned) = points(shown.into_iter().step_by(stride).collect())?;
        let shift = room(entry, self.model);
        // The sensor's zero is a constant reading.
        let zero = entry == Entry::Reading && self.model.has_effect(ZERO_OFFSET.name);
        let pinned = (zero || entry.has_free_level()).then_some(pinned);
        let mut term = Term {
            entry,
            coordinate,
            shape: Shape::Points {
                g: vec![0.0; x.len()],
                x,
                pinned,
            },
            on: ON,
            shift,
            time: 1.0,
            number: self.number,
        };
        let reference = reference(&term.coordinate, &self.learning);
        let with = term.added_to(self.model, reference)?;
        let Tangent {
            coefficients,
            learned,
            held_out,
            ..
        } = self.screen.tangent(&with, &term.name())?;
        let cost = coefficients.len() as f64;
        let size = (coefficients.iter().map(|c| c * c).sum::<f64>() / cost).sqrt();
        // What would have been worth it takes so much of the error.
        let wanted = 1.0 - (1.0 - RULES.worthwhile).powi(2);
        let smallest = size * (wanted / learned.max(1e-12)).sqrt();
        term = term.with_values(&coefficients);
        Some(Screened {
            score: 0.5 * (1.0 - held_out).max(1e-6).ln() + crate::terms::RULES.price * cost,
            held_out,
            smallest,
            term,
        })
    }
}

/// The first so many, no more of a kind than rules allow.
pub(super) fn diverse(all: Vec<Screened>, most: usize) -> Vec<Screened> {
    let mut kept: Vec<Screened> = Vec::new();
    for one in all {
        let of_a_kind = kept.iter().filter(|other| other.term.is_like(&one.term));
        if kept.len() < most && of_a_kind.count() < RULES.of_a_kind {
            kept.push(one);
        }
    }
    kept
}
