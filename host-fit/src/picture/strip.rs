//! The command as a thin strip of on/off bars on a panel's time axis.

use std::ops::Range;

use super::axis::{Axis, extent};
use super::canvas::{Anchor, Canvas, Ink, Words};
use super::palette::{GRID, INK, MUTED};
use super::panel::{Clock, Panel, TICK_SIZE};

/// Height of a strip, pixels.
pub(super) const HEIGHT: f64 = 18.0;

/// Draws `u` below `above`, at `top`: bars while on, or a line where the command
/// has more than two levels.
pub(super) fn strip(
    canvas: &mut Canvas,
    above: &Panel,
    top: f64,
    (clock, u, range): (Clock, &[f64], Range<usize>),
    columns: usize,
    (name, ink): (&str, Ink),
) {
    let values = u
        .get(range.start.min(u.len())..range.end.min(u.len()))
        .unwrap_or_default();
    let on_off = values
        .iter()
        .all(|v| !v.is_finite() || *v == 0.0 || *v == 1.0);
    let span = if on_off {
        Some((0.0, 1.0))
    } else {
        extent(values.iter().copied())
    };
    let panel = Panel {
        top,
        height: HEIGHT,
        y: Axis::linear(span),
        ..*above
    };
    canvas.rectangle(
        (panel.left, top),
        (panel.left + panel.width, top + HEIGHT),
        Ink::new(GRID, 1.0).faint(0.55),
    );
    canvas.text(
        Words::new(TICK_SIZE, INK).at(Anchor::End),
        (panel.left - 7.0, top + HEIGHT / 2.0),
        name,
    );
    if on_off {
        let range = range.start..range.end.min(u.len());
        for (from, to) in bars(&panel, clock, u, range, columns) {
            canvas.rectangle((from, top), (to, top + HEIGHT), ink);
        }
    } else {
        panel.trace(canvas, clock, u, range, columns, Ink { width: 1.25, ..ink });
        let (low, high) = panel.y.ends();
        for (value, at) in [(high, top + 4.0), (low, top + HEIGHT - 3.0)] {
            canvas.text(
                Words::new(10.5, MUTED),
                (panel.left + panel.width + 4.0, at),
                &super::significant(value, 2),
            );
        }
    }
}

/// Left and right pixel of every interval of blowing. An interval is drawn at least half a pixel wide; intervals
/// that are closer share a bar, so their number is bounded.
fn bars(
    panel: &Panel,
    clock: Clock,
    u: &[f64],
    range: Range<usize>,
    columns: usize,
) -> Vec<(f64, f64)> {
    let narrowest = (panel.width / columns.max(1) as f64).max(0.5);
    let pixel = |k: usize| panel.point(clock.time(k), 0.0).map_or(panel.left, |p| p.0);
    let mut bars: Vec<(f64, f64)> = Vec::new();
    let mut start = None;
    for k in range.start..=range.end {
        let on = k < range.end && u.get(k) == Some(&1.0);
        match (start, on) {
            (None, true) => start = Some(k),
            (Some(first), false) => {
                start = None;
                let from = pixel(first);
                let right = panel.left + panel.width;
                let to = pixel(k).max(from + narrowest).min(right);
                match bars.last_mut() {
                    Some(last) if from - last.1 < narrowest * 0.5 => last.1 = last.1.max(to),
                    _ => bars.push((from, to)),
                }
            }
            _ => {}
        }
    }
    bars
}

/// Columns for each of `lines` decimated lines, so that the size of a picture does not depend on its
/// contents.
pub(super) fn columns(width: f64, lines: usize) -> usize {
    /// Points in all lines of a picture; a point takes 10 bytes.
    const POINTS: f64 = 20_000.0;
    let most = POINTS / (2.0 * lines.max(1) as f64);
    width.min(most).max(20.0) as usize
}

#[cfg(test)]
mod tests {
    use super::*;

    fn panel() -> Panel {
        Panel {
            left: 0.0,
            top: 0.0,
            width: 800.0,
            height: 100.0,
            x: Axis::linear(Some((0.0, 10.0))),
            y: Axis::linear(None),
        }
    }

    #[test]
    fn pulses_become_bars_of_their_width() {
        let u: Vec<f64> = (0..10_000)
            .map(|k| f64::from(u8::from(k % 1000 < 500)))
            .collect();
        let bars = bars(&panel(), Clock::new(0.0, 0.001), &u, 0..u.len(), 800);
        assert_eq!(bars.len(), 10);
        assert!((bars[3].0 - 240.0).abs() < 1e-9 && (bars[3].1 - 280.0).abs() < 1e-9);
    }

    #[test]
    fn a_pulse_of_one_sample_shows_and_chatter_stays_small() {
        let mut u = vec![0.0; 1_000_000];
        u[500_000] = 1.0;
        let clock = Clock::new(0.0, 1e-5);
        let single = bars(&panel(), clock, &u, 0..u.len(), 800);
        assert_eq!(single.len(), 1);
        assert!(single[0].1 - single[0].0 >= 0.5);
        let chatter: Vec<f64> = (0..1_000_000).map(|k| f64::from(k % 2)).collect();
        assert!(bars(&panel(), clock, &chatter, 0..chatter.len(), 800).len() < 1600);
    }
}
