//! Parts that several pages share: the answer, the interval of largest error, the standard residual tests.

use host_fit::analysis::{
    Estimate, FrequencyPoint, FrequencyResponse, Residuals, correlations, estimated_response,
    frequency_response, poles, spectrum, step_response,
};
use host_fit::data::{Record, Use};
use host_fit::indicators::ErrorKind;
use host_fit::model::Model;
use host_fit::picture::{
    Column, FrequencyCurve, FrequencyPlot, LabelledRun, Line, LinePlot, MAGNITUDE_DEPTH_DB,
    MeasuredResponse, Overlay, PHASE_DEPTH_DEG, Picture, Report, Tone, frequency, lines, overlay,
    significant,
};
use host_fit::steps::{self, Answer};

/// The answer as a card.
pub(crate) fn card(report: &mut Report, answer: &Answer) {
    let tone = match answer.tone {
        steps::Tone::Good => Tone::Good,
        steps::Tone::Finding => Tone::Finding,
        steps::Tone::Warning => Tone::Warning,
    };
    report.answer(tone, &answer.verdict, &answer.parts(), &answer.notes);
}

/// Free runs of a model, one for each record.
pub(crate) struct Run<'a> {
    pub(crate) label: &'a str,
    pub(crate) model: &'a Model,
    pub(crate) runs: &'a [Vec<f64>],
    /// Colour index of the model's curves; `None` for its position among the runs.
    pub(crate) colour: Option<usize>,
}

/// Colour index of each run.
fn colours(runs: &[Run<'_>]) -> Vec<usize> {
    let each = runs.iter().enumerate();
    each.map(|(i, run)| run.colour.unwrap_or(i)).collect()
}

/// The interval in which a run has its largest error.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Stretch {
    /// Index of the record.
    pub(crate) record: usize,
    /// Start and end, s since the start of the record.
    pub(crate) from: f64,
    pub(crate) to: f64,
}

/// Length of the interval: two seconds or four periods of the command, at least a hundred samples.
fn stretch_samples(record: &Record) -> usize {
    let rising = record.u.windows(2).enumerate();
    let rising: Vec<usize> = rising
        .filter(|(_, pair)| pair[0] < 0.5 && pair[1] >= 0.5)
        .map(|(k, _)| k)
        .collect();
    let mut periods: Vec<usize> = rising.windows(2).map(|pair| pair[1] - pair[0]).collect();
    periods.sort_unstable();
    let period = periods.get(periods.len() / 2).copied().unwrap_or(0);
    let two_seconds = (2.0 / record.sample_period_s) as usize;
    let least = two_seconds.max(100).max(4 * period);
    least.min(record.len())
}

/// The interval of the validation records (of all records if there are none) with the largest error of
/// `runs`.
pub(crate) fn worst_stretch(records: &[Record], runs: &[Vec<f64>]) -> Option<Stretch> {
    let validate = records.iter().any(|r| r.role == Use::Validate);
    let judged = records.iter().zip(runs).enumerate();
    let judged = judged.filter(|(_, (record, run))| {
        (!validate || record.role == Use::Validate) && run.len() == record.len()
    });
    let mut worst: Option<(f64, Stretch)> = None;
    for (index, (record, run)) in judged {
        let width = stretch_samples(record);
        let squares: Vec<f64> = record
            .y
            .iter()
            .zip(run)
            .map(|(y, m)| (y - m).powi(2))
            .collect();
        let step = (width / 20).max(1);
        for start in (0..=record.len() - width).step_by(step) {
            let Some(part) = squares.get(start..start + width) else {
                continue;
            };
            let mean = part.iter().sum::<f64>() / width.max(1) as f64;
            if mean.is_finite() && worst.is_none_or(|(most, _)| mean > most) {
                let seconds = |k: usize| k as f64 * record.sample_period_s;
                let stretch = Stretch {
                    record: index,
                    from: seconds(start),
                    to: seconds(start + width),
                };
                worst = Some((mean, stretch));
            }
        }
    }
    worst.map(|(_, stretch)| stretch)
}

/// The picture of an interval: measurement and runs, with the error of each there.
pub(crate) fn stretch_picture(
    report: &mut Report,
    records: &[Record],
    runs: &[(&str, &[Vec<f64>])],
    stretch: Stretch,
) {
    if let Some((picture, caption)) = stretch_figure(records, runs, stretch) {
        report.figure(&picture, &caption);
    }
}

/// The picture of [`stretch_picture`].
pub(crate) fn stretch_figure(
    records: &[Record],
    runs: &[(&str, &[Vec<f64>])],
    stretch: Stretch,
) -> Option<Figure> {
    let record = records.get(stretch.record)?;
    let rate = 1.0 / record.sample_period_s;
    let (from, to) = ((stretch.from * rate) as usize, (stretch.to * rate) as usize);
    let own: Vec<(&str, &Vec<f64>)> = runs
        .iter()
        .filter_map(|(label, runs)| Some((*label, runs.get(stretch.record)?)))
        .collect();
    let errors = own.iter().map(|(label, run)| {
        let pairs = record.y.iter().zip(*run).take(to).skip(from);
        let sum: f64 = pairs.map(|(y, m)| (y - m).powi(2)).sum();
        let rmse = (sum / to.saturating_sub(from).max(1) as f64).sqrt();
        format!("{label} RMSE {}", significant(rmse, 3))
    });
    let errors = errors.collect::<Vec<_>>().join(", ");
    let models: Vec<LabelledRun<'_>> = own
        .iter()
        .map(|(label, y)| LabelledRun { label, y })
        .collect();
    let title = format!(
        "Where the error is largest: {}, {} to {} s",
        record.name,
        significant(stretch.from, 3),
        significant(stretch.to, 3)
    );
    let svg = overlay(&Overlay {
        title: &title,
        y_label: "y",
        models: &models,
        window_s: Some((record.t0 + stretch.from, record.t0 + stretch.to)),
        ..measured(record)
    });
    let caption = format!(
        "The {} s of the {} with the largest error. Errors in this interval: {errors}.",
        significant(stretch.to - stretch.from, 2),
        ErrorKind::of(record.role).records()
    );
    Some((svg, caption))
}

/// The measurement of a record, for a picture.
pub(super) fn measured(record: &Record) -> Overlay<'_> {
    Overlay {
        sample_period_s: record.sample_period_s,
        t0_s: record.t0,
        u: &record.u,
        y: &record.y,
        y_sd: record.y_sd.as_deref(),
        y_min: record.y_min.as_deref(),
        y_max: record.y_max.as_deref(),
        ..Overlay::default()
    }
}

/// A picture with its caption.
pub(crate) type Figure = (Picture, String);

/// Residual correlations, residual spectrum, step responses, poles and frequency responses of each model.
pub(crate) fn checks(report: &mut Report, records: &[Record], runs: &[Run<'_>]) {
    report.section("Residual tests");
    report.columns();
    for (picture, caption) in check_figures(records, runs) {
        report.figure(&picture, &caption);
    }
    report.end_columns();
    let rows = pole_rows(runs);
    if !rows.is_empty() {
        report.subsection("Poles");
        let columns = POLES.map(|(name, is_number)| match is_number {
            true => Column::Number(name),
            false => Column::Text(name),
        });
        report.table(POLES_ARE, &columns, &rows);
    }
    let figures = frequency_figures(records, runs);
    if figures.is_empty() {
        return;
    }
    report.fold("Frequency response");
    report.columns();
    for (picture, caption) in figures {
        report.figure(&picture, &caption);
    }
    report.end_columns();
    report.end_fold();
}

/// The pictures of [`checks`].
pub(crate) fn check_figures(records: &[Record], runs: &[Run<'_>]) -> Vec<Figure> {
    let residuals: Vec<Residuals> = runs
        .iter()
        .map(|run| Residuals::of(records, run.runs))
        .collect();
    let tested: Vec<_> = residuals.iter().map(correlations).collect();
    let outside = |of: &dyn Fn(usize) -> f64| {
        let each = runs.iter().enumerate();
        let each = each.map(|(i, run)| format!("{} {:.0} %", run.label, 100.0 * of(i)));
        each.collect::<Vec<_>>().join(", ")
    };
    let last = tested.last().cloned().unwrap_or_default();
    let mut figures = Vec::new();
    let auto = curves(runs, tested.iter().map(|(auto, _)| auto.points.as_slice()));
    figures.push((
        lines(&LinePlot {
            title: "Residual autocorrelation",
            x_label: "lag (s)",
            y_label: "correlation",
            lines: &auto,
            band: Some((last.0.band, "95 % band of a white residual")),
            log_x: false,
        }),
        format!(
            "95 % of the lags of a white residual lie within the band. Coloured measurement noise exceeds the band as well. Share of the lags outside: {}.",
            outside(&|i| tested[i].0.outside)
        ),
    ));
    let cross = curves(
        runs,
        tested.iter().map(|(_, cross)| cross.points.as_slice()),
    );
    figures.push((
        lines(&LinePlot {
            title: "Cross-correlation of u and residual",
            x_label: "lag of the residual behind u (s)",
            y_label: "correlation",
            lines: &cross,
            band: Some((last.1.band, "95 % band of an independent residual")),
            log_x: false,
        }),
        format!(
            "Peaks outside the band at positive lags show dynamics from u to y that the model lacks. Share of the lags outside \
             (5 % is expected of a complete model): {}.",
            outside(&|i| tested[i].1.outside)
        ),
    ));
    figures.extend(spectra(runs, &residuals));
    figures.extend(responses(runs));
    figures
}

/// A solid line for each model, in its colour.
fn curves<'a>(runs: &[Run<'a>], points: impl Iterator<Item = &'a [(f64, f64)]>) -> Vec<Line<'a>> {
    let labels = runs.iter().map(|run| run.label).zip(colours(runs));
    let line = |((label, colour), points)| Line {
        label,
        points,
        colour: Some(colour),
        dashed: false,
    };
    labels.zip(points).map(line).collect()
}

fn spectra(runs: &[Run<'_>], residuals: &[Residuals]) -> Option<Figure> {
    let spectra: Vec<_> = residuals.iter().map(spectrum).collect();
    let decibels = |hz: &[f64], density: &[f64]| -> Vec<(f64, f64)> {
        let pairs = hz.iter().zip(density);
        pairs
            .map(|(hz, s)| (*hz, 10.0 * s.max(f64::MIN_POSITIVE).log10()))
            .collect()
    };
    let first = spectra.first().filter(|s| !s.hz.is_empty())?;
    let output = decibels(&first.hz, &first.output);
    let noise = first
        .noise
        .map(|noise| decibels(&first.hz, &vec![noise; first.hz.len()]));
    let each: Vec<Vec<(f64, f64)>> = spectra
        .iter()
        .map(|s| decibels(&s.hz, &s.residual))
        .collect();
    let mut drawn = vec![Line {
        label: "measured y",
        points: &output,
        colour: None,
        dashed: false,
    }];
    if let Some(noise) = &noise {
        drawn.push(Line {
            label: "noise y_sd, if white",
            points: noise,
            colour: None,
            dashed: true,
        });
    }
    drawn.extend(curves(runs, each.iter().map(Vec::as_slice)));
    Some((
        lines(&LinePlot {
            title: "Residual spectrum",
            x_label: "frequency (Hz)",
            y_label: "density (dB re 1 y²/Hz)",
            lines: &drawn,
            band: None,
            log_x: true,
        }),
        "Welch's estimate. If the residual exceeds the noise at a frequency, the model lacks dynamics there, or the noise is \
         coloured.".to_owned(),
    ))
}

/// Labels of the two curves of each model.
fn labels(runs: &[Run<'_>], curves: [&str; 2]) -> Vec<[String; 2]> {
    let each = runs.iter();
    each.map(|run| curves.map(|curve| format!("{}: {curve}", run.label)))
        .collect()
}

fn responses(runs: &[Run<'_>]) -> Option<Figure> {
    let found: Vec<_> = runs.iter().map(|run| step_response(run.model)).collect();
    let labels = labels(runs, ["opening from rest", "closing from steady"]);
    let mut drawn = Vec::new();
    let curves = found.iter().zip(&labels).zip(colours(runs));
    for ((response, [opening, closing]), colour) in curves {
        let Some(response) = response else { continue };
        for (label, points, dashed) in [
            (opening, &response.opening, false),
            (closing, &response.closing, true),
        ] {
            drawn.push(Line {
                label,
                points,
                colour: Some(colour),
                dashed,
            });
        }
    }
    if drawn.is_empty() {
        return None;
    }
    Some((
        lines(&LinePlot {
            title: "Step response at two levels",
            x_label: "time since the step (s)",
            y_label: "change of y",
            lines: &drawn,
            band: None,
            log_x: false,
        }),
        "The command switches on from rest (0 → 1), and off from the steady state (1 → 0; this response is drawn \
         with the opposite sign). For a linear plant the two responses are equal."
            .to_owned(),
    ))
}

/// The frequency responses of each model: over the records with the measured one, and at the two levels of the step response.
pub(crate) fn frequency_figures(records: &[Record], runs: &[Run<'_>]) -> Vec<Figure> {
    let seconds = records.iter().map(|r| r.len() as f64 * r.sample_period_s);
    let longest_s = seconds.fold(0.0, f64::max);
    let levels: Vec<[Option<FrequencyResponse>; 2]> = runs
        .iter()
        .map(|run| [0, 1].map(|command| frequency_response(run.model, command, longest_s)))
        .collect();
    let over = over_records(records, runs, &levels);
    over.into_iter().chain(at_levels(runs, &levels)).collect()
}

/// The measured frequency response, and that of each model's free run, estimated in the same way.
fn over_records(
    records: &[Record],
    runs: &[Run<'_>],
    levels: &[[Option<FrequencyResponse>; 2]],
) -> Option<Figure> {
    let each: Vec<Vec<Estimate>> = runs
        .iter()
        .zip(levels)
        .map(|(run, levels)| {
            let known = levels.iter().flatten().next();
            let dead_time = known.map_or(0, |response| response.dead_time);
            let range = run.model.command;
            let residuals = Residuals::of(records, run.runs);
            estimated_response(&residuals, range.full - range.off, dead_time)
        })
        .collect();
    let measured = each.last().filter(|estimates| !estimates.is_empty())?;
    let measured: Vec<MeasuredResponse> = measured
        .iter()
        .map(|estimate| MeasuredResponse {
            at: estimate.measured.values(),
            gain: estimate.gain,
            phase: estimate.phase,
        })
        .collect();
    let points: Vec<Vec<[f64; 3]>> = each
        .iter()
        .map(|estimates| estimates.iter().map(|one| one.run.values()).collect())
        .collect();
    let curves: Vec<FrequencyCurve<'_>> = runs
        .iter()
        .zip(&points)
        .zip(colours(runs))
        .map(|((run, points), colour)| FrequencyCurve {
            label: run.label,
            points,
            colour,
            dashed: false,
        })
        .collect();
    let kind = match records.iter().any(|r| r.role == Use::Validate) {
        true => "validation records",
        false => "records",
    };
    Some((
        frequency(&FrequencyPlot {
            title: "Frequency response over the records",
            curves: &curves,
            measured: &measured,
        }),
        format!(
            "Cross-spectrum of u and y divided by the spectrum of u, in twelve bands per decade, from the {kind}; \
             unit: y per full command. The curves are the same estimate from the free runs. Only bands with significant \
             coherence (5 % level) are drawn. The 95 % limits account for measurement noise and for the part of y \
             that is not linear in u. They hold for each band separately. If a curve leaves the limits, the model \
             lacks dynamics there. {}",
            drawing_limits()
        ),
    ))
}

/// The part of a frequency response that is drawn.
fn drawing_limits() -> String {
    format!(
        "Magnitudes more than {MAGNITUDE_DEPTH_DB} dB below the largest and phases more than {PHASE_DEPTH_DEG}° below the \
         largest are not drawn."
    )
}

/// The frequency response of each model, linearised at the two levels of the step response.
fn at_levels(runs: &[Run<'_>], levels: &[[Option<FrequencyResponse>; 2]]) -> Option<Figure> {
    let labels = labels(runs, ["about off", "about on"]);
    let values = |response: &FrequencyResponse| -> Vec<[f64; 3]> {
        let points = response.points.iter();
        points.map(FrequencyPoint::values).collect()
    };
    let points: Vec<[Option<Vec<[f64; 3]>>; 2]> = levels
        .iter()
        .map(|levels| levels.each_ref().map(|level| level.as_ref().map(values)))
        .collect();
    let mut curves = Vec::new();
    for ((points, labels), colour) in points.iter().zip(&labels).zip(colours(runs)) {
        for ((points, label), dashed) in points.iter().zip(labels).zip([false, true]) {
            let Some(points) = points else { continue };
            curves.push(FrequencyCurve {
                label,
                points,
                colour,
                dashed,
            });
        }
    }
    if curves.is_empty() {
        return None;
    }
    let mut caption = format!(
        "Each model with its effects and its dead time, linearised at rest (command off) and in the steady state with the \
         command on. Unit: y per full command, for small changes of the duty. No confidence band is drawn, because a \
         model file has no covariance of its coefficients. {}",
        drawing_limits()
    );
    if levels.iter().flatten().any(Option::is_none) {
        caption.push_str(
            " A level is not drawn if the model does not settle there, or is not linear for small changes of the command.",
        );
    }
    Some((
        frequency(&FrequencyPlot {
            title: "Frequency response at two levels",
            curves: &curves,
            measured: &[],
        }),
        caption,
    ))
}

/// Columns of [`pole_rows`]: the name, and whether the column holds numbers.
pub(crate) const POLES: [(&str, bool); 6] = [
    ("model", false),
    ("command", false),
    ("modulus", true),
    ("time constant, s", true),
    ("frequency, Hz", true),
    ("damping ratio", true),
];

/// Caption of [`pole_rows`].
pub(crate) const POLES_ARE: &str = "The slowest poles of the recursion with a constant command, without effects; one of each conjugate pair.";

/// The slowest poles of each model.
pub(crate) fn pole_rows(runs: &[Run<'_>]) -> Vec<Vec<String>> {
    const MOST: usize = 3;
    let number = |value: f64| significant(value, 3);
    runs.iter()
        .flat_map(|run| {
            let own = poles(run.model, MOST).into_iter();
            own.map(|pole| {
                vec![
                    run.label.to_owned(),
                    if pole.command == 0 { "off" } else { "on" }.to_owned(),
                    format!("{:.5}", pole.modulus),
                    number(pole.time_constant_s),
                    if pole.hz > 0.0 {
                        number(pole.hz)
                    } else {
                        "real".to_owned()
                    },
                    number(pole.damping),
                ]
            })
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_worst_stretch_is_where_the_error_is() {
        let n = 4000;
        let u: Vec<f64> = (0..n).map(|k| f64::from(u8::from(k % 250 < 100))).collect();
        let record = Record::new("a", Use::Validate, 0.001, u, vec![0.0; n]);
        let mut run = vec![0.0; n];
        run[2500..2600].fill(1.0);
        let found = worst_stretch(&[record], &[run]).unwrap();
        assert!(found.from <= 2.5 && found.to >= 2.6, "{found:?}");
        assert!((found.to - found.from - 2.0).abs() < 1e-9);
        assert_eq!(worst_stretch(&[], &[]), None);
    }
}
