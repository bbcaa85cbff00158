//! Regions around a point, side by side, for pairs of model errors.

use super::axis::{Axis, extent};
use super::canvas::{Ink, MARGIN, Picture, draw};
use super::legend::{Swatch, heading, nothing};
use super::palette::{BLUE, INK};
use super::panel::{FOOT, Panel, left_edge};

/// A region around (0, 0) and the labels of its axes.
#[derive(Clone, Copy, Debug)]
pub struct Region<'a> {
    /// Label of the horizontal axis.
    pub across: &'a str,
    /// Label of the vertical axis.
    pub up: &'a str,
    /// Contour of the region, ordered by angle.
    pub contour: &'a [[f64; 2]],
}

/// Contents of [`regions`].
#[derive(Clone, Copy, Debug)]
pub struct Regions<'a> {
    /// Title; empty for none.
    pub title: &'a str,
    /// Legend of the inside of a contour.
    pub inside: &'a str,
    /// Legend of the point at (0, 0).
    pub centre: &'a str,
    /// The regions, from left to right.
    pub regions: &'a [Region<'a>],
}

/// Draws each region with its contour. Returns SVG.
#[must_use]
pub fn regions(plot: &Regions<'_>) -> Picture {
    draw(plot.title, |canvas| {
        if plot.regions.is_empty() {
            return nothing(canvas, plot.title, "There is no region.");
        }
        let entries = [
            (Swatch::Band(BLUE), plot.inside.to_owned()),
            (Swatch::Dot(INK), plot.centre.to_owned()),
        ];
        let top = heading(canvas, plot.title, &entries);
        let columns = if canvas.is_narrow() {
            1
        } else {
            plot.regions.len()
        };
        let each = (canvas.width - MARGIN) / columns as f64;
        let mut bottom = top;
        for (index, region) in plot.regions.iter().enumerate() {
            let axis = |i: usize| {
                let values = region.contour.iter().map(|point| point[i]);
                Axis::padded(extent(values.chain([0.0])), 0.1)
            };
            let y = axis(1);
            let left = left_edge([&y]);
            let panel = Panel {
                left: each * (index % columns) as f64 + left,
                top: top + (220.0 + FOOT) * (index / columns) as f64,
                width: each - left - MARGIN,
                height: 220.0,
                x: axis(0),
                y,
            };
            panel.uprights(canvas);
            panel.frame(canvas, region.up);
            let points = region.contour.iter();
            let outline: Vec<(f64, f64)> =
                points.filter_map(|[x, y]| panel.point(*x, *y)).collect();
            canvas.area(&outline, Ink::new(BLUE, 1.0).faint(0.22));
            let closed: Vec<(f64, f64)> = outline.iter().chain(outline.first()).copied().collect();
            canvas.line(&closed, Ink::new(BLUE, 2.0));
            if let Some(at) = panel.point(0.0, 0.0) {
                canvas.dot(at, 4.0, Ink::new(INK, 1.0), true);
            }
            panel.foot(canvas, region.across);
            bottom = panel.bottom();
        }
        bottom + FOOT
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::picture::testing::{check, words};

    #[test]
    fn regions_stand_side_by_side_and_nonsense_is_left_out() {
        let square = [[-20.0, -20.0], [30.0, -20.0], [30.0, 30.0], [f64::NAN, 4.0]];
        let region = Region {
            across: "delay, %",
            up: "gain, %",
            contour: &square,
        };
        let svg = regions(&Regions {
            title: "Margin",
            inside: "works",
            centre: "the model",
            regions: &[
                region,
                Region {
                    contour: &[],
                    ..region
                },
                region,
            ],
        });
        check(&svg);
        assert_eq!(words(&svg).matches("delay, %").count(), 3);
        check(&regions(&Regions {
            title: "",
            inside: "",
            centre: "",
            regions: &[],
        }));
    }
}
