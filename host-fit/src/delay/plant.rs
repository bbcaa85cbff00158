//! A plant of first or second order behind a dead time, sampled exactly.
//!
//!    b·S²·ÿ + S·ẏ + y = K·u(t − h)
//!
//! S is the sum of the time constants T₁ + T₂; b = T₁T₂/S². b = 0 is first order, b = ¼ two equal time constants, b
//! above ¼ an underdamped plant (damping ratio 1/(2√b)). u is held between samples; h need not be a whole number of
//! samples. S may differ between command on and off, and h between rising and falling edges: the simplest bilinear
//! plant. The plant is always linear in K, in the level and in the initial state.
//!
//! A third lag T₃ in series may follow. It is computed by the trapezoidal rule between samples, with an error of
//! 1/(12·T₃²) of a response.

/// With a smaller ratio the second time constant counts as 0.
const FIRST_ORDER: f64 = 1e-5;

/// The changes of the command in one record.
#[derive(Debug, Clone, Default)]
pub(crate) struct Switching {
    /// In order of time.
    pub(crate) changes: Vec<Change>,
    /// Whether the command is on (in the upper half of its range) before the first change.
    pub(crate) on: bool,
}

/// One change of the command.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Change {
    /// Time of the first sample with the new command, samples.
    pub(crate) time: f64,
    /// The new command minus that before the record.
    pub(crate) level: f64,
    /// Whether the command rose.
    pub(crate) rising: bool,
    /// Whether the new command is in the upper half of the range.
    pub(crate) on: bool,
}

impl Switching {
    /// The changes of `u`, which was `before` before its first sample; on is above `middle`.
    pub(crate) fn of(u: &[f64], before: f64, middle: f64) -> Self {
        let mut last = before;
        let mut changes = Vec::new();
        for (sample, &level) in u.iter().enumerate() {
            if level != last {
                changes.push(Change {
                    time: sample as f64,
                    level: level - before,
                    rising: level > last,
                    on: level > middle,
                });
                last = level;
            }
        }
        Self {
            changes,
            on: before > middle,
        }
    }
}

/// Dead time and dynamics.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Plant {
    /// h after rising and after falling edges, samples, at least 0.
    pub(crate) delay: [f64; 2],
    /// S with the command on and off, samples, above 0.
    pub(crate) sum: [f64; 2],
    /// b, at least 0.
    pub(crate) ratio: f64,
    /// T₃, samples; 0 without a third lag.
    pub(crate) third: f64,
}

/// Sum and product of the time constants.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Dynamics {
    sum: f64,
    ratio: f64,
}

/// A 2 × 2 matrix, row by row.
type Square = [f64; 4];

impl Dynamics {
    /// The transition of (y, b·S·ẏ) over `time` samples with the input at 0.
    fn transition(self, time: f64) -> Square {
        if self.ratio < FIRST_ORDER {
            return [(-time / self.sum).exp(), 0.0, 0.0, 0.0];
        }
        let (s, bs) = (self.sum, self.ratio * self.sum);
        let middle = -0.5 / bs;
        let spread = 1.0 - 4.0 * self.ratio;
        let (even, odd) = if spread.abs() < 1e-9 {
            let decay = (middle * time).exp();
            (decay, decay * time)
        } else if spread > 0.0 {
            let root = spread.sqrt();
            // The slow pole is computed without a difference of nearly equal numbers.
            let slow = (-2.0 * time / (s * (1.0 + root))).exp();
            let fast = (-0.5 * time * (1.0 + root) / bs).exp();
            ((slow + fast) / 2.0, (slow - fast) * bs / root)
        } else {
            let frequency = (-spread).sqrt() / (2.0 * bs);
            let decay = (middle * time).exp();
            let (sin, cos) = (frequency * time).sin_cos();
            (decay * cos, decay * sin / frequency)
        };
        [
            even + odd * 0.5 / bs,
            odd / bs,
            -odd / s,
            even - odd * 0.5 / bs,
        ]
    }
}

/// Cache of transition matrices.
#[derive(Debug, Default)]
struct Memory(Vec<(usize, f64, Square)>);

impl Plant {
    /// A plant with equal dead times after all edges and equal dynamics under all commands.
    pub(crate) fn linear(delay: f64, sum: f64, ratio: f64) -> Self {
        Self {
            delay: [delay; 2],
            sum: [sum; 2],
            ratio,
            third: 0.0,
        }
    }

    /// Whether there is only one time constant.
    pub(crate) fn is_first_order(&self) -> bool {
        self.ratio < FIRST_ORDER
    }

    /// Mean dead time over the directions, samples.
    pub(crate) fn mean_delay(&self) -> f64 {
        f64::midpoint(self.delay[0], self.delay[1])
    }

    /// Mean sum of time constants, samples.
    pub(crate) fn mean_sum(&self) -> f64 {
        f64::midpoint(self.sum[0], self.sum[1])
    }

    /// This plant at a sampling period `factor` times longer.
    pub(crate) fn slower(&self, factor: f64) -> Self {
        Self {
            delay: self.delay.map(|h| h * factor),
            sum: self.sum.map(|s| s * factor),
            ratio: self.ratio,
            third: self.third * factor,
        }
    }

    /// Arrivals of the changes: time, level, on. A change overtaken by a later one has no effect.
    fn arrivals(&self, switching: &Switching) -> Vec<(f64, f64, bool)> {
        let mut arrivals: Vec<(f64, f64, bool)> = Vec::with_capacity(switching.changes.len());
        for change in &switching.changes {
            let time = change.time + self.delay[usize::from(!change.rising)];
            while arrivals.last().is_some_and(|last| last.0 >= time) {
                arrivals.pop();
            }
            arrivals.push((time, change.level, change.on));
        }
        arrivals
    }

    fn transition(&self, memory: &mut Memory, mode: usize, time: f64) -> Square {
        if let Some(known) = memory.0.iter().find(|m| m.0 == mode && m.1 == time) {
            return known.2;
        }
        let dynamics = Dynamics {
            sum: self.sum[mode],
            ratio: self.ratio,
        };
        let square = dynamics.transition(time);
        if memory.0.len() < 12 {
            memory.0.push((mode, time, square));
        }
        square
    }

    /// Simulates `n` samples from a state (y, b·S·ẏ); levels are multiplied by `gain`.
    fn run(&self, switching: &Switching, start: [f64; 2], gain: f64, out: &mut [f64]) {
        let arrivals = self.arrivals(switching);
        let mut next = arrivals.iter().peekable();
        let mut memory = Memory::default();
        let mut mode = usize::from(!switching.on);
        let mut whole = self.transition(&mut memory, mode, 1.0);
        let mut level = 0.0;
        let [mut y, mut v] = start;
        let step = |[a, b, c, d]: Square, level: f64, y: f64, v: f64| {
            let away = y - level;
            (level + a * away + b * v, c * away + d * v)
        };
        for (k, out) in out.iter_mut().enumerate() {
            *out = y;
            let end = k as f64 + 1.0;
            if next.peek().is_none_or(|n| n.0 >= end) {
                (y, v) = step(whole, level, y, v);
                continue;
            }
            let mut now = k as f64;
            while let Some(&(time, new, on)) = next.next_if(|n| n.0 < end) {
                let part = self.transition(&mut memory, mode, time - now);
                (y, v) = step(part, level, y, v);
                let new_mode = usize::from(!on);
                if new_mode != mode {
                    v *= self.sum[new_mode] / self.sum[mode];
                    mode = new_mode;
                    whole = self.transition(&mut memory, mode, 1.0);
                }
                (now, level) = (time, gain * new);
            }
            let part = self.transition(&mut memory, mode, end - now);
            (y, v) = step(part, level, y, v);
        }
    }

    /// The response from rest with gain 1, into `out`.
    pub(crate) fn respond(&self, switching: &Switching, out: &mut [f64]) {
        self.run(switching, [0.0, 0.0], 1.0, out);
        self.lag(out, 0.0);
    }

    /// Passes a series of values through the third lag, whose initial state is `from`.
    fn lag(&self, values: &mut [f64], from: f64) {
        if self.third <= 0.0 {
            return;
        }
        let (kept, weight) = (2.0 * self.third - 1.0, 1.0 / (2.0 * self.third + 1.0));
        let mut lagging = from;
        let mut last: Option<f64> = None;
        for value in values {
            if let Some(last) = last {
                lagging = (kept * lagging + last + *value) * weight;
            }
            last = Some(std::mem::replace(value, lagging));
        }
    }

    /// The free responses of `n` samples, one per order: all possible outputs without input, except the
    /// constant level.
    pub(crate) fn free(&self, switching: &Switching, n: usize) -> Vec<Vec<f64>> {
        let course = |start: [f64; 2]| {
            let mut out = vec![0.0; n];
            self.run(switching, start, 0.0, &mut out);
            self.lag(&mut out, 0.0);
            out
        };
        let mut free = vec![course([1.0, 0.0])];
        if !self.is_first_order() {
            free.push(course([0.0, 1.0]));
        }
        if self.third > 0.0 {
            let mut own = vec![0.0; n];
            self.lag(&mut own, 1.0);
            free.push(own);
        }
        free
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// T₁T₂ÿ + (T₁ + T₂)ẏ + y = u(t − h) in small steps; T₁ differs between on and off.
    fn integrated(t1: [f64; 2], t2: f64, delay: f64, u: &[f64]) -> Vec<f64> {
        let steps = 4000;
        let dt = 1.0 / f64::from(steps);
        let (mut x, mut y) = (0.0, 0.0);
        let mut out = Vec::new();
        for k in 0..u.len() {
            out.push(if t2 > 0.0 { y } else { x });
            for s in 0..steps {
                let t = k as f64 + (f64::from(s) + 0.5) * dt - delay;
                let input = if t < 0.0 { 0.0 } else { u[t as usize] };
                x += dt * (input - x) / t1[usize::from(input < 0.5)];
                if t2 > 0.0 {
                    y += dt * (x - y) / t2;
                }
            }
        }
        out
    }

    fn response(plant: Plant, u: &[f64]) -> Vec<f64> {
        let mut out = vec![0.0; u.len()];
        plant.respond(&Switching::of(u, 0.0, 0.5), &mut out);
        out
    }

    #[test]
    fn responses_are_those_of_the_differential_equation() {
        let u: Vec<f64> = (0..60).map(|k| f64::from(u8::from(k % 25 > 7))).collect();
        for (t1, t2, delay) in [
            ([9.0, 9.0], 0.0, 3.0),
            ([9.0, 4.0], 0.0, 3.4),
            ([12.0, 12.0], 2.5, 0.75),
            ([6.0, 6.0], 6.0, 5.2),
        ] {
            let sum = t1.map(|t1: f64| t1 + t2);
            let plant = Plant {
                delay: [delay; 2],
                sum,
                ratio: t1[0] * t2 / (sum[0] * sum[0]),
                third: 0.0,
            };
            let reference = integrated(t1, t2, delay, &u);
            for (k, (ours, theirs)) in response(plant, &u).iter().zip(reference).enumerate() {
                assert!(
                    (ours - theirs).abs() < 1e-3,
                    "{t1:?} {t2} {delay} {k}: {ours} {theirs}"
                );
            }
        }
    }

    /// 1 − e^(−t/T)·(1 + t/T + (t/T)²/2) of three equal lags.
    #[test]
    fn a_third_lag_is_in_series() {
        let plant = Plant {
            third: 10.0,
            ..Plant::linear(4.0, 20.0, 0.25)
        };
        for (sample, y) in response(plant, &[1.0; 120]).into_iter().enumerate() {
            let t = (sample as f64 - 4.0).max(0.0) / 10.0;
            let known = 1.0 - (-t).exp() * (1.0 + t + t * t / 2.0);
            assert!((y - known).abs() < 1e-3, "{sample}: {y} {known}");
        }
        let free = plant.free(&Switching::default(), 50);
        assert_eq!(free.len(), 3);
        // From an initial value of the third lag alone, the output decays with the time constant of that lag.
        assert!((free[2][20] - (-2.0f64).exp()).abs() < 1e-3);
    }

    #[test]
    fn a_plant_that_rings_rings() {
        // At a damping ratio of ½ the overshoot is exp(−π/√3) = 16.3 %.
        let out = response(Plant::linear(0.0, 20.0, 1.0), &[1.0; 400]);
        let highest = out.iter().copied().fold(0.0, f64::max);
        assert!((highest - 1.163).abs() < 0.002, "{highest}");
        assert!((out[399] - 1.0).abs() < 1e-3);
    }

    #[test]
    fn small_ratios_run_into_the_first_order() {
        let u = [1.0; 100];
        let first = response(Plant::linear(2.0, 30.0, 0.0), &u);
        let second = response(Plant::linear(2.0, 30.0, 2e-5), &u);
        let apart = first.iter().zip(&second).map(|(a, b)| (a - b).abs());
        assert!(apart.fold(0.0, f64::max) < 1e-3);
        let none = Switching::default();
        assert_eq!(Plant::linear(2.0, 30.0, 0.0).free(&none, 5).len(), 1);
        assert_eq!(Plant::linear(2.0, 30.0, 0.2).free(&none, 5).len(), 2);
    }

    #[test]
    fn an_overtaken_change_is_never_seen() {
        let mut u = vec![0.0; 40];
        u[10] = 1.0;
        let plant = Plant {
            delay: [9.0, 2.0],
            sum: [5.0; 2],
            ratio: 0.0,
            third: 0.0,
        };
        assert!(response(plant, &u).iter().all(|y| *y == 0.0));
    }
}
