//! A command sent by the host: run lengths, checked before a valve moves.
//!
//! Runs alternate, closed first. A command is played completely or ended by closing the valve; it is never
//! altered otherwise.

use heapless::Vec;
use model_core::control::HoldTimes;
use wire::reply::Status;
use wire::request::checksum;

/// Largest number of runs in a command: 4 kB, several minutes of switching at a valve's shortest times.
pub const RUNS: usize = 1024;

/// Reason for not playing a command: the status and its detail.
pub type Refusal = (Status, u32);

/// The command and the player's position.
#[derive(Clone, Debug)]
pub struct Player {
    runs: Vec<u32, RUNS>,
    /// The present run.
    at: usize,
    /// Samples left of the present run.
    left: u32,
    /// Repeats to come after the present one.
    repeats: u32,
    /// Samples to wait before the first repeat, with the valve closed.
    wait: u32,
}

impl Player {
    /// Without a command.
    #[must_use]
    pub const fn new() -> Self {
        Self {
            runs: Vec::new(),
            at: 0,
            left: 0,
            repeats: 0,
            wait: 0,
        }
    }

    /// Stores runs from index `at` on, in place of all runs stored from there on.
    ///
    /// # Errors
    /// [`Status::Missing`] if earlier runs are missing, [`Status::TooLong`] if they do not fit.
    pub fn load(&mut self, at: u16, runs: impl Iterator<Item = u32>) -> Result<(), Refusal> {
        let at = usize::from(at);
        if at > self.runs.len() {
            return Err((Status::Missing, self.runs.len() as u32));
        }
        self.runs.truncate(at);
        for run in runs {
            if self.runs.push(run).is_err() {
                return Err((Status::TooLong, RUNS as u32));
            }
        }
        Ok(())
    }

    /// Checks the command against the valve's `hold` times and moves to its start. The valve has been closed
    /// for `shut` samples.
    ///
    /// # Errors
    /// The reason of the refusal.
    pub fn start(
        &mut self,
        repeats: u32,
        runs: u16,
        expected: u32,
        hold: &HoldTimes,
        shut: u32,
    ) -> Result<(), Refusal> {
        let same =
            self.runs.len() == usize::from(runs) && checksum(self.runs.iter().copied()) == expected;
        if !same {
            return Err((Status::OtherCommand, self.runs.len() as u32));
        }
        let period: u64 = self.runs.iter().map(|run| u64::from(*run)).sum();
        // Samples are numbered with 32 bits.
        let samples = period.saturating_mul(u64::from(repeats));
        if samples == 0 || samples > u64::from(u32::MAX) {
            return Err((Status::Nothing, 0));
        }
        if let Some(index) = self.too_short(repeats, hold) {
            return Err((Status::TooShort, index));
        }
        let lead = self.runs.first().copied().unwrap_or(0);
        self.wait = hold.of(false).saturating_sub(shut.saturating_add(lead));
        self.repeats = repeats - 1;
        self.at = 0;
        self.left = lead;
        Ok(())
    }

    /// The first run that is shorter than a hold time.
    fn too_short(&self, repeats: u32, hold: &HoldTimes) -> Option<u32> {
        let last = self.runs.len().checked_sub(1)?;
        let lead = self.runs.first().copied().unwrap_or(0);
        for (index, run) in self.runs.iter().enumerate() {
            let open = index % 2 == 1;
            let length = if index == 0 || (index == last && !open) {
                // The valve is closed before the command, after it, or between two repeats.
                if repeats == 1 || last == 0 {
                    continue;
                }
                let tail = if last.is_multiple_of(2) {
                    self.runs.last().copied().unwrap_or(0)
                } else {
                    0
                };
                let between = lead.saturating_add(tail);
                if between == 0 {
                    // If the valve is open at the end and at the start of the command, both runs
                    // form one.
                    continue;
                }
                between
            } else {
                *run
            };
            if length < hold.of(open) {
                return Some(index as u32);
            }
        }
        None
    }

    /// Whether the initial rest is over.
    #[must_use]
    pub fn waits(&self) -> bool {
        self.wait > 0
    }

    /// The valve position at the next sample; `None` at the end of the command.
    pub fn level(&mut self) -> Option<bool> {
        if self.wait > 0 {
            self.wait -= 1;
            return Some(false);
        }
        // Only the first or last run of a repeat can have length 0, so the loop ends.
        while self.left == 0 {
            self.at += 1;
            if self.at >= self.runs.len() {
                self.repeats = self.repeats.checked_sub(1)?;
                self.at = 0;
            }
            self.left = self.runs.get(self.at).copied()?;
        }
        self.left -= 1;
        Some(self.at % 2 == 1)
    }
}

impl Default for Player {
    fn default() -> Self {
        Self::new()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const HOLD: HoldTimes = HoldTimes { on: 5, off: 3 };

    fn start(runs: &[u32], repeats: u32, shut: u32) -> Result<Player, Refusal> {
        let mut player = Player::new();
        player.load(0, runs.iter().copied())?;
        let sum = checksum(runs.iter().copied());
        player.start(repeats, runs.len() as u16, sum, &HOLD, shut)?;
        Ok(player)
    }

    fn played(runs: &[u32], repeats: u32, shut: u32) -> std::vec::Vec<bool> {
        let mut player = start(runs, repeats, shut).expect("it can be played");
        core::iter::from_fn(|| player.level())
            .take(10_000)
            .collect()
    }

    #[test]
    fn runs_are_played_as_they_are_for_every_repeat() {
        for runs in [&[4, 5, 3, 7, 2][..], &[0, 5, 3], &[3, 6], &[0, 5], &[9]] {
            let mut once = std::vec::Vec::new();
            for (i, run) in runs.iter().enumerate() {
                once.extend((0..*run).map(|_| i % 2 == 1));
            }
            assert_eq!(played(runs, 3, 100), once.repeat(3), "{runs:?}");
        }
    }

    /// Every accepted command respects the hold times, for any initial rest.
    #[test]
    fn what_is_accepted_keeps_the_hold_times() {
        let mut seed = 5_u32;
        let mut random = |below: u32| {
            seed = seed.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            (seed >> 16) % below
        };
        let (mut accepted, mut refused) = (0, 0);
        for _ in 0..20_000 {
            let runs: std::vec::Vec<u32> = (0..1 + random(5)).map(|_| random(9)).collect();
            let (repeats, shut) = (1 + random(3), random(6));
            let Ok(mut player) = start(&runs, repeats, shut) else {
                refused += 1;
                continue;
            };
            accepted += 1;
            let (mut open, mut since) = (false, shut);
            while let Some(next) = player.level() {
                if next == open {
                    since += 1;
                } else {
                    assert!(since >= HOLD.of(open), "{runs:?} × {repeats} after {shut}");
                    (open, since) = (next, 1);
                }
            }
        }
        assert!(accepted > 1000 && refused > 1000, "{accepted} {refused}");
    }

    #[test]
    fn what_cannot_be_played_is_refused_with_the_reason() {
        let refused = |runs: &[u32], repeats| start(runs, repeats, 9).expect_err("refused");
        assert_eq!(refused(&[4, 4, 9], 1), (Status::TooShort, 1));
        assert_eq!(refused(&[4, 5, 2, 5, 9], 1), (Status::TooShort, 2));
        assert_eq!(refused(&[1, 5, 1], 2), (Status::TooShort, 0));
        assert!(start(&[1, 5, 1], 1, 9).is_ok());
        assert_eq!(refused(&[4, 5, 9], 0), (Status::Nothing, 0));
        assert_eq!(refused(&[], 1), (Status::Nothing, 0));
        assert_eq!(refused(&[u32::MAX, 5], 1), (Status::Nothing, 0));
        let mut player = Player::new();
        assert_eq!(player.load(1, [7].into_iter()), Err((Status::Missing, 0)));
        let many = (0..2000).map(|_| 7);
        assert_eq!(player.load(0, many), Err((Status::TooLong, RUNS as u32)));
        let mut player = start(&[4, 5, 9], 1, 9).expect("good");
        let other = player.start(1, 3, 17, &HOLD, 9);
        assert_eq!(other, Err((Status::OtherCommand, 3)));
    }
}
