//! Measured input delays against the averaged output, and the law fitted to them (the paper's Fig. 8).

use super::axis::{Axis, extent};
use super::canvas::{Ink, MARGIN, Picture, draw};
use super::legend::{Swatch, heading, nothing};
use super::overlay::{named, union};
use super::palette::{BLUE, INK, MUTED, VERMILLION};
use super::panel::{FOOT, Panel, left_edge};

/// Direction of an edge of the command.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum DelayEdge {
    /// Blowing starts.
    Rising,
    /// Blowing stops.
    Falling,
}

/// Delay measured at one edge. Edges without a measurable response are not listed.
#[derive(Clone, Copy, Debug)]
pub struct MeasuredDelay {
    /// Averaged output ỹ at the edge, in the unit of y.
    pub y_avg: f64,
    /// Delay until the output responds, samples.
    pub delay: f64,
    /// Direction of the edge.
    pub edge: DelayEdge,
}

/// The fitted law at one ỹ. Equal limits, or NaN, draw no band.
#[derive(Clone, Copy, Debug)]
pub struct LawPoint {
    /// Averaged output ỹ.
    pub y_avg: f64,
    /// Delay by the law, samples.
    pub delay: f64,
    /// Lower confidence limit, samples.
    pub low: f64,
    /// Upper confidence limit, samples.
    pub high: f64,
}

/// Contents of [`delay_law`].
#[derive(Clone, Copy, Debug, Default)]
pub struct DelayLawPlot<'a> {
    /// Title; empty for none.
    pub title: &'a str,
    /// Sample period, s; turns samples into milliseconds in the label.
    pub sample_period_s: f64,
    /// Measured delays.
    pub points: &'a [MeasuredDelay],
    /// The fitted law on an ascending grid of ỹ; empty for none.
    pub law: &'a [LawPoint],
    /// Label of the law in the legend, for example `"47.35 + 12.69·exp(−20.18·ỹ)"`.
    pub law_label: &'a str,
    /// Number of edges without a measurable response; stated in the legend.
    pub unmeasured: usize,
}

/// Draws measured delays and the fitted law with its confidence band. Returns SVG.
#[must_use]
pub fn delay_law(plot: &DelayLawPlot<'_>) -> Picture {
    let description = format!("{}: measured input delays and the fitted law", plot.title);
    draw(&description, |canvas| {
        let thin = plot.law.len().div_ceil(400).max(1);
        let law: Vec<&LawPoint> = plot.law.iter().step_by(thin).collect();
        let of_points = extent(plot.points.iter().map(|p| p.delay));
        let of_law = extent(law.iter().map(|p| p.delay));
        if of_points.is_none() && of_law.is_none() {
            return nothing(canvas, plot.title, "No edge has a measured delay.");
        }
        let mut entries = Vec::new();
        for (edge, swatch, name) in [
            (DelayEdge::Rising, Swatch::Dot(BLUE), "rising"),
            (DelayEdge::Falling, Swatch::Ring(VERMILLION), "falling"),
        ] {
            let count = plot.points.iter().filter(|p| p.edge == edge).count();
            if count > 0 {
                entries.push((swatch, format!("{name} edges ({count})")));
            }
        }
        if of_law.is_some() {
            let label = named(plot.law_label, "fitted law");
            entries.push((Swatch::Line(INK), label.to_owned()));
            if law.iter().any(|p| p.high > p.low) {
                entries.push((Swatch::Band(MUTED), "95 % confidence".to_owned()));
            }
        }
        let top = heading(canvas, plot.title, &entries);

        // A wide band at the ends of the data must not flatten the points.
        let shown = union(of_points, of_law);
        let x = extent(
            plot.points
                .iter()
                .map(|p| p.y_avg)
                .chain(law.iter().map(|p| p.y_avg)),
        );
        let y_axis = Axis::padded(shown, 0.12);
        let left = left_edge([&y_axis]);
        let panel = Panel {
            left,
            top,
            width: canvas.width - left - MARGIN - 12.0,
            height: 330.0,
            x: Axis::padded(x, 0.03),
            y: y_axis,
        };
        panel.uprights(canvas);
        let period = super::significant(plot.sample_period_s * 1e3, 3);
        let unit = if plot.sample_period_s > 0.0 {
            format!("Input delay (samples of {period} ms)")
        } else {
            "Input delay (samples)".to_owned()
        };
        panel.frame(canvas, &unit);
        let band = || law.iter().filter(|p| p.high > p.low);
        let lower = band().filter_map(|p| panel.point(p.y_avg, p.low));
        let upper = band().rev().filter_map(|p| panel.point(p.y_avg, p.high));
        let outline: Vec<(f64, f64)> = lower.chain(upper).collect();
        canvas.area(&outline, Ink::new(MUTED, 1.0).faint(0.22));
        // More dots make no visible difference.
        let stride = plot.points.len().div_ceil(800).max(1);
        for point in plot.points.iter().step_by(stride) {
            if !(point.y_avg.is_finite() && point.delay.is_finite()) {
                continue;
            }
            if let Some(at) = panel.point(point.y_avg, point.delay) {
                match point.edge {
                    DelayEdge::Rising => canvas.dot(at, 4.5, Ink::new(BLUE, 1.0).faint(0.75), true),
                    DelayEdge::Falling => canvas.dot(at, 4.0, Ink::new(VERMILLION, 1.75), false),
                }
            }
        }
        panel.curve(
            canvas,
            law.iter().map(|p| (p.y_avg, p.delay)),
            Ink::new(INK, 2.25),
        );
        let x_label = match plot.unmeasured {
            0 => "Averaged output ỹ at the edge".to_owned(),
            n => format!(
                "Averaged output ỹ at the edge   (without {n} edges that have no measurable response)"
            ),
        };
        panel.foot(canvas, &x_label);
        panel.bottom() + FOOT
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::picture::testing::{absurd_series, check, words};

    #[test]
    fn counts_edges_and_names_those_left_out() {
        let points = [
            MeasuredDelay {
                y_avg: 0.0,
                delay: 60.0,
                edge: DelayEdge::Rising,
            },
            MeasuredDelay {
                y_avg: 0.8,
                delay: 47.0,
                edge: DelayEdge::Falling,
            },
        ];
        let svg = delay_law(&DelayLawPlot {
            sample_period_s: 0.001,
            points: &points,
            unmeasured: 3,
            ..DelayLawPlot::default()
        });
        check(&svg);
        let words = words(&svg);
        assert!(words.contains("rising edges (1)") && words.contains("falling edges (1)"));
        assert!(words.contains("without 3 edges"));
        assert!(words.contains("samples of 1 ms"));
    }

    #[test]
    fn absurd_input_never_panics() {
        for values in absurd_series() {
            let points: Vec<_> = values
                .iter()
                .map(|v| MeasuredDelay {
                    y_avg: *v,
                    delay: -*v,
                    edge: DelayEdge::Rising,
                })
                .collect();
            let law: Vec<_> = values
                .iter()
                .map(|v| LawPoint {
                    y_avg: *v,
                    delay: *v,
                    low: v - 1.0,
                    high: v * 2.0,
                })
                .collect();
            check(&delay_law(&DelayLawPlot {
                points: &points,
                law: &law,
                ..DelayLawPlot::default()
            }));
        }
    }
}
