//! A curve with its confidence band: a term as a function of its coordinate.

use super::axis::{Axis, extent};
use super::canvas::{Ink, MARGIN, Picture, draw};
use super::legend::{Swatch, heading, nothing};
use super::palette::{BLUE, MUTED};
use super::panel::{FOOT, Panel, left_edge};

/// A point of a curve. NaN limits draw no band.
#[derive(Clone, Copy, Debug)]
pub struct BandPoint {
    /// Coordinate.
    pub x: f64,
    /// Value.
    pub value: f64,
    /// Lower confidence limit.
    pub low: f64,
    /// Upper confidence limit.
    pub high: f64,
}

/// Contents of [`curve`].
#[derive(Clone, Copy, Debug, Default)]
pub struct CurvePlot<'a> {
    /// Title; empty for none.
    pub title: &'a str,
    /// Label of the coordinate with its unit.
    pub x_label: &'a str,
    /// Label of the value with its unit.
    pub y_label: &'a str,
    /// The curve on ascending coordinates.
    pub points: &'a [BandPoint],
}

/// Largest number of points drawn.
const MOST_POINTS: usize = 400;

/// Draws a curve with its confidence band. Returns SVG.
#[must_use]
pub fn curve(plot: &CurvePlot<'_>) -> Picture {
    let description = format!("{}: {} against {}", plot.title, plot.y_label, plot.x_label);
    draw(&description, |canvas| {
        // More points make no visible difference.
        let thin = plot.points.len().div_ceil(MOST_POINTS).max(1);
        let points: Vec<&BandPoint> = plot.points.iter().step_by(thin).collect();
        let values = points.iter().map(|p| p.value);
        let Some(shown) = extent(values) else {
            return nothing(canvas, plot.title, "There is no curve.");
        };
        let entries = [
            (Swatch::Line(BLUE), "curve".to_owned()),
            (Swatch::Band(MUTED), "95 % confidence".to_owned()),
        ];
        let top = heading(canvas, plot.title, &entries);
        // A wide band at poorly determined points must not flatten the curve.
        let y = Axis::padded(Some(shown), 0.35);
        let left = left_edge([&y]);
        let x = extent(points.iter().map(|p| p.x));
        let panel = Panel {
            left,
            top,
            width: canvas.width - left - MARGIN - 12.0,
            height: 280.0,
            x: Axis::padded(x, 0.03),
            y,
        };
        panel.uprights(canvas);
        panel.frame(canvas, plot.y_label);
        let band = || points.iter().filter(|p| p.high > p.low);
        let room = 0.3 * (shown.1 - shown.0).max(0.0);
        let within = |v: f64| v.max(shown.0 - room).min(shown.1 + room);
        let lower = band().filter_map(|p| panel.point(p.x, within(p.low)));
        let upper = band()
            .rev()
            .filter_map(|p| panel.point(p.x, within(p.high)));
        let outline: Vec<(f64, f64)> = lower.chain(upper).collect();
        canvas.area(&outline, Ink::new(MUTED, 1.0).faint(0.22));
        panel.curve(
            canvas,
            points.iter().map(|p| (p.x, p.value)),
            Ink::new(BLUE, 2.25),
        );
        for point in &points {
            if let Some(at) = panel.point(point.x, point.value) {
                canvas.dot(at, 3.5, Ink::new(BLUE, 1.0), true);
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
    fn a_curve_says_what_its_axes_are() {
        let points = [0.0, 0.4, 1.0].map(|x| BandPoint {
            x,
            value: 0.2 * x,
            low: 0.2 * x - 0.01,
            high: 0.2 * x + 0.01,
        });
        let svg = curve(&CurvePlot {
            x_label: "pulse number",
            y_label: "relative change of the jet",
            points: &points,
            ..CurvePlot::default()
        });
        check(&svg);
        let words = words(&svg);
        assert!(words.contains("pulse number") && words.contains("95 % confidence"));
    }

    #[test]
    fn absurd_input_never_panics() {
        for values in absurd_series() {
            let points: Vec<_> = values
                .iter()
                .map(|v| BandPoint {
                    x: *v,
                    value: -*v,
                    low: v - 1.0,
                    high: v * 2.0,
                })
                .collect();
            check(&curve(&CurvePlot {
                points: &points,
                ..CurvePlot::default()
            }));
        }
    }
}
