//! Colours: the Okabe–Ito set, told apart with every common colour blindness, on
//! quiet greys. Each has a counterpart for dark pages (see [`dark_rules`]).

use plotters::style::RGBColor;
use std::fmt::Write as _;

/// Background of a picture.
pub(super) const PAPER: RGBColor = RGBColor(255, 255, 255);
/// Text and measured data.
pub(super) const INK: RGBColor = RGBColor(31, 35, 40);
/// Secondary text, scatter bands, noise floor, decoys.
pub(super) const MUTED: RGBColor = RGBColor(101, 109, 118);
/// Grid lines.
pub(super) const GRID: RGBColor = RGBColor(230, 234, 238);
/// Axis lines and ticks.
pub(super) const RULE: RGBColor = RGBColor(175, 184, 193);
/// Noise floor and measurement scatter.
pub(super) const FLOOR: RGBColor = RGBColor(140, 149, 159);
/// First series.
pub(super) const BLUE: RGBColor = RGBColor(0, 114, 178);
/// What needs attention: the worst bin, the second series.
pub(super) const VERMILLION: RGBColor = RGBColor(213, 94, 0);
const GREEN: RGBColor = RGBColor(0, 158, 115);
const PURPLE: RGBColor = RGBColor(170, 68, 153);
const ORANGE: RGBColor = RGBColor(230, 159, 0);
const SKY: RGBColor = RGBColor(86, 180, 233);

const SERIES: [RGBColor; 6] = [BLUE, VERMILLION, GREEN, PURPLE, ORANGE, SKY];

/// Colour of the `index`-th series; repeats after six.
pub(super) fn series(index: usize) -> RGBColor {
    SERIES.get(index % SERIES.len()).copied().unwrap_or(BLUE)
}

/// Light colour and the one that replaces it on a dark page.
const DARK: [(RGBColor, RGBColor); 12] = [
    (PAPER, RGBColor(22, 27, 34)),
    (INK, RGBColor(230, 237, 243)),
    (MUTED, RGBColor(154, 163, 173)),
    (GRID, RGBColor(42, 49, 58)),
    (RULE, RGBColor(88, 97, 107)),
    (FLOOR, RGBColor(125, 134, 144)),
    (BLUE, RGBColor(77, 170, 232)),
    (VERMILLION, RGBColor(255, 138, 76)),
    (GREEN, RGBColor(60, 207, 158)),
    (PURPLE, RGBColor(214, 130, 200)),
    (ORANGE, RGBColor(240, 183, 60)),
    (SKY, RGBColor(140, 208, 250)),
];

/// CSS rules that turn a picture inside `scope` dark: author rules win over the
/// presentation attributes of SVG, so the picture itself stays a light one.
pub(super) fn dark_rules(scope: &str) -> String {
    let mut css = String::new();
    for (light, dark) in DARK {
        let (light, dark) = (hex(light), hex(dark));
        for property in ["fill", "stroke"] {
            let _ = write!(css, "{scope} [{property}=\"{light}\"]{{{property}:{dark}}}");
        }
    }
    css
}

/// `#RRGGBB`, spelt as the SVG backend spells it.
pub(super) fn hex(RGBColor(r, g, b): RGBColor) -> String {
    format!("#{r:02X}{g:02X}{b:02X}")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_series_colour_is_distinct_and_has_a_dark_counterpart() {
        for i in 0..SERIES.len() {
            assert!(DARK.iter().any(|(light, _)| *light == series(i)));
            for j in 0..i {
                assert_ne!(series(i), series(j));
            }
        }
        assert_eq!(series(6), series(0));
    }

    #[test]
    fn dark_rules_name_the_colours_as_written_in_the_picture() {
        let css = dark_rules("figure svg");
        assert!(css.contains("figure svg [stroke=\"#0072B2\"]{stroke:#4DAAE8}"));
    }
}
