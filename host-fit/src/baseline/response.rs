//! Responses of a first and of a second order from sample to sample. They are exact for a command that is held
//! between samples and for a dead time that is not a whole number of samples.

/// A free response has ended when it is below this share of its initial value.
const ENDED: f64 = 1e-9;

/// A linear process of unit static gain, time in samples.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Shape {
    /// T·x′ + x = u.
    First {
        /// T, samples.
        time_constant: f64,
    },
    /// x″/ω² + 2ζ·x′/ω + x = u.
    Second {
        /// ω, radians a sample.
        frequency: f64,
        /// ζ; below 1 the response overshoots.
        damping: f64,
    },
}

/// A process behind a dead time, advanced from sample to sample:
/// z_{k+1} = Φ·z_k + before·u_{k−m−1} + now·u_{k−m}; the output is the first state.
#[derive(Clone, Copy, Debug)]
pub(super) struct Response {
    order: usize,
    fastest: f64,
    phi: [[f64; 2]; 2],
    before: [f64; 2],
    now: [f64; 2],
    whole: usize,
}

/// State transition over `time` samples, and the contribution of a command of 1 during it.
fn transition(shape: Shape, time: f64) -> ([[f64; 2]; 2], [f64; 2]) {
    match shape {
        Shape::First { time_constant } => {
            let kept = (-time / time_constant).exp();
            let added = -(-time / time_constant).exp_m1();
            ([[kept, 0.0], [0.0, 0.0]], [added, 0.0])
        }
        Shape::Second { frequency, damping } => second_order(frequency * time, damping),
    }
}

/// The exponential of [[0, 1, 0], [−1, −2ζ, 1], [0, 0, 0]]·angle by its series; the angle is halved until the
/// series converges fast.
fn second_order(angle: f64, damping: f64) -> ([[f64; 2]; 2], [f64; 2]) {
    let size = angle * (1.0 + 2.0 * damping);
    let halvings = size.max(1e-3).log2().ceil().max(0.0) as i32 + 3;
    let step = angle / 2f64.powi(halvings);
    let generator = [
        [0.0, step, 0.0],
        [-step, -2.0 * damping * step, step],
        [0.0; 3],
    ];
    let one = |i: usize, j: usize| f64::from(u8::from(i == j));
    let mut sum: [[f64; 3]; 3] = std::array::from_fn(|i| std::array::from_fn(|j| one(i, j)));
    let mut term = sum;
    for n in 1..=10 {
        term = product(&term, &generator);
        for (sums, terms) in sum.iter_mut().zip(&mut term) {
            for (sum, term) in sums.iter_mut().zip(terms) {
                *term /= f64::from(n);
                *sum += *term;
            }
        }
    }
    for _ in 0..halvings {
        sum = product(&sum, &sum);
    }
    let [[a, b, e], [c, d, f], _] = sum;
    ([[a, b], [c, d]], [e, f])
}

fn product(a: &[[f64; 3]; 3], b: &[[f64; 3]; 3]) -> [[f64; 3]; 3] {
    std::array::from_fn(|i| std::array::from_fn(|j| (0..3).map(|k| a[i][k] * b[k][j]).sum()))
}

impl Response {
    /// A process behind a dead time of `dead_time` samples, ≥ 0; 0 means that y_{k+1} responds to u_k.
    pub(super) fn new(shape: Shape, dead_time: f64) -> Self {
        let whole = dead_time.max(0.0).floor();
        let part = dead_time.max(0.0) - whole;
        let (phi, _) = transition(shape, 1.0);
        let (after, now) = transition(shape, 1.0 - part);
        let (_, early) = transition(shape, part);
        let before = std::array::from_fn(|i| after[i][0] * early[0] + after[i][1] * early[1]);
        Self {
            fastest: shape.fastest(),
            order: match shape {
                Shape::First { .. } => 1,
                Shape::Second { .. } => 2,
            },
            phi,
            before,
            now,
            whole: whole as usize,
        }
    }

    /// Fastest time scale of the process, samples: the decay time of an initial slope, or the time of one radian of an
    /// oscillation.
    pub(super) fn fastest(&self) -> f64 {
        self.fastest
    }

    /// The response to `u`, starting in steady state at `first`, the command before it.
    pub(super) fn forced(&self, u: &[f64], first: f64) -> Vec<f64> {
        let at = |k: usize, lag: usize| {
            let index = k.checked_sub(lag);
            index.and_then(|i| u.get(i)).copied().unwrap_or(first)
        };
        let mut out = Vec::with_capacity(u.len());
        let (mut x, mut v) = (first, 0.0);
        let mut earlier = first;
        let [[a, b], [c, d]] = self.phi;
        for k in 0..u.len() {
            out.push(x);
            let now = at(k, self.whole);
            if self.order == 1 {
                x = a * x + self.before[0] * earlier + self.now[0] * now;
            } else {
                let next = a * x + b * v + self.before[0] * earlier + self.now[0] * now;
                v = c * x + d * v + self.before[1] * earlier + self.now[1] * now;
                x = next;
            }
            earlier = now;
        }
        out
    }

    /// The response as the recursion y_{k+1} = Σ a_i·y_{k−i} + Σ b_j·u_{k−m−j} for gain 1: a, b and m.
    pub(super) fn recursion(&self) -> (Vec<f64>, Vec<f64>, usize) {
        let [[p, q], [_, s]] = self.phi;
        let ([b, db], [e, de]) = (self.now, self.before);
        if self.order == 1 {
            return (vec![p], vec![b, e], self.whole);
        }
        // The second state is eliminated (Cayley–Hamilton).
        let determinant = p * s - q * self.phi[1][0];
        let inputs = vec![b, e - s * b + q * db, q * de - s * e];
        (vec![p + s, -determinant], inputs, self.whole)
    }

    /// Free responses to a unit of each state, `samples` long or until they have ended.
    pub(super) fn free(&self, samples: usize) -> Vec<Vec<f64>> {
        let [[a, b], [c, d]] = self.phi;
        let starts: [[f64; 2]; 2] = [[1.0, 0.0], [0.0, 1.0]];
        let mut columns = Vec::with_capacity(self.order);
        for start in starts.iter().take(self.order) {
            let [mut x, mut v] = *start;
            let mut column = Vec::new();
            while column.len() < samples && x.abs() + v.abs() > ENDED {
                column.push(x);
                (x, v) = (a * x + b * v, c * x + d * v);
            }
            columns.push(column);
        }
        let longest = columns.iter().map(Vec::len).max().unwrap_or(0);
        columns.iter_mut().for_each(|c| c.resize(longest, 0.0));
        columns
    }
}

impl Shape {
    fn fastest(self) -> f64 {
        match self {
            // The only state of a first order is its value, which a few samples determine.
            Self::First { .. } => 0.0,
            Self::Second { frequency, damping } => {
                1.0 / (frequency * (damping + (damping * damping - 1.0).max(0.0).sqrt()).max(1.0))
            }
        }
    }

    /// Both time constants, the slow one first; `None` for an oscillating response.
    pub(super) fn time_constants(self) -> Option<[f64; 2]> {
        match self {
            Self::First { time_constant } => Some([time_constant, 0.0]),
            Self::Second { frequency, damping } => (damping >= 1.0).then(|| {
                let slow = damping + (damping * damping - 1.0).sqrt();
                [slow / frequency, 1.0 / (slow * frequency)]
            }),
        }
    }

    /// Two first orders, one after the other.
    pub(super) fn of_time_constants(slow: f64, fast: f64) -> Self {
        let mean = (slow * fast).sqrt();
        Self::Second {
            frequency: 1.0 / mean,
            damping: (slow + fast) / (2.0 * mean),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A step at sample 10, and its response in continuous time `t` samples later.
    fn check(shape: Shape, dead_time: f64, exact: impl Fn(f64) -> f64) {
        let u: Vec<f64> = (0..200).map(|k| f64::from(u8::from(k >= 10))).collect();
        let run = Response::new(shape, dead_time).forced(&u, 0.0);
        for (k, x) in run.iter().enumerate() {
            let time = k as f64 - 10.0 - dead_time;
            let expected = if time > 0.0 { exact(time) } else { 0.0 };
            assert!(
                (x - expected).abs() < 1e-11,
                "{shape:?} {k}: {x} {expected}"
            );
        }
    }

    #[test]
    fn steps_of_first_and_second_order_are_exact_between_samples() {
        let first = Shape::First { time_constant: 7.0 };
        check(first, 3.3, |t| 1.0 - (-t / 7.0).exp());
        let (slow, fast) = (12.0, 2.5);
        check(Shape::of_time_constants(slow, fast), 0.6, |t| {
            1.0 - (slow * (-t / slow).exp() - fast * (-t / fast).exp()) / (slow - fast)
        });
        let (w, z) = (0.4, 0.1f64);
        let swing = Shape::Second {
            frequency: w,
            damping: z,
        };
        let r = (1.0 - z * z).sqrt();
        check(swing, 5.0, |t| {
            1.0 - (-z * w * t).exp() * ((w * r * t).cos() + z / r * (w * r * t).sin())
        });
    }

    #[test]
    fn free_responses_continue_any_state() {
        let shape = Shape::of_time_constants(9.0, 4.0);
        let response = Response::new(shape, 0.0);
        let free = response.free(500);
        assert_eq!(free.len(), 2);
        // The slow mode x = e^(−t/9) starts with v = x′/ω = −1/(9ω).
        let slope = -(36f64.sqrt()) / 9.0;
        for (k, (x, v)) in free[0].iter().zip(&free[1]).enumerate().take(100) {
            let slow = x + slope * v;
            assert!((slow - (-(k as f64) / 9.0).exp()).abs() < 1e-11);
        }
    }

    #[test]
    fn the_recursion_runs_as_the_states_do() {
        let u: Vec<f64> = (0..300).map(|k| f64::from(k * k % 11)).collect();
        let swing = Shape::Second {
            frequency: 0.5,
            damping: 0.2,
        };
        for shape in [Shape::First { time_constant: 9.0 }, swing] {
            let response = Response::new(shape, 4.7);
            let run = response.forced(&u, 0.0);
            let (a, b, delay) = response.recursion();
            assert_eq!(delay, 4);
            for k in 10..299 {
                let past = a.iter().enumerate().map(|(i, a)| a * run[k - i]);
                let input = b.iter().enumerate().map(|(j, b)| b * u[k - delay - j]);
                let next: f64 = past.sum::<f64>() + input.sum::<f64>();
                assert!((next - run[k + 1]).abs() < 1e-10, "{shape:?} {k}");
            }
        }
    }

    #[test]
    fn time_constants_come_back() {
        let [slow, fast] = Shape::of_time_constants(165.0, 14.0)
            .time_constants()
            .expect("two real ones");
        assert!((slow - 165.0).abs() < 1e-9 && (fast - 14.0).abs() < 1e-9);
    }
}
