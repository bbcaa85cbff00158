//! The colour of a model, the same in all charts of the page.

use host_fit::picture::{SERIES_COLOURS, series_colour};

/// Colour index of a model.
pub(super) fn index(model: u32) -> usize {
    (model.saturating_sub(1) as usize) % SERIES_COLOURS
}

/// Colour of a model.
pub(super) fn of(model: u32) -> String {
    series_colour(index(model))
}

/// The picture with `colours[i]` in place of the colour of its i-th series.
pub(super) fn recoloured(picture: &str, colours: &[String]) -> String {
    let series: Vec<String> = (0..SERIES_COLOURS).map(series_colour).collect();
    let mut parts = picture.split('#');
    let mut text = parts.next().unwrap_or_default().to_owned();
    for part in parts {
        let mut pairs = series.iter().zip(colours);
        let replaced = pairs.find_map(|(series, colour)| {
            let rest = part.strip_prefix(series.trim_start_matches('#'))?;
            Some((colour, rest))
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
    fn a_model_has_the_colour_of_its_index_in_pictures() {
        for model in 1..=6 {
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
            let others = (1..=6).filter(|other| *other != model);
            assert!(picture.contains(&of(model)), "{model}");
            assert!(
                others
                    .into_iter()
                    .all(|other| !picture.contains(&of(other)))
            );
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
