//! Colours: the Okabe–Ito set, distinguishable with all common colour blindness, on neutral greys. Each has a
//! counterpart for dark pages (see [`dark_rules`]).

use std::fmt::{self, Write as _};

/// A colour, printed as `#RRGGBB`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Colour(u8, u8, u8);

impl fmt::Display for Colour {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self(r, g, b) = self;
        write!(f, "#{r:02X}{g:02X}{b:02X}")
    }
}

/// Background of a picture.
pub(super) const PAPER: Colour = Colour(255, 255, 255);
/// Text and measured data.
pub(super) const INK: Colour = Colour(31, 35, 40);
/// Secondary text, scatter bands, noise level.
pub(super) const MUTED: Colour = Colour(101, 109, 118);
/// Grid lines.
pub(super) const GRID: Colour = Colour(230, 234, 238);
/// Axis lines and ticks.
pub(super) const RULE: Colour = Colour(175, 184, 193);
/// Noise level and measurement scatter.
pub(super) const FLOOR: Colour = Colour(140, 149, 159);
/// First series.
pub(super) const BLUE: Colour = Colour(0, 114, 178);
/// Emphasis: the worst bin, the second series.
pub(super) const VERMILLION: Colour = Colour(213, 94, 0);
const GREEN: Colour = Colour(0, 158, 115);
const PURPLE: Colour = Colour(170, 68, 153);
const ORANGE: Colour = Colour(230, 159, 0);
const SKY: Colour = Colour(86, 180, 233);

/// Number of colours of series.
pub const SERIES_COLOURS: usize = 6;
const SERIES: [Colour; SERIES_COLOURS] = [BLUE, VERMILLION, GREEN, PURPLE, ORANGE, SKY];

/// Colour of the `index`-th series; repeats after six.
pub(super) fn series(index: usize) -> Colour {
    SERIES.get(index % SERIES.len()).copied().unwrap_or(BLUE)
}

/// Colour of the `index`-th series of a picture, as `#RRGGBB`; repeats after six.
#[must_use]
pub fn series_colour(index: usize) -> String {
    series(index).to_string()
}

/// Colour of a curve that belongs to no series, as `#RRGGBB`.
#[must_use]
pub fn neutral_colour() -> String {
    MUTED.to_string()
}

/// Light colours with their dark replacements.
const DARK: [(Colour, Colour); 12] = [
    (PAPER, Colour(22, 27, 34)),
    (INK, Colour(230, 237, 243)),
    (MUTED, Colour(154, 163, 173)),
    (GRID, Colour(42, 49, 58)),
    (RULE, Colour(88, 97, 107)),
    (FLOOR, Colour(125, 134, 144)),
    (BLUE, Colour(77, 170, 232)),
    (VERMILLION, Colour(255, 138, 76)),
    (GREEN, Colour(60, 207, 158)),
    (PURPLE, Colour(214, 130, 200)),
    (ORANGE, Colour(240, 183, 60)),
    (SKY, Colour(140, 208, 250)),
];

/// CSS rules that turn a picture inside `scope` dark: author rules win over the presentation
/// attributes of SVG, so the picture's own colours stay those for light pages.
pub(super) fn dark_rules(scope: &str) -> String {
    let mut css = String::new();
    for (light, dark) in DARK {
        for property in ["fill", "stroke"] {
            let _ = write!(css, "{scope} [{property}=\"{light}\"]{{{property}:{dark}}}");
        }
    }
    css
}

/// The colours as CSS variables for scripts: `--s0` … the series, `--floor`, `--grid`, `--axis`, `--band`
/// (scatter) and `--lit` (marked samples).
pub(super) fn variables(dark: bool) -> String {
    let shade = |colour: Colour| {
        let counterpart = DARK.iter().find(|(light, _)| dark && *light == colour);
        counterpart.map_or(colour, |(_, dark)| *dark)
    };
    let mut css = String::new();
    for (name, colour) in [("floor", FLOOR), ("grid", GRID), ("axis", RULE)] {
        let _ = write!(css, "--{name}:{};", shade(colour));
    }
    // With transparency: `#RRGGBBAA`.
    let _ = write!(css, "--band:{}59;--lit:{}40;", shade(FLOOR), shade(ORANGE));
    for index in 0..SERIES.len() {
        let _ = write!(css, "--s{index}:{};", shade(series(index)));
    }
    css
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
