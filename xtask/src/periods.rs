//! The loop at other periods than 1 ms: lockstep at the ends of the range and between, bit for bit, and the emulated board
//! at 10 ms with the faults that depend on the period.

use crate::Task;
use crate::shell::root;
use anyhow::{Context, Result, bail};

pub(crate) const TASK: Task = Task {
    name: "periods",
    does: "compares firmware and plant in lockstep with the host at loop periods of 0.2, 10 and 100 ms, bit for bit; tests the emulated board and its faults at 10 ms",
    run: periods,
};

/// Loop periods of the lockstep run, s.
const PERIODS: &str = "0.0002,0.01,0.1";
/// The bundled model that the emulated board runs: a sample every 10 ms.
const SLOW: &str = "firmware/identified/models/slow.toml";

pub(crate) fn periods(arguments: &[String]) -> Result<()> {
    if !arguments.is_empty() {
        bail!("there are no options");
    }
    crate::pil::pil(&["--periods", PERIODS].map(str::to_owned)).context("lockstep")?;
    let constants = crate::identified::of(Some(&root().join(SLOW)), None)?;
    crate::faults::of_the_period(&constants).context("the board at 10 ms")
}
