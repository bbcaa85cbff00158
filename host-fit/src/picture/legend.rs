//! Titles and legends, placed above the data.

use super::canvas::{BOLD, Canvas, Ink, MARGIN, Words, text_width, wrap};
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
        for line in wrap(title, BOLD * 18.0, canvas.width - 2.0 * MARGIN, 3) {
            canvas.text(words, (MARGIN, top + 9.0), &line);
            top += 23.0;
        }
        top += 5.0;
    }
    let mut left = MARGIN;
    let mut drawn = false;
    for (swatch, name) in entries {
        let lines = wrap(name, SIZE, canvas.width - 2.0 * MARGIN - SWATCH - 8.0, 3);
        let widths = lines.iter().map(|line| text_width(line, SIZE));
        let width = SWATCH + 8.0 + widths.fold(0.0, f64::max);
        if left > MARGIN && left + width > canvas.width - MARGIN {
            left = MARGIN;
            top += ROW;
        }
        let middle = top + ROW / 2.0;
        sample(canvas, *swatch, left, middle);
        for (row, line) in lines.iter().enumerate() {
            let at = (left + SWATCH + 8.0, middle + 17.0 * row as f64);
            canvas.text(Words::new(SIZE, INK), at, line);
        }
        top += 17.0 * (lines.len() - 1) as f64;
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
