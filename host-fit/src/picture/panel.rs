//! A panel: a rectangle with two axes, and data drawn into it.

use std::ops::Range;

use super::axis::{Axis, Tick};
use super::canvas::{Anchor, Canvas, Ink, Words, text_width};
use super::decimate;
use super::palette::{GRID, INK, MUTED, RULE};

/// Size of tick labels, pixels.
pub(super) const TICK_SIZE: f64 = 14.0;
/// Size of axis labels, pixels.
pub(super) const LABEL_SIZE: f64 = 14.5;
/// Height below a panel for tick labels and the axis label, pixels.
pub(super) const FOOT: f64 = 50.0;

/// Position and axes of a panel.
#[derive(Clone, Copy, Debug)]
pub(super) struct Panel {
    pub(super) left: f64,
    pub(super) top: f64,
    pub(super) width: f64,
    pub(super) height: f64,
    pub(super) x: Axis,
    pub(super) y: Axis,
}

/// Times of the samples of a record, s.
#[derive(Clone, Copy, Debug)]
pub(super) struct Clock {
    start: f64,
    period: f64,
}

impl Clock {
    /// A non-finite start counts as 0, a non-positive period as 1.
    pub(super) fn new(start: f64, period: f64) -> Self {
        Self {
            start: if start.is_finite() { start } else { 0.0 },
            period: if period.is_finite() && period > 0.0 {
                period
            } else {
                1.0
            },
        }
    }

    /// Time of sample `index`, s.
    pub(super) fn time(&self, index: usize) -> f64 {
        self.start + self.period * index as f64
    }

    /// Samples of `0..length` inside `window` (s) with one more on either side; all samples without a window
    /// or if none is inside.
    pub(super) fn samples(&self, window: Option<(f64, f64)>, length: usize) -> Range<usize> {
        let Some((from, to)) = window else {
            return 0..length;
        };
        let index = |t: f64| (t - self.start) / self.period;
        let first = index(from.min(to)).floor().max(0.0) as usize;
        let end = (index(from.max(to)).ceil().max(-1.0) + 1.0) as usize;
        let range = first..end.min(length);
        if range.is_empty() { 0..length } else { range }
    }

    /// Axis over `range`; the last sample lasts for one period.
    pub(super) fn axis(&self, range: &Range<usize>) -> Axis {
        Axis::linear(Some((self.time(range.start), self.time(range.end))))
    }
}

impl Panel {
    /// Pixel of a point; `None` if a coordinate is NaN. Points outside are moved to the edge.
    pub(super) fn point(&self, x: f64, y: f64) -> Option<(f64, f64)> {
        Some((
            self.left + self.width * self.x.place(x)?,
            self.top + self.height * (1.0 - self.y.place(y)?),
        ))
    }

    /// Lower edge, pixels.
    pub(super) fn bottom(&self) -> f64 {
        self.top + self.height
    }

    /// Grid, lower and left axis and the ticks of y with its label.
    pub(super) fn frame(&self, canvas: &mut Canvas, y_label: &str) {
        self.grid(canvas, y_label, (self.height / 44.0).max(2.0) as usize);
    }

    fn grid(&self, canvas: &mut Canvas, y_label: &str, count: usize) {
        for Tick { value, label } in self.y.ticks(count) {
            let Some((_, at)) = self.point(self.x.ends().0, value) else {
                continue;
            };
            canvas.line(
                &[(self.left, at), (self.left + self.width, at)],
                Ink::new(GRID, 1.0),
            );
            canvas.text(
                Words::new(TICK_SIZE, MUTED).at(Anchor::End),
                (self.left - 7.0, at),
                &label,
            );
        }
        canvas.line(
            &[
                (self.left, self.bottom()),
                (self.left + self.width, self.bottom()),
            ],
            Ink::new(RULE, 1.25),
        );
        // The label is next to the ticks: at the edge of the picture, or where a panel of a row
        // begins.
        let begins = self.left - left_edge([&self.y]);
        let begins = if begins > 60.0 { begins } else { 0.0 };
        canvas.upright(
            Words::new(LABEL_SIZE, INK),
            (begins + 18.0, self.top + self.height / 2.0),
            y_label,
        );
    }

    /// Vertical grid lines at the ticks of x.
    pub(super) fn uprights(&self, canvas: &mut Canvas) {
        for (at, _) in self.x_ticks() {
            canvas.line(&[(at, self.top), (at, self.bottom())], Ink::new(GRID, 1.0));
        }
    }

    /// Ticks, tick labels and label of x, [`FOOT`] high.
    pub(super) fn foot(&self, canvas: &mut Canvas, x_label: &str) {
        for (at, label) in self.x_ticks() {
            canvas.line(
                &[(at, self.bottom()), (at, self.bottom() + 4.0)],
                Ink::new(RULE, 1.25),
            );
            canvas.text(
                Words::new(TICK_SIZE, MUTED).at(Anchor::Middle),
                (at, self.bottom() + 15.0),
                &label,
            );
        }
        // A label that is longer than its axis stays within the picture.
        let need = text_width(x_label, LABEL_SIZE);
        let room = canvas.width - 8.0;
        let size = LABEL_SIZE * (room / need.max(1.0)).min(1.0);
        let half = 0.5 * need.min(room);
        let middle = self.left + self.width / 2.0;
        let middle = middle.min(canvas.width - 4.0 - half).max(4.0 + half);
        canvas.text(
            Words::new(size, INK).at(Anchor::Middle),
            (middle, self.bottom() + 36.0),
            x_label,
        );
    }

    /// Pixel and label of the ticks of x, as many as fit.
    fn x_ticks(&self) -> Vec<(f64, String)> {
        let mut ticks = Vec::new();
        for count in (2..=10).rev() {
            ticks = self.x.ticks(count);
            let widest = ticks
                .iter()
                .map(|t| text_width(&t.label, TICK_SIZE))
                .fold(0.0, f64::max);
            if ticks.len() as f64 * (widest + 16.0) <= self.width {
                break;
            }
        }
        ticks
            .into_iter()
            .filter_map(|t| Some((self.point(t.value, 0.0)?.0, t.label)))
            .collect()
    }

    /// A record, decimated to `columns` columns.
    pub(super) fn trace(
        &self,
        canvas: &mut Canvas,
        clock: Clock,
        values: &[f64],
        range: Range<usize>,
        columns: usize,
        ink: Ink,
    ) {
        for piece in decimate::min_max(values, range, columns) {
            let points: Vec<_> = piece
                .into_iter()
                .filter_map(|k| self.point(clock.time(k), *values.get(k)?))
                .collect();
            canvas.line(&points, ink);
        }
    }

    /// The area between two records; each column spans from the lowest `low` to the highest `high`.
    pub(super) fn band(
        &self,
        canvas: &mut Canvas,
        clock: Clock,
        (low, high): (&[f64], &[f64]),
        range: Range<usize>,
        columns: usize,
        ink: Ink,
    ) {
        let end = range.end.min(low.len()).min(high.len());
        let range = range.start.min(end)..end;
        let columns = columns.clamp(1, range.len().max(1));
        let mut lower = Vec::new();
        let mut upper = Vec::new();
        let mut flush = |lower: &mut Vec<(f64, f64)>, upper: &mut Vec<(f64, f64)>| {
            upper.reverse();
            lower.append(upper);
            canvas.area(lower, ink);
            lower.clear();
        };
        for column in decimate::split(range, columns) {
            let middle = (column.start + column.end.saturating_sub(1)) / 2;
            let ends = decimate::extremes(low, column.clone())
                .zip(decimate::extremes(high, column))
                .and_then(|((lowest, _), (_, highest))| {
                    let time = clock.time(middle);
                    let below = self.point(time, *low.get(lowest)?)?;
                    Some((below, self.point(time, *high.get(highest)?)?))
                });
            match ends {
                Some((below, above)) => {
                    lower.push(below);
                    upper.push(above);
                }
                None => flush(&mut lower, &mut upper),
            }
        }
        flush(&mut lower, &mut upper);
    }

    /// A line through points in the units of the axes; non-finite ones break it.
    pub(super) fn curve(
        &self,
        canvas: &mut Canvas,
        points: impl IntoIterator<Item = (f64, f64)>,
        ink: Ink,
    ) {
        let mut piece = Vec::new();
        for (x, y) in points {
            match self.point(x, y) {
                Some(point) if x.is_finite() && y.is_finite() => piece.push(point),
                _ => {
                    canvas.line(&piece, ink);
                    piece.clear();
                }
            }
        }
        canvas.line(&piece, ink);
    }

    /// A dashed horizontal line across the panel.
    pub(super) fn level(&self, canvas: &mut Canvas, y: f64, ink: Ink) {
        if let Some((_, at)) = self.point(self.x.ends().0, y) {
            canvas.dashes(&[(self.left, at), (self.left + self.width, at)], ink, 7.0);
        }
    }

    /// A dashed vertical line across the panel.
    pub(super) fn upright(&self, canvas: &mut Canvas, x: f64, ink: Ink) {
        if let Some((at, _)) = self.point(x, self.y.ends().0) {
            canvas.dashes(&[(at, self.top), (at, self.bottom())], ink, 7.0);
        }
    }
}

/// Left edge with room for the vertical label and the widest tick label of `axes`.
pub(super) fn left_edge<'a>(axes: impl IntoIterator<Item = &'a Axis>) -> f64 {
    axes.into_iter()
        .flat_map(|axis| axis.ticks(6))
        .map(|tick| text_width(&tick.label, TICK_SIZE))
        .fold(30.0, f64::max)
        + 40.0
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_window_selects_its_samples_and_a_missed_one_selects_all() {
        let clock = Clock::new(1.0, 0.001);
        assert_eq!(clock.samples(Some((1.5, 1.6)), 1000), 500..602);
        assert_eq!(clock.samples(Some((1.6, 1.5)), 1000).len(), 102);
        assert_eq!(clock.samples(Some((5.0, 6.0)), 1000), 0..1000);
        assert_eq!(clock.samples(Some((f64::NAN, f64::NAN)), 10), 0..10);
        assert_eq!(Clock::new(f64::NAN, -1.0).time(3), 3.0);
    }
}
