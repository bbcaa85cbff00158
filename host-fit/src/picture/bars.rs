//! Horizontal bars: one number per record and model, side by side.

use super::axis::{Axis, extent};
use super::canvas::{Anchor, Ink, MARGIN, WIDTH, Words, draw, fit, text_width};
use super::legend::{Swatch, heading, nothing};
use super::palette::{INK, MUTED, RULE, series};
use super::panel::{FOOT, Panel};

/// The bars of one row.
#[derive(Clone, Copy, Debug, Default)]
pub struct BarRow<'a> {
    /// Name of the row, for example a record.
    pub label: &'a str,
    /// One value per series; NaN leaves its bar out.
    pub values: &'a [f64],
}

/// What [`bars`] draws.
#[derive(Clone, Copy, Debug, Default)]
pub struct Bars<'a> {
    /// Title; empty for none.
    pub title: &'a str,
    /// Label of the axis with its unit.
    pub axis_label: &'a str,
    /// Names of the series; one or none leaves the legend out.
    pub series: &'a [&'a str],
    /// Rows from top to bottom.
    pub rows: &'a [BarRow<'a>],
}

const BAR: f64 = 17.0;
const SIZE: f64 = 14.5;
/// Bars drawn; what comes after is left out.
const MOST: usize = 100;

/// Draws grouped horizontal bars from zero, each with its number. Returns SVG.
#[must_use]
pub fn bars(plot: &Bars<'_>) -> String {
    draw(plot.title, |canvas| {
        let Some((low, high)) = extent(plot.rows.iter().flat_map(|r| r.values).copied()) else {
            return nothing(canvas, plot.title, "No values to draw.");
        };
        let entries: Vec<_> = plot
            .series
            .iter()
            .enumerate()
            .filter(|_| plot.series.len() > 1)
            .map(|(i, name)| (Swatch::Bar(series(i)), (*name).to_owned()))
            .collect();
        let top = heading(canvas, plot.title, &entries);
        let count = plot
            .rows
            .iter()
            .map(|r| r.values.len())
            .max()
            .unwrap_or(1)
            .clamp(1, 10);
        let rows = plot
            .rows
            .get(..plot.rows.len().min(MOST / count))
            .unwrap_or_default();
        let pitch = BAR * count as f64 + 13.0;
        let left = rows
            .iter()
            .map(|r| text_width(r.label, SIZE))
            .fold(40.0, f64::max)
            .min(320.0)
            + MARGIN
            + 10.0;
        // Numbers stand behind their bars: the longest bar leaves room for one.
        let number = 62.0;
        let panel = Panel {
            left,
            top,
            width: WIDTH - left - MARGIN - number,
            height: pitch * rows.len() as f64,
            x: Axis::linear(Some((low.min(0.0), high.max(0.0)))),
            y: Axis::linear(None),
        };
        panel.uprights(canvas);
        let zero = panel.point(0.0, 0.0).map_or(panel.left, |p| p.0);
        for (row, bars) in rows.iter().enumerate() {
            let head = panel.top + pitch * row as f64 + 6.5;
            for (index, value) in bars.values.iter().take(count).enumerate() {
                if !value.is_finite() {
                    continue;
                }
                let Some((tip, _)) = panel.point(*value, 0.0) else {
                    continue;
                };
                let y = head + BAR * index as f64;
                let ink = Ink::new(series(index), 1.0).faint(0.85);
                canvas.rectangle((zero, y + 1.5), (tip, y + BAR - 1.5), ink);
                let at = (tip.max(zero) + 6.0, y + BAR / 2.0);
                canvas.text(Words::new(13.0, MUTED), at, &super::significant(*value, 4));
            }
            let label = fit(bars.label, SIZE, left - MARGIN - 10.0);
            let at = (panel.left - 10.0, head + BAR * count as f64 / 2.0);
            canvas.text(Words::new(SIZE, INK).at(Anchor::End), at, &label);
        }
        canvas.line(
            &[(zero, panel.top), (zero, panel.bottom())],
            Ink::new(RULE, 1.25),
        );
        panel.foot(canvas, plot.axis_label);
        panel.bottom() + FOOT
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::picture::testing::{absurd_series, check, words};

    #[test]
    fn numbers_and_names_are_written() {
        let svg = bars(&Bars {
            title: "FIT",
            axis_label: "FIT (%)",
            series: &["fixed", "state-dependent"],
            rows: &[
                BarRow {
                    label: "sq4-50",
                    values: &[87.62, 88.7],
                },
                BarRow {
                    label: "sq8-80",
                    values: &[92.53, f64::NAN],
                },
            ],
        });
        check(&svg);
        let words = words(&svg);
        assert!(words.contains("87.62") && words.contains("sq8-80") && words.contains("fixed"));
        assert!(!words.contains('–'));
    }

    #[test]
    fn absurd_input_never_panics() {
        for values in absurd_series() {
            let row = BarRow {
                label: "<&>",
                values: &values,
            };
            check(&bars(&Bars {
                series: &["<a>", "b"],
                rows: &[row; 300],
                ..Bars::default()
            }));
        }
    }
}
