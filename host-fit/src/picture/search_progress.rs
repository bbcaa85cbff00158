//! The best objective found against the number of evaluations.

use super::axis::{Axis, extent};
use super::canvas::{Ink, MARGIN, WIDTH, draw};
use super::legend::{Swatch, heading, nothing};
use super::overlay::{named, union};
use super::palette::{INK, series};
use super::panel::{FOOT, Panel, left_edge};
use super::strip::columns;

/// The last count over the first one shown.
const SHOWN: f64 = 200.0;

/// One search.
#[derive(Clone, Copy, Debug, Default)]
pub struct ProgressRun<'a> {
    /// What the legend says.
    pub label: &'a str,
    /// `(evaluations, best objective so far)` whenever the best improves, ascending; end
    /// with the final count so that the last stretch is drawn.
    pub best: &'a [(f64, f64)],
}

/// What [`search_progress`] draws.
#[derive(Clone, Copy, Debug, Default)]
pub struct SearchProgress<'a> {
    /// Title; empty for none.
    pub title: &'a str,
    /// Label of the objective's axis; empty means "Best objective".
    pub objective: &'a str,
    /// Searches to compare.
    pub runs: &'a [ProgressRun<'a>],
    /// A value to compare with and its name.
    pub reference: Option<(&'a str, f64)>,
}

/// Draws the progress of searches as steps, from half a per cent of the evaluations on.
/// Returns SVG.
#[must_use]
pub fn search_progress(plot: &SearchProgress<'_>) -> String {
    let description = format!("{}: best objective against evaluations", plot.title);
    draw(&description, |canvas| {
        let points = || plot.runs.iter().flat_map(|r| r.best).copied();
        if extent(points().map(|p| p.1)).is_none() {
            return nothing(canvas, plot.title, "No evaluation succeeded.");
        }
        let mut entries: Vec<_> = plot
            .runs
            .iter()
            .enumerate()
            .map(|(i, run)| {
                let last = run.best.last().map_or(f64::NAN, |p| p.1);
                let text = format!("{}: {}", run.label, super::significant(last, 5));
                (Swatch::Line(series(i)), text)
            })
            .collect();
        let reference = plot.reference.filter(|r| r.1.is_finite());
        if let Some((name, value)) = reference {
            let text = format!("{name}: {}", super::significant(value, 5));
            entries.push((Swatch::Dashes(INK), text));
        }
        let top = heading(canvas, plot.title, &entries);

        let counts = extent(points().map(|p| p.0).filter(|n| *n >= 1.0));
        // Any point is better than the first ones; what counts is how a search ends.
        let shown = counts.map(|(few, many)| (few.max(many / SHOWN), many));
        let from = shown.map_or(f64::NEG_INFINITY, |s| s.0);
        let most = columns(WIDTH, plot.runs.len());
        let steps: Vec<Vec<(f64, f64)>> = plot
            .runs
            .iter()
            .map(|run| staircase(run.best, from, most))
            .collect();
        let values = extent(steps.iter().flatten().map(|p| p.1));
        let y = Axis::padded(union(values, reference.map(|r| (r.1, r.1))), 0.06);
        let left = left_edge([&y]);
        let panel = Panel {
            left,
            top,
            width: WIDTH - left - MARGIN - 16.0,
            height: 300.0,
            x: match shown {
                Some((few, many)) if many / few > 20.0 => Axis::logarithmic(shown),
                _ => Axis::linear(shown),
            },
            y,
        };
        panel.uprights(canvas);
        panel.frame(canvas, named(plot.objective, "Best objective"));
        if let Some((_, value)) = reference {
            panel.level(canvas, value, Ink::new(INK, 1.5));
        }
        for (index, steps) in steps.into_iter().enumerate() {
            let last = steps.last().and_then(|p| panel.point(p.0, p.1));
            panel.curve(canvas, steps, Ink::new(series(index), 2.0));
            if let Some(last) = last {
                canvas.dot(last, 4.5, Ink::new(series(index), 1.0), true);
            }
        }
        panel.foot(canvas, "Evaluations of the objective");
        panel.bottom() + FOOT
    })
}

/// Corners of the steps through `best` from the count `from` on, of at most `most` steps.
fn staircase(best: &[(f64, f64)], from: f64, most: usize) -> Vec<(f64, f64)> {
    let stride = best.len().div_ceil(most.max(1)).max(1);
    // Thinned from the end, so that the result of the search stays.
    let kept = best.iter().rev().step_by(stride).rev();
    let mut corners = Vec::new();
    let mut held = None;
    for &(count, value) in kept.filter(|p| p.0.is_finite() && p.1.is_finite()) {
        if count >= from {
            corners.extend(held.map(|before| (count, before)));
            corners.push((count, value));
        } else {
            corners = vec![(from, value)];
        }
        held = Some(value);
    }
    corners
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::picture::testing::{absurd_series, check, words};

    #[test]
    fn the_final_value_is_in_the_legend() {
        let svg = search_progress(&SearchProgress {
            runs: &[ProgressRun {
                label: "MADS",
                best: &[(1.0, 9.0), (50.0, 2.0), (4545.0, 1.2571)],
            }],
            reference: Some(("paper", 1.2576)),
            ..SearchProgress::default()
        });
        check(&svg);
        let words = words(&svg);
        assert!(words.contains("MADS: 1.2571") && words.contains("paper: 1.2576"));
    }

    #[test]
    fn steps_before_the_first_count_shown_are_held_there() {
        let best = [(1.0, 9.0), (5.0, 4.0), (50.0, 2.0), (90.0, 1.0)];
        assert_eq!(
            staircase(&best, 20.0, 100),
            [
                (20.0, 4.0),
                (50.0, 4.0),
                (50.0, 2.0),
                (90.0, 2.0),
                (90.0, 1.0)
            ]
        );
        assert_eq!(staircase(&best, 95.0, 100), [(95.0, 1.0)]);
        assert_eq!(staircase(&best, 0.0, 2).last(), Some(&(90.0, 1.0)));
    }

    #[test]
    fn absurd_input_never_panics() {
        for values in absurd_series() {
            let best: Vec<_> = values.iter().map(|v| (*v, -*v)).collect();
            let far: Vec<_> = (1..100_000)
                .map(|k| (f64::from(k), 1.0 / f64::from(k)))
                .collect();
            check(&search_progress(&SearchProgress {
                runs: &[
                    ProgressRun {
                        label: "<a>",
                        best: &best,
                    },
                    ProgressRun {
                        label: "b",
                        best: &far,
                    },
                ],
                reference: Some(("&", values.first().copied().unwrap_or(f64::NAN))),
                ..SearchProgress::default()
            }));
        }
    }
}
