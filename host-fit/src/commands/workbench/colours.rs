//! The colour of a model, the same in all charts of the page.

/// Colours of the series in pictures, in the order of their index.
const SERIES: [&str; 6] = [
    "#0072B2", "#D55E00", "#009E73", "#AA4499", "#E69F00", "#56B4E9",
];

/// Colour of a curve that belongs to no model of the project.
pub(super) const NO_MODEL: &str = "#656D76";

/// Colour index of a model.
pub(super) fn index(model: u32) -> usize {
    (model.saturating_sub(1) as usize) % SERIES.len()
}

/// Colour of a model.
pub(super) fn of(model: u32) -> &'static str {
    SERIES.get(index(model)).copied().unwrap_or(NO_MODEL)
}

/// The picture with `colours[i]` in place of the colour of its i-th series.
pub(super) fn recoloured(picture: &str, colours: &[&str]) -> String {
    let mut parts = picture.split('#');
    let mut text = parts.next().unwrap_or_default().to_owned();
    for part in parts {
        let mut series = SERIES.iter().zip(colours);
        let replaced = series.find_map(|(series, colour)| {
            let rest = part.strip_prefix(series.trim_start_matches('#'))?;
            Some((*colour, rest))
        });
        match replaced {
            Some((colour, rest)) => {
                text.push_str(colour);
                text.push_str(rest);
            }
            None => {
                text.push('#');
                text.push_str(part);
            }
        }
    }
    text
}

#[cfg(test)]
mod tests {
    use super::*;
    use host_fit::picture::{Line, LinePlot, lines};

    #[test]
    fn the_colours_are_those_of_the_pictures() {
        for (model, colour) in (1..).zip(SERIES) {
            assert_eq!((of(model), of(model + 6)), (colour, colour));
            let drawn = [Line {
                label: "a model",
                points: &[(0.0, 0.0), (1.0, 1.0)],
                colour: Some(index(model)),
                dashed: false,
            }];
            let picture = lines(&LinePlot {
                title: "a title",
                x_label: "x",
                y_label: "y",
                lines: &drawn,
                band: None,
                log_x: false,
            });
            assert!(picture.contains(colour), "{colour}");
        }
    }

    #[test]
    fn colours_are_exchanged_in_one_pass() {
        let picture = "<a stroke=\"#0072B2\"/><a fill=\"#D55E00\"/><a fill=\"#FFFFFF\"/>";
        let exchanged = "<a stroke=\"#D55E00\"/><a fill=\"#0072B2\"/><a fill=\"#FFFFFF\"/>";
        assert_eq!(recoloured(picture, &[of(2), of(1)]), exchanged);
        assert_eq!(recoloured(picture, &[]), picture);
    }
}
