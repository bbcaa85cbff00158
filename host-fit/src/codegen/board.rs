//! Whether the boards of this project can run a model.

use super::items::{buffer, setting};
use crate::model::{CommandRange, Law, Model};
use crate::user_effect::line_lengths;
use model_core::control::period::{LONGEST_US, SHORTEST_US, loop_period_us};
use model_core::effect::RustType;
use thiserror::Error;

/// RAM of a board that the loop may use, bytes. The firmware has the same number; a test across the crates compares
/// them.
pub const MOST: usize = 30 * 1024;
/// RAM of loop and law for a model with the shortest possible memory, bytes.
const OVERHEAD: usize = 2 * 1024;

/// Why a board cannot run a model.
#[derive(Clone, Debug, Error, PartialEq)]
#[non_exhaustive]
pub enum BoardError {
    /// The model has no law.
    #[error(
        "key `law`: the model has no law, but a board needs one. Run `host-fit design` on the model and use the file that `design` writes."
    )]
    NoLaw,
    /// The jet blows at the lower command, but a board opens the valve with its output on.
    #[error(
        "key `command`: the lower command ({full:?}) is a full jet and {off:?} is no jet, but a board blows when its \
            output is on. Record u again with 1 for a full jet and 0 for no jet, and identify again."
    )]
    Inverted {
        /// The command of no jet.
        off: f64,
        /// The command of a full jet.
        full: f64,
    },
    /// More measured channels than converters.
    #[error(
        "key `effect`: the model's effects need the measured channels {names}, but the board has one spare input (A1). Leave out an effect, so that one channel remains."
    )]
    Channels {
        /// The channels.
        names: String,
    },
    /// The sample period is outside the range of the timers.
    #[error(
        "key `sample_period_s`: the board samples every {} to {} ms, not every {period} s. \
         Identify the model from records with a sampling period in this range.",
        f64::from(SHORTEST_US) * 1e-3, f64::from(LONGEST_US) * 1e-3
    )]
    Period {
        /// The model's, s.
        period: f64,
    },
    /// The memory of the model is too long for the board.
    #[error(
        "key `{key}`: the model stores {kept} samples for this key. Model and law together need {bytes} bytes of memory; the board has {most}. {remedy}"
    )]
    Memory {
        /// Key that needs most of the memory.
        key: String,
        /// Samples that the board stores for this key.
        kept: usize,
        /// Memory of the loop, bytes.
        bytes: usize,
        /// Memory of the board for the loop, bytes.
        most: usize,
        /// The remedy.
        remedy: &'static str,
    },
}

/// A memory of a model: its purpose, its length in samples, its bytes.
type Part = (String, usize, usize, &'static str);

/// Checks that the boards can run `model` with its law.
///
/// # Errors
/// The key of the model file that causes the problem, and the remedy.
pub fn check(model: &Model) -> Result<(), BoardError> {
    let Some(law) = &model.law else {
        return Err(BoardError::NoLaw);
    };
    let period = model.sample_period_s;
    if loop_period_us(period).is_none() {
        return Err(BoardError::Period { period });
    }
    let CommandRange { off, full } = model.command;
    if full < off {
        return Err(BoardError::Inverted { off, full });
    }
    let memory = model.memory();
    if memory.channels.len() > 1 {
        let names = memory.channels.iter().map(|c| format!("`{}`", c.name));
        let names = names.collect::<Vec<_>>().join(", ");
        return Err(BoardError::Channels { names });
    }
    let bytes = loop_bytes(model, law);
    if bytes <= MOST {
        return Ok(());
    }
    let largest = parts(model)
        .into_iter()
        .max_by_key(|(_, _, bytes, _)| *bytes);
    let (key, kept, _, remedy) = largest.unwrap_or_default();
    Err(BoardError::Memory {
        key,
        kept,
        bytes,
        most: MOST,
        remedy,
    })
}

/// RAM of the loop with `model` and `law`, bytes; an upper estimate.
#[must_use]
pub fn loop_bytes(model: &Model, law: &Law) -> usize {
    let state: usize = parts(model).iter().map(|(_, _, bytes, _)| bytes).sum();
    let law = match law {
        // The law stores its own model, and 12 bytes for each sample of its prediction horizon.
        Law::Track(track) => state + 12 * usize::from(track.look_ahead),
        // The averaged readings.
        Law::Maximise(_) => 8 * model.averaging.window as usize,
    };
    state + law + OVERHEAD
}

fn parts(model: &Model) -> Vec<Part> {
    let memory = model.memory();
    let longest = |lags: &[u16]| lags.iter().copied().max().unwrap_or(0);
    let outputs = if memory.outputs <= model.averaging.window as usize {
        "structure.window"
    } else if longest(&model.state_lags) >= longest(&model.product_lags) {
        "structure.state_lags"
    } else {
        "structure.product_lags"
    };
    let jets = if memory.graded {
        8 * memory.jets
    } else {
        4 * memory.words()
    };
    let shorter = "Identify the model again with a shorter `--max-lag`.";
    let mut parts = vec![
        (
            outputs.to_owned(),
            memory.outputs,
            8 * memory.outputs,
            shorter,
        ),
        (
            "delay".to_owned(),
            memory.jets,
            jets,
            "Identify a model with a shorter delay, or a model with a longer sample period.",
        ),
    ];
    for added in &model.effects {
        let samples = match model.definition(&added.name) {
            Some(definition) => {
                let setting = setting(model, added);
                let lengths = line_lengths(definition, &added.parameters, &setting);
                lengths.into_iter().sum()
            }
            None => match model.spec(&added.name).map(|spec| spec.rust_type) {
                Some(RustType::Buffer(time)) => buffer(model, added, time),
                _ => 0,
            },
        };
        parts.push((
            format!("effect.{}", added.name),
            samples,
            8 * samples,
            "Use a model without this effect, or with a shorter delay in this effect.",
        ));
    }
    parts
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::model::Delay;

    fn full() -> Model {
        let text = include_str!("../../../firmware/identified/models/full.toml");
        Model::from_toml(text, "full.toml").expect("a model file")
    }

    #[test]
    fn what_a_board_runs_is_let_through() {
        assert_eq!(check(&full()), Ok(()));
        let text = include_str!("../../../firmware/identified/models/averaged.toml");
        let averaged = Model::from_toml(text, "averaged.toml").expect("a model file");
        assert_eq!(check(&averaged), Ok(()));
    }

    #[test]
    fn what_it_cannot_run_is_refused_with_key_and_remedy() {
        let refused = |change: &dyn Fn(&mut Model), words: [&str; 2]| {
            let mut model = full();
            change(&mut model);
            let error = check(&model).expect_err("refused").to_string();
            for word in words {
                assert!(error.contains(word), "{error}");
            }
        };
        refused(&|model| model.law = None, ["`law`", "host-fit design"]);
        refused(
            &|model| (model.command.off, model.command.full) = (1.0, 0.0),
            ["`command`", "Record u again with 1 for a full jet"],
        );
        refused(
            &|model| model.sample_period_s = 1.0,
            ["`sample_period_s`", "Identify"],
        );
        refused(
            &|model| model.product_lags[9] = 5000,
            ["`structure.product_lags`", "--max-lag"],
        );
        refused(
            &|model| model.state_lags[4] = 5000,
            ["`structure.state_lags`", "5000 samples"],
        );
        refused(
            &|model| {
                let spec = model_core::effects::spec("plenum-droop").expect("in the catalogue");
                model.add(spec, &[1.0, 1.0], None);
                model.delay = Delay::Fixed { delays: vec![9000] };
            },
            ["`delay`", "shorter delay"],
        );
        refused(
            &|model| {
                for channel in ["u_inf", "temperature"] {
                    model.effects.push(crate::model::Added {
                        name: "free-stream-variation".to_owned(),
                        parameters: vec![-1.0],
                        channel: Some(channel.to_owned()),
                        reference: Some(10.0),
                    });
                }
            },
            ["`u_inf`, `temperature`", "one"],
        );
    }
}
