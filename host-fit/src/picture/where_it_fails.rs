//! Where a model fails: the size of the residual along one coordinate after another.

use super::axis::{Axis, extent};
use super::canvas::{Anchor, BOLD, Canvas, Ink, MARGIN, Picture, Words, draw, fit, text_width};
use super::format::fixed;
use super::legend::{Swatch, heading, nothing};
use super::overlay::named;
use super::palette::{BLUE, INK, MUTED, VERMILLION};
use super::panel::{Panel, left_edge};

/// One bin of a coordinate. A bin with `from == to` contains a single value.
#[derive(Clone, Copy, Debug)]
pub struct FailureBin {
    /// Lower end, in the coordinate's unit.
    pub from: f64,
    /// Upper end.
    pub to: f64,
    /// RMS of the free-run residual in the bin, unit of y; NaN for an empty bin.
    pub rmse: f64,
    /// RMS of the noise in the bin; NaN if unknown.
    pub noise_rmse: f64,
}

/// The residual along one coordinate.
#[derive(Clone, Debug, Default)]
pub struct FailureView<'a> {
    /// Name of the coordinate, for example `"time since rising edge"`.
    pub coordinate: String,
    /// Unit of the coordinate; empty for none.
    pub unit: &'a str,
    /// Share of the error above the noise that the coordinate explains, cross-validated, 0 to 1.
    pub explained_fraction: Option<f64>,
    /// Bins in ascending order; they are drawn equally wide.
    pub bins: &'a [FailureBin],
}

/// Contents of the picture that [`where_it_fails`] draws.
#[derive(Clone, Copy, Debug, Default)]
pub struct WhereItFails<'a> {
    /// Title; empty for none.
    pub title: &'a str,
    /// Label of the vertical axes with the unit of y; empty means "RMS residual".
    pub y_label: &'a str,
    /// Panels, in this order.
    pub views: &'a [FailureView<'a>],
}

/// Explained share below which no bin is marked.
const WORTH_MARKING: f64 = 0.05;
const PANEL: f64 = 118.0;
/// Height for the name of the coordinate and, below it, the explained share.
const HEAD: f64 = 48.0;
const TICKS: f64 = 26.0;

/// Draws one small panel per coordinate on a common scale, with the noise level and the
/// bin that stands out most above it. Returns SVG.
#[must_use]
pub fn where_it_fails(plot: &WhereItFails<'_>) -> Picture {
    let description = format!("{}: residual along each coordinate", plot.title);
    draw(&description, |canvas| {
        let bins = || plot.views.iter().flat_map(|v| v.bins);
        let Some((_, highest)) = extent(bins().map(|b| b.rmse)) else {
            return nothing(canvas, plot.title, "No residual to draw.");
        };
        let mut entries = vec![
            (Swatch::Bar(BLUE), "RMS residual".to_owned()),
            (Swatch::Bar(VERMILLION), "worst bin".to_owned()),
        ];
        if bins().any(|b| b.noise_rmse.is_finite()) {
            entries.push((Swatch::Line(INK), "noise level".to_owned()));
        }
        let top = heading(canvas, plot.title, &entries);
        let upper = if highest > 0.0 { highest * 1.12 } else { 1.0 };
        let y = Axis::linear(Some((0.0, upper)));
        let left = left_edge([&y]);
        let gap = left - 22.0;
        let columns = if canvas.is_narrow() { 1 } else { 2 };
        // The last label of a panel reaches beyond its edge.
        let width =
            (canvas.width - left - MARGIN - 10.0 - gap * (columns - 1) as f64) / columns as f64;
        let mut bottom = top;
        for (index, view) in plot.views.iter().enumerate() {
            let row = (index / columns) as f64;
            let column = (index % columns) as f64;
            let panel = Panel {
                left: left + column * (width + gap),
                top: top + row * (HEAD + PANEL + TICKS + 12.0) + HEAD,
                width,
                height: PANEL,
                x: Axis::linear(Some((0.0, view.bins.len().max(1) as f64))),
                y,
            };
            small(
                canvas,
                &panel,
                index,
                view,
                if index % columns == 0 {
                    named(plot.y_label, "RMS residual")
                } else {
                    ""
                },
            );
            bottom = panel.bottom() + TICKS;
        }
        bottom + MARGIN
    })
}

fn small(canvas: &mut Canvas, panel: &Panel, index: usize, view: &FailureView<'_>, y_label: &str) {
    panel.frame(canvas, y_label);
    title(canvas, panel, view);
    // The largest bin of a coordinate that explains nothing is accidental.
    let worst = match view.explained_fraction {
        Some(share) if share < WORTH_MARKING => None,
        _ => worst(view.bins),
    };
    let slot = panel.width / view.bins.len().max(1) as f64;
    let inset = (slot * 0.08).min(2.0);
    let place = |i: usize| panel.left + slot * i as f64;
    for (i, bin) in view
        .bins
        .iter()
        .enumerate()
        .filter(|(_, b)| b.rmse.is_finite())
    {
        let Some((_, top)) = panel.point(0.0, bin.rmse) else {
            continue;
        };
        let colour = if worst == Some(i) { VERMILLION } else { BLUE };
        let [from, to, rmse] = [bin.from, bin.to, bin.rmse].map(|v| super::significant(v, 3));
        canvas.bar(
            (place(i) + inset, panel.bottom()),
            (place(i + 1) - inset, top),
            Ink::new(colour, 1.0).faint(0.8),
            &format!("{index}:{i}"),
            &format!(
                "{} {from} to {to} {}: rms {rmse}",
                view.coordinate, view.unit
            ),
        );
    }
    let floor = view
        .bins
        .iter()
        .enumerate()
        .flat_map(|(i, bin)| [i as f64, i as f64 + 1.0].map(|x| (x, bin.noise_rmse)));
    panel.curve(canvas, floor, Ink::new(INK, 1.75));
    edges(canvas, panel, view.bins, slot);
}

/// Name, unit and explained share above a panel.
fn title(canvas: &mut Canvas, panel: &Panel, view: &FailureView<'_>) {
    let at = panel.top - 32.0;
    if let Some(share) = view.explained_fraction.filter(|s| s.is_finite()) {
        let percent = (100.0 * share).round();
        let text = if percent >= 1.0 {
            format!("explains {} %", fixed(percent.min(100.0), 0, false))
        } else {
            "explains 0 %".to_owned()
        };
        let colour = if share >= 0.2 { VERMILLION } else { MUTED };
        let below = (panel.left, panel.top - 13.0);
        canvas.text(Words::new(13.5, colour), below, &text);
    }
    let name = match view.unit {
        // Some names end in their unit, for example "level of y".
        unit if view.coordinate.ends_with(unit) => view.coordinate.clone(),
        unit => format!("{} ({unit})", view.coordinate),
    };
    let need = BOLD * text_width(&name, 14.5);
    let size = 14.5 * (panel.width / need).clamp(0.75, 1.0);
    let name = fit(&name, BOLD * size, panel.width);
    canvas.text(Words::new(size, INK).bold(), (panel.left, at), &name);
}

/// Bin limits below a panel, as many as fit; a bin of one value has its label in the middle.
fn edges(canvas: &mut Canvas, panel: &Panel, bins: &[FailureBin], slot: f64) {
    const SIZE: f64 = 13.0;
    let single = bins.iter().all(|b| b.from == b.to);
    let offset = if single { 0.5 } else { 0.0 };
    let limits: Vec<(f64, f64)> = bins
        .iter()
        .map(|bin| bin.from)
        .chain(bins.last().filter(|_| !single).map(|bin| bin.to))
        .enumerate()
        .map(|(i, limit)| (panel.left + slot * (i as f64 + offset), limit))
        .collect();
    let labels = distinct(&limits);
    let widest = labels
        .iter()
        .map(|(_, text)| text_width(text, SIZE))
        .fold(1.0, f64::max);
    let stride = ((widest + 8.0) / slot.max(1e-3)).ceil().max(1.0) as usize;
    for (at, text) in labels.iter().step_by(stride) {
        canvas.text(
            Words::new(SIZE, MUTED).at(Anchor::Middle),
            (*at, panel.bottom() + 13.0),
            text,
        );
    }
}

/// Limits with the fewest digits, at least three, that distinguish neighbours.
fn distinct(limits: &[(f64, f64)]) -> Vec<(f64, String)> {
    let written = |digits| -> Vec<(f64, String)> {
        let label = |(at, limit): &(f64, f64)| (*at, super::significant(*limit, digits));
        limits.iter().map(label).collect()
    };
    (3..7)
        .map(written)
        .find(|labels| labels.windows(2).all(|pair| pair[0].1 != pair[1].1))
        .unwrap_or_else(|| written(3))
}

/// Bin whose mean square is farthest above the noise level.
fn worst(bins: &[FailureBin]) -> Option<usize> {
    let floor = |b: &FailureBin| {
        if b.noise_rmse.is_finite() {
            b.noise_rmse
        } else {
            0.0
        }
    };
    bins.iter()
        .enumerate()
        .filter(|(_, b)| b.rmse.is_finite() && b.rmse > floor(b))
        .max_by(|(_, a), (_, b)| {
            let excess = |b: &FailureBin| b.rmse * b.rmse - floor(b) * floor(b);
            excess(a).total_cmp(&excess(b))
        })
        .map(|(i, _)| i)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::picture::testing::{absurd_series, check, words};

    fn bin(from: f64, rmse: f64) -> FailureBin {
        FailureBin {
            from,
            to: from + 10.0,
            rmse,
            noise_rmse: 0.01,
        }
    }

    #[test]
    fn the_worst_bin_is_marked_once_and_the_share_is_written() {
        let bins = [bin(0.0, 0.02), bin(10.0, 0.09), bin(20.0, 0.03)];
        let svg = where_it_fails(&WhereItFails {
            views: &[FailureView {
                coordinate: "time since rising edge".to_owned(),
                unit: "ms",
                explained_fraction: Some(0.74),
                bins: &bins,
            }],
            ..WhereItFails::default()
        });
        check(&svg);
        assert!(words(&svg).contains("time since rising edge (ms)"));
        assert!(words(&svg).contains("explains 74 %"));
        assert_eq!(worst(&bins), Some(1));
        // The colour occurs in one bar and in the legend.
        let fill = format!("fill=\"{VERMILLION}\" opacity");
        assert_eq!(svg.matches(&fill).count(), 2);
    }

    #[test]
    fn neighbouring_limits_read_differently() {
        let labels = distinct(&[(0.0, 10.0), (1.0, 10.05), (2.0, 10.1)]);
        let labels: Vec<_> = labels.into_iter().map(|l| l.1).collect();
        assert_eq!(labels, ["10", "10.05", "10.1"]);
    }

    #[test]
    fn bins_at_the_floor_have_no_worst() {
        assert_eq!(
            worst(&[bin(0.0, 0.01), bin(1.0, 0.009), bin(2.0, f64::NAN)]),
            None
        );
    }

    #[test]
    fn absurd_input_never_panics() {
        for values in absurd_series() {
            let bins: Vec<_> = values
                .iter()
                .take(500)
                .map(|v| FailureBin {
                    from: *v,
                    to: *v,
                    rmse: *v,
                    noise_rmse: -*v,
                })
                .collect();
            let view = FailureView {
                coordinate: "<u>".to_owned(),
                unit: "&",
                explained_fraction: values.first().copied(),
                bins: &bins,
            };
            check(&where_it_fails(&WhereItFails {
                views: &std::array::from_fn::<_, 3, _>(|_| view.clone()),
                ..WhereItFails::default()
            }));
        }
    }
}
