//! The beginning of a record: at rest under a constant command, with an edge of the command at its first sample, or
//! in mid-run.

use super::RULES;
use super::levels::two_levels;
use super::reference::FirstOrder;
use crate::data::Record;
use crate::order;

/// How a record begins.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Beginning {
    /// The command before the first sample.
    pub(super) command: f64,
    /// Number of samples from the start during which y rests; 0 in mid-run.
    pub(super) rest: usize,
    /// Number of samples from the start that may be responses to commands before the record; 0 if these commands are
    /// known.
    pub(super) follow: usize,
}

/// The level at which a record rests, and its standard error for white noise.
#[derive(Clone, Copy, Debug)]
struct Rest {
    level: f64,
    error: f64,
}

impl Rest {
    fn of(y: &[f64]) -> Self {
        let n = y.len().max(1) as f64;
        let level = y.iter().sum::<f64>() / n;
        let square = y.iter().map(|y| (y - level).powi(2)).sum::<f64>();
        Self {
            level,
            error: (square / (n - 1.0).max(1.0) / n).sqrt(),
        }
    }

    /// Whether `y`, whose mean is this level, rests there instead of relaxing towards `end`. It rests if a
    /// relaxation with any of these time constants has a clearly larger residual.
    fn is_settled(&self, y: &[f64], end: f64, times: [f64; 3]) -> bool {
        let n = y.len() as f64;
        let constant = self.error.powi(2) * n * (n - 1.0).max(1.0);
        let least = RULES.motion_over_noise * self.error.powi(2) * n;
        times.into_iter().all(|time| {
            let shape = |k: usize| (-(k as f64) / time).exp();
            let (mut product, mut square, mut whole) = (0.0, 0.0, 0.0);
            for (k, y) in y.iter().enumerate() {
                product += shape(k) * (y - end);
                square += shape(k).powi(2);
                whole += (y - end).powi(2);
            }
            whole - product * product / square - constant > least
        })
    }

    /// Whether the two levels are equal within three standard errors of the noise.
    fn is_at_level_of(&self, other: &Self) -> bool {
        (self.level - other.level).abs() <= 3.0 * self.error.hypot(other.error)
    }
}

/// A least-squares fit of y by a constant and one shape.
struct Shape {
    /// Sum of squares of the residual.
    left: f64,
    /// Sum of squares of the motion that the fit describes.
    motion: f64,
}

impl Shape {
    fn of(y: &[f64], shape: impl Fn(usize) -> f64) -> Self {
        let n = y.len() as f64;
        let (mut s, mut ss, mut sy, mut sum) = (0.0, 0.0, 0.0, 0.0);
        for (k, y) in y.iter().enumerate() {
            let x = shape(k);
            s += x;
            ss += x * x;
            sy += x * y;
            sum += y;
        }
        let mean = sum / n;
        let spread: f64 = y.iter().map(|y| (y - mean).powi(2)).sum();
        let (square, product) = (ss - s * s / n, sy - s * mean);
        let motion = if square > 1e-12 * ss.max(1e-300) {
            product * product / square
        } else {
            0.0
        };
        Self {
            left: (spread - motion).max(0.0),
            motion,
        }
    }
}

impl Beginning {
    /// The beginning of `record`, one of `set`, determined with the response of `reference`.
    pub(super) fn of(record: &Record, set: &[Record], reference: Option<&FirstOrder>) -> Self {
        let first = record.u.first().copied().unwrap_or(0.0);
        let held = record.u_before.unwrap_or(first);
        let in_mid_run =
            |dead_time: f64, time: f64| Self::in_mid_run(record, held, dead_time, time);
        let Some(reference) = reference else {
            return in_mid_run(0.0, 0.0);
        };
        let (dead_time, time) = (reference.dead_time, reference.time_constant);
        let changes = |u: &f64| (u - first).abs() > 1e-9 * first.abs().max(1e-9);
        let change = record.u.iter().position(changes).unwrap_or(record.len());
        // If an edge is at the first sample, the response to it comes before the response to the first edge
        // within the record.
        let known_edge = (held - first).abs() > 1e-9 * first.abs().max(1e-9);
        let edge = if known_edge { 0 } else { change };
        // A switched input other than the command may act without delay.
        let other = record.channels.values().filter_map(|v| first_switch(v));
        let other = other.min().unwrap_or(record.len());
        let felt = |edge: usize| {
            let felt = edge + (RULES.surely_before * dead_time).floor() as usize;
            felt.min(other)
        };
        let enough = (RULES.times_of_rest * time + 2.0 * dead_time).ceil() as usize;
        let window = felt(edge).min(record.len()).min(enough.max(5));
        if window < RULES.fewest_at_rest {
            return in_mid_run(dead_time, time);
        }
        let y = &record.y[..window];
        let times = [0.5, 1.0, 2.0].map(|factor| factor * time);
        let least = |shapes: Vec<Shape>| {
            let by_rest = |a: &Shape, b: &Shape| a.left.total_cmp(&b.left);
            shapes.into_iter().min_by(by_rest)
        };
        let relaxing = |y: &[f64]| {
            least(
                times
                    .map(|time| Shape::of(y, |k| (-(k as f64) / time).exp()))
                    .into(),
            )
        };
        let answering = |y: &[f64]| {
            let shares = [0.15, 0.3, 0.5, 0.7, 0.85, 1.0, 1.15, 1.3, 1.6];
            let arrivals = shares
                .map(|share| share * dead_time)
                .into_iter()
                .filter(|at| at + 3.0 < y.len() as f64);
            let each = arrivals.flat_map(|at| {
                let answer = move |k: usize, time: f64| {
                    let since = (k as f64 - at).max(0.0);
                    1.0 - (-since / time).exp()
                };
                times.map(|time| (at, Shape::of(y, |k| answer(k, time))))
            });
            each.min_by(|a, b| a.1.left.total_cmp(&b.1.left))
        };
        // The samples before and just after the start of a response decide between a relaxation and
        // a response to an edge.
        let early = &y[..window.min((RULES.early * dead_time).ceil() as usize + 5)];
        let (Some(relaxes), Some(relaxes_early)) = (relaxing(y), relaxing(early)) else {
            return in_mid_run(dead_time, time);
        };
        let (answers, answers_early) = (answering(y), answering(early));
        let moves = |shape: &Shape| {
            let noise = shape.left / (window as f64 - 3.0).max(1.0);
            let least = RULES.motion_unexplained * reference.left_rms;
            let visible = least.powi(2) * window as f64;
            shape.motion > visible && shape.motion > RULES.motion_over_noise * noise
        };
        let at_rest = |command: f64, rest: usize| Self {
            command,
            rest,
            follow: 0,
        };
        let best = match &answers {
            Some((_, answer)) if answer.left < relaxes.left => answer,
            _ => &relaxes,
        };
        if !moves(best) {
            // If y does not move in this interval, it rests until the response to an edge begins.
            return at_rest(held, felt(edge).min(record.len()));
        }
        // The response to the record's own first edge may begin earlier than in the reference, for example in a
        // second-order plant.
        let sooner = [0.0, 0.15, 0.3, 0.45].map(|share| edge as f64 + share * dead_time);
        let sooner = sooner.into_iter().flat_map(|at| {
            let answer = move |k: usize, time: f64| 1.0 - (-(k as f64 - at).max(0.0) / time).exp();
            times.map(|time| Shape::of(y, |k| answer(k, time)))
        });
        if edge >= RULES.fewest_at_rest
            && edge < window
            && least(sooner.collect()).is_some_and(|own| own.left < RULES.answer * relaxes.left)
        {
            return at_rest(held, edge);
        }
        // If the command has two levels, the response may belong to an edge at the first sample.
        let other = two_levels(set).and_then(|levels| levels.into_iter().find(|u| *u != first));
        if let (Some((at, answer)), Some(other)) = (&answers_early, other)
            && !known_edge
            && record.u_before.is_none()
            && answer.left < RULES.answer * relaxes_early.left
            // An earlier response belongs to an edge before the record; in case of doubt the record begins in
            // mid-run.
            && *at >= 0.5 * (1.0 + RULES.surely_before) * dead_time
        {
            let rest = ((RULES.surely_before * at).floor() as usize).max(1);
            // y must not move before the response `answer`.
            let trend = Shape::of(&y[..rest.min(window)], |k| k as f64);
            let noise = trend.left / (rest as f64 - 2.0).max(1.0);
            if rest < RULES.fewest_at_rest || trend.motion <= RULES.motion_over_noise * noise {
                return at_rest(other, rest);
            }
        }
        in_mid_run(dead_time, time)
    }

    /// A beginning in mid-run after a command of `held`. Responses that are still in the dead time are followed
    /// until they arrive, slower ones for as long as the length of the record allows.
    fn in_mid_run(record: &Record, held: f64, dead_time: f64, time: f64) -> Self {
        let most = record.len() / RULES.most_followed;
        let share = record.len() / RULES.followed_share;
        let arrives = (2.0 * dead_time).ceil() as usize + 2;
        let fades = (RULES.times_of_rest * time).ceil() as usize;
        Self {
            command: held,
            rest: 0,
            follow: (arrives + fades).min(share).max(arrives.min(most.max(1))),
        }
    }

    /// In records that were cut out of a longer run, an edge near the first sample of a resting record may have
    /// occurred before it, at an unknown time. The response to it is followed, as in mid-run, if the record has
    /// further edges.
    pub(super) fn distrust(beginnings: &mut [Self], records: &[Record], reference: &FirstOrder) {
        if beginnings.iter().all(|own| own.follow == 0) {
            return;
        }
        for (own, record) in beginnings.iter_mut().zip(records) {
            let has_edge_before = record.u.first().is_some_and(|first| *first != own.command);
            if !has_edge_before || record.u_before.is_some() {
                continue;
            }
            let (dead_time, time) = (reference.dead_time, reference.time_constant);
            let follow = Self::in_mid_run(record, own.command, dead_time, time).follow;
            let later = record.u.windows(2).skip(follow);
            if later.filter(|pair| pair[0] != pair[1]).count() > 1 {
                own.follow = follow;
            }
        }
    }

    /// Re-examines rests that are too short to be certain. If records rest at different levels under the same
    /// command, or if one rests away from the level where the response to its command ends, a response is still in
    /// progress. Records with a rest shorter than a motion then begin in mid-run, with two exceptions. The first is
    /// a rest of at least a time constant beyond the dead time that is too still for a response in progress: its offset
    /// has changed. The second is a group of at least three rests, more than half of all, at the level of their median
    /// within the noise; two rests could agree accidentally.
    pub(super) fn reconcile(beginnings: &mut [Self], records: &[Record], reference: &FirstOrder) {
        let time = reference.time_constant;
        let times = [0.5, 1.0, 2.0].map(|factor| factor * time);
        let rests: Vec<Option<(f64, Rest, &[f64])>> = records
            .iter()
            .zip(&*beginnings)
            .map(|(record, own)| {
                let y = &record.y[..own.rest.min(record.y.len())];
                (own.rest > 0).then(|| (own.command, Rest::of(y), y))
            })
            .collect();
        let under = |command: f64| {
            let same = rests.iter().flatten();
            let mut same: Vec<(Rest, &[f64])> = same
                .filter(|(other, ..)| *other == command)
                .map(|(_, rest, y)| (*rest, *y))
                .collect();
            order::ascending(&mut same, |(rest, _)| rest.level);
            // With more records, more pairs differ accidentally; only a few records differ from their median.
            let middle = same[(same.len() - 1) / 2].0;
            (same, middle)
        };
        let apart = RULES.rests_apart * range_of_y(records);
        // If another input is switched, a response to the command alone does not say where the records end.
        let mut channels = records.iter().flat_map(|record| record.channels.values());
        let alone = !channels.any(|channel| first_switch(channel).is_some());
        for ((own, record), rest) in beginnings.iter_mut().zip(records).zip(&rests) {
            let Some((command, rest, y)) = rest else {
                continue;
            };
            let (same, middle) = under(*command);
            let ends = [middle.level, reference.at_rest(*command)];
            // Within a dead time y can still be where an earlier command has brought it.
            let dead_time = reference.dead_time.ceil() as usize;
            let is_settled = |y: &[f64]| {
                let y = y.get(dead_time..).unwrap_or_default();
                let rest = Rest::of(y);
                let long = |times: f64| y.len() as f64 >= times * time;
                let still = || ends.iter().all(|end| rest.is_settled(y, *end, times));
                long(RULES.times_of_rest) || (long(1.0) && still())
            };
            let alike = same.iter();
            let alike = alike
                .filter(|(other, _)| other.is_at_level_of(&middle))
                .count();
            let with_most = rest.is_at_level_of(&middle) && alike >= 3 && 2 * alike > same.len();
            let unsettled = same.iter().filter(|(_, y)| !is_settled(y));
            let levels = unsettled.map(|(rest, _)| rest.level);
            let [low, high] = levels.fold([middle.level; 2], |[low, high], level| {
                [low.min(level), high.max(level)]
            });
            // The limit is three times the rms residual of the reference, because the reference
            // describes no flow exactly.
            let from_end = (rest.level - reference.at_rest(*command)).abs();
            let is_elsewhere = alone && from_end > apart + 3.0 * reference.left_rms;
            let on_its_way = high - low > apart || is_elsewhere;
            if !is_settled(y) && on_its_way && !with_most {
                *own = Self::in_mid_run(record, own.command, reference.dead_time, time);
            }
        }
    }

    /// Treats a record as one that begins at rest with an edge near its first sample, under two conditions: y begins at
    /// the level where other records rest under the other command, and y does not begin at the final level of the
    /// response to the record's first command.
    pub(super) fn recognise(beginnings: &mut [Self], records: &[Record], reference: &FirstOrder) {
        let Some(levels) = two_levels(records) else {
            return;
        };
        let mean = |y: &[f64]| y.iter().sum::<f64>() / y.len().max(1) as f64;
        let near = 0.5 * RULES.rests_apart * range_of_y(records);
        let spread = (reference.at_rest(levels[1]) - reference.at_rest(levels[0])).abs();
        let early = (RULES.surely_before * reference.dead_time).floor() as usize;
        let rests: Vec<(f64, f64)> = records
            .iter()
            .zip(&*beginnings)
            .filter(|(record, own)| own.rest > 0 && own.rest <= record.y.len())
            .map(|(record, own)| (own.command, mean(&record.y[..own.rest])))
            .collect();
        for (own, record) in beginnings.iter_mut().zip(records) {
            let first = record.u.first().copied().unwrap_or(0.0);
            let other = levels.into_iter().find(|level| *level != first);
            let is_known = record.u_before.is_some() || own.command != first;
            let Some(other) = other.filter(|_| !is_known) else {
                continue;
            };
            let under: Vec<f64> = rests
                .iter()
                .filter(|(command, _)| *command == other)
                .map(|(_, level)| *level)
                .collect();
            if under.is_empty() || early == 0 || early > record.y.len() {
                continue;
            }
            let level = mean(&record.y[..early]);
            let is_elsewhere =
                own.follow > 0 || (level - reference.at_rest(first)).abs() > 0.5 * spread;
            if is_elsewhere && (level - mean(&under)).abs() < near {
                *own = Self {
                    command: other,
                    rest: early,
                    follow: 0,
                };
            }
        }
    }

    /// Whether the record begins at rest under a command of `level`.
    pub(super) fn rests_at(&self, level: f64) -> bool {
        self.rest > 0 && self.command == level
    }

    /// The record with the values before its first sample.
    pub(super) fn filled_in(&self, record: &Record) -> Record {
        let mut record = record.clone();
        record.u_before.get_or_insert(self.command);
        if self.rest > 0 && record.y_before.is_none() {
            let rest = &record.y[..self.rest.min(record.y.len())];
            record.y_before = Some(rest.iter().sum::<f64>() / rest.len().max(1) as f64);
        }
        record
    }
}

/// The first change of a channel that is switched, i.e. that keeps each value for many samples.
fn first_switch(channel: &[f64]) -> Option<usize> {
    let changes = channel.windows(2).filter(|pair| pair[0] != pair[1]).count();
    let is_switched = changes * RULES.switched < channel.len();
    let changed = || channel.iter().position(|value| *value != channel[0]);
    is_switched.then(changed)?
}

/// The difference of the largest and the smallest y of all records.
pub(super) fn range_of_y(records: &[Record]) -> f64 {
    let all = || records.iter().flat_map(|r| r.y.iter().copied());
    all().fold(f64::NEG_INFINITY, f64::max) - all().fold(f64::INFINITY, f64::min)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::data::Use;

    /// The response of a first-order plant with a dead time of 10 and a time constant of 30 samples to `u`, which
    /// was 0 before.
    fn response(u: &[f64]) -> Vec<f64> {
        let mut y = vec![0.0; u.len()];
        for k in 1..u.len() {
            let now = if k > 10 { u[k - 11] } else { 0.0 };
            y[k] = y[k - 1] + (now - y[k - 1]) / 30.0;
        }
        y
    }

    #[test]
    fn a_record_rests_until_its_first_edge_is_felt() {
        let command = |first: usize| -> Vec<f64> {
            (0..2000)
                .map(|k| f64::from(u8::from(k >= first && (k - first) % 300 < 150)))
                .collect()
        };
        let records = [400, 700, 900].map(|first| {
            let u = command(first);
            let y = response(&u);
            Record::new("r", Use::Identify, 0.001, u, y)
        });
        let reference = FirstOrder::fitted(&records).unwrap();
        for (record, first) in records.iter().zip([400, 700, 900]) {
            let own = Beginning::of(record, &records, Some(&reference));
            assert_eq!((own.rest, own.follow), (first + 6, 0));
        }
    }

    #[test]
    fn a_record_rests_until_another_input_is_switched() {
        let u: Vec<f64> = (0..900)
            .map(|k| f64::from(u8::from(k % 300 > 150)))
            .collect();
        let y = response(&u);
        let mut record = Record::new("r", Use::Identify, 0.001, u, y);
        let fan = (0..900).map(|k| f64::from(u8::from(k >= 80))).collect();
        record.channels.insert("fan".to_owned(), fan);
        // A channel that changes at every sample is measured, not switched.
        let wanders = (0..900).map(f64::from).collect();
        record.channels.insert("wanders".to_owned(), wanders);
        let records = [record];
        let reference = FirstOrder::fitted(&records).unwrap();
        let own = Beginning::of(&records[0], &records, Some(&reference));
        assert_eq!((own.rest, own.follow), (80, 0));
    }

    /// A second-order plant moves before the dead time of its first-order reference has passed.
    #[test]
    fn a_record_that_answers_its_edge_sooner_than_the_reference_rests_until_the_edge() {
        let u: Vec<f64> = (0..900)
            .map(|k| f64::from(u8::from(k % 300 >= 20)))
            .collect();
        let record = Record::new("r", Use::Identify, 0.001, u.clone(), response(&u));
        let records = [record];
        let late = FirstOrder {
            dead_time: 60.0,
            ..FirstOrder::fitted(&records).unwrap()
        };
        let own = Beginning::of(&records[0], &records, Some(&late));
        assert_eq!((own.rest, own.follow), (20, 0));
        // A record that relaxes from its start begins in mid-run.
        let mut relaxing = records.clone();
        for (k, y) in relaxing[0].y.iter_mut().enumerate() {
            *y = (-(k as f64) / 30.0).exp();
        }
        let own = Beginning::of(&relaxing[0], &relaxing, Some(&late));
        assert!(own.follow > 0, "{own:?}");
    }

    /// Rests of more than a time constant that are still have their own offset; records that move contain a
    /// response in progress.
    #[test]
    fn a_zero_that_moved_is_no_motion() {
        let command: Vec<f64> = (0..900)
            .map(|k| f64::from(u8::from(k % 300 > 60)))
            .collect();
        let noise = |k: usize| {
            let drawn = (k as u32).wrapping_mul(2_654_435_761) >> 8;
            0.01 * (f64::from(drawn) / f64::from(1 << 24) - 0.5)
        };
        let records = [0.0, 0.1, -0.1].map(|zero| {
            let y = response(&command).into_iter().enumerate();
            let y = y.map(|(k, y)| y + zero + noise(k)).collect();
            Record::new("r", Use::Identify, 0.001, command.clone(), y)
        });
        let reference = FirstOrder::fitted(&records).unwrap();
        let rests = Beginning {
            command: 0.0,
            rest: 67,
            follow: 0,
        };
        let mut beginnings = [rests; 3];
        Beginning::reconcile(&mut beginnings, &records, &reference);
        assert_eq!(beginnings, [rests; 3]);
        // The second record relaxes to the level at which the first rests.
        let mut relaxing = records.clone();
        for (k, y) in relaxing[1].y.iter_mut().enumerate() {
            *y += 0.3 * (-(k as f64) / 30.0).exp() - 0.1;
        }
        Beginning::reconcile(&mut beginnings, &relaxing, &reference);
        assert_eq!(beginnings[2], rests);
        assert!(beginnings[1].follow > 0, "{beginnings:?}");
    }

    #[test]
    fn a_short_rest_where_the_response_does_not_end_is_no_rest() {
        let command: Vec<f64> = (0..900)
            .map(|k| f64::from(u8::from(k % 150 > 60)))
            .collect();
        let y = response(&command);
        let part = |from: usize, to: usize| {
            let (u, y) = (command[from..to].to_vec(), y[from..to].to_vec());
            Record::new("part", Use::Identify, 0.001, u, y)
        };
        // The second record begins 20 samples after a rising edge, while y is still far below 1.
        let records = [part(0, 381), part(381, 900)];
        let reference = FirstOrder::fitted(&records).unwrap();
        let rests = |command: f64| Beginning {
            command,
            rest: 14,
            follow: 0,
        };
        let mut beginnings = [rests(0.0), rests(1.0)];
        Beginning::reconcile(&mut beginnings, &records, &reference);
        assert_eq!(beginnings[0], rests(0.0));
        assert!(beginnings[1].follow > 0, "{beginnings:?}");
    }

    /// The jet was opened a sample before the second record and closed before y had responded. y is therefore still
    /// at its level of rest without jet.
    #[test]
    fn an_edge_before_the_record_is_recognised_and_its_answer_is_not_scored() {
        let command: Vec<f64> = (0..1500)
            .map(|k| f64::from(u8::from(k >= 300 && (k < 304 || k > 600 && k % 300 < 150))))
            .collect();
        let y = response(&command);
        let from = |from: usize| {
            let (u, y) = (command[from..].to_vec(), y[from..].to_vec());
            Record::new("part", Use::Identify, 0.001, u, y)
        };
        // The third record begins while y rises.
        let records = [from(0), from(301), from(650)];
        let reference = FirstOrder::fitted(&records).unwrap();
        let mut beginnings = records
            .each_ref()
            .map(|r| Beginning::of(r, &records, Some(&reference)));
        // y is still under its first command until the response begins.
        assert_eq!((beginnings[1].command, beginnings[1].follow), (1.0, 0));
        Beginning::reconcile(&mut beginnings, &records, &reference);
        Beginning::recognise(&mut beginnings, &records, &reference);
        assert_eq!((beginnings[0].command, beginnings[0].follow), (0.0, 0));
        assert_eq!((beginnings[1].command, beginnings[1].follow), (0.0, 0));
        let mut two = beginnings;
        let together = &mut two[..2];
        Beginning::distrust(together, &records[..2], &reference);
        assert_eq!(together, &beginnings[..2], "no record was cut out of a run");
        Beginning::distrust(&mut beginnings, &records, &reference);
        assert_eq!((beginnings[0].command, beginnings[0].follow), (0.0, 0));
        let edge_before = beginnings[1];
        assert!(edge_before.command == 0.0 && edge_before.rest > 0 && edge_before.follow > 20);
        // Without further edges only the response to the first edge can be scored.
        let short = Record {
            u: records[1].u[..200].to_vec(),
            ..records[1].clone()
        };
        let mut own = [together[1], beginnings[2]];
        Beginning::distrust(&mut own, &[short, records[2].clone()], &reference);
        assert_eq!(own[0], together[1]);
    }
}
