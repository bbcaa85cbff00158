//! Long runs: the board's loop for a day with random faults and commands, and the model in single against double
//! precision.

mod board;
mod line;
mod models;
mod rules;

pub use models::{Difference, compare};

use anyhow::{Context, Result, ensure};
use board::{Board, Plant, Sickness};
use firmware::controller::Mode;
use firmware::on_board::{self, SETTINGS};
use line::Line;
use rand::{RngExt as _, SeedableRng as _};
use rand_chacha::ChaCha8Rng;
use rules::Rules;
use std::collections::BTreeMap;
use std::time::Instant;

/// Samples for which a second board runs whose clock and sample number wrap soon after each start.
const TWIN: u64 = 10_000_000;
/// Mean time between faults, samples.
const BETWEEN_FAULTS: u64 = 15_000;
/// Samples between comparisons of a loop that is armed again with a new one.
const BETWEEN_FRESH: u64 = 3_000_000;
/// Closed valve before such a comparison, samples: the model forgets what was before.
const REST: u64 = 20_000;
/// Length of such a comparison, samples.
const COMPARED: u64 = 3_000;
/// Largest difference of the predictions, y, while the decisions are the same.
const SAME: f32 = 1e-5;

/// Counts of a run.
#[derive(Debug, Default)]
pub struct Day {
    /// Samples of the loop.
    pub ticks: u64,
    /// Changes of the valve's position.
    pub switches: u64,
    /// Samples in each mode.
    pub modes: BTreeMap<&'static str, u64>,
    /// Latched faults by name.
    pub faults: BTreeMap<&'static str, u64>,
    /// Bytes received from the line.
    pub bytes: u64,
    /// Restarts by the watchdog.
    pub restarts: u64,
    /// Comparisons with a new loop, and the largest difference of predictions in y.
    pub fresh: (u64, f32),
    /// Samples compared with a board whose counters wrap.
    pub twin: u64,
    /// Number of these wraps.
    pub wraps: u64,
}

/// Runs the loop for `ticks` samples.
///
/// # Errors
/// The first broken rule, with the sample.
pub fn day(ticks: u64, seed: u64) -> Result<Day> {
    let mut random = ChaCha8Rng::seed_from_u64(seed);
    let mut day = Day::default();
    let mut board = Board::new(0, false);
    let mut twin = Some(Board::near_wrap(false));
    let mut plant = Plant::new()?;
    let mut line = Line::new();
    let mut rules = Rules::new();
    let mut sickness = Sickness::None;
    let (mut next_fault, mut next_fresh) = (BETWEEN_FAULTS, BETWEEN_FRESH);
    let started = Instant::now();
    for k in 0..ticks {
        if k >= next_fault && sickness == Sickness::None {
            next_fault = k + random.random_range(1..2 * BETWEEN_FAULTS);
            sickness = Sickness::draw(&mut random);
        }
        if sickness == Sickness::Watchdog {
            sickness = Sickness::None;
            board = Board::new(board.clock(), true);
            twin = twin.map(|_| Board::near_wrap(true));
            rules.restarted();
            line.restarted();
            day.restarts += 1;
        }
        let reading = plant.reading(board.is_open(), &mut random);
        let (counts, periods) = sickness.apply(reading);
        line.fill(board.mode(), &mut random);
        let bytes = line.take();
        day.bytes += bytes.len() as u64;
        let tick = board.sample(counts, periods, bytes);
        rules
            .check(&tick, periods, &board, &line, sickness)
            .with_context(|| format!("sample {k} of seed {seed}: {sickness:?}, {tick:?}"))?;
        if let Some(other) = &mut twin {
            let same = other.sample(counts, periods, bytes);
            let bits = |tick: &firmware::controller::Tick| {
                (
                    tick.predicted.to_bits(),
                    tick.residual.to_bits(),
                    tick.open,
                    tick.mode,
                )
            };
            ensure!(
                bits(&same) == bits(&tick),
                "sample {k} of seed {seed}: the board whose counters wrap differs: {same:?}, {tick:?}"
            );
            day.twin += 1;
            day.wraps += u64::from(other.clock() == 0);
            if k >= TWIN {
                twin = None;
            }
        }
        sickness = sickness.after();
        line.sent();
        day.ticks += 1;
        *day.modes.entry(mode_name(tick.mode)).or_default() += 1;
        if k >= next_fresh && sickness == Sickness::None {
            next_fresh = k + BETWEEN_FRESH;
            let difference = against_fresh(&board, seed ^ k)
                .with_context(|| format!("sample {k} of seed {seed}"))?;
            day.fresh = (day.fresh.0 + 1, day.fresh.1.max(difference));
        }
        if (k + 1) % (ticks / 10).max(1) == 0 {
            eprintln!(
                "{} of {ticks} samples in {:.0} s",
                k + 1,
                started.elapsed().as_secs_f64()
            );
        }
    }
    day.switches = rules.switches();
    day.faults = rules.faults();
    Ok(day)
}

fn mode_name(mode: Mode) -> &'static str {
    match mode {
        Mode::Disarmed => "disarmed",
        Mode::Armed => "armed",
        Mode::Playing => "playing",
        Mode::Paused => "paused",
        Mode::Faulted(_) => "faulted",
    }
}

/// A copy of the loop, disarmed, at rest and armed again, against a new loop: the settings are equal, and the
/// predictions while the decisions are. Returns their largest difference.
fn against_fresh(board: &Board, seed: u64) -> Result<f32> {
    let mut used = board.controller();
    used.disarm();
    let mut fresh = on_board::controller();
    let mut random = ChaCha8Rng::seed_from_u64(seed);
    let mut at_rest = Plant::new()?;
    for _ in 0..REST {
        let reading = board::reading(at_rest.reading(false, &mut random));
        used.tick(reading);
    }
    ensure!(
        used.law_settings() == fresh.law_settings(),
        "the settings of a law that is armed again are not those of its design"
    );
    used.arm();
    fresh.arm();
    let mut most = 0.0_f32;
    for k in 0..COMPARED {
        let reading = board::reading(at_rest.reading(fresh.is_open(), &mut random));
        let (a, b) = (used.tick(reading), fresh.tick(reading));
        ensure!(
            a.mode == b.mode,
            "{:?} when armed again, {:?} when new",
            a.mode,
            b.mode
        );
        if a.open != b.open {
            ensure!(k > 0, "the first decision differs");
            break;
        }
        most = most.max((a.predicted - b.predicted).abs());
        ensure!(
            most <= SAME,
            "a loop that is armed again predicts {} after {k} samples, a new one {}",
            a.predicted,
            b.predicted
        );
    }
    Ok(most)
}

/// The shortest times of the valve, samples.
fn hold() -> model_core::control::HoldTimes {
    SETTINGS.hold
}

#[cfg(test)]
mod tests {
    #[test]
    fn the_loop_keeps_its_rules_for_ten_minutes() {
        let day = super::day(600_000, 3).expect("no rule is broken");
        assert!(day.switches > 1000, "{day:?}");
        assert!(day.faults.len() >= 6, "{day:?}");
        assert!(day.modes.len() == 5 && day.wraps > 0, "{day:?}");
    }
}
