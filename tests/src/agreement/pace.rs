//! The time of a million samples in each language.

use super::Case;
use super::languages::{C, Tool, output};
use anyhow::{Context, Result};
use host_fit::codegen::portable::{self, Precision};
use host_fit::model::Rounding;
use host_fit::simulate::{Signals, Simulator};
use std::ops::ControlFlow;
use std::path::Path;
use std::process::Command;
use std::time::Instant;

const SAMPLES: usize = 1_000_000;
/// Runs of each; the shortest counts.
const RUNS: usize = 3;

/// Seconds of a free run of a million samples.
#[derive(Clone, Copy, Debug)]
pub struct Pace {
    /// By the library, in `f64`.
    pub rust: f64,
    /// By the exported C, in `double`.
    pub c: f64,
    /// By the exported Python; none without NumPy.
    pub python: Option<f64>,
}

/// Times `case`, which has no channels, in files of `folder`; GCC is needed.
///
/// # Errors
/// If a tool refuses the generated file, or the languages end at different readings.
pub fn pace(case: &Case, folder: &Path) -> Result<Pace> {
    let model = &case.model;
    let shares = || (0..SAMPLES).map(|k| f64::from(u8::from(k / 90 % 2 == 1)));
    let u: Vec<f64> = shares().map(|share| model.command.command(share)).collect();
    let values = model.values();
    let (mut rust, mut last) = (f64::INFINITY, 0.0);
    for _ in 0..RUNS {
        let signals = Signals::commanded(model, &u);
        let simulator = Simulator::with_values(model, &values, Rounding::Samples);
        let began = Instant::now();
        simulator.run(&signals, |_, output| {
            last = output.measured;
            ControlFlow::Continue(())
        });
        rust = rust.min(began.elapsed().as_secs_f64());
    }
    std::fs::write(
        folder.join("model.c"),
        portable::c(model, Precision::Double)?,
    )?;
    std::fs::write(folder.join("pace.c"), include_str!("pace.c"))?;
    let mut gcc = Command::new("gcc");
    gcc.args(C)
        .arg(format!("-DSAMPLES={SAMPLES}"))
        .arg(format!("-DOFF={:?}", model.command.off))
        .arg(format!("-DFULL={:?}", model.command.full))
        .args(["-o", "pace", "pace.c", "-lm"]);
    output(gcc.current_dir(folder))?;
    let c = shortest(|| Command::new(folder.join("pace")), last)?;
    if !Tool::Python.is_installed() {
        return Ok(Pace {
            rust,
            c,
            python: None,
        });
    }
    std::fs::write(folder.join("model.py"), portable::python(model)?)?;
    let script = format!(
        "import time, numpy, model\nu = numpy.where(numpy.arange({SAMPLES}) // 90 % 2 == 1, {:?}, {:?})\n\
         t = time.perf_counter()\ny = model.Model().simulate(u)\nprint(time.perf_counter() - t, repr(float(y[-1])))\n",
        model.command.full, model.command.off
    );
    let python = || {
        let mut python = Tool::Python.command();
        python.args(["-B", "-c", &script]).current_dir(folder);
        python
    };
    let python = Some(shortest(python, last)?);
    Ok(Pace { rust, c, python })
}

/// The shortest of the times that `program` prints before its last reading, which must be `last`.
fn shortest(program: impl Fn() -> Command, last: f64) -> Result<f64> {
    let mut least = f64::INFINITY;
    for _ in 0..RUNS {
        let said = output(&mut program())?;
        let (seconds, reading) = said.trim().split_once(' ').context("two numbers")?;
        let reading: f64 = reading.parse()?;
        anyhow::ensure!(
            (reading - last).abs() <= 1e-9 * last.abs().max(1e-9),
            "the last reading is {reading}, not {last}"
        );
        least = least.min(seconds.parse()?);
    }
    Ok(least)
}
