//! One SVG document: lines, areas and text in pixels, with coordinates to a tenth of a pixel.

use std::fmt::Write as _;

use super::palette::{Colour, PAPER};

/// Widths in which a picture is laid out, pixels: for half the screen of a desktop computer, and for a phone. The text
/// has the same size in both, so that it can be read in both.
const WIDTHS: [f64; 2] = [660.0, 420.0];
/// Free border around a picture, pixels.
pub(super) const MARGIN: f64 = 14.0;

/// Width of an average character over the font's size, for a wide sans-serif.
const CHARACTER: f64 = 0.59;
/// Width of bold letters relative to plain ones.
pub(super) const BOLD: f64 = 1.12;

/// Horizontal alignment of a text.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Anchor {
    Start,
    Middle,
    End,
}

/// Size, weight and colour of a text, vertically centred.
#[derive(Clone, Copy, Debug)]
pub(super) struct Words {
    pub(super) size: f64,
    pub(super) bold: bool,
    pub(super) colour: Colour,
    pub(super) anchor: Anchor,
}

impl Words {
    pub(super) fn new(size: f64, colour: Colour) -> Self {
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
    pub(super) colour: Colour,
    pub(super) opacity: f64,
    pub(super) width: f64,
}

impl Ink {
    pub(super) fn new(colour: Colour, width: f64) -> Self {
        Self {
            colour,
            opacity: 1.0,
            width,
        }
    }

    pub(super) fn faint(self, opacity: f64) -> Self {
        Self { opacity, ..self }
    }

    fn stroke(self) -> String {
        format!(
            "stroke=\"{}\" stroke-width=\"{}\"{}",
            self.colour,
            pixel(self.width.max(0.25) * 10.0) / 10.0,
            self.transparency()
        )
    }

    fn fill(self) -> String {
        format!("fill=\"{}\"{}", self.colour, self.transparency())
    }

    fn transparency(self) -> String {
        if self.opacity < 1.0 {
            format!(" opacity=\"{}\"", self.opacity.max(0.0))
        } else {
            String::new()
        }
    }
}

/// A picture: one SVG document for wide places and one for narrow ones. As text it is the wide document.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Picture {
    wide: String,
    narrow: String,
}

impl Picture {
    /// Both drawings for a page; the page's style shows the one for the width of the window.
    #[must_use]
    pub fn html(&self) -> String {
        let Self { wide, narrow } = self;
        format!("<div class=\"wide\">{wide}</div><div class=\"narrow\">{narrow}</div>")
    }
}

impl std::ops::Deref for Picture {
    type Target = str;

    fn deref(&self) -> &str {
        &self.wide
    }
}

impl From<Picture> for String {
    fn from(picture: Picture) -> Self {
        picture.wide
    }
}

/// The drawing surface: a string, so no operation can fail.
pub(super) struct Canvas {
    /// Width of the picture, pixels.
    pub(super) width: f64,
    elements: String,
}

/// Draws a picture in both widths; `paint` returns its height. `description` is the text for screen readers.
pub(super) fn draw(description: &str, paint: impl Fn(&mut Canvas) -> f64) -> Picture {
    let [wide, narrow] = WIDTHS.map(|width| document(description, width, &paint));
    Picture { wide, narrow }
}

fn document(description: &str, width: f64, paint: impl Fn(&mut Canvas) -> f64) -> String {
    let mut canvas = Canvas {
        width,
        elements: String::new(),
    };
    let height = paint(&mut canvas).clamp(1.0, 1e5);
    format!(
        "<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"{width}\" height=\"{height:.0}\" \
         viewBox=\"0 0 {width} {height:.0}\" role=\"img\" stroke-linejoin=\"round\" \
         font-family=\"Helvetica, Arial, sans-serif\">\n<title>{}</title>\n\
         <rect width=\"100%\" height=\"100%\" fill=\"{PAPER}\"/>\n{}</svg>\n",
        super::format::escape(description),
        canvas.elements,
    )
}

impl Canvas {
    /// Whether the layout is for a phone: parts that are side by side in the wide layout are below each other.
    pub(super) fn is_narrow(&self) -> bool {
        self.width < 500.0
    }

    fn write(&mut self, element: std::fmt::Arguments<'_>) {
        // Writing to a string cannot fail.
        let _ = self.elements.write_fmt(element);
        self.elements.push('\n');
    }

    /// A line through `points`; a dot for a single point.
    pub(super) fn line(&mut self, points: &[(f64, f64)], ink: Ink) {
        match points {
            [] => {}
            [only] => self.dot(*only, ink.width / 2.0, ink, true),
            _ => self.write(format_args!(
                "<polyline fill=\"none\" {} points=\"{}\"/>",
                ink.stroke(),
                list(points)
            )),
        }
    }

    /// A dashed line through `points`; solid if it would need thousands of dashes.
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
            self.write(format_args!(
                "<polygon {} points=\"{}\"/>",
                ink.fill(),
                list(points)
            ));
        }
    }

    /// A filled rectangle between two opposite corners.
    pub(super) fn rectangle(&mut self, (x0, y0): (f64, f64), (x1, y1): (f64, f64), ink: Ink) {
        self.write(format_args!(
            "<rect {} {}/>",
            between((x0, y0), (x1, y1)),
            ink.fill()
        ));
    }

    /// A rectangle that a page can make interactive: `name` identifies it, `label` is its accessible text.
    pub(super) fn bar(
        &mut self,
        corner: (f64, f64),
        opposite: (f64, f64),
        ink: Ink,
        name: &str,
        label: &str,
    ) {
        self.write(format_args!(
            "<rect {} {} data-bar=\"{}\" aria-label=\"{}\"/>",
            between(corner, opposite),
            ink.fill(),
            super::format::escape(name),
            super::format::escape(label),
        ));
    }

    /// A disc, or a ring that is filled with the colour of the background.
    pub(super) fn dot(&mut self, (x, y): (f64, f64), radius: f64, ink: Ink, filled: bool) {
        let style = if filled {
            ink.fill()
        } else {
            format!("fill=\"{PAPER}\" {}", ink.stroke())
        };
        self.write(format_args!(
            "<circle cx=\"{}\" cy=\"{}\" r=\"{}\" {style}/>",
            pixel(x),
            pixel(y),
            pixel(radius).max(0.1)
        ));
    }

    /// Text at a point, vertically centred on it.
    pub(super) fn text(&mut self, words: Words, at: (f64, f64), text: &str) {
        self.words(words, at, text, false);
    }

    /// Text running upwards, centred on a point.
    pub(super) fn upright(&mut self, words: Words, at: (f64, f64), text: &str) {
        self.words(words.at(Anchor::Middle), at, text, true);
    }

    fn words(&mut self, words: Words, (x, y): (f64, f64), text: &str, upright: bool) {
        if text.is_empty() {
            return;
        }
        let (x, y) = (pixel(x), pixel(y));
        let weight = if words.bold {
            " font-weight=\"bold\""
        } else {
            ""
        };
        let anchor = match words.anchor {
            Anchor::Start => "start",
            Anchor::Middle => "middle",
            Anchor::End => "end",
        };
        let turn = if upright {
            format!(" transform=\"rotate(270 {x} {y})\"")
        } else {
            String::new()
        };
        self.write(format_args!(
            "<text x=\"{x}\" y=\"{y}\" dy=\"0.5ex\" text-anchor=\"{anchor}\" font-size=\"{}\"{weight} \
             fill=\"{}\"{turn}>{}</text>",
            words.size,
            words.colour,
            super::format::escape(text)
        ));
    }
}

fn between((x0, y0): (f64, f64), (x1, y1): (f64, f64)) -> String {
    let (left, top) = (pixel(x0.min(x1)), pixel(y0.min(y1)));
    let (right, bottom) = (pixel(x0.max(x1)), pixel(y0.max(y1)));
    let (width, height) = (pixel(right - left), pixel(bottom - top));
    format!("x=\"{left}\" y=\"{top}\" width=\"{width}\" height=\"{height}\"")
}

fn distance(pair: &[(f64, f64)]) -> f64 {
    match pair {
        [a, b] => (b.0 - a.0).hypot(b.1 - a.1),
        _ => 0.0,
    }
}

/// A coordinate, rounded to a tenth of a pixel and limited to ± 100 000 pixels; 0 for NaN.
fn pixel(v: f64) -> f64 {
    let v = if v.is_nan() { 0.0 } else { v };
    (v.clamp(-1e5, 1e5) * 10.0).round() / 10.0
}

fn list(points: &[(f64, f64)]) -> String {
    let mut list = String::with_capacity(12 * points.len());
    for (x, y) in points {
        let _ = write!(list, "{},{} ", pixel(*x), pixel(*y));
    }
    list.pop();
    list
}

/// Estimated width of `text`, pixels; an upper estimate.
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

/// `text`, shortened with an ellipsis if it is wider than `width` pixels.
pub(super) fn fit(text: &str, size: f64, width: f64) -> String {
    // Half a pixel of tolerance is needed, because callers compute `width` from the same text and
    // round it.
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
