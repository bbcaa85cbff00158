//! History of the pulses of an on/off signal.

/// State of the pulses so far. Before the first one the signal has always been off.
#[derive(Debug, Clone, Copy)]
pub(super) struct Pulses {
    on: bool,
    number: u32,
    rose_at: f64,
    fell_at: f64,
    rest_before: f64,
}

impl Default for Pulses {
    fn default() -> Self {
        Self {
            on: false,
            number: 0,
            rose_at: f64::NEG_INFINITY,
            fell_at: f64::NEG_INFINITY,
            rest_before: f64::INFINITY,
        }
    }
}

impl Pulses {
    /// The signal is `level` from `t` on; it counts as on above 0.
    pub(super) fn see(&mut self, t: f64, level: f64) {
        let on = level > 0.0;
        if on == self.on {
            return;
        }
        self.on = on;
        if on {
            self.number += 1;
            self.rest_before = t - self.fell_at;
            self.rose_at = t;
        } else {
            self.fell_at = t;
        }
    }

    /// Whether a pulse is in progress.
    pub(super) fn is_on(&self) -> bool {
        self.on
    }

    /// Number of pulses, the present one included.
    pub(super) fn number(&self) -> u32 {
        self.number
    }

    /// Length of the rest before the last pulse (s).
    pub(super) fn rest_before(&self) -> f64 {
        self.rest_before
    }

    /// Time since the last pulse began (s).
    pub(super) fn since_rise(&self, t: f64) -> f64 {
        t - self.rose_at
    }

    /// Time since the last pulse ended (s).
    pub(super) fn since_fall(&self, t: f64) -> f64 {
        t - self.fell_at
    }

    /// Length of the last pulse, or of the present one so far (s); 0 before the first.
    pub(super) fn length(&self, t: f64) -> f64 {
        match (self.on, self.number) {
            (_, 0) => 0.0,
            (true, _) => t - self.rose_at,
            (false, _) => self.fell_at - self.rose_at,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn pulses_are_counted_and_measured() {
        let mut pulses = Pulses::default();
        assert_eq!((pulses.number(), pulses.length(1.0)), (0, 0.0));
        assert_eq!(pulses.rest_before(), f64::INFINITY);
        for (t, level) in [(1.0, 1.0), (1.5, 1.0), (2.0, 0.0), (5.0, 0.5)] {
            pulses.see(t, level);
        }
        assert!(pulses.is_on());
        assert_eq!(pulses.number(), 2);
        assert_eq!(pulses.rest_before(), 3.0);
        assert_eq!(pulses.since_rise(6.0), 1.0);
        assert_eq!(pulses.since_fall(6.0), 4.0);
        assert_eq!(pulses.length(5.25), 0.25);
        pulses.see(7.0, 0.0);
        assert_eq!(pulses.length(9.0), 2.0);
    }
}
