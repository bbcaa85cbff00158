//! Several curves over one coordinate: correlations, spectra, step responses.

use super::axis::{Axis, extent};
use super::canvas::{Ink, MARGIN, Picture, draw};
use super::legend::{Swatch, heading, nothing};
use super::palette::{FLOOR, INK, MUTED, series};
use super::panel::{FOOT, Panel, left_edge};

/// One curve.
#[derive(Clone, Copy, Debug, Default)]
pub struct Line<'a> {
    /// Label in the legend.
    pub label: &'a str,
    /// Points on ascending coordinates.
    pub points: &'a [(f64, f64)],
    /// Colour index of the curve's model; `None` for the ink colour of measurements.
    pub colour: Option<usize>,
    /// Dashed, to distinguish two curves of one model.
    pub dashed: bool,
}

/// Contents of [`lines`].
#[derive(Clone, Copy, Debug, Default)]
pub struct LinePlot<'a> {
    /// Title; empty for none.
    pub title: &'a str,
    /// Label of the coordinate with its unit.
    pub x_label: &'a str,
    /// Label of the value with its unit.
    pub y_label: &'a str,
    /// The curves, the most important last.
    pub lines: &'a [Line<'a>],
    /// Half width of a band about zero, with its label in the legend.
    pub band: Option<(f64, &'a str)>,
    /// Logarithmic coordinate: points at or below 0 are left out.
    pub log_x: bool,
}

/// Largest number of points drawn.
const MOST_POINTS: usize = 600;

/// Draws curves over one coordinate, with a band about zero. Returns SVG.
#[must_use]
pub fn lines(plot: &LinePlot<'_>) -> Picture {
    let description = format!("{}: {} against {}", plot.title, plot.y_label, plot.x_label);
    draw(&description, |canvas| {
        let place = |x: f64| if plot.log_x { x.log10() } else { x };
        let curves: Vec<Vec<(f64, f64)>> = plot
            .lines
            .iter()
            .map(|line| {
                let usable = line.points.iter().map(|(x, y)| (place(*x), *y));
                let usable: Vec<_> = usable
                    .filter(|(x, y)| x.is_finite() && y.is_finite())
                    .collect();
                let thin = usable.len().div_ceil(MOST_POINTS).max(1);
                usable.into_iter().step_by(thin).collect()
            })
            .collect();
        let all = || curves.iter().flatten();
        let band = plot.band.filter(|(half, _)| half.is_finite());
        let ends = band.iter().flat_map(|(half, _)| [-half, *half]);
        let Some(shown) = extent(all().map(|p| p.1).chain(ends)) else {
            return nothing(canvas, plot.title, "There is nothing to draw.");
        };
        let ink = |line: &Line<'_>| line.colour.map_or(INK, series);
        let mut entries: Vec<_> = plot
            .lines
            .iter()
            .map(|line| {
                let swatch = if line.dashed {
                    Swatch::Dashes(ink(line))
                } else {
                    Swatch::Line(ink(line))
                };
                (swatch, line.label.to_owned())
            })
            .collect();
        entries.extend(band.map(|(_, label)| (Swatch::Band(FLOOR), label.to_owned())));
        let top = heading(canvas, plot.title, &entries);
        let y = Axis::padded(Some(shown), 0.06);
        let x = extent(all().map(|p| p.0));
        let left = left_edge([&y]);
        let panel = Panel {
            left,
            top,
            width: canvas.width - left - MARGIN - 12.0,
            height: 260.0,
            x: if plot.log_x {
                Axis::decades(x)
            } else {
                Axis::linear(x)
            },
            y,
        };
        panel.uprights(canvas);
        panel.frame(canvas, plot.y_label);
        if let Some((half, _)) = band {
            let (from, to) = panel.x.ends();
            let corners = [(from, half), (to, half), (to, -half), (from, -half)];
            let corners = corners.into_iter().filter_map(|(x, y)| panel.point(x, y));
            let corners: Vec<_> = corners.collect();
            canvas.area(&corners, Ink::new(FLOOR, 1.0).faint(0.35));
            panel.level(canvas, 0.0, Ink::new(MUTED, 1.0));
        }
        for (line, points) in plot.lines.iter().zip(&curves) {
            let ink = Ink::new(ink(line), 2.0);
            if line.dashed {
                let pixels = points.iter().filter_map(|(x, y)| panel.point(*x, *y));
                canvas.dashes(&pixels.collect::<Vec<_>>(), ink, 6.0);
            } else {
                panel.curve(canvas, points.iter().copied(), ink);
            }
        }
        panel.foot(canvas, plot.x_label);
        panel.bottom() + FOOT
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::picture::testing::{absurd_series, check, words};

    #[test]
    fn every_curve_and_the_band_are_in_the_legend() {
        let points = [(0.1, 0.5), (1.0, 0.2), (10.0, -0.1)];
        let line = |label, dashed| Line {
            label,
            points: &points,
            colour: Some(1),
            dashed,
        };
        let svg = lines(&LinePlot {
            x_label: "frequency (Hz)",
            y_label: "dB",
            lines: &[line("before", false), line("after", true)],
            band: Some((0.05, "95 % band")),
            log_x: true,
            ..LinePlot::default()
        });
        check(&svg);
        let said = words(&svg);
        for word in ["before", "after", "95 % band", "frequency (Hz)"] {
            assert!(said.contains(word), "{word}");
        }
    }

    #[test]
    fn absurd_input_never_panics() {
        for values in absurd_series() {
            let points: Vec<_> = values.iter().map(|v| (*v, -*v)).collect();
            for log_x in [false, true] {
                check(&lines(&LinePlot {
                    lines: &[Line {
                        points: &points,
                        ..Line::default()
                    }],
                    band: Some((f64::NAN, "")),
                    log_x,
                    ..LinePlot::default()
                }));
            }
        }
    }
}
