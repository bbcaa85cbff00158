//! Phase averages of raw recordings of any length in constant memory.
//!
//! A recording in which one command sequence is repeated is read once, row by row. Repeats are superimposed; for
//! each sample of the period the mean, the standard error of the mean and the envelope are computed (Welford's
//! recursion, which loses no digits over millions of repeats). The memory is a few periods of accumulators,
//! whatever the length of the file.
//!
//! Repeats are aligned on the command's own edges. The first rising edge after the start is the anchor; in every
//! later repeat it is the rising edge closest to the expected time. The command generator and the clock of the
//! recording may therefore drift apart without smearing the average. A period is dropped and counted if it has a
//! missing or unreadable sample, a time step off the grid, no anchor, or another command than most periods.

use std::path::Path;

use crate::averaging::{AverageError, AverageSummary, Averaging, Defect, Dropped};
use crate::error::FilePlace;
use crate::folding::Folding;
use crate::raw::{RawReader, Step};
use crate::record::{Record, Use};
use crate::repetition::Edges;
use crate::sampling::tidy;
use crate::set::{DataSet, unite_periods};
use crate::thresholds::RULES;

/// Number of bytes between progress reports.
const PROGRESS_BYTES: u64 = 1 << 22;

/// Phase-averages several recordings into one data set: each file becomes one record named by its stem.
///
/// Records named in `held_out` are for validation, the others for identification. `progress` is called from time to
/// time with the index of the file and the bytes of it read so far.
///
/// # Errors
/// [`AverageError`] when a file cannot be read, holds no complete period, or the files do not fit together.
pub fn average_files(
    paths: &[&Path],
    held_out: &[String],
    averaging: &Averaging,
    progress: &mut dyn FnMut(usize, u64),
) -> Result<(DataSet, Vec<AverageSummary>), AverageError> {
    let mut records: Vec<Record> = Vec::with_capacity(paths.len());
    let mut summaries = Vec::with_capacity(paths.len());
    let name_of = |path: &Path| {
        path.file_stem()
            .map_or_else(|| "record".into(), |s| s.to_string_lossy().into_owned())
    };
    for (i, path) in paths.iter().enumerate() {
        if paths.iter().take(i).any(|p| name_of(p) == name_of(path)) {
            return Err(AverageError::DoubledName(name_of(path)));
        }
    }
    for (i, path) in paths.iter().enumerate() {
        let name = name_of(path);
        let role = if held_out.contains(&name) {
            Use::Validate
        } else {
            Use::Identify
        };
        let mut raw = RawReader::open(path)?;
        let (record, summary) = average(
            &mut raw,
            &name,
            role,
            averaging,
            FilePlace::file(path),
            &mut |bytes| {
                progress(i, bytes);
            },
        )?;
        records.push(record);
        summaries.push(summary);
    }
    unite_periods(&mut records);
    Ok((DataSet::from_records(None, records)?, summaries))
}

fn average<R: std::io::BufRead>(
    raw: &mut RawReader<R>,
    name: &str,
    role: Use,
    averaging: &Averaging,
    place: FilePlace,
    progress: &mut dyn FnMut(u64),
) -> Result<(Record, AverageSummary), AverageError> {
    let sample_period_s = raw.sample_period_s();
    let samples = averaging.period_s / sample_period_s;
    if !(samples.round() >= 2.0 && samples <= 1e9 && averaging.start_s.is_finite()) {
        return Err(AverageError::Period {
            period_s: averaging.period_s,
            sample_period_s,
        });
    }
    let width = raw.names().len();
    let mut folding = Folding::new(samples, width, averaging);
    let mut values = vec![0.0; width];
    let mut edges = Edges::default();
    let mut reported = 0;
    let mut skip = (averaging.start_s / sample_period_s).round().max(0.0) as u64;
    while let Some(row) = raw.next_row(&mut values)? {
        folding.rows += 1;
        let mut step = row.step;
        if skip > 0 {
            // Rows before the start are only counted.
            let passed = match step {
                Step::Forward(n) => n,
                Step::OffGrid | Step::Restart => 1,
            };
            if folding.rows > 1 {
                skip = skip.saturating_sub(passed);
            }
            if skip > 0 {
                folding.before = row.on;
                continue;
            }
            step = Step::Forward(1);
        }
        let defect = match (step, row.on, row.readable) {
            (Step::OffGrid, _, _) => Some(Defect::UnevenTime),
            (_, _, false) => Some(Defect::UnreadableValue),
            (_, None, true) => Some(Defect::CommandNotOnOff),
            _ => None,
        };
        match step {
            Step::Forward(n) => edges.push(n, row.on),
            Step::OffGrid => edges.push(1, row.on),
            Step::Restart => edges.end(),
        }
        match step {
            Step::Forward(n) if n > 1 => folding.gap(n - 1, row.line),
            Step::Restart => folding.restart(row.line),
            _ => {}
        }
        folding.push(row.line, row.on, defect, &values);
        if raw.bytes() - reported >= PROGRESS_BYTES {
            reported = raw.bytes();
            progress(reported);
        }
    }
    progress(raw.bytes());
    let found = folding.finish(raw, name, role, place.clone());
    if averaging_drops_commands(&found)
        && let Some(repeat) = edges.repeat(averaging.edge_jitter)
        && !is_multiple(samples, repeat as f64)
    {
        return Err(AverageError::RepeatsEvery {
            place: Box::new(place),
            stated: averaging.period_s,
            found: tidy(repeat as f64 * sample_period_s, 0.5 / repeat as f64),
        });
    }
    found
}

/// Whether many periods were dropped for their command, or none remained.
fn averaging_drops_commands(found: &Result<(Record, AverageSummary), AverageError>) -> bool {
    match found {
        Ok((_, summary)) => {
            let is_other =
                |d: &&Dropped| matches!(d.defect, Defect::OtherCommand | Defect::NoAnchorEdge);
            let dropped: u64 = summary
                .dropped
                .iter()
                .filter(is_other)
                .map(|d| d.periods)
                .sum();
            let all = (dropped + summary.periods_used) as f64;
            dropped as f64 >= RULES.other_commands * all
        }
        Err(AverageError::NothingLeft { .. }) => true,
        Err(_) => false,
    }
}

/// Whether `samples` is a multiple of `repeat`, within the search range of the anchor.
fn is_multiple(samples: f64, repeat: f64) -> bool {
    let times = (samples / repeat).round();
    times >= 1.0 && (samples - times * repeat).abs() <= 0.02 * samples
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::averaging::Align;
    use rand::{RngExt, SeedableRng};
    use rand_chacha::ChaCha8Rng;
    use std::fmt::Write as _;

    /// One repeat: 100 samples, on at 10..30 and 50..60.
    fn command(phase: usize) -> bool {
        (10..30).contains(&phase) || (50..60).contains(&phase)
    }

    fn response(phase: usize) -> f64 {
        (phase as f64 * 0.1).sin()
    }

    struct Row {
        time: f64,
        on: bool,
        y: f64,
    }

    fn recording(repeats: usize, noise: f64, seed: u64) -> Vec<Row> {
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        (0..repeats * 100)
            .map(|k| Row {
                time: k as f64 * 0.001,
                on: command(k % 100),
                y: response(k % 100) + noise * (rng.random::<f64>() - 0.5) * 12f64.sqrt(),
            })
            .collect()
    }

    fn text(rows: &[Row]) -> String {
        let mut text = String::from("t,u,y,temp\n");
        for r in rows {
            writeln!(
                text,
                "{:.4},{},{},{}",
                r.time,
                u8::from(r.on),
                r.y,
                20.0 + r.y
            )
            .unwrap();
        }
        text
    }

    fn run(text: &str, averaging: &Averaging) -> Result<(Record, AverageSummary), AverageError> {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("raw.csv");
        std::fs::write(&path, text).unwrap();
        let (set, mut summaries) = average_files(&[&path], &[], averaging, &mut |_, _| {})?;
        Ok((set.records.into_iter().next().unwrap(), summaries.remove(0)))
    }

    fn dropped(summary: &AverageSummary, defect: Defect) -> Option<(u64, u64)> {
        let found = summary.dropped.iter().find(|d| d.defect == defect)?;
        Some((found.periods, found.first_line))
    }

    #[test]
    fn mean_error_and_envelope_are_those_of_all_repeats_at_once() {
        let rows = recording(40, 0.3, 1);
        for align in [Align::Edges, Align::Grid] {
            let averaging = Averaging {
                align,
                ..Averaging::over(0.1)
            };
            let (record, summary) = run(&text(&rows), &averaging).unwrap();
            assert_eq!((summary.periods_used, summary.left_over_samples), (40, 0));
            assert!(summary.dropped.is_empty());
            assert_eq!((record.len(), record.sample_period_s), (100, 0.001));
            for p in 0..100 {
                let all: Vec<f64> = (0..40).map(|r| rows[r * 100 + p].y).collect();
                let mean = all.iter().sum::<f64>() / 40.0;
                let variance = all.iter().map(|y| (y - mean).powi(2)).sum::<f64>() / 39.0;
                assert!((record.y[p] - mean).abs() < 1e-14);
                assert!(
                    (record.y_sd.as_ref().unwrap()[p] - (variance / 40.0).sqrt()).abs() < 1e-14
                );
                assert_eq!(
                    record.y_min.as_ref().unwrap()[p],
                    all.iter().copied().fold(f64::MAX, f64::min)
                );
                assert_eq!(
                    record.y_max.as_ref().unwrap()[p],
                    all.iter().copied().fold(f64::MIN, f64::max)
                );
                assert!((record.channels["temp"][p] - 20.0 - mean).abs() < 1e-12);
                assert_eq!(record.u[p] == 1.0, command(p));
            }
        }
    }

    #[test]
    fn the_standard_error_is_calibrated() {
        // Of the samples' true values, 95 % lie within t(0.975, 19) = 2.093 standard errors of the mean.
        let mut inside = 0;
        for seed in 0..50 {
            let (record, _) = run(&text(&recording(20, 0.3, seed)), &Averaging::over(0.1)).unwrap();
            let sd = record.y_sd.unwrap();
            inside += (0..100)
                .filter(|&p| (record.y[p] - response(p)).abs() < 2.093 * sd[p])
                .count();
        }
        let share = inside as f64 / 5000.0;
        assert!((share - 0.95).abs() < 0.012, "{share}");
    }

    #[test]
    fn broken_periods_are_dropped_and_named_by_their_first_line() {
        let mut rows = recording(20, 0.1, 2);
        rows[512].on = !rows[512].on; // period 5: another command
        rows[713].y = f64::NAN; // period 7
        for row in &mut rows[955..] {
            row.time += 0.0004; // period 9: off the grid once
        }
        rows.drain(1130..1140); // period 11: a gap
        let (record, summary) = run(&text(&rows), &Averaging::over(0.1)).unwrap();
        assert_eq!(summary.periods_used, 16, "{summary:?}");
        assert_eq!(dropped(&summary, Defect::OtherCommand), Some((1, 502)));
        assert_eq!(dropped(&summary, Defect::UnreadableValue), Some((1, 715)));
        assert_eq!(dropped(&summary, Defect::UnevenTime), Some((1, 957)));
        assert_eq!(dropped(&summary, Defect::MissingSamples), Some((1, 1132)));
        assert!(
            record
                .y
                .iter()
                .zip(0..)
                .all(|(y, p)| (y - response(p)).abs() < 0.15)
        );
    }

    #[test]
    fn a_period_that_is_not_that_of_the_command_is_refused_with_its_own() {
        let rows = recording(20, 0.1, 7);
        for align in [Align::Edges, Align::Grid] {
            for (period, is_right) in [
                (0.1, true),
                (0.2, true),
                (0.05, false),
                (0.07, false),
                (0.15, false),
            ] {
                let averaging = Averaging {
                    align,
                    ..Averaging::over(period)
                };
                match run(&text(&rows), &averaging) {
                    Ok(_) => assert!(is_right, "{period}"),
                    Err(error) => {
                        let error = error.to_string();
                        let said =
                            error.contains("repeats every 0.1 s") && error.contains("--period 0.1");
                        assert!(!is_right && said, "{period}: {error}");
                    }
                }
            }
        }
        // The command is off for half of the sequence.
        let mut rows = recording(20, 0.1, 8);
        for (k, row) in rows.iter_mut().enumerate() {
            row.on &= k % 200 < 100;
        }
        let error = run(&text(&rows), &Averaging::over(0.1))
            .unwrap_err()
            .to_string();
        assert!(
            error.contains("raw.csv") && error.contains("every 0.2 s, not every 0.1 s"),
            "{error}"
        );
    }

    #[test]
    fn edges_keep_the_average_sharp_when_the_two_clocks_drift() {
        // The command generator's clock is 0.5 % slow relative to the recording's: 0.5 samples per period.
        let n = 100 * 200;
        let rows: Vec<Row> = (0..n)
            .map(|k| {
                let phase = (f64::from(k) / 1.005) as usize % 100;
                Row {
                    time: f64::from(k) * 0.001,
                    on: command(phase),
                    y: f64::from(u8::from(command(phase))),
                }
            })
            .collect();
        let (record, summary) = run(&text(&rows), &Averaging::over(0.1)).unwrap();
        assert!(
            summary.aligned_on_edges && summary.periods_used > 190,
            "{summary:?}"
        );
        let blurred = record.y.iter().filter(|&&y| y > 0.02 && y < 0.98).count();
        assert!(
            blurred <= 3,
            "{blurred}: one sample of jitter at the other three edges"
        );
        let grid = Averaging {
            align: Align::Grid,
            ..Averaging::over(0.1)
        };
        let (_, summary) = run(&text(&rows), &grid).unwrap();
        assert!(summary.periods_used < 20, "{summary:?}");
    }

    #[test]
    fn start_restart_and_rest_are_handled() {
        let mut rows = recording(10, 0.0, 3);
        let later = Averaging {
            start_s: 0.035,
            ..Averaging::over(0.1)
        };
        let (record, summary) = run(&text(&rows), &later).unwrap();
        assert_eq!(summary.periods_used, 9);
        assert!((record.y[0] - response(35)).abs() < 1e-12);
        // A second recording is appended after 5.4 periods.
        rows.truncate(540);
        rows.extend(recording(4, 0.0, 4));
        let (record, summary) = run(&text(&rows), &Averaging::over(0.1)).unwrap();
        assert_eq!(summary.periods_used, 9);
        assert_eq!(dropped(&summary, Defect::Restart), Some((1, 542)));
        assert!((record.y[35] - response(35)).abs() < 1e-12);
        // The command has no edge: natural flow.
        rows.iter_mut().for_each(|r| r.on = false);
        let (record, summary) = run(&text(&rows), &Averaging::over(0.1)).unwrap();
        assert!(!summary.aligned_on_edges && record.u.iter().all(|&u| u == 0.0));
    }

    #[test]
    fn a_gap_of_years_takes_no_time_and_alignment_goes_on() {
        let mut rows = recording(10, 0.0, 5);
        rows[450..].iter_mut().for_each(|r| r.time += 1e8);
        let (record, summary) = run(&text(&rows), &Averaging::over(0.1)).unwrap();
        assert_eq!(summary.periods_used, 9, "{summary:?}");
        assert!((record.y[35] - response(35)).abs() < 1e-12);
    }

    #[test]
    fn a_gap_of_years_takes_no_time_when_the_period_is_no_whole_number_of_samples() {
        let mut rows = recording(10, 0.0, 5);
        rows[450..].iter_mut().for_each(|r| r.time += 1e9);
        for align in [Align::Edges, Align::Grid] {
            let averaging = Averaging {
                align,
                ..Averaging::over(0.0024)
            };
            let outcome = run(&text(&rows), &averaging);
            assert!(outcome.is_ok_and(|(_, summary)| summary.periods_used > 0));
        }
    }

    #[test]
    fn what_cannot_be_averaged_says_why() {
        let rows = recording(3, 0.0, 6);
        let message =
            |averaging: &Averaging, text: &str| run(text, averaging).unwrap_err().to_string();
        assert!(message(&Averaging::over(0.0), &text(&rows)).contains("period of 0 s"));
        assert!(message(&Averaging::over(f64::NAN), &text(&rows)).contains("period of NaN s"));
        let found = message(&Averaging::over(1.0), &text(&rows));
        assert!(
            found.contains("raw.csv") && found.contains("300 samples left over; a period has 1000"),
            "{found}"
        );
        assert!(message(&Averaging::over(0.1), "t,u,y\n0,0,0\n").contains("raw.csv"));
        assert!(message(&Averaging::over(0.1), "t,u,y,y_sd\n0,0,0,0\n1,0,0,0\n").contains("y_sd"));
    }
}
