//! The rules that the loop must keep at every sample.

use super::board::{Board, Sickness};
use super::hold;
use super::line::Line;
use anyhow::{Result, bail, ensure};
use firmware::controller::{Mode, Tick};
use firmware::fault::Fault;
use firmware::on_board::{BOARD, SETTINGS};
use std::collections::BTreeMap;
use wire::reply::lost_after_samples;

/// Samples after wrong readings during which the residual may close the valve.
const AFTERMATH: u32 = 1000;
/// Samples after a restart during which the residual may close the valve: the model starts at rest, and the flow is not.
const SETTLING: u32 = 5000;

/// The valve's position with its duration, and the mode of the last sample.
pub(super) struct Rules {
    mode: Mode,
    open: bool,
    since: u32,
    samples: u64,
    equal: u32,
    last: f32,
    /// Samples since the last wrong reading.
    since_sick: u32,
    /// Samples since the restart by the watchdog.
    since_restart: u32,
    stopped: bool,
    switches: u64,
    faults: BTreeMap<&'static str, u64>,
}

impl Rules {
    pub(super) fn new() -> Self {
        Self {
            mode: Mode::Disarmed,
            open: false,
            since: u32::MAX,
            samples: 0,
            equal: 0,
            last: f32::NAN,
            since_sick: u32::MAX,
            since_restart: u32::MAX,
            stopped: false,
            switches: 0,
            faults: BTreeMap::new(),
        }
    }

    pub(super) fn switches(&self) -> u64 {
        self.switches
    }

    pub(super) fn faults(self) -> BTreeMap<&'static str, u64> {
        self.faults
    }

    /// The board has been restarted by its watchdog: it starts with the valve closed.
    pub(super) fn restarted(&mut self) {
        let (faults, switches) = (std::mem::take(&mut self.faults), self.switches);
        *self = Self {
            mode: Mode::Faulted(Fault::Watchdog),
            since_restart: 0,
            faults,
            switches,
            ..Self::new()
        };
        *self.faults.entry(Fault::Watchdog.name()).or_default() += 1;
    }

    /// Checks a sample; the bytes of the line arrived after it.
    pub(super) fn check(
        &mut self,
        tick: &Tick,
        periods: u32,
        board: &Board,
        line: &Line,
        sickness: Sickness,
    ) -> Result<()> {
        ensure!(
            tick.predicted.is_finite() && tick.residual.is_finite(),
            "a number of the loop is not finite"
        );
        self.samples += u64::from(periods);
        let (samples, _) = board.state();
        ensure!(
            samples == self.samples,
            "sample {samples}, not {}",
            self.samples
        );
        ensure!(
            board.is_open() == tick.open,
            "the pin differs from the decision"
        );
        if !matches!(tick.mode, Mode::Armed | Mode::Playing) {
            ensure!(!tick.open, "the valve is open");
        }
        let counts = tick.reading.counts;
        self.equal = if counts == self.last {
            self.equal + 1
        } else {
            0
        };
        self.last = counts;
        self.since_sick = match sickness {
            Sickness::None => self.since_sick.saturating_add(1),
            _ => 0,
        };
        self.since_restart = self.since_restart.saturating_add(1);
        self.check_fault(tick, periods, line)?;
        self.check_times(tick, line)?;
        // Commands that arrived after this sample have changed the mode for the next one.
        self.mode = board.mode();
        self.stopped = line.has_stopped();
        if let Mode::Faulted(fault) = self.mode
            && tick.mode != self.mode
        {
            ensure!(
                fault == Fault::Setting && line.has_set() || fault == Fault::Link,
                "{fault:?} after the sample"
            );
            if fault == Fault::Link {
                self.check_link(line)?;
            }
            *self.faults.entry(fault.name()).or_default() += 1;
        }
        Ok(())
    }

    /// Every fault has a cause, and every cause a fault, which is latched.
    fn check_fault(&mut self, tick: &Tick, periods: u32, line: &Line) -> Result<()> {
        let counts = tick.reading.counts;
        let range = &SETTINGS.range;
        let cause = if periods > 1 {
            Some(Fault::Overrun)
        } else if !counts.is_finite() {
            Some(Fault::NotFinite)
        } else if counts <= range.lower_rail || counts >= range.upper_rail {
            Some(Fault::AtRail)
        } else if self.equal >= range.stuck_after {
            Some(Fault::Stuck)
        } else {
            None
        };
        match (self.mode, tick.mode) {
            (Mode::Faulted(before), now) => {
                ensure!(now == Mode::Faulted(before), "{before:?} is not latched");
            }
            (Mode::Disarmed, now) => ensure!(now == Mode::Disarmed, "{now:?} from disarmed"),
            (_, Mode::Faulted(fault)) => {
                match (cause, fault) {
                    (Some(cause), fault) => ensure!(fault == cause, "{fault:?}, not {cause:?}"),
                    (None, Fault::Residual) => ensure!(
                        self.since_sick <= AFTERMATH || self.since_restart <= SETTLING,
                        "a residual without a wrong reading"
                    ),
                    (None, Fault::Link) => self.check_link(line)?,
                    (None, _) => bail!("{fault:?} without a cause"),
                }
                *self.faults.entry(fault.name()).or_default() += 1;
            }
            (before, now) => {
                ensure!(cause.is_none(), "{cause:?} is not latched");
                let ended = before == Mode::Playing && now == Mode::Disarmed;
                ensure!(now == before || ended, "{now:?} from {before:?}");
            }
        }
        Ok(())
    }

    fn check_link(&self, line: &Line) -> Result<()> {
        let lost = lost_after_samples(BOARD.period_us);
        // The messages of another host do not count, and neither do an operator's words.
        ensure!(
            line.silent() + 200 >= lost || line.since_host() <= 2 * lost || line.has_stopped(),
            "the link was lost after {} samples",
            line.silent()
        );
        Ok(())
    }

    fn check_times(&mut self, tick: &Tick, line: &Line) -> Result<()> {
        if tick.open == self.open {
            self.since = self.since.saturating_add(1);
            return Ok(());
        }
        self.switches += 1;
        let shortest = hold().of(self.open);
        // A fault, the end of a command, or a message closes the valve at once.
        let is_stop = !matches!(tick.mode, Mode::Armed | Mode::Playing)
            || tick.mode != self.mode
            || self.stopped
            || line.has_stopped();
        ensure!(
            self.since >= shortest || (self.open && is_stop),
            "the valve was {} for {} samples, not {shortest}",
            if self.open { "open" } else { "closed" },
            self.since
        );
        (self.open, self.since) = (tick.open, 1);
        Ok(())
    }
}
