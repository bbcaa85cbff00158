//! The picture of the page: a validation record with both models, and the reading under both laws.

use super::TARGET;
use anyhow::{Context, Result};
use std::fmt::Write as _;
use std::path::Path;

const WIDTH: f64 = 860.0;
const PANEL: f64 = 170.0;
/// Samples averaged per point of a line.
const MEAN: usize = 20;
/// Colours of the measurement and target, and of the models without and with the effect.
const GREY: &str = "#57606A";
const BEFORE: &str = "#D55E00";
const AFTER: &str = "#0072B2";

/// Draws the files of a day.
pub(super) fn draw(folder: &Path, shown: &str) -> Result<String> {
    let mut svg = format!(
        "<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"900\" height=\"{}\" viewBox=\"0 0 900 {0}\" role=\"img\" \
         font-family=\"Helvetica, Arial, sans-serif\">\n<title>A validation record with both models; the reading under both \
         laws</title>\n<rect width=\"100%\" height=\"100%\" fill=\"#FFFFFF\"/>\n",
        3.0 * PANEL + 30.0
    );
    let read = |file: &str, from: usize| means(&folder.join(file), from);
    let record = [
        (read(&format!("set/{shown}.csv"), 0)?, GREY),
        (read("model-run.csv", 0)?, BEFORE),
        (read("better-run.csv", 0)?, AFTER),
    ];
    let words = format!(
        "validation record {shown}, 4 s: measured (grey), model without (orange) and with (blue) the effect"
    );
    panel(&mut svg, 0, &words, &record, None);
    for (i, (name, colour)) in [("before", BEFORE), ("after", AFTER)]
        .into_iter()
        .enumerate()
    {
        let reading = read(&format!("service-{name}/service.csv"), 6000)?;
        let words = format!("law {name} the effect was added: reading for 4 s, target dashed");
        panel(
            &mut svg,
            i + 1,
            &words,
            &[(reading, colour)],
            Some(TARGET.parse()?),
        );
    }
    svg.push_str("</svg>\n");
    Ok(svg)
}

/// Four seconds of a file's y, in means over [`MEAN`] samples.
fn means(file: &Path, from: usize) -> Result<Vec<f64>> {
    let text = std::fs::read_to_string(file).with_context(|| file.display().to_string())?;
    let y: Vec<f64> = text
        .lines()
        .skip(1 + from)
        .take(4000)
        .filter_map(|line| line.split(',').nth(2)?.parse().ok())
        .collect();
    let mean = |chunk: &[f64]| chunk.iter().sum::<f64>() / MEAN as f64;
    Ok(y.chunks_exact(MEAN).map(mean).collect())
}

/// Lines on one scale, y from −0.1 to 1.2.
fn panel(
    svg: &mut String,
    row: usize,
    words: &str,
    lines: &[(Vec<f64>, &str)],
    target: Option<f64>,
) {
    let top = 30.0 + row as f64 * PANEL;
    let height = |y: f64| top + (PANEL - 40.0) * (1.2 - y.clamp(-0.1, 1.2)) / 1.3;
    for (level, dashes, colour) in [
        (Some(0.0), "", "#D0D7DE"),
        (Some(1.0), "", "#D0D7DE"),
        (target, "4 4", GREY),
    ] {
        let Some(level) = level else { continue };
        let y = height(level);
        let _ = writeln!(
            svg,
            "<line x1=\"20\" x2=\"880\" y1=\"{y:.1}\" y2=\"{y:.1}\" stroke=\"{colour}\" stroke-dasharray=\"{dashes}\"/>\n\
             <text x=\"4\" y=\"{:.1}\" font-size=\"11\" fill=\"{GREY}\">{level}</text>",
            y + 4.0
        );
    }
    for (line, colour) in lines {
        let points: Vec<String> = line
            .iter()
            .enumerate()
            .map(|(k, y)| {
                let x = 20.0 + WIDTH * k as f64 / line.len().max(1) as f64;
                format!("{x:.1},{:.1}", height(*y))
            })
            .collect();
        let _ = writeln!(
            svg,
            "<polyline points=\"{}\" fill=\"none\" stroke=\"{colour}\" stroke-width=\"1.4\"/>",
            points.join(" ")
        );
    }
    let _ = writeln!(
        svg,
        "<text x=\"24\" y=\"{:.1}\" font-size=\"13\" fill=\"#24292F\">{words}</text>",
        top - 8.0
    );
}
