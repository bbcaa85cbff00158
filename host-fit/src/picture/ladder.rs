//! The ladder: the error of the model after each added effect, against the noise level.

use super::axis::{Axis, extent};
use super::canvas::{Anchor, Canvas, Ink, MARGIN, Picture, Words, draw, text_width, wrap};
use super::legend::{Swatch, heading, nothing};
use super::palette::{BLUE, Colour, FLOOR, INK, MUTED, PAPER, VERMILLION, series};
use super::panel::{LABEL_SIZE, Panel, TICK_SIZE, left_edge};

/// A step of the ladder: the model after an effect was added.
#[derive(Clone, Copy, Debug, Default)]
pub struct LadderStep<'a> {
    /// Name of the step, for example `"model as given"` or `"+ plenum-droop"`.
    pub label: &'a str,
    /// RMSE of the free run, all records together, in the unit of y.
    pub rmse: f64,
}

/// The errors of the models on one record.
#[derive(Clone, Copy, Debug, Default)]
pub struct LadderRecord<'a> {
    /// Name of the record.
    pub name: &'a str,
    /// RMSE at every step; NaN where unknown.
    pub rmse: &'a [f64],
}

/// Contents of [`ladder`].
#[derive(Clone, Copy, Debug, Default)]
pub struct Ladder<'a> {
    /// Title; empty for none.
    pub title: &'a str,
    /// Unit of y; empty for a normalised output.
    pub y_unit: &'a str,
    /// The steps in order, the given model first.
    pub steps: &'a [LadderStep<'a>],
    /// Name of the error, with a capital letter, for example `"Validation error"`.
    pub error: &'a str,
    /// The records of the error, for example `"validation records"`.
    pub scored: &'a str,
    /// Single records; empty to show them together only.
    pub records: &'a [LadderRecord<'a>],
    /// Noise level, rms over all records together.
    pub noise_rmse: Option<f64>,
}

const HEIGHT: f64 = 300.0;

/// Draws the error step by step against the noise level. Returns SVG.
#[must_use]
pub fn ladder(plot: &Ladder<'_>) -> Picture {
    let description = format!("{}: a column for each step", plot.title);
    draw(&description, |canvas| {
        let noise = plot.noise_rmse.filter(|n| n.is_finite() && *n > 0.0);
        let together = extent(plot.steps.iter().map(|s| s.rmse));
        let Some((_, highest)) = together else {
            return nothing(canvas, plot.title, "No step has an error to draw.");
        };
        let mut entries = vec![(Swatch::Bar(BLUE), format!("all {}", plot.scored))];
        for (index, record) in plot.records.iter().enumerate() {
            entries.push((Swatch::Dot(record_colour(index)), record.name.to_owned()));
        }
        if let Some(noise) = noise {
            let text = format!("noise level {}", super::significant(noise, 3));
            entries.push((Swatch::Dashes(INK), text));
        }
        let top = heading(canvas, plot.title, &entries);

        let records = extent(plot.records.iter().flat_map(|r| r.rmse).copied());
        let upper = [Some(highest), records.map(|r| r.1), noise]
            .into_iter()
            .flatten()
            .fold(0.0, f64::max);
        // A diverging record must not flatten the others.
        let upper = upper.min(highest.max(noise.unwrap_or(0.0)) * 3.0);
        let y = Axis::linear(Some((0.0, if upper > 0.0 { upper * 1.2 } else { 1.0 })));
        let left = left_edge([&y]);
        let panel = Panel {
            left,
            top,
            width: canvas.width - left - MARGIN - 12.0,
            height: HEIGHT,
            x: Axis::linear(Some((0.0, plot.steps.len() as f64))),
            y,
        };
        let unit = match plot.y_unit {
            "" => String::new(),
            unit => format!(" ({unit})"),
        };
        panel.frame(
            canvas,
            &format!("{}: RMSE of the free run{unit}", plot.error),
        );
        let slot = panel.width / plot.steps.len() as f64;
        let half = (slot * 0.34).min(75.0);
        let rungs: Vec<(f64, &LadderStep<'_>)> = plot
            .steps
            .iter()
            .enumerate()
            .map(|(i, step)| (panel.left + slot * (i as f64 + 0.5), step))
            .collect();
        columns(canvas, &panel, &rungs, half, noise);
        if let Some(noise) = noise {
            floor(canvas, &panel, noise);
        }
        dots(canvas, &panel, &rungs, half, plot.records);
        numbers(canvas, &panel, &rungs, half, plot.records);
        labels(canvas, &panel, &rungs, slot)
    })
}

fn record_colour(index: usize) -> Colour {
    // The first colour belongs to the columns.
    series(index % 5 + 1)
}

/// One column per step; the part above the noise level is the model error.
fn columns(
    canvas: &mut Canvas,
    panel: &Panel,
    rungs: &[(f64, &LadderStep<'_>)],
    half: f64,
    noise: Option<f64>,
) {
    for (x, step) in rungs {
        if !step.rmse.is_finite() {
            continue;
        }
        let floor = noise.unwrap_or(0.0).min(step.rmse);
        let corners = [0.0, floor, step.rmse].map(|v| panel.point(0.0, v).map_or(0.0, |p| p.1));
        let [base, middle, top] = corners;
        let excess = Ink::new(BLUE, 1.0).faint(0.85);
        canvas.rectangle((x - half, middle), (x + half, top), excess);
        canvas.rectangle(
            (x - half, base),
            (x + half, middle),
            Ink::new(BLUE, 1.0).faint(0.3),
        );
    }
}

fn floor(canvas: &mut Canvas, panel: &Panel, noise: f64) {
    if let Some((_, at)) = panel.point(0.0, noise) {
        canvas.rectangle(
            (panel.left, at),
            (panel.left + panel.width, panel.bottom()),
            Ink::new(FLOOR, 1.0).faint(0.18),
        );
    }
    panel.level(canvas, noise, Ink::new(INK, 1.5));
}

/// The errors of the single records, side by side within the column of their step.
fn dots(
    canvas: &mut Canvas,
    panel: &Panel,
    rungs: &[(f64, &LadderStep<'_>)],
    half: f64,
    records: &[LadderRecord<'_>],
) {
    let pitch = (1.5 * half / records.len().max(1) as f64).min(26.0);
    for (index, record) in records.iter().enumerate() {
        let offset = pitch * (index as f64 - (records.len() as f64 - 1.0) / 2.0);
        for ((x, _), rmse) in rungs.iter().zip(record.rmse).filter(|(_, r)| r.is_finite()) {
            if let Some((_, y)) = panel.point(0.0, *rmse) {
                canvas.dot((x + offset, y), 6.0, Ink::new(PAPER, 1.0), true);
                canvas.dot(
                    (x + offset, y),
                    4.5,
                    Ink::new(record_colour(index), 1.0),
                    true,
                );
            }
        }
    }
}

/// The error of every step above its column, and the reduction from the step before.
fn numbers(
    canvas: &mut Canvas,
    panel: &Panel,
    rungs: &[(f64, &LadderStep<'_>)],
    half: f64,
    records: &[LadderRecord<'_>],
) {
    let size = if half < 32.0 { 12.0 } else { 15.0 };
    let mut before: Option<f64> = None;
    for (index, (x, step)) in rungs.iter().enumerate() {
        let above = extent(
            records
                .iter()
                .filter_map(|r| r.rmse.get(index).copied())
                .chain([step.rmse]),
        );
        let Some((_, at)) = above.and_then(|(_, highest)| panel.point(0.0, highest)) else {
            continue;
        };
        // Keeps room for both lines below the upper edge.
        let at = (at - 17.0).max(panel.top + 22.0);
        let middle = Words::new(size, INK).at(Anchor::Middle);
        canvas.text(middle.bold(), (*x, at), &super::significant(step.rmse, 3));
        if let Some(before) = before.filter(|b| *b > 0.0 && step.rmse.is_finite()) {
            let change = 100.0 * (step.rmse / before - 1.0);
            let sign = if change > 0.0 { "+" } else { "" };
            let colour = if change > 0.0 { VERMILLION } else { MUTED };
            let text = format!("{sign}{} %", super::format::fixed(change, 0, false));
            let quiet = Words::new(size - 1.0, colour).at(Anchor::Middle);
            canvas.text(quiet, (*x, at - 17.0), &text);
        }
        if step.rmse.is_finite() {
            before = Some(step.rmse);
        }
    }
}

/// Names below the columns; returns the height of the picture.
fn labels(canvas: &mut Canvas, panel: &Panel, rungs: &[(f64, &LadderStep<'_>)], slot: f64) -> f64 {
    let widest = rungs
        .iter()
        .flat_map(|(_, step)| step.label.split_inclusive([' ', '-']))
        .map(|word| text_width(word.trim_end(), 1.0))
        .fold(1.0, f64::max);
    let size = ((slot - 8.0) / widest)
        .clamp(9.0, LABEL_SIZE)
        .min(TICK_SIZE + 1.0);
    let mut most = 1;
    for (x, step) in rungs {
        let lines = wrap(step.label, size, slot - 6.0, 3);
        most = most.max(lines.len());
        for (row, line) in lines.iter().enumerate() {
            canvas.text(
                Words::new(size, INK).at(Anchor::Middle),
                (*x, panel.bottom() + 16.0 + 18.0 * row as f64),
                line,
            );
        }
    }
    panel.bottom() + 18.0 * most as f64 + 18.0
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::picture::testing::{absurd_series, check, words};

    #[test]
    fn prints_the_errors_and_their_fall() {
        let steps = [
            LadderStep {
                label: "model as given",
                rmse: 0.1,
            },
            LadderStep {
                label: "+ plenum-droop",
                rmse: 0.025,
            },
        ];
        let svg = ladder(&Ladder {
            error: "Estimation error",
            scored: "estimation records",
            steps: &steps,
            noise_rmse: Some(0.02),
            ..Ladder::default()
        });
        check(&svg);
        let words = words(&svg);
        assert!(words.contains("0.1\n") && words.contains("0.025") && words.contains("−75 %"));
        assert!(words.contains("noise level"));
        assert!(words.contains("all estimation records") && !words.contains("alidation"));
    }

    #[test]
    fn absurd_input_never_panics() {
        for values in absurd_series() {
            let values = &values[..values.len().min(60)];
            let steps: Vec<_> = values
                .iter()
                .map(|v| LadderStep {
                    label: "<effect-with-a-long-name>",
                    rmse: *v,
                })
                .collect();
            for noise_rmse in [None, Some(f64::NAN), Some(0.0), Some(1e300)] {
                check(&ladder(&Ladder {
                    steps: &steps,
                    records: &[LadderRecord {
                        name: "&",
                        rmse: values,
                    }],
                    noise_rmse,
                    ..Ladder::default()
                }));
            }
        }
    }
}
