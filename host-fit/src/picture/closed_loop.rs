//! A closed-loop run: output and reference, commands, air used.

use super::axis::{Axis, extent};
use super::canvas::{Ink, MARGIN, Picture, draw};
use super::legend::{Swatch, heading, nothing};
use super::overlay::{named, part, union};
use super::palette::{INK, series};
use super::panel::{Clock, FOOT, Panel, left_edge};
use super::strip::{HEIGHT as STRIP, columns, strip};

/// One controller's run.
#[derive(Clone, Copy, Debug, Default)]
pub struct LoopRun<'a> {
    /// Label in the legend.
    pub label: &'a str,
    /// Controlled output, one value per sample.
    pub y: &'a [f64],
    /// Command given, in {0, 1}.
    pub u: &'a [f64],
    /// Air used so far, in any unit named by [`ClosedLoop::air_label`]; empty for none.
    pub air: &'a [f64],
}

/// Contents of [`closed_loop()`].
#[derive(Clone, Copy, Debug, Default)]
pub struct ClosedLoop<'a> {
    /// Title; empty for none.
    pub title: &'a str,
    /// Label of the output axis with its unit; empty means "Output y".
    pub y_label: &'a str,
    /// Label of the air axis with its unit; empty means "Air used (s)", seconds of blowing.
    pub air_label: &'a str,
    /// Sample period, s.
    pub sample_period_s: f64,
    /// Reference, one value per sample; empty for none.
    pub reference: &'a [f64],
    /// Runs to compare, the most important last (drawn on top).
    pub runs: &'a [LoopRun<'a>],
    /// Part to show, from and to, s; `None` shows the whole run.
    pub window_s: Option<(f64, f64)>,
}

/// Draws closed-loop runs over each other, one strip of commands per run. Returns SVG.
#[must_use]
pub fn closed_loop(plot: &ClosedLoop<'_>) -> Picture {
    let description = format!("{}: closed-loop run", plot.title);
    draw(&description, |canvas| {
        let clock = Clock::new(0.0, plot.sample_period_s);
        let length = plot.runs.iter().map(|r| r.y.len()).max().unwrap_or(0);
        let range = clock.samples(plot.window_s, length);
        let finite = |values: &[f64]| extent(part(values, &range));
        let outputs = plot
            .runs
            .iter()
            .fold(None, |all, r| union(all, finite(r.y)));
        if outputs.is_none() {
            return nothing(canvas, plot.title, "No closed-loop samples to draw.");
        }
        let mut entries: Vec<_> = plot
            .runs
            .iter()
            .enumerate()
            .map(|(i, run)| (Swatch::Line(series(i)), run.label.to_owned()))
            .collect();
        if !plot.reference.is_empty() {
            entries.push((Swatch::Dashes(INK), "reference".to_owned()));
        }
        let top = heading(canvas, plot.title, &entries);

        let y = Axis::padded(union(outputs, finite(plot.reference)), 0.05);
        let air = plot
            .runs
            .iter()
            .fold(None, |all, r| union(all, finite(r.air)));
        let air_axis = Axis::padded(air, 0.04);
        let left = left_edge([&y, &air_axis]);
        let main = Panel {
            left,
            top,
            width: canvas.width - left - MARGIN - 12.0,
            height: 280.0,
            x: clock.axis(&range),
            y,
        };
        let columns = columns(main.width, 2 * plot.runs.len() + 1);
        main.uprights(canvas);
        main.frame(canvas, named(plot.y_label, "Output y"));
        for (index, run) in plot.runs.iter().enumerate() {
            let ink = Ink::new(series(index), 1.75);
            main.trace(canvas, clock, run.y, range.clone(), columns, ink);
        }
        for piece in super::decimate::min_max(plot.reference, range.clone(), columns) {
            let points: Vec<_> = piece
                .into_iter()
                .filter_map(|k| main.point(clock.time(k), *plot.reference.get(k)?))
                .collect();
            canvas.dashes(&points, Ink::new(INK, 1.5), 7.0);
        }
        let mut bottom = main.bottom() + 8.0;
        for (index, run) in plot
            .runs
            .iter()
            .enumerate()
            .filter(|(_, r)| !r.u.is_empty())
            .take(8)
        {
            let ink = Ink::new(series(index), 1.0).faint(0.85);
            let command = (clock, run.u, range.clone());
            // The strips of several runs share the limit of the picture's size.
            let columns = columns / plot.runs.len().clamp(1, 4);
            strip(canvas, &main, bottom, command, columns, ("u", ink));
            bottom += STRIP + 5.0;
        }
        let last = if air.is_some() {
            let panel = Panel {
                top: bottom + 5.0,
                height: 100.0,
                y: air_axis,
                ..main
            };
            panel.uprights(canvas);
            panel.frame(canvas, named(plot.air_label, "Air used (s)"));
            for (index, run) in plot.runs.iter().enumerate() {
                let ink = Ink::new(series(index), 1.75);
                panel.trace(canvas, clock, run.air, range.clone(), columns, ink);
            }
            panel
        } else {
            Panel {
                top: bottom - 3.0,
                height: 0.0,
                ..main
            }
        };
        last.foot(canvas, "Time (s)");
        last.bottom() + FOOT
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::picture::testing::{absurd_series, check, square_response, words};

    #[test]
    fn every_run_has_its_strip() {
        let (u, y) = square_response(5000);
        let run = LoopRun {
            label: "relay",
            y: &y,
            u: &u,
            air: &[],
        };
        let svg = closed_loop(&ClosedLoop {
            sample_period_s: 0.001,
            reference: &vec![0.8; y.len()],
            runs: &[run, run],
            ..ClosedLoop::default()
        });
        check(&svg);
        assert_eq!(words(&svg).lines().filter(|line| *line == "u").count(), 2);
        assert!(words(&svg).contains("reference"));
    }

    #[test]
    fn absurd_input_never_panics() {
        for a in absurd_series() {
            for b in absurd_series() {
                let run = LoopRun {
                    label: "<&",
                    y: &a,
                    u: &b,
                    air: &b,
                };
                check(&closed_loop(&ClosedLoop {
                    sample_period_s: f64::NAN,
                    reference: &b,
                    runs: &[run; 3],
                    window_s: Some((0.0, 1e9)),
                    ..ClosedLoop::default()
                }));
            }
        }
    }
}
