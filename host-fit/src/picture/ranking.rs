//! Candidate effects ranked by the error of the model with each of them.

use super::axis::{Axis, extent};
use super::canvas::{Anchor, BOLD, Ink, MARGIN, Picture, Words, draw, fit, text_width};
use super::legend::{Swatch, heading, nothing};
use super::overlay::union;
use super::palette::{BLUE, GRID, INK, MUTED, PAPER, VERMILLION};
use super::panel::{FOOT, Panel};
use crate::order;

/// One candidate.
#[derive(Clone, Copy, Debug, Default)]
pub struct Candidate<'a> {
    /// Name of the effect, or of the equivalence set.
    pub name: &'a str,
    /// RMSE of the free run with the candidate added and everything refitted, unit of y.
    pub rmse: f64,
    /// Lower end of the interval of `rmse`; NaN without an interval.
    pub low: f64,
    /// Upper end of the interval.
    pub high: f64,
    /// Whether the effect is named as missing.
    pub accepted: bool,
    /// A short note at the right, for example `"p < 0.001"`; empty for none.
    pub note: &'a str,
}

/// Contents of [`ranking`].
#[derive(Clone, Copy, Debug, Default)]
pub struct Ranking<'a> {
    /// Title; empty for none.
    pub title: &'a str,
    /// Unit of y; empty for a normalised output.
    pub y_unit: &'a str,
    /// Name of the error, with a capital letter, for example `"Validation error"`.
    pub error: &'a str,
    /// Candidates in any order; the best comes first in the picture.
    pub candidates: &'a [Candidate<'a>],
    /// RMSE of the base model, to which each candidate is added.
    pub base_rmse: Option<f64>,
    /// Noise level, rms.
    pub noise_rmse: Option<f64>,
}

const ROW: f64 = 25.0;
/// Height of a row whose name stands above its dot.
const STACKED: f64 = 46.0;
const SIZE: f64 = 14.5;
/// Largest number of rows; the worst candidates are left out.
const MOST: usize = 60;

/// Draws candidates as dots with intervals, the best on top, between the noise level and the error of the base
/// model. Returns SVG.
#[must_use]
pub fn ranking(plot: &Ranking<'_>) -> Picture {
    let description = format!("{}: a row for each candidate effect", plot.title);
    draw(&description, |canvas| {
        let mut order: Vec<&Candidate<'_>> = plot.candidates.iter().collect();
        order::ascending(&mut order, |one| one.rmse);
        order.truncate(MOST);
        if extent(order.iter().map(|c| c.rmse)).is_none() {
            return nothing(canvas, plot.title, "No candidate was tried.");
        }
        let base = plot.base_rmse.filter(|v| v.is_finite());
        let noise = plot.noise_rmse.filter(|v| v.is_finite());
        let mut entries = Vec::new();
        if order.iter().any(|c| c.accepted) {
            entries.push((Swatch::Dot(VERMILLION), "accepted".to_owned()));
        }
        if order.iter().any(|c| !c.accepted) {
            entries.push((Swatch::Dot(BLUE), "candidate".to_owned()));
        }
        if noise.is_some() {
            entries.push((Swatch::Dashes(INK), "noise level".to_owned()));
        }
        if base.is_some() {
            entries.push((
                Swatch::Line(MUTED),
                "base model without the candidate".to_owned(),
            ));
        }
        let top = heading(canvas, plot.title, &entries);

        let ends = |pick: fn(&Candidate<'_>) -> f64| extent(order.iter().map(|c| pick(c)));
        let lines = extent(base.into_iter().chain(noise));
        let all = union(
            union(ends(|c| c.rmse), lines),
            union(ends(|c| c.low), ends(|c| c.high)),
        );
        // A candidate with a much larger error may lie far to the right.
        let shown = match (all, base) {
            (Some((low, high)), Some(base)) => {
                let low = low.max(0.0);
                Some((low, high.min(base + 0.6 * (base - low).abs()).max(base)))
            }
            (all, _) => all,
        };
        let stacked = canvas.is_narrow();
        let names = order
            .iter()
            // Every name may be bold.
            .map(|c| BOLD * text_width(c.name, SIZE))
            .fold(60.0, f64::max);
        let notes = order
            .iter()
            .map(|c| text_width(c.note, SIZE - 1.0))
            .fold(0.0, f64::max)
            .min(200.0);
        let (left, right, pitch) = match stacked {
            true => (MARGIN, 0.0, STACKED),
            false => (names.min(0.36 * canvas.width) + MARGIN + 12.0, notes, ROW),
        };
        let panel = Panel {
            left,
            top,
            width: canvas.width - left - right - MARGIN - 24.0,
            height: pitch * order.len() as f64 + 8.0,
            x: Axis::padded(shown, 0.05),
            y: Axis::linear(None),
        };
        panel.uprights(canvas);
        let rows = || order.iter().enumerate();
        // Where the name is above the dot, the dot is in the lower half of the row.
        let middle = |row: usize| panel.top + 4.0 + pitch * (row as f64 + 1.0) - 0.5 * ROW;
        for (row, _) in rows() {
            let ends = [panel.left, panel.left + panel.width].map(|x| (x, middle(row)));
            canvas.line(&ends, Ink::new(GRID, 1.0));
        }
        if let Some(base) = base {
            panel.curve(canvas, [(base, 0.0), (base, 1.0)], Ink::new(MUTED, 1.5));
        }
        if let Some(noise) = noise {
            panel.upright(canvas, noise, Ink::new(INK, 1.5));
        }
        for (row, candidate) in rows() {
            let middle = middle(row);
            let colour = if candidate.accepted { VERMILLION } else { BLUE };
            let place = |value: f64| Some(panel.point(value, 0.0)?.0);
            let beyond = candidate.rmse > panel.x.ends().1;
            let interval = place(candidate.low).zip(place(candidate.high));
            if let Some((from, to)) = interval.filter(|_| !beyond) {
                canvas.line(
                    &[(from, middle), (to, middle)],
                    Ink::new(colour, 2.5).faint(0.6),
                );
            }
            if let (true, Some(at)) = (beyond, place(candidate.rmse)) {
                let words = Words::new(SIZE - 1.5, MUTED).at(Anchor::End);
                let text = format!("{} →", super::significant(candidate.rmse, 2));
                canvas.text(words, (at, middle), &text);
            } else if let Some(at) = place(candidate.rmse) {
                canvas.dot((at, middle), 5.0, Ink::new(colour, 1.75), true);
            }
            let name = Words::new(SIZE, INK);
            let name = if candidate.accepted {
                name.bold()
            } else {
                name
            };
            let quiet = Words::new(SIZE - 1.0, MUTED);
            if stacked {
                let above = middle - 0.5 * STACKED;
                let note = fit(candidate.note, SIZE - 1.0, notes);
                let room = panel.width - text_width(&note, SIZE - 1.0) - 10.0;
                let text = fit(candidate.name, SIZE, room);
                // Lines of the panel pass behind words.
                let width = BOLD * text_width(&text, SIZE) + 4.0;
                let right = panel.left + panel.width;
                let note_from = right - text_width(&note, SIZE - 1.0) - 4.0;
                for (from, to) in [(panel.left, panel.left + width), (note_from, right)] {
                    let (low, high) = (above - 9.0, above + 9.0);
                    canvas.rectangle((from, low), (to, high), Ink::new(PAPER, 1.0));
                }
                canvas.text(name, (panel.left, above), &text);
                let right = (panel.left + panel.width, above);
                canvas.text(quiet.at(Anchor::End), right, &note);
            } else {
                let text = fit(candidate.name, SIZE, left - MARGIN - 12.0);
                canvas.text(name.at(Anchor::End), (panel.left - 12.0, middle), &text);
                let note = fit(candidate.note, SIZE - 1.0, right);
                let at = (panel.left + panel.width + 12.0, middle);
                canvas.text(quiet, at, &note);
            }
        }
        let unit = match plot.y_unit {
            "" => String::new(),
            unit => format!(" ({unit})"),
        };
        panel.foot(
            canvas,
            &format!("{}: RMSE of the free run after refitting{unit}", plot.error),
        );
        panel.bottom() + FOOT
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::picture::testing::{absurd_series, check, words};

    #[test]
    fn the_best_candidate_comes_first() {
        let named = |name, rmse| Candidate {
            name,
            rmse,
            low: rmse - 0.001,
            high: rmse + 0.001,
            ..Candidate::default()
        };
        let svg = ranking(&Ranking {
            error: "Cross-validation error",
            candidates: &[named("valve-lag", 0.05), named("plenum-droop", 0.02)],
            base_rmse: Some(0.05),
            noise_rmse: Some(0.018),
            ..Ranking::default()
        });
        check(&svg);
        let words = words(&svg);
        let at = |name| words.find(name).unwrap();
        assert!(at("plenum-droop") < at("valve-lag"));
        assert!(words.contains("base model without the candidate"));
        assert!(words.contains("Cross-validation error"));
    }

    #[test]
    fn absurd_input_never_panics() {
        for values in absurd_series() {
            let candidates: Vec<_> = values
                .iter()
                .map(|v| Candidate {
                    name: "<b>",
                    rmse: *v,
                    low: v * 2.0,
                    high: f64::NAN,
                    accepted: *v < 0.0,
                    note: "p < 0.05 & <more>",
                })
                .collect();
            for line in [None, Some(f64::NAN), Some(f64::MAX), Some(0.0)] {
                check(&ranking(&Ranking {
                    candidates: &candidates,
                    base_rmse: line,
                    noise_rmse: line,
                    ..Ranking::default()
                }));
            }
        }
    }
}
