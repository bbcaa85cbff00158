//! Measurement of a rig's properties.
//!
//! In this order: the valve closed, then open, each until the flow is steady; then pulses, and gaps in steady
//! blowing, of several lengths, until the shortest one with a response is known. The behaviour of a healthy sensor
//! (noise, equal readings in a row, distance from the rails) is measured at the same time.

use wire::reply::Phase;

use crate::command::Command;
use crate::error::LineError;
use crate::host::{Host, word};
use crate::record::{MOST_SAMPLES, Progress, record};
use crate::rig_file::{ChannelEntry, FULL_SCALE, RigFile, SensorEntry, VERSION, ValveEntry};

/// Parameters of a calibration.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Plan {
    /// Time with the valve open, and closed, for the flow to become steady, s; the second half of it is measured.
    /// `None`: 4 s, or 1000 samples if that is longer. Flows that need longer than 4 s get longer rests and longer
    /// pulses in proportion.
    pub steady_s: Option<f64>,
    /// Pulses of each length.
    pub pulses: u32,
    /// Standard errors by which a response to a pulse must exceed the noise.
    pub sigmas: f64,
    /// Alarm limit of the residual, in standard deviations of noise averaged over 64 samples.
    pub envelope_sigmas: f64,
    /// Smallest alarm limit, y.
    pub least_envelope: f64,
}

impl Default for Plan {
    fn default() -> Self {
        Self {
            steady_s: None,
            pulses: 24,
            sigmas: 5.0,
            envelope_sigmas: 6.0,
            least_envelope: 0.25,
        }
    }
}

/// Usual settling time of a flow, s, and its least number of samples.
const STEADY: (f64, f64) = (4.0, 1000.0);

/// Waiting times of a calibration, s.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Times {
    /// Waiting time for a steady flow.
    steady: f64,
    /// Time between two pulses for the flow to settle.
    rest: f64,
    /// Longest pulse that is tried.
    longest_pulse: f64,
}

impl Times {
    fn of(plan: &Plan, period: f64) -> Self {
        let steady = plan.steady_s.unwrap_or(STEADY.0.max(STEADY.1 * period));
        let slower = (steady / STEADY.0).max(1.0);
        Self {
            steady,
            rest: 0.5 * slower,
            longest_pulse: 0.05 * slower,
        }
    }
}

/// A run of equal readings counts as a stuck sensor if it is longer than the longest observed run by this factor,
/// and at least this long.
const STUCK: (u32, u32) = (20, 200);
/// Readings this close to the ends of the converter's range count as saturated.
const RAIL: f64 = 8.0;

/// The measured channel of a rig, stated by the user.
#[derive(Clone, Debug, PartialEq)]
pub struct ChannelSaid {
    /// Name of the channel.
    pub name: String,
    /// Unit of the channel.
    pub unit: String,
    /// Counts at 0.
    pub zero_counts: f64,
    /// Units per count.
    pub per_count: f64,
}

/// Calibrates the rig behind `host`.
///
/// # Errors
/// [`LineError`] if the board cannot do it, or if the rig does not permit it: the flow does not respond, or
/// readings are at a rail.
pub fn calibrate(
    host: &mut Host,
    plan: &Plan,
    channel: Option<ChannelSaid>,
    watch: &mut dyn FnMut(&str, &Progress),
) -> Result<RigFile, LineError> {
    let board = host.hello()?;
    if let Phase::Faulted(_) | Phase::Armed | Phase::Playing = board.phase {
        return Err(LineError::Calibration(format!(
            "the board is {}; find the cause, and disarm it",
            word(board.phase)
        )));
    }
    let period = f64::from(board.period_us) * 1e-6;
    let times = Times::of(plan, period);
    let steady = (times.steady / period).round().max(1.0) as usize;
    let longest = 2.0 * times.steady + f64::from(plan.pulses) * (times.rest + times.longest_pulse);
    if longest / period > MOST_SAMPLES as f64 {
        return Err(LineError::Calibration(format!(
            "{} pulses and {} s of steady flow need {:.0} samples at once, but at most {MOST_SAMPLES} are \
                 possible; reduce them (--steady, --pulses)",
            plan.pulses,
            times.steady,
            longest / period
        )));
    }
    let mut play = |what: &str, levels: Vec<bool>| {
        let command = Command::new("calibration", period, levels);
        played(host, &command, &mut |progress| watch(what, progress))
    };
    let shut = play("valve shut", vec![false; steady])?;
    // The valve is opened, then closed for the same time, so that the next test starts at rest.
    let blown = play(
        "valve open",
        [vec![true; steady], vec![false; steady]].concat(),
    )?;
    let half = |counts: &[f64]| counts[counts.len() / 2..].to_vec();
    let (off, on) = (half(&shut), half(&blown[..steady]));
    let (zero, noise_off) = (mean(&off), deviation(&off));
    let (one, noise_on) = (mean(&on), deviation(&on));
    let noise = noise_off.max(noise_on);
    let swing = one - zero;
    if noise == 0.0 {
        return Err(LineError::Calibration(
            "the reading does not change at all; check the sensor's connection".into(),
        ));
    }
    // Noise is coloured: the scatter of segment means gives the standard error.
    let sure = stretches(&off).max(stretches(&on));
    if swing.abs() < plan.sigmas * sure || swing.abs() < 20.0 {
        return Err(LineError::Calibration(format!(
            "steady blowing changes the reading by only {swing:.1} counts; check the air supply and the valve's pin"
        )));
    }
    let seen = |counts: &[f64]| {
        counts
            .iter()
            .copied()
            .fold((f64::MAX, 0.0), |(a, b), c| (c.min(a), c.max(b)))
    };
    let (low, high) = seen(&[&shut[..], &blown].concat());
    if low <= RAIL || high >= FULL_SCALE - RAIL {
        return Err(LineError::Calibration(format!(
            "readings from {low} to {high} reach an end of the converter's range; change the voltage divider (WIRING.md)"
        )));
    }
    let equal = longest_equal(&shut).max(longest_equal(&blown));
    let per_count = 1.0 / swing;

    let (shortest_on, shortest_off) = {
        let mut answers =
            |open: bool| shortest(&mut play, (plan, times), period, steady, open, swing);
        (answers(true)?, answers(false)?)
    };
    let slow_noise = sixty_four(&off).max(sixty_four(&on));
    let envelope = plan.envelope_sigmas * slow_noise * per_count.abs();
    Ok(RigFile {
        format_version: VERSION,
        sample_period_s: period,
        residual_envelope: rounded(envelope.max(plan.least_envelope), 3),
        sensor: SensorEntry {
            zero_counts: rounded(zero, 2),
            per_count: significant(per_count),
            lower_rail_counts: RAIL,
            upper_rail_counts: FULL_SCALE - RAIL,
            stuck_after_samples: (STUCK.0 * equal).max(STUCK.1),
            noise_counts: Some([rounded(noise_off, 2), rounded(noise_on, 2)]),
            slow_noise_counts: Some(rounded(slow_noise, 2)),
        },
        valve: ValveEntry {
            shortest_on_s: rounded(shortest_on, 6),
            shortest_off_s: rounded(shortest_off, 6),
        },
        channel: channel.map(|said| ChannelEntry {
            name: said.name,
            unit: said.unit,
            zero_counts: said.zero_counts,
            per_count: said.per_count,
            lower_rail_counts: RAIL,
            upper_rail_counts: FULL_SCALE - RAIL,
        }),
    })
}

/// Plays levels under a display name and returns the counts.
type Play<'a> = dyn FnMut(&str, Vec<bool>) -> Result<Vec<f64>, LineError> + 'a;

/// The shortest pulse (`open`), or gap in steady blowing, with a significant response, s.
fn shortest(
    play: &mut Play<'_>,
    (plan, times): (&Plan, Times),
    period: f64,
    steady: usize,
    open: bool,
    swing: f64,
) -> Result<f64, LineError> {
    let longest = (times.longest_pulse / period).round().max(1.0) as usize;
    let what = if open { "pulses" } else { "gaps" };
    let mut answers = |length: usize| {
        let rest = (times.rest / period).round().max(1.0) as usize;
        let mut levels = if open { Vec::new() } else { vec![true; steady] };
        for _ in 0..plan.pulses {
            levels.extend(std::iter::repeat_n(!open, rest));
            levels.extend(std::iter::repeat_n(open, length));
        }
        levels.extend(std::iter::repeat_n(!open, rest));
        levels.extend(std::iter::repeat_n(false, steady));
        let lead = if open { 0 } else { steady };
        let text = format!("{what} of {:.0} ms", length as f64 * period * 1e3);
        let counts = match play(&text, levels) {
            Ok(counts) => counts,
            // The pulse is shorter than the board's hold times.
            Err(LineError::Refused { reason, .. }) if reason.contains("hold time") => {
                return Ok(false);
            }
            Err(other) => return Err(other),
        };
        let answers: Vec<f64> = (0..plan.pulses as usize)
            .filter_map(|n| {
                let edge = lead + n * (rest + length) + rest;
                // Mean level before the pulse, and extreme reading after it.
                let before = mean(counts.get(edge - rest / 4..edge)?);
                let after = mean(counts.get(edge + 20.min(rest / 8)..edge + rest / 2)?);
                Some((after - before) * if open { swing } else { -swing } / swing.abs())
            })
            .collect();
        let sure = deviation(&answers) / (answers.len() as f64).sqrt();
        Ok(mean(&answers) > plan.sigmas * sure)
    };
    match first_that(&lengths(longest), &mut answers)? {
        Some(length) => Ok(length as f64 * period),
        None => Err(LineError::Calibration(format!(
            "the flow does not respond to any {what} up to {} s; check the air supply, or average over more pulses (--pulses)",
            times.longest_pulse
        ))),
    }
}

/// Lengths to try, samples: all short ones, then in steps of a quarter.
fn lengths(longest: usize) -> Vec<usize> {
    let longer = |length: &usize| {
        Some(if *length < 8 {
            length + 1
        } else {
            length + length / 4
        })
    };
    std::iter::successors(Some(1), longer)
        .take_while(|length| *length < longest)
        .chain([longest.max(1)])
        .collect()
}

/// The shortest of `lengths` with a response, if all longer ones have a response too. Found by doubling, then
/// bisection, because each test takes a quarter of a minute.
fn first_that(
    lengths: &[usize],
    answers: &mut impl FnMut(usize) -> Result<bool, LineError>,
) -> Result<Option<usize>, LineError> {
    // Nothing below `low` has a response; `high` has one, unless it is past the end.
    let (mut low, mut high, mut leap) = (0, lengths.len(), 1);
    while low < high {
        let at = if high == lengths.len() {
            (low + leap - 1).min(high - 1)
        } else {
            (low + high) / 2
        };
        if answers(lengths[at])? {
            high = at;
        } else {
            low = at + 1;
            leap *= 2;
        }
    }
    Ok(lengths.get(low).copied())
}

/// Plays a command once and gives the counts.
fn played(
    host: &mut Host,
    command: &Command,
    watch: &mut dyn FnMut(&Progress),
) -> Result<Vec<f64>, LineError> {
    let mut counts = Vec::new();
    let mut gone = || {
        Err(LineError::Gone(
            "the line broke during the calibration".into(),
        ))
    };
    let mut keep = |_, samples: &[wire::samples::Sample]| {
        counts = samples.iter().map(|s| f64::from(s.counts)).collect();
        Ok(())
    };
    let recording = record(host, &mut gone, command, 1, &mut keep, watch)?;
    match recording.cut_short {
        None => Ok(counts),
        Some(why) => Err(LineError::Calibration(why)),
    }
}

fn mean(values: &[f64]) -> f64 {
    values.iter().sum::<f64>() / values.len().max(1) as f64
}

fn deviation(values: &[f64]) -> f64 {
    let m = mean(values);
    let square = values.iter().map(|v| (v - m).powi(2)).sum::<f64>();
    (square / (values.len().max(2) - 1) as f64).sqrt()
}

/// Standard error of the mean from the scatter of ten segments.
fn stretches(values: &[f64]) -> f64 {
    let each = (values.len() / 10).max(1);
    let means: Vec<f64> = values.chunks_exact(each).map(mean).collect();
    deviation(&means) / (means.len().max(1) as f64).sqrt()
}

/// Standard deviation of averages over 64 samples.
fn sixty_four(values: &[f64]) -> f64 {
    let means: Vec<f64> = values.chunks_exact(64).map(mean).collect();
    deviation(&means)
}

fn longest_equal(values: &[f64]) -> u32 {
    let (mut longest, mut now) = (0, 0);
    for pair in values.windows(2) {
        now = if pair[0] == pair[1] { now + 1 } else { 0 };
        longest = longest.max(now);
    }
    longest
}

fn rounded(value: f64, digits: i32) -> f64 {
    let scale = 10_f64.powi(digits);
    (value * scale).round() / scale
}

/// Seven digits, as in single precision.
fn significant(value: f64) -> f64 {
    format!("{value:.6e}").parse().unwrap_or(value)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn slow_flows_and_long_periods_are_given_their_time() {
        let of = |steady_s, period| {
            Times::of(
                &Plan {
                    steady_s,
                    ..Plan::default()
                },
                period,
            )
        };
        let usual = Times {
            steady: 4.0,
            rest: 0.5,
            longest_pulse: 0.05,
        };
        assert_eq!(of(None, 2e-4), usual);
        assert_eq!(of(None, 1e-3), usual);
        // A shorter time is the user's responsibility; pulses are not shortened.
        let hasty = Times {
            steady: 1.5,
            ..usual
        };
        assert_eq!(of(Some(1.5), 1e-3), hasty);
        let slow = of(None, 0.1);
        let near = |a: f64, b: f64| (a - b).abs() < 1e-9;
        assert!(
            near(slow.steady, 100.0) && near(slow.rest, 12.5) && near(slow.longest_pulse, 1.25)
        );
    }

    #[test]
    fn the_shortest_answered_length_is_found_in_few_plays() {
        let lengths = lengths(50);
        assert_eq!(lengths.first().zip(lengths.last()), Some((&1, &50)));
        for (place, shortest) in lengths.iter().enumerate() {
            let mut plays = 0;
            let found = first_that(&lengths, &mut |length| {
                plays += 1;
                Ok(length >= *shortest)
            });
            assert_eq!(found.unwrap(), Some(*shortest));
            assert!(plays <= 9.min(2 * place + 1), "{plays} for {shortest}");
        }
        assert_eq!(first_that(&lengths, &mut |_| Ok(false)).unwrap(), None);
    }
}
