//! Frequency responses (Bode diagram): magnitude above phase over one logarithmic frequency axis.

use super::axis::{Axis, extent};
use super::canvas::{Canvas, Ink, MARGIN, Picture, draw};
use super::legend::{Swatch, heading, nothing};
use super::palette::{INK, series};
use super::panel::{FOOT, Panel, left_edge};

/// The frequency response of one model.
#[derive(Clone, Copy, Debug, Default)]
pub struct FrequencyCurve<'a> {
    /// Label in the legend.
    pub label: &'a str,
    /// Frequency (Hz), magnitude (y) and phase (degrees) of points on ascending frequencies.
    pub points: &'a [[f64; 3]],
    /// Colour index of the model.
    pub colour: usize,
    /// Dashed, to distinguish two curves of one model.
    pub dashed: bool,
}

/// A point of a frequency response that was estimated from records.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MeasuredResponse {
    /// Frequency (Hz), magnitude (y) and phase (degrees).
    pub at: [f64; 3],
    /// 95 % limits of the magnitude, y.
    pub gain: [f64; 2],
    /// 95 % limits of the phase, degrees.
    pub phase: [f64; 2],
}

/// Contents of [`frequency`].
#[derive(Clone, Copy, Debug, Default)]
pub struct FrequencyPlot<'a> {
    /// Title; empty for none.
    pub title: &'a str,
    /// Curves of models.
    pub curves: &'a [FrequencyCurve<'a>],
    /// Estimates from records, drawn as points with their 95 % limits.
    pub measured: &'a [MeasuredResponse],
}

/// Largest number of points drawn of a curve.
const MOST_POINTS: usize = 600;
/// Range of the magnitude below its largest value, dB.
pub const DEPTH: f64 = 60.0;
/// Range of the phase below its largest value, degrees.
pub const TURN: f64 = 720.0;
/// Height of a panel and distance between the two, pixels.
const HEIGHT: f64 = 190.0;
const BETWEEN: f64 = 20.0;

/// A point of one panel with its limits: logarithm of the frequency, value, lower and upper limit.
type Measured = (f64, f64, [f64; 2]);

/// Draws magnitude and phase of frequency responses. Returns SVG. Nothing is drawn more than 60 dB below the largest
/// magnitude or more than 720° below the largest phase, because so small a response is only rounding and leakage of the
/// window.
#[must_use]
pub fn frequency(plot: &FrequencyPlot<'_>) -> Picture {
    let description = format!("{}: magnitude and phase against frequency", plot.title);
    draw(&description, |canvas| {
        let within = |of: &dyn Fn(&[f64; 3]) -> f64| -> Vec<Vec<(f64, f64)>> {
            let each = plot.curves.iter();
            each.map(|curve| {
                let thin = curve.points.len().div_ceil(MOST_POINTS).max(1);
                let points = curve.points.iter().step_by(thin);
                points.map(|point| (point[0].log10(), of(point))).collect()
            })
            .collect()
        };
        let gains = within(&|[_, gain, _]| decibels(*gain));
        let measured_gains: Vec<Measured> = (plot.measured.iter())
            .map(|e| {
                let limits = e.gain.map(decibels);
                (e.at[0].log10(), decibels(e.at[1]), limits)
            })
            .collect();
        let Some(gain) = range(&gains, &measured_gains, DEPTH) else {
            return nothing(canvas, plot.title, "There is nothing to draw.");
        };
        // A phase is drawn only where its magnitude is drawn.
        let phase = |[_, magnitude, phase]: &[f64; 3]| match decibels(*magnitude) >= gain.0 {
            true => *phase,
            false => f64::NAN,
        };
        let phases = within(&phase);
        let measured_phases: Vec<Measured> = (plot.measured.iter())
            .filter(|e| decibels(e.at[1]) >= gain.0)
            .map(|e| (e.at[0].log10(), e.at[2], e.phase))
            .collect();
        let x = gains.iter().flatten().map(|point| point.0);
        let x = extent(x.chain(measured_gains.iter().map(|point| point.0)));
        let Some(phase) = range(&phases, &measured_phases, TURN) else {
            return nothing(canvas, plot.title, "There is nothing to draw.");
        };
        let mut entries: Vec<_> = plot
            .curves
            .iter()
            .map(|curve| {
                let swatch = match curve.dashed {
                    true => Swatch::Dashes(series(curve.colour)),
                    false => Swatch::Line(series(curve.colour)),
                };
                (swatch, curve.label.to_owned())
            })
            .collect();
        if !plot.measured.is_empty() {
            entries.push((Swatch::Dot(INK), "measured, with 95 % limits".to_owned()));
        }
        let top = heading(canvas, plot.title, &entries);
        let axes = [
            Axis::padded(Some(gain), 0.06),
            Axis::degrees(Axis::padded(Some(phase), 0.06).ends()),
        ];
        let left = left_edge(&axes);
        let width = canvas.width - left - MARGIN - 12.0;
        let mut below = top;
        let parts = [
            (&gains, &measured_gains, gain.0, "magnitude (dB re 1 y)"),
            (&phases, &measured_phases, phase.0, "phase (°)"),
        ];
        for (y, (curves, points, lowest, label)) in axes.into_iter().zip(parts) {
            let panel = Panel {
                left,
                top: below,
                width,
                height: HEIGHT,
                x: Axis::decades(x),
                y,
            };
            panel.uprights(canvas);
            panel.frame(canvas, label);
            for (curve, points) in plot.curves.iter().zip(curves) {
                draw_curve(canvas, &panel, curve, points, lowest);
            }
            for point in points.iter().filter(|point| point.1 >= lowest) {
                draw_measured(canvas, &panel, point);
            }
            below = panel.bottom() + BETWEEN;
            if label.starts_with("phase") {
                panel.foot(canvas, "frequency (Hz)");
            }
        }
        below - BETWEEN + FOOT
    })
}

/// Lowest and highest value of a panel, at most `depth` apart. The limits of measured points widen this range by at
/// most a tenth of `depth` at each end.
fn range(curves: &[Vec<(f64, f64)>], measured: &[Measured], depth: f64) -> Option<(f64, f64)> {
    let values = curves.iter().flatten().map(|point| point.1);
    let (low, high) = extent(values.chain(measured.iter().map(|point| point.1)))?;
    let limits = || measured.iter().flat_map(|point| point.2);
    let (least, most) = extent(limits()).unwrap_or((low, high));
    let beyond = 0.1 * depth;
    let high = high.max(most.min(high + beyond));
    let low = low.min(least.max(low - beyond));
    Some((low.max(high - depth), high))
}

fn draw_curve(
    canvas: &mut Canvas,
    panel: &Panel,
    curve: &FrequencyCurve<'_>,
    points: &[(f64, f64)],
    lowest: f64,
) {
    let ink = Ink::new(series(curve.colour), 2.0);
    let shown = |(x, y): (f64, f64)| (x, if y >= lowest { y } else { f64::NAN });
    let points = points.iter().copied().map(shown);
    if !curve.dashed {
        return panel.curve(canvas, points, ink);
    }
    let pixels: Vec<_> = points.map(|(x, y)| panel.point(x, y)).collect();
    for piece in pixels.split(Option::is_none) {
        let piece: Vec<(f64, f64)> = piece.iter().flatten().copied().collect();
        canvas.dashes(&piece, ink, 6.0);
    }
}

fn draw_measured(canvas: &mut Canvas, panel: &Panel, (x, y, limits): &Measured) {
    let ink = Ink::new(INK, 1.25);
    let [low, high] = limits.map(|limit| panel.point(*x, limit));
    if let (Some(low), Some(high)) = (low, high) {
        canvas.line(&[low, high], ink);
    }
    if let Some(at) = panel.point(*x, *y) {
        canvas.dot(at, 2.5, ink, true);
    }
}

/// A magnitude in dB re 1 y; NaN for one that is not above 0.
fn decibels(gain: f64) -> f64 {
    if gain > 0.0 {
        20.0 * gain.log10()
    } else {
        f64::NAN
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::picture::testing::{absurd_series, check, words};

    #[test]
    fn both_panels_have_their_units_and_every_curve_is_in_the_legend() {
        let points = [0.1, 1.0, 10.0, 100.0].map(|hz| [hz, 1.0 / (1.0 + hz), -36.0 * hz]);
        let curve = |label, dashed| FrequencyCurve {
            label,
            points: &points,
            colour: 1,
            dashed,
        };
        let svg = frequency(&FrequencyPlot {
            title: "Frequency response",
            curves: &[curve("about off", false), curve("about on", true)],
            measured: &[MeasuredResponse {
                at: points[1],
                gain: [0.4, 0.6],
                phase: [-40.0, -30.0],
            }],
        });
        check(&svg);
        let said = words(&svg);
        for word in [
            "about off",
            "about on",
            "95 % limits",
            "frequency (Hz)",
            "magnitude (dB re 1 y)",
            "phase (°)",
            "−360",
        ] {
            assert!(said.contains(word), "{word} in {said}");
        }
        // The phase of the last point is 3600° lower, so the axis ends before it.
        assert!(!said.contains("−3600"), "{said}");
    }

    #[test]
    fn absurd_input_never_panics() {
        for values in absurd_series() {
            let points: Vec<_> = values.iter().map(|v| [*v, *v, -*v]).collect();
            let measured: Vec<_> = points
                .iter()
                .take(500)
                .map(|point| MeasuredResponse {
                    at: *point,
                    gain: [f64::NAN, point[1]],
                    phase: [point[2], f64::INFINITY],
                })
                .collect();
            for dashed in [false, true] {
                check(&frequency(&FrequencyPlot {
                    title: "",
                    curves: &[FrequencyCurve {
                        points: &points,
                        dashed,
                        ..FrequencyCurve::default()
                    }],
                    measured: &measured,
                }));
            }
        }
    }
}
