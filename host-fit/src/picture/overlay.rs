//! Measured output, model free-runs, their difference against the noise level, and the command.

use std::ops::Range;

use super::axis::{Axis, extent};
use super::canvas::{Ink, MARGIN, Picture, draw};
use super::legend::{Swatch, heading, nothing};
use super::palette::{FLOOR, INK, MUTED, series};
use super::panel::{Clock, FOOT, Panel, left_edge};
use super::strip::{HEIGHT as STRIP, columns, strip};

/// One free-run simulation of a model.
#[derive(Clone, Copy, Debug, Default)]
pub struct LabelledRun<'a> {
    /// Label in the legend, for example `"fixed delay, FIT 87.6 %"`.
    pub label: &'a str,
    /// Simulated output, one value per sample of the record, in the unit of y.
    pub y: &'a [f64],
}

/// Contents of [`overlay`]. Slices may be shorter than the record; the missing part is not drawn.
#[derive(Clone, Copy, Debug, Default)]
pub struct Overlay<'a> {
    /// Title; empty for none.
    pub title: &'a str,
    /// Label of the output axis with its unit; empty means "Output y".
    pub y_label: &'a str,
    /// Sample period, s.
    pub sample_period_s: f64,
    /// Time of the first sample, s.
    pub t0_s: f64,
    /// Command; values in {0, 1} become bars, others a line; empty for none.
    pub u: &'a [f64],
    /// Measured output.
    pub y: &'a [f64],
    /// Standard error of the measured output; a band of ±2 standard errors is drawn.
    pub y_sd: Option<&'a [f64]>,
    /// Smallest value over the repeats; with `y_max` the band around y (instead of ±2 `y_sd`).
    pub y_min: Option<&'a [f64]>,
    /// Largest value over the repeats.
    pub y_max: Option<&'a [f64]>,
    /// Models to compare, the most important last (drawn on top).
    pub models: &'a [LabelledRun<'a>],
    /// Part to show, from and to, s; the whole record when `None`.
    pub window_s: Option<(f64, f64)>,
}

const MAIN: f64 = 290.0;
const RESIDUAL: f64 = 120.0;

/// Draws one record: the output with its scatter and the models' free-runs, the command,
/// and the residual (measured − model) against the noise level. Returns SVG.
///
/// The scale follows the measurement. A model that deviates from the measured range by more than
/// this range is drawn along the edge of the panel.
#[must_use]
pub fn overlay(plot: &Overlay<'_>) -> Picture {
    let description = format!("{}: measured output and model", plot.title);
    draw(&description, |canvas| {
        let clock = Clock::new(plot.t0_s, plot.sample_period_s);
        let range = clock.samples(plot.window_s, plot.y.len());
        let finite = |values: &[f64]| extent(part(values, &range));
        if plot.y.is_empty() || (finite(plot.y).is_none() && plot.models.is_empty()) {
            return nothing(canvas, plot.title, "No samples to draw.");
        }

        let spread: Option<(Vec<f64>, Vec<f64>)> = plot.y_sd.map(|sd| around(plot.y, sd));
        let floor: Option<(Vec<f64>, Vec<f64>)> =
            plot.y_sd.map(|sd| around(&vec![0.0; sd.len()], sd));
        let scatter: Option<(&[f64], &[f64], &str)> = match (plot.y_min, plot.y_max, &spread) {
            (Some(low), Some(high), None) => Some((low, high, "range over repeats")),
            (Some(low), Some(high), _) if plot.models.is_empty() => {
                Some((low, high, "range over repeats"))
            }
            (Some(low), Some(high), Some(_)) => {
                Some((low, high, "range over repeats (below: ± 2 standard errors)"))
            }
            (_, _, Some((low, high))) => Some((low, high, "± 2 standard errors")),
            _ => None,
        };
        let residuals: Vec<Vec<f64>> = plot
            .models
            .iter()
            .map(|run| plot.y.iter().zip(run.y).map(|(y, m)| y - m).collect())
            .collect();

        let mut entries = vec![(Swatch::Line(INK), "measured".to_owned())];
        if let Some((_, _, name)) = scatter {
            entries.push((Swatch::Band(FLOOR), name.to_owned()));
        }
        for (index, run) in plot.models.iter().enumerate() {
            entries.push((Swatch::Line(series(index)), run.label.to_owned()));
        }
        let top = heading(canvas, plot.title, &entries);

        let measured = union(
            finite(plot.y),
            scatter.and_then(|(low, high, _)| union(finite(low), finite(high))),
        );
        let simulated = plot
            .models
            .iter()
            .fold(None, |all, run| union(all, finite(run.y)));
        let y_axis = Axis::padded(within(measured, simulated, 0.6), 0.05);
        let misfit = residuals.iter().fold(None, |all, r| union(all, finite(r)));
        let around_zero = floor
            .as_ref()
            .and_then(|(low, high)| union(finite(low), finite(high)));
        let (low, high) = y_axis.ends();
        let limit = (high - low) * 0.6;
        let residual_axis = Axis::padded(
            union(union(misfit, around_zero), Some((0.0, 0.0)))
                .map(|(low, high)| (low.max(-limit), high.min(limit))),
            0.06,
        );

        let left = left_edge([&y_axis, &residual_axis]);
        let main = Panel {
            left,
            top,
            width: canvas.width - left - MARGIN - 12.0,
            height: MAIN,
            x: clock.axis(&range),
            y: y_axis,
        };
        let lines = 2 * plot.models.len() + 7;
        let columns = columns(main.width, lines);
        main.uprights(canvas);
        main.frame(canvas, named(plot.y_label, "Output y"));
        if let Some((low, high, _)) = scatter {
            let ink = Ink::new(FLOOR, 1.0).faint(0.35);
            main.band(canvas, clock, (low, high), range.clone(), columns, ink);
        }
        main.trace(
            canvas,
            clock,
            plot.y,
            range.clone(),
            columns,
            Ink::new(INK, 1.75),
        );
        for (index, run) in plot.models.iter().enumerate() {
            let ink = Ink::new(series(index), 1.75).faint(0.9);
            main.trace(canvas, clock, run.y, range.clone(), columns, ink);
        }

        let mut bottom = main.bottom() + 8.0;
        if !plot.u.is_empty() {
            let command = (clock, plot.u, range.clone());
            let ink = Ink::new(MUTED, 1.0);
            strip(canvas, &main, bottom, command, columns, ("u", ink));
            bottom += STRIP + 10.0;
        }
        let last = if plot.models.is_empty() {
            Panel {
                top: bottom - 8.0,
                height: 0.0,
                ..main
            }
        } else {
            let panel = Panel {
                top: bottom,
                height: RESIDUAL,
                y: residual_axis,
                ..main
            };
            panel.uprights(canvas);
            panel.frame(canvas, "y − model");
            if let Some((low, high)) = &floor {
                let ink = Ink::new(FLOOR, 1.0).faint(0.35);
                panel.band(canvas, clock, (low, high), range.clone(), columns, ink);
            }
            for (index, residual) in residuals.iter().enumerate() {
                let ink = Ink::new(series(index), 1.25).faint(0.85);
                panel.trace(canvas, clock, residual, range.clone(), columns, ink);
            }
            if let Some((low, high)) = &floor {
                for edge in [low, high] {
                    let ink = Ink::new(MUTED, 1.0);
                    panel.trace(canvas, clock, edge, range.clone(), columns, ink);
                }
            }
            panel.curve(
                canvas,
                [(panel.x.ends().0, 0.0), (panel.x.ends().1, 0.0)],
                Ink::new(MUTED, 1.0),
            );
            panel
        };
        last.foot(canvas, "Time (s)");
        last.bottom() + FOOT
    })
}

/// `label`, or `otherwise` when it is empty.
pub(super) fn named<'a>(label: &'a str, otherwise: &'a str) -> &'a str {
    if label.is_empty() { otherwise } else { label }
}

/// ±2 `sd` around `centre`.
fn around(centre: &[f64], sd: &[f64]) -> (Vec<f64>, Vec<f64>) {
    centre
        .iter()
        .zip(sd)
        .map(|(c, s)| (c - 2.0 * s, c + 2.0 * s))
        .unzip()
}

/// The existing samples of `range`.
pub(super) fn part(values: &[f64], range: &Range<usize>) -> impl Iterator<Item = f64> {
    let end = range.end.min(values.len());
    values
        .get(range.start.min(end)..end)
        .unwrap_or_default()
        .iter()
        .copied()
}

/// Smallest range that contains `a` and `b`.
pub(super) fn union(a: Option<(f64, f64)>, b: Option<(f64, f64)>) -> Option<(f64, f64)> {
    match (a, b) {
        (Some(a), Some(b)) => Some((a.0.min(b.0), a.1.max(b.1))),
        (one, other) => one.or(other),
    }
}

/// `measured`, widened towards `simulated` by at most `share` of its length on either side.
pub(super) fn within(
    measured: Option<(f64, f64)>,
    simulated: Option<(f64, f64)>,
    share: f64,
) -> Option<(f64, f64)> {
    let (Some((low, high)), Some(other)) = (measured, simulated) else {
        return measured.or(simulated);
    };
    let room = (high - low).max(low.abs().max(high.abs()) * 1e-6) * share;
    Some((
        low.min(other.0.max(low - room)),
        high.max(other.1.min(high + room)),
    ))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::picture::testing::{absurd_series, check, square_response};

    #[test]
    fn a_spike_of_one_sample_in_a_long_record_is_drawn() {
        let (u, mut y) = square_response(400_000);
        y[250_001] = 9.0;
        let model = vec![0.5; y.len()];
        let plot = Overlay {
            sample_period_s: 0.001,
            u: &u,
            y: &y,
            models: &[LabelledRun {
                label: "m",
                y: &model,
            }],
            ..Overlay::default()
        };
        let svg = overlay(&plot);
        check(&svg);
        // With the spike the measured line spans the panel; without it, the line stays within the lowest eighth.
        let document = roxmltree::Document::parse(&svg).unwrap();
        let heights = |points: &str| {
            let ys = points
                .split_whitespace()
                .filter_map(|p| p.split_once(',')?.1.parse().ok());
            let (top, bottom) = extent(ys).unwrap();
            bottom - top
        };
        let tallest = document
            .descendants()
            .filter(|n| n.attribute("stroke") == Some(INK.to_string().as_str()))
            .filter_map(|n| n.attribute("points").map(heights))
            .fold(0.0, f64::max);
        assert!(tallest > 0.85 * MAIN, "spike lost: {tallest}");
    }

    #[test]
    fn ten_models_on_a_long_record_stay_small() {
        let (u, y) = square_response(300_000);
        let noisy: Vec<f64> = (0..y.len())
            .map(|k| y[k] + 0.1 * ((k * 7919 % 1000) as f64 / 1000.0))
            .collect();
        let sd = vec![0.02; y.len()];
        let models = [LabelledRun {
            label: "model",
            y: &noisy,
        }; 10];
        check(&overlay(&Overlay {
            sample_period_s: 0.001,
            u: &u,
            y: &noisy,
            y_sd: Some(&sd),
            y_min: Some(&y),
            y_max: Some(&noisy),
            models: &models,
            ..Overlay::default()
        }));
    }

    #[test]
    fn absurd_input_never_panics() {
        for y in absurd_series() {
            for model in absurd_series() {
                for window_s in [None, Some((0.5, 0.2)), Some((f64::NAN, 1e300))] {
                    check(&overlay(&Overlay {
                        title: "<&>\"",
                        sample_period_s: 0.001,
                        u: &model,
                        y: &y,
                        y_sd: Some(&model),
                        y_min: Some(&y),
                        y_max: Some(&model),
                        models: &[LabelledRun {
                            label: "<m>",
                            y: &model,
                        }],
                        window_s,
                        ..Overlay::default()
                    }));
                }
            }
        }
    }
}
