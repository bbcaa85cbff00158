//! One case: board, host and plant, sample by sample.

use super::host;
use super::{Case, Link};
use anyhow::{Context, Result, bail};
use firmware::cases::SETTINGS;
use firmware::link::lockstep::{BATCH, REPORT, Report, START, STEPS};
use firmware_sim::plant::{BasePlant, FlowDelay, PlantSpec, RateLaw, Rig};

/// A run with fewer switches is not meaningful.
const FEWEST_SWITCHES: usize = 10;

/// Result of a case.
#[derive(Clone, Copy, Debug)]
pub struct Measured {
    /// Figures counted by the board.
    pub report: Report,
    /// Number of valve switches.
    pub switches: usize,
    /// Mean friction of the plant.
    pub friction: f64,
}

/// A plant with different attachment and separation and the paper's delay law. One millisecond of it is one
/// sample of the loop at any period: the delay is longer than a batch.
fn plant() -> Result<Rig> {
    let base = BasePlant {
        attach_s: 0.055,
        separate_s: 0.080,
        gain: 1.0,
        delay: FlowDelay::StateDependent {
            floor_s: 0.04735,
            rise_s: 0.01269,
            rate: 15.0,
        },
        rate_law: RateLaw::default(),
    };
    Ok(Rig::new(&PlantSpec::new(base, &[]), None)?)
}

/// The measured channel at sample `k`, counts: a slow variation by a tenth about the middle, which is the
/// channel's reference.
fn channel(k: usize) -> u16 {
    let phase = k as f64 / 700.0 * std::f64::consts::TAU;
    (2048.0 + 200.0 * phase.sin()).round() as u16
}

/// Runs the case of that number.
///
/// # Errors
/// A board that computes other bits than the host, or does not answer.
pub fn run_case(link: &mut Link, number: u8, case: &Case) -> Result<Measured> {
    if link.ask(START, &[number])? != [1] {
        bail!("the board has no case {number}; flash the present firmware");
    }
    let mut step = host::steps(&case.model);
    let mut plant = plant()?;
    let mut noise = 0x1234_5678_u32;
    let (mut switches, mut friction, mut open, mut done) = (0, 0.0, false, 0);
    while done < case.steps {
        let batch = BATCH.min(case.steps - done);
        // The readings during the batch. All jets that arrive during the batch were issued before
        // it.
        let mut ahead = plant.clone();
        let mut readings = Vec::with_capacity(batch);
        let channel = channel(done);
        for _ in 0..batch {
            noise = noise.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            let scatter = f64::from(noise >> 24) / 256.0 * 0.04 - 0.02;
            let y = ahead.read() + scatter;
            friction += ahead.friction() / case.steps as f64;
            let code = y / f64::from(SETTINGS.calibration.per_count)
                + f64::from(SETTINGS.calibration.zero);
            readings.push(code.round().clamp(0.0, 4095.0) as u16);
            ahead.advance_sample();
        }
        let counts = std::iter::once(&channel).chain(&readings);
        let bytes = counts.flat_map(|counts| counts.to_le_bytes());
        let reply = link.ask(STEPS, &bytes.collect::<Vec<u8>>())?;
        let (predicted_there, decided_there) = reply
            .split_last_chunk::<4>()
            .context("the reply to a batch is too short")?;
        if predicted_there.len() != 4 * batch {
            bail!(
                "{} bytes of predictions for {batch} steps",
                predicted_there.len()
            );
        }
        let decided_there = u32::from_le_bytes(*decided_there);
        for (i, counts) in readings.iter().enumerate() {
            let (predicted, decided) = step(*counts, channel);
            let bits = predicted_there
                .get(4 * i..4 * i + 4)
                .and_then(|bytes| bytes.try_into().ok())
                .map_or(0, u32::from_le_bytes);
            let opens = decided_there >> i & 1 == 1;
            if bits != predicted.to_bits() || opens != decided {
                bail!(
                    "{}, step {}: board {:e} (0x{bits:08x}) {opens}, host {predicted:e} (0x{:08x}) {decided}",
                    case.name,
                    done + i,
                    f32::from_bits(bits),
                    predicted.to_bits(),
                );
            }
            if !predicted.is_finite() {
                bail!("{}, step {}: {predicted}", case.name, done + i);
            }
            switches += usize::from(opens != open);
            open = opens;
            plant.command(f64::from(u8::from(open)));
            plant.advance_sample();
        }
        done += batch;
    }
    let report = link.ask(REPORT, &[])?;
    let report = Report::from_bytes(&report).context("the report is too short")?;
    if report.steps as usize != case.steps {
        bail!(
            "the board made {} steps, the host {}",
            report.steps,
            case.steps
        );
    }
    if switches < FEWEST_SWITCHES {
        bail!("{}: only {switches} switches, nothing was shown", case.name);
    }
    Ok(Measured {
        report,
        switches,
        friction,
    })
}
