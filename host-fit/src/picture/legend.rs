//! Titles and legends, placed above the data.

use super::canvas::{Canvas, Ink, MARGIN, WIDTH, Words, fit, text_width};
use super::palette::{Colour, INK, MUTED};

/// Size of legend text, pixels.
const SIZE: f64 = 14.5;
const ROW: f64 = 22.0;
const SWATCH: f64 = 24.0;
const GAP: f64 = 20.0;

/// The sample of a series in the legend, before its name.
#[derive(Clone, Copy, Debug)]
pub(super) enum Swatch {
    Line(Colour),
    Dashes(Colour),
    Band(Colour),
    Bar(Colour),
    Dot(Colour),
    Ring(Colour),
}

/// Draws the title and the rows of the legend; returns the height used.
pub(super) fn heading(canvas: &mut Canvas, title: &str, entries: &[(Swatch, String)]) -> f64 {
    let mut top = MARGIN;
    if !title.is_empty() {
        let words = Words::new(18.0, INK).bold();
        let title = fit(title, 18.5, WIDTH - 2.0 * MARGIN);
        canvas.text(words, (MARGIN, top + 9.0), &title);
        top += 28.0;
    }
    let mut left = MARGIN;
    let mut drawn = false;
    for (swatch, name) in entries {
        let name = fit(name, SIZE, WIDTH - 2.0 * MARGIN - SWATCH - 8.0);
        let width = SWATCH + 8.0 + text_width(&name, SIZE);
        if left > MARGIN && left + width > WIDTH - MARGIN {
            left = MARGIN;
            top += ROW;
        }
        let middle = top + ROW / 2.0;
        sample(canvas, *swatch, left, middle);
        canvas.text(Words::new(SIZE, INK), (left + SWATCH + 8.0, middle), &name);
        left += width + GAP;
        drawn = true;
    }
    if drawn { top + ROW + 10.0 } else { top + 6.0 }
}

fn sample(canvas: &mut Canvas, swatch: Swatch, left: f64, middle: f64) {
    let ends = [(left, middle), (left + SWATCH, middle)];
    let centre = (left + SWATCH / 2.0, middle);
    match swatch {
        Swatch::Line(colour) => canvas.line(&ends, Ink::new(colour, 2.5)),
        Swatch::Dashes(colour) => canvas.dashes(&ends, Ink::new(colour, 2.0), 6.0),
        Swatch::Band(colour) | Swatch::Bar(colour) => canvas.rectangle(
            (left, middle - 6.0),
            (left + SWATCH, middle + 6.0),
            Ink::new(colour, 1.0).faint(match swatch {
                Swatch::Bar(_) => 0.85,
                _ => 0.35,
            }),
        ),
        Swatch::Dot(colour) => canvas.dot(centre, 5.0, Ink::new(colour, 1.0), true),
        Swatch::Ring(colour) => canvas.dot(centre, 4.5, Ink::new(colour, 1.75), false),
    }
}

/// Draws an empty picture with a message; returns its height.
pub(super) fn nothing(canvas: &mut Canvas, title: &str, reason: &str) -> f64 {
    let top = heading(canvas, title, &[]);
    canvas.text(Words::new(SIZE, MUTED), (MARGIN, top + 16.0), reason);
    top + 46.0
}
