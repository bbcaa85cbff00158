//! The position of a response's front: first roughly for all edges together, then for each edge.
//!
//! The matched filter for a change of level is the mean of y over the `reach` samples from a time on, minus the
//! mean over the samples before it. Summed over all edges of one direction, as a function of the time since the
//! edge, it peaks at the middle of the front. The contribution of each edge is bounded, so that no single edge
//! decides. Responses to the neighbouring edges have the other sign and do not add up.

use super::edge::Edge;
use super::rules::RULES;
use super::spread::mean;

/// Expected arrival of a response to edges of one direction, samples.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct Arrival {
    /// Middle of the front.
    pub(crate) front: usize,
    /// Start of the front.
    pub(crate) onset: usize,
}

/// Prior knowledge for locating single edges.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Expectation {
    rising: Arrival,
    falling: Arrival,
    /// +1 if y rises with the command; −1 if y falls.
    gain_sign: f64,
    /// Samples of y used on either side of an arrival.
    pub(crate) reach: usize,
    /// Longest delay that is searched, samples.
    pub(crate) max_delay: usize,
}

impl Expectation {
    /// Expected arrival of a response to edges in the direction of `edge`.
    pub(crate) fn of(&self, edge: Edge) -> Arrival {
        if edge.rising {
            self.rising
        } else {
            self.falling
        }
    }

    /// The sign of the change of y after an edge.
    pub(crate) fn direction(&self, edge: Edge) -> f64 {
        if edge.rising {
            self.gain_sign
        } else {
            -self.gain_sign
        }
    }

    /// Corrects the start of the responses to edges of one direction.
    pub(crate) fn set_onset(&mut self, rising: bool, onset: usize) {
        if rising {
            self.rising.onset = onset;
        } else {
            self.falling.onset = onset;
        }
    }
}

/// Expected arrival times over all edges. `None` if there is no edge.
pub(crate) fn expect(
    series: &[(&[f64], Vec<Edge>)],
    levels: &[Vec<f64>],
    max_delay: usize,
    reach: usize,
) -> Option<Expectation> {
    // The weight of an edge is at most twice the median.
    let mut sizes: Vec<f64> = Vec::new();
    for ((_, edges), levels) in series.iter().zip(levels) {
        for edge in edges {
            let seen = levels.iter().skip(edge.sample).take(max_delay + 1);
            sizes.push(seen.fold(0.0, |m: f64, k| m.max(k.abs())));
        }
    }
    if sizes.is_empty() {
        return None;
    }
    let middle = sizes.len() / 2;
    let bound = RULES.front_largest * *sizes.select_nth_unstable_by(middle, f64::total_cmp).1
        + f64::MIN_POSITIVE;
    let gain_sign = gain_sign(series);
    let arrival = |rising: bool| -> Option<Arrival> {
        let direction = if rising { gain_sign } else { -gain_sign };
        let votes = |most: usize| -> Option<Vec<f64>> {
            let mine: Vec<(usize, &[f64])> = series
                .iter()
                .zip(levels)
                .flat_map(|((_, edges), levels)| {
                    let mine = edges.iter().filter(|e| e.rising == rising).take(most);
                    mine.map(|e| (e.sample, levels.as_slice()))
                })
                .collect();
            if mine.is_empty() {
                return None;
            }
            // The front lies up to `reach` samples after the start of a response.
            let vote = |delay: usize| {
                let seen = mine
                    .iter()
                    .filter_map(|(sample, levels)| levels.get(sample + delay));
                let (sum, count) = seen.fold((0.0, 0usize), |(sum, count), level| {
                    (sum + (direction * level).clamp(-bound, bound), count + 1)
                });
                sum / count.max(1) as f64
            };
            Some((0..=max_delay + reach).map(vote).collect())
        };
        let front = soonest_peak(&votes(usize::MAX)?, &votes(1)?, reach / 2)?;
        Some(Arrival {
            front,
            onset: front.saturating_sub(reach / 2),
        })
    };
    let (rising, falling) = (arrival(true), arrival(false));
    Some(Expectation {
        rising: rising.or(falling)?,
        falling: falling.or(rising)?,
        gain_sign,
        reach,
        max_delay,
    })
}

/// The front of the response to one edge, as a sample of the record: the highest level change near the expected
/// arrival.
pub(crate) fn own_front(levels: &[f64], edge: Edge, expected: &Expectation) -> usize {
    let centre = edge.sample + expected.of(edge).front;
    let spread = expected.reach * 2 / 3;
    let from = centre.saturating_sub(spread).max(edge.sample);
    let direction = expected.direction(edge);
    levels
        .iter()
        .enumerate()
        .take(centre + spread + 1)
        .skip(from)
        .max_by(|a, b| (direction * a.1).total_cmp(&(direction * b.1)))
        .map_or(centre, |(k, _)| k)
}

/// The earliest peak (within `half_width` to either side) that is nearly as high as the highest.
///
/// In periodic records the peak recurs with the period, and the earliest peak is the right one. In a lightly damped
/// flow that swings back as fast as it responds, the earliest peak may be wrong. The first edge of each record,
/// which starts from rest, then decides (`at_rest`).
fn soonest_peak(votes: &[f64], at_rest: &[f64], half_width: usize) -> Option<usize> {
    let highest = votes.iter().copied().fold(f64::NEG_INFINITY, f64::max);
    let peaks: Vec<usize> = (0..votes.len())
        .filter(|&d| {
            let mut around = votes
                .iter()
                .take(d + half_width + 1)
                .skip(d.saturating_sub(half_width));
            votes
                .get(d)
                .is_some_and(|&v| v >= RULES.front_height * highest && around.all(|&a| a <= v))
        })
        .collect();
    let from_rest = |d: usize| at_rest.get(d).copied().unwrap_or(0.0);
    let soonest = *peaks.first()?;
    peaks
        .iter()
        .copied()
        .find(|&d| from_rest(d) > RULES.front_clearly * from_rest(soonest).max(0.0))
        .or(Some(soonest))
}

/// +1 if y is mostly above its level at rest, −1 if below. The level at rest is y before the first edge, or
/// 0.
///
/// The fronts alone are ambiguous: a square wave of 50 % duty equals its inverse half a period later.
fn gain_sign(series: &[(&[f64], Vec<Edge>)]) -> f64 {
    let mut sum = 0.0;
    for (y, edges) in series {
        let Some(first) = edges.first() else { continue };
        let rest = y
            .get(..first.sample)
            .filter(|rest| rest.len() >= 20)
            .map_or(0.0, mean);
        sum += y.iter().skip(first.sample).map(|y| y - rest).sum::<f64>();
    }
    if sum < 0.0 { -1.0 } else { 1.0 }
}

/// Mean of y over the `reach` samples from each sample on, minus the mean over the `reach` samples before it.
/// Before the record y is 0. The last `reach` samples of the record get no value.
pub(crate) fn level_filter(y: &[f64], reach: usize) -> Vec<f64> {
    let mut sums = Vec::with_capacity(y.len() + 1);
    let mut total = 0.0;
    sums.push(total);
    for value in y {
        total += value;
        sums.push(total);
    }
    let sum = |k: usize| sums.get(k).copied().unwrap_or(total);
    (0..y.len().saturating_sub(reach))
        .map(|k| {
            let after = sum(k + reach) - sum(k);
            let before = sum(k) - sum(k.saturating_sub(reach));
            (after - before) / reach.max(1) as f64
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn level_filter_peaks_at_a_step_and_sees_its_size() {
        let y: Vec<f64> = (0..200).map(|k| if k < 90 { 0.25 } else { 1.0 }).collect();
        let levels = level_filter(&y, 20);
        assert_eq!(levels.len(), 180);
        assert!((levels[90] - 0.75).abs() < 1e-12);
        assert!(levels.iter().skip(30).all(|l| *l <= 0.75 + 1e-12));
    }

    #[test]
    fn soonest_of_equal_peaks_and_sign_of_the_gain() {
        let votes: Vec<f64> = (0..300)
            .map(|d| (f64::from(d) * std::f64::consts::TAU / 125.0).sin())
            .collect();
        assert_eq!(soonest_peak(&votes, &votes, 15), Some(31));
        let later: Vec<f64> = (0..300).map(|d| if d < 100 { 0.1 } else { 0.5 }).collect();
        assert_eq!(soonest_peak(&votes, &later, 15), Some(156));
        let edges = vec![Edge {
            sample: 30,
            rising: true,
        }];
        let y: Vec<f64> = (0..100).map(|k| if k < 50 { 5.0 } else { 4.0 }).collect();
        assert_eq!(gain_sign(&[(&y, edges)]), -1.0);
    }
}
