//! First-order screening of curves: every entry times every coordinate, orthogonal to everything that the base can
//! imitate.

use super::RULES;
use super::coordinate::{Coordinate, coordinates, remembered};
use super::place::{Entry, Place};
use super::term::{Shape, Term};
use crate::data::Record;
use crate::model::Model;
use crate::order;
use crate::parallel;
use crate::terms::{Screen, Search, Tangent};
use crate::user_effect::Definition;
use model_core::effects::ZERO_OFFSET;

/// A curve that was screened.
pub(crate) struct Screened {
    /// The term with the predicted values.
    pub(crate) term: Term,
    /// ½ ln of the predicted validation mean square over the present one, plus the penalty of its points; negative
    /// if the gain exceeds the penalty.
    pub(crate) score: f64,
    /// Explained share of the validation error energy.
    pub(crate) held_out: f64,
    /// Rms value that the term would need to be worth reporting.
    pub(crate) smallest: f64,
}

/// Above this level the command counts as on, inner units.
pub(crate) const ON: f64 = 0.5;
/// Bounds of the flow's time constant, s at 1 kHz (1000 samples). The time constants of coordinates are multiples of
/// the flow's.
const FASTEST_S: f64 = 0.005;
const SLOWEST_S: f64 = 0.2;
/// Factors on a found time constant for a finer grid around it.
const NEARBY: [f64; 6] = [0.5, 0.63, 0.79, 1.26, 1.59, 2.0];
/// Factors that refine the first grid of time constants, whose steps are two to three.
const BETWEEN: [f64; 2] = [0.63, 1.59];
/// Samples used for the distribution of a coordinate.
const SHOWN: usize = 20_000;

/// The values of a coordinate over the records in a run of the model; `None` if it is not defined there.
fn values_of(coordinate: &Coordinate, model: &Model, records: &[&Record]) -> Option<Vec<Vec<f64>>> {
    let mut probe = model.clone();
    // The sensor's offset acts after the probe and would be added to it.
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
pub(crate) fn reference(coordinate: &Coordinate, records: &[&Record]) -> Option<f64> {
    let channel = coordinate.channel()?;
    let values = || {
        let series = records.iter().filter_map(|r| r.channels.get(channel));
        series.flatten()
    };
    Some(values().sum::<f64>() / values().count().max(1) as f64)
}

/// Quantiles of a coordinate with equal weights between them, and the index of the one nearest to the median.
fn points(mut weighted: Vec<(f64, f64)>) -> Option<(Vec<f64>, usize)> {
    weighted.retain(|(x, weight)| x.is_finite() && *weight > 0.0);
    order::ascending(&mut weighted, |one| one.0);
    let mut whole = 0.0;
    let mut up_to = Vec::with_capacity(weighted.len());
    for (_, weight) in &weighted {
        whole += weight;
        up_to.push(whole);
    }
    let last = weighted.len().checked_sub(1)?;
    let reaching = |sum: f64| weighted[up_to.partition_point(|own| *own < sum).min(last)].0;
    let at = |share: f64| reaching(share * whole);
    let (low, high) = (at(RULES.beyond), at(1.0 - RULES.beyond));
    if high - low <= 1e-6 * low.abs().max(high.abs()).max(1e-6) {
        return None;
    }
    // Rests of a fraction of a second and of ten seconds occur together, so the least distance of points is
    // relative to their position.
    let least = (0.01 * (at(0.5) - low)).max(1e-6 * (high - low));
    let count = RULES.points;
    let are_apart = |a: f64, b: f64| b - a > (RULES.apart * (a - low)).max(least);
    let mut x: Vec<f64> = vec![low];
    for i in 1..count {
        let along = i as f64 / (count - 1) as f64;
        let place = at(RULES.beyond + along * (1.0 - 2.0 * RULES.beyond));
        if are_apart(x[x.len() - 1], place) {
            x.push(place);
        }
    }
    // A rest that is constant throughout a record covers several quantiles. The values between such rests get
    // points too.
    let from = |x: f64| weighted.partition_point(|(own, _)| *own <= x);
    let to = |x: f64| weighted.partition_point(|(own, _)| *own < x);
    let before = |index: usize| index.checked_sub(1).map_or(0.0, |last| up_to[last]);
    while x.len() < count {
        let gaps = x.windows(2).enumerate().filter_map(|(i, ends)| {
            let (low, high) = (before(from(ends[0])), before(to(ends[1])));
            let middle = reaching(0.5 * (low + high));
            let fits = high - low > RULES.beyond * whole
                && are_apart(ends[0], middle)
                && are_apart(middle, ends[1]);
            fits.then_some((high - low, i, middle))
        });
        let Some((_, i, middle)) = gaps.max_by(|a, b| a.0.total_cmp(&b.0)) else {
            break;
        };
        x.insert(i + 1, middle);
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

/// Time by which the model's own delay is shortened for a term of the delay, s, so that the term
/// can also shorten the delay.
pub(crate) fn room(entry: Entry, model: &Model) -> f64 {
    match entry {
        Entry::Delay => {
            let period = model.sample_period_s;
            let present = model.delay.present(0.5, period).floor();
            (0.8 * present).floor().clamp(0.0, 20.0) * period
        }
        _ => 0.0,
    }
}

/// A model on which curves are screened.
pub(crate) struct Context<'a> {
    screen: Screen<'a>,
    model: &'a Model,
    learning: Vec<&'a Record>,
    /// Length of the longest record, s.
    longest: f64,
    /// Number of the term that is searched.
    number: usize,
}

impl<'a> Context<'a> {
    /// Prepares the model; `None` if it diverges.
    pub(crate) fn new(search: &Search<'a>, model: &'a Model, number: usize) -> Option<Self> {
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

    /// All curves that enter the model at one of these `entries`, the most promising first.
    pub(crate) fn all(&self, entries: &[Entry]) -> Vec<Screened> {
        self.curves(self.coordinates(), entries)
    }

    /// Screens all coordinates with a finer grid of time constants.
    pub(crate) fn closer(&self, entries: &[Entry]) -> Vec<Screened> {
        let mut all = self.coordinates();
        let between: Vec<_> = all
            .iter()
            .flat_map(|one| self.times(one, &BETWEEN))
            .collect();
        all.extend(between);
        self.curves(all, entries)
    }

    /// A coordinate with its time constant multiplied by each factor, if the records are long enough.
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

    /// This term with neighbouring time constants, if its own was chosen from a grid.
    pub(crate) fn near(&self, term: &Term) -> Vec<Screened> {
        if term.fading.is_some() {
            return Vec::new();
        }
        self.curves(self.times(&term.coordinate, &NEARBY), &[term.entry])
    }

    /// First-order change of the free run by a term.
    pub(crate) fn direction(&self, term: &Term) -> Option<Vec<f64>> {
        let reference = reference(&term.coordinate, &self.learning);
        let with = term.added_to(self.model, reference)?;
        Some(self.screen.tangent(&with, &term.name())?.direction)
    }

    /// The screening of the model.
    pub(crate) fn screen(&self) -> &Screen<'a> {
        &self.screen
    }

    fn curves(&self, coordinates: Vec<Coordinate>, entries: &[Entry]) -> Vec<Screened> {
        let mut curves = self.each(coordinates, entries, |(term, with)| {
            self.screened(term, &with)
        });
        order::ascending(&mut curves, |one| one.score);
        curves
    }

    /// Applies a function to every curve that is defined on the records, with the model that contains it.
    fn each<T: Send>(
        &self,
        coordinates: Vec<Coordinate>,
        entries: &[Entry],
        make: impl Fn((Term, Model)) -> Option<T> + Sync,
    ) -> Vec<T> {
        let each = parallel::each(coordinates, |coordinate| {
            let Some(series) = values_of(&coordinate, self.model, &self.learning) else {
                return Vec::new();
            };
            let shown = |entry: &Entry| {
                let coordinate = match (&coordinate, entry.place()) {
                    // The sensor's coordinate is the reading.
                    (Coordinate::Y, Place::Sensor) => Coordinate::Reading,
                    (other, _) => other.clone(),
                };
                self.curve(*entry, coordinate, &series)
            };
            let shown = entries.iter().filter_map(shown);
            shown.filter_map(&make).collect::<Vec<_>>()
        });
        each.into_iter().flatten().collect()
    }

    /// A curve of zeros over the coordinate's range, and the model with it.
    fn curve(
        &self,
        entry: Entry,
        coordinate: Coordinate,
        series: &[Vec<f64>],
    ) -> Option<(Term, Model)> {
        let pairs = series.iter().zip(&self.learning);
        let shown: Vec<(f64, f64)> = pairs
            .flat_map(|(series, record)| {
                let samples = series.iter().zip(record.u.iter().zip(&record.y));
                samples.map(|(x, (u, y))| (*x, entry.shown_by(*u > ON, *y)))
            })
            .collect();
        let stride = shown.len().div_ceil(SHOWN).max(1);
        let (x, pinned) = points(shown.into_iter().step_by(stride).collect())?;
        let shift = room(entry, self.model);
        // A constant reading is the sensor's offset.
        let zero = entry == Entry::Reading && self.model.has_effect(ZERO_OFFSET.name);
        let pinned = (zero || entry.has_free_level()).then_some(pinned);
        let term = Term {
            entry,
            coordinate,
            shape: Shape::Points {
                g: vec![0.0; x.len()],
                x,
                pinned,
            },
            fading: None,
            on: ON,
            shift,
            time: 1.0,
            number: self.number,
        };
        let reference = reference(&term.coordinate, &self.learning);
        let with = term.added_to(self.model, reference)?;
        Some((term, with))
    }

    fn screened(&self, term: Term, with: &Model) -> Option<Screened> {
        let Tangent {
            coefficients,
            learned,
            held_out,
            ..
        } = self.screen.tangent(with, &term.name())?;
        let cost = coefficients.len() as f64;
        let size = (coefficients.iter().map(|c| c * c).sum::<f64>() / cost).sqrt();
        // Share of the error energy that a reportable term explains.
        let wanted = 1.0 - (1.0 - RULES.worthwhile).powi(2);
        let smallest = size * (wanted / learned.max(1e-12)).sqrt();
        Some(Screened {
            score: 0.5 * (1.0 - held_out).max(1e-6).ln() + crate::terms::RULES.price * cost,
            held_out,
            smallest,
            term: term.with_values(&coefficients),
        })
    }
}

/// The first `most` candidates, limited per kind by the rules.
pub(crate) fn diverse(all: Vec<Screened>, most: usize) -> Vec<Screened> {
    let mut kept: Vec<Screened> = Vec::new();
    for one in all {
        let of_a_kind = kept.iter().filter(|other| other.term.is_like(&one.term));
        if kept.len() < most && of_a_kind.count() < RULES.of_a_kind {
            kept.push(one);
        }
    }
    kept
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Square waves have one rest duration. The durations that random commands add get points too; unused ranges
    /// get none.
    #[test]
    fn points_lie_between_rests_that_take_most_of_the_time() {
        let mut shown = vec![(0.05, 1.0); 4000];
        shown.extend(vec![(0.5, 1.0); 5000]);
        shown.extend((0..800).map(|i| (0.1 + 0.0005 * f64::from(i), 1.0)));
        shown.extend(vec![(3.0, 0.0); 1000]);
        let (x, nearest) = points(shown).expect("a curve");
        assert_eq!((x[0], x[x.len() - 1]), (0.05, 0.5));
        assert_eq!(x.len(), RULES.points);
        let between = x.windows(2).map(|ends| ends[1] - ends[0]);
        assert!(between.fold(0.0, f64::max) < 0.15, "{x:?}");
        assert_eq!(nearest, x.len() - 1);
        assert!(points(vec![(0.05, 1.0); 100]).is_none());
    }
}
