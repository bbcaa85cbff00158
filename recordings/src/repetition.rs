//! The repetition period of the command sequence of a raw recording, from its edges.

use crate::thresholds::RULES;

/// Largest number of stored edges; the rest of the recording is assumed to continue in the same way.
const MOST: usize = 8000;

/// Edges of a command: the sample in which the new level begins, and whether it is on.
#[derive(Debug, Clone, Default)]
pub(crate) struct Edges {
    edges: Vec<(u64, bool)>,
    level: Option<bool>,
    sample: u64,
    is_over: bool,
}

impl Edges {
    /// Adds the command of the next sample, `steps` after the previous one; none if unreadable.
    pub(crate) fn push(&mut self, steps: u64, on: Option<bool>) {
        self.sample = self.sample.saturating_add(steps);
        let Some(on) = on else { return };
        if self.is_over || self.level == Some(on) {
            return;
        }
        if self.level.is_some() {
            self.edges.push((self.sample, on));
        }
        self.level = Some(on);
        self.is_over = self.edges.len() >= MOST;
    }

    /// The recording was restarted: counting starts again.
    pub(crate) fn end(&mut self) {
        self.is_over = true;
    }

    /// The shortest time, in samples, after which the command repeats at least twice in the recording; `None` if it
    /// does not. Edges may differ by `jitter` samples.
    pub(crate) fn repeat(&self, jitter: usize) -> Option<u64> {
        let last = self.edges.last()?.0;
        let rises = || self.edges.iter().filter(|e| e.1).map(|e| e.0);
        let first = rises().next()?;
        let lags = rises().skip(1).map(|rise| rise - first);
        let lags: Vec<u64> = lags.take_while(|lag| first + 2 * lag <= last).collect();
        let shares: Vec<f64> = lags
            .iter()
            .map(|&lag| self.share(lag, jitter as u64))
            .collect();
        let best = shares.iter().copied().fold(0.0, f64::max);
        if best < RULES.repeats {
            return None;
        }
        // A sequence in which one of twenty pulses is missing nearly repeats after one pulse.
        let at = shares.iter().position(|&share| share >= best - 0.02)?;
        lags.get(at).copied()
    }

    /// The share of the edges with an equal edge at distance `lag`, where recorded.
    fn share(&self, lag: u64, jitter: u64) -> f64 {
        let (Some(first), Some(last)) = (self.edges.first(), self.edges.last()) else {
            return 0.0;
        };
        let has = |at: u64, on: bool| {
            let from = self.edges.partition_point(|e| e.0 + jitter + 1 < at);
            let near = self
                .edges
                .iter()
                .skip(from)
                .take_while(|e| e.0 <= at + jitter + 1);
            near.into_iter().any(|e| e.1 == on)
        };
        let (mut all, mut found) = (0_u32, 0_u32);
        for &(at, on) in &self.edges {
            if at + lag <= last.0 {
                all += 1;
                found += u32::from(has(at + lag, on));
            }
            if at >= first.0 + lag {
                all += 1;
                found += u32::from(has(at - lag, on));
            }
        }
        f64::from(found) / f64::from(all.max(1))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn edges(samples: u64, command: impl Fn(u64) -> bool) -> Edges {
        let mut edges = Edges::default();
        (0..samples).for_each(|k| edges.push(u64::from(k > 0), Some(command(k))));
        edges
    }

    #[test]
    fn the_shortest_repeat_is_found() {
        let two_pulses = |k: u64| (10..30).contains(&(k % 100)) || (50..60).contains(&(k % 100));
        assert_eq!(edges(1000, two_pulses).repeat(1), Some(100));
        assert_eq!(edges(1000, |k| k % 50 < 20).repeat(1), Some(50));
        // One of twenty pulses is missing.
        let gapped = |k: u64| k % 50 < 20 && k % 1000 > 50;
        assert_eq!(edges(5000, gapped).repeat(1), Some(1000));
        // The clock drifts by half a sample per repeat, and one sample is wrong.
        let drifting = |k: u64| two_pulses((k as f64 / 1.005) as u64) ^ (k == 512);
        let found = edges(2000, drifting).repeat(1).unwrap();
        assert!((100..=101).contains(&found), "{found}");
        assert_eq!(edges(150, two_pulses).repeat(1), None);
        assert_eq!(edges(1000, |_| true).repeat(1), None);
        // Pulses of ever-changing lengths.
        let chirp = |k: u64| (0.6 * (k as f64).sqrt()) as u64 % 2 == 1;
        assert_eq!(edges(5000, chirp).repeat(1), None);
    }

    #[test]
    fn a_long_recording_is_judged_by_its_head() {
        let edges = edges(200_000, |k| k % 20 < 10);
        assert_eq!(edges.edges.len(), MOST);
        assert_eq!(edges.repeat(1), Some(20));
    }
}
