//! One SVG document: lines, areas and words in pixels, placed to a quarter pixel.

use std::fmt::Write as _;

use plotters::backend::{DrawingBackend, SVGBackend};
use plotters::style::text_anchor::{HPos, Pos, VPos};
use plotters::style::{
    Color, FontDesc, FontFamily, FontStyle, FontTransform, RGBColor, ShapeStyle, TextStyle,
};

use super::palette::{PAPER, hex};

/// Width of every picture, pixels.
pub(super) const WIDTH: f64 = 900.0;
/// Free border around a picture, pixels.
pub(super) const MARGIN: f64 = 14.0;

/// The backend knows whole units only; this many of them make a pixel.
const UNITS: f64 = 4.0;
/// The backend divides a font's size by this.
const FONT_SCALE: f64 = 1.24;
const FAMILY: FontFamily<'static> = FontFamily::Name("Helvetica, Arial, sans-serif");
/// Width of an average character over the font's size, for a wide sans-serif.
const CHARACTER: f64 = 0.59;

/// Which part of a text lies at the point it is written at, horizontally.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Anchor {
    Start,
    Middle,
    End,
}

/// Size, weight and colour of words; they are centred on their line.
#[derive(Clone, Copy, Debug)]
pub(super) struct Words {
    pub(super) size: f64,
    pub(super) bold: bool,
    pub(super) colour: RGBColor,
    pub(super) anchor: Anchor,
}

impl Words {
    pub(super) fn new(size: f64, colour: RGBColor) -> Self {
        Self {
            size,
            bold: false,
            colour,
            anchor: Anchor::Start,
        }
    }

    pub(super) fn bold(self) -> Self {
        Self { bold: true, ..self }
    }

    pub(super) fn at(self, anchor: Anchor) -> Self {
        Self { anchor, ..self }
    }
}

/// Colour, opacity and width of a stroke; width is ignored where an area is filled.
#[derive(Clone, Copy, Debug)]
pub(super) struct Ink {
    pub(super) colour: RGBColor,
    pub(super) opacity: f64,
    pub(super) width: f64,
}

impl Ink {
    pub(super) fn new(colour: RGBColor, width: f64) -> Self {
        Self {
            colour,
            opacity: 1.0,
            width,
        }
    }

    pub(super) fn faint(self, opacity: f64) -> Self {
        Self { opacity, ..self }
    }

    fn style(self, filled: bool) -> ShapeStyle {
        ShapeStyle {
            color: self.colour.mix(self.opacity.clamp(0.0, 1.0)),
            filled,
            stroke_width: (self.width * UNITS).round().clamp(1.0, 1e3) as u32,
        }
    }
}

/// The drawing surface; what it writes to is a string, so nothing can fail.
pub(super) struct Canvas<'a> {
    backend: SVGBackend<'a>,
}

/// Draws a picture of [`WIDTH`]; `paint` returns the height it came to.
/// `description` is what a screen reader says.
pub(super) fn draw(description: &str, paint: impl FnOnce(&mut Canvas<'_>) -> f64) -> String {
    let mut drawn = String::new();
    let height = {
        let mut canvas = Canvas {
            backend: SVGBackend::with_string(&mut drawn, (1, 1)),
        };
        paint(&mut canvas).clamp(1.0, 1e5)
        // Dropping the backend closes the document.
    };
    // The backend's own first tag fixes one unit to one pixel and knows no height
    // found while drawing.
    let elements = drawn.split_once('>').map_or("", |(_, rest)| rest);
    let mut svg = String::with_capacity(elements.len() + 500);
    let _ = write!(
        svg,
        "<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"{WIDTH}\" height=\"{height:.0}\" \
         viewBox=\"0 0 {:.0} {:.0}\" role=\"img\" stroke-linejoin=\"round\">\n<title>{}</title>\n\
         <rect width=\"100%\" height=\"100%\" fill=\"{}\"/>",
        WIDTH * UNITS,
        height * UNITS,
        super::report::escape(description),
        hex(PAPER),
    );
    svg.push_str(elements);
    svg
}

impl Canvas<'_> {
    /// A line through `points`.
    pub(super) fn line(&mut self, points: &[(f64, f64)], ink: Ink) {
        let path: Vec<(i32, i32)> = points.iter().map(|p| unit(*p)).collect();
        match path.as_slice() {
            [] => {}
            [only] => {
                let _ = self.backend.draw_circle(
                    *only,
                    (ink.width * UNITS / 2.0) as u32,
                    &ink.style(true),
                    true,
                );
            }
            _ => {
                let _ = self.backend.draw_path(path, &ink.style(false));
            }
        }
    }

    /// A dashed line through `points`; solid where it would take thousands of dashes.
    pub(super) fn dashes(&mut self, points: &[(f64, f64)], ink: Ink, dash: f64) {
        let length: f64 = points.windows(2).map(distance).sum();
        if !(dash > 0.5 && length / dash < 600.0) {
            return self.line(points, ink);
        }
        let mut piece: Vec<(f64, f64)> = Vec::new();
        let mut pen_down = true;
        let mut left = dash;
        for pair in points.windows(2) {
            let &[from, to] = pair else { continue };
            let whole = distance(pair);
            let mut done = 0.0;
            if pen_down && piece.is_empty() {
                piece.push(from);
            }
            while whole - done > left {
                done += left;
                let share = done / whole;
                let here = (
                    from.0 + share * (to.0 - from.0),
                    from.1 + share * (to.1 - from.1),
                );
                piece.push(here);
                if pen_down {
                    self.line(&piece, ink);
                    piece.clear();
                } else {
                    piece = vec![here];
                }
                pen_down = !pen_down;
                left = if pen_down { dash } else { dash * 0.7 };
            }
            left -= whole - done;
            if pen_down {
                piece.push(to);
            } else {
                piece.clear();
            }
        }
        if pen_down {
            self.line(&piece, ink);
        }
    }

    /// A filled area bounded by `points`.
    pub(super) fn area(&mut self, points: &[(f64, f64)], ink: Ink) {
        if points.len() > 2 {
            let path: Vec<(i32, i32)> = points.iter().map(|p| unit(*p)).collect();
            let _ = self.backend.fill_polygon(path, &ink.style(true));
        }
    }

    /// A filled rectangle between two opposite corners.
    pub(super) fn rectangle(&mut self, (x0, y0): (f64, f64), (x1, y1): (f64, f64), ink: Ink) {
        let from = unit((x0.min(x1), y0.min(y1)));
        let to = unit((x0.max(x1), y0.max(y1)));
        let _ = self.backend.draw_rect(from, to, &ink.style(true), true);
    }

    /// A disc, or a ring on the paper's colour.
    pub(super) fn dot(&mut self, centre: (f64, f64), radius: f64, ink: Ink, filled: bool) {
        let at = unit(centre);
        let radius = (radius * UNITS).round().clamp(1.0, 1e4) as u32;
        if !filled {
            let paper = Ink::new(PAPER, 1.0);
            let _ = self
                .backend
                .draw_circle(at, radius, &paper.style(true), true);
        }
        let _ = self
            .backend
            .draw_circle(at, radius, &ink.style(filled), filled);
    }

    /// Words at a point, centred on it vertically.
    pub(super) fn text(&mut self, words: Words, at: (f64, f64), text: &str) {
        self.write(words, at, text, FontTransform::None);
    }

    /// Words running upwards, centred on a point.
    pub(super) fn upright(&mut self, words: Words, at: (f64, f64), text: &str) {
        self.write(words.at(Anchor::Middle), at, text, FontTransform::Rotate270);
    }

    fn write(&mut self, words: Words, at: (f64, f64), text: &str, turn: FontTransform) {
        if text.is_empty() {
            return;
        }
        let weight = if words.bold {
            FontStyle::Bold
        } else {
            FontStyle::Normal
        };
        let font = FontDesc::new(FAMILY, words.size * UNITS * FONT_SCALE, weight).transform(turn);
        let across = match words.anchor {
            Anchor::Start => HPos::Left,
            Anchor::Middle => HPos::Center,
            Anchor::End => HPos::Right,
        };
        let style = TextStyle::from(font)
            .color(&words.colour)
            .pos(Pos::new(across, VPos::Center));
        let _ = self.backend.draw_text(&clean(text), &style, unit(at));
    }
}

/// Control characters are not allowed in XML, not even escaped.
fn clean(text: &str) -> String {
    text.chars()
        .map(|c| {
            if super::report::allowed(c) {
                c
            } else {
                '\u{fffd}'
            }
        })
        .collect()
}

fn distance(pair: &[(f64, f64)]) -> f64 {
    match pair {
        [a, b] => (b.0 - a.0).hypot(b.1 - a.1),
        _ => 0.0,
    }
}

fn unit((x, y): (f64, f64)) -> (i32, i32) {
    // `as` saturates and sends NaN to 0, so any input gives a point.
    let round = |v: f64| (v * UNITS).round().clamp(-1e6, 1e6) as i32;
    (round(x), round(y))
}

/// Estimated width of `text`, pixels; on the wide side.
pub(super) fn text_width(text: &str, size: f64) -> f64 {
    text.chars()
        .map(|c| match c {
            'i' | 'j' | 'l' | 't' | 'f' | 'r' | '.' | ',' | ':' | ';' | '|' | '\'' | ' ' | '('
            | ')' | 'I' => 0.36,
            'm' | 'w' | 'M' | 'W' | '%' | '→' => 0.95,
            'A'..='Z' | '−' | '+' | '×' | '=' | '±' => 0.72,
            '⁰'..='⁹' | '⁻' | '²' | '³' | '¹' => 0.38,
            _ => CHARACTER,
        })
        .sum::<f64>()
        * size
}

/// `text`, cut with an ellipsis where it is wider than `width` pixels.
pub(super) fn fit(text: &str, size: f64, width: f64) -> String {
    // Half a pixel of slack: callers compute `width` from this very text and round.
    if text_width(text, size) <= width + 0.5 {
        return text.to_owned();
    }
    let mut kept = String::new();
    for c in text.chars() {
        kept.push(c);
        if text_width(&kept, size) > width - size {
            kept.pop();
            break;
        }
    }
    kept.push('…');
    kept
}

/// `text` broken after spaces and hyphens into at most `lines` lines of `width` pixels.
pub(super) fn wrap(text: &str, size: f64, width: f64, lines: usize) -> Vec<String> {
    let mut broken: Vec<String> = Vec::new();
    let mut line = String::new();
    for word in text.split_inclusive([' ', '-']) {
        if !line.is_empty() && text_width(&line, size) + text_width(word.trim_end(), size) > width {
            broken.push(std::mem::take(&mut line));
        }
        line.push_str(word);
    }
    broken.push(line);
    let surplus = broken.split_off(lines.max(1).min(broken.len()));
    if let Some(last) = broken.last_mut() {
        surplus.iter().for_each(|rest| last.push_str(rest));
    }
    broken
        .iter()
        .map(|line| fit(line.trim_end(), size, width))
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::picture::palette::INK;

    #[test]
    fn text_is_escaped_and_nonsense_coordinates_are_harmless() {
        let svg = draw("a < b & \u{1}", |canvas| {
            canvas.text(
                Words::new(12.0, INK),
                (f64::NAN, 1e300),
                "<script>&\"\u{0}\u{8}",
            );
            canvas.line(&[(f64::INFINITY, 0.0), (f64::NAN, 5.0)], Ink::new(INK, 1.0));
            canvas.dashes(&[(0.0, 0.0), (1e9, 5.0)], Ink::new(INK, f64::NAN), 4.0);
            f64::NAN
        });
        let document = roxmltree::Document::parse(&svg).unwrap();
        assert!(!svg.contains("<script>"));
        assert!(svg.contains("&lt;script&gt;"));
        let title = document.descendants().find(|n| n.has_tag_name("title"));
        assert_eq!(title.unwrap().text(), Some("a < b & \u{fffd}"));
    }

    #[test]
    fn dashes_cover_about_their_share_of_a_line() {
        let svg = draw("", |canvas| {
            canvas.dashes(
                &[(0.0, 0.0), (50.0, 0.0), (170.0, 0.0)],
                Ink::new(INK, 1.0),
                10.0,
            );
            10.0
        });
        // A period is 17 px, so ten dashes fit into 170 px.
        assert_eq!(svg.matches("<polyline").count(), 10);
    }

    #[test]
    fn wrapping_breaks_after_hyphens_and_keeps_every_letter() {
        let lines = wrap("+ free-stream-variation", 14.0, 100.0, 3);
        assert_eq!(lines.concat().replace(' ', ""), "+free-stream-variation");
        assert!(lines.len() > 1);
        assert_eq!(wrap("", 14.0, 50.0, 2), [""]);
        assert!(fit(&"x".repeat(500), 14.0, 100.0).ends_with('…'));
    }
}
