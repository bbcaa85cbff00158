//! The exact integral sliding variable of the bilinear delayed model, for one
//! input with a fixed delay h.
//!
//! ```text
//! σ_k = y_k + Σ_i a_i Σ_{s=k−τ_i}^{k−1} y_s + Σ_{m=k−h}^{k−1} g_{m+h} u_m          (A1)
//! σ_{k+1} = σ_k − α·y_k + g_{k+h}·u_k,   α = 1 − Σa,   g_k = b + Σ_j c_j y_{k−τ̄_j}  (A2)
//! ```
//!
//! The first sum is what the state delays remember, the second the effect of the
//! input already in flight; (A2) follows from (A1) and the model by telescoping
//! and has no delay between u and σ. Lags here are those behind the newest
//! sample. For a state-dependent delay use [`tracking`](super::tracking).

use crate::history::Past;
use crate::real::Real;
use crate::recursion::Bilinear;

/// The sliding variable of a model with one input delayed by `delay` samples.
#[derive(Clone, Copy, Debug)]
pub struct Sliding<'a, T> {
    /// Structure and coefficients; of several inputs only the first is used.
    pub recursion: Bilinear<'a, T>,
    /// h, samples.
    pub delay: usize,
}

impl<T: Real> Sliding<'_, T> {
    /// α = 1 − Σa, per sample.
    #[must_use]
    pub fn alpha(&self) -> T {
        self.recursion.relaxation(|_| T::ZERO)
    }

    /// g = b + Σ_j c_j y_{·−τ̄_j}, with `y` read at the sample of the arrival.
    pub fn gain(&self, y: &impl Past<T>) -> T {
        let recursion = &self.recursion;
        let mut gain = recursion.b.first().copied().unwrap_or(T::ZERO);
        for (c, lag) in recursion.c.iter().zip(recursion.product_lags) {
            gain = gain + *c * y.back(recursion.convention.behind_newest(*lag));
        }
        gain
    }

    /// σ_k by its definition (A1). `in_flight` reads g_{m+h}·u_m, the newest of
    /// them (lag 0) issued at k − 1. Costs Στ + h additions.
    pub fn value(&self, y: &impl Past<T>, in_flight: &impl Past<T>) -> T {
        let mut sum = y.back(0);
        for (a, lag) in self.recursion.a.iter().zip(self.recursion.state_lags) {
            let lag = self.recursion.convention.behind_newest(*lag);
            let mut memory = T::ZERO;
            for back in 1..=lag {
                memory = memory + y.back(back);
            }
            sum = sum + *a * memory;
        }
        for back in 0..self.delay {
            sum = sum + in_flight.back(back);
        }
        sum
    }

    /// σ_{k+1} from σ_k by (A2): `arriving` is g_{k+h}·u_k, and the model's
    /// constant drive d enters as it does in the model.
    #[inline]
    pub fn next(&self, sigma: T, y: T, arriving: T) -> T {
        sigma - self.alpha() * y + self.recursion.constant + arriving
    }

    /// σ* = y*·(1 + Σ_i a_i τ_i + α·h) − d·h: σ while y rests at y*.
    pub fn set_point(&self, reference: T) -> T {
        let mut weight = T::ONE + self.alpha() * count(self.delay);
        for (a, lag) in self.recursion.a.iter().zip(self.recursion.state_lags) {
            weight = weight + *a * count(self.recursion.convention.behind_newest(*lag));
        }
        reference * weight - self.recursion.constant * count(self.delay)
    }

    /// u_eq = (α·y* − d)/(b + y*·Σc): the duty that holds y*. A sliding motion
    /// exists where 0 < u_eq < 1, which is 0 < y* < y_ss(u = 1) for d = 0.
    #[must_use]
    pub fn equivalent_duty(&self, reference: T) -> T {
        let mut gain = self.recursion.b.first().copied().unwrap_or(T::ZERO);
        for c in self
            .recursion
            .c
            .iter()
            .take(self.recursion.product_lags.len())
        {
            gain = gain + *c * reference;
        }
        (self.alpha() * reference - self.recursion.constant) / gain
    }
}

fn count<T: Real>(samples: usize) -> T {
    T::from_count(u32::try_from(samples).unwrap_or(u32::MAX))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::control::hold::{Hold, HoldTimes};
    use crate::history::{DelayLine, Memory};
    use crate::recursion::{Grading, LagConvention};

    /// Table II, fixed delay, but for the lag τ̄_1, which theory A.2 needs at
    /// least h so that g_{k+h} is known at k.
    fn recursion(convention: LagConvention) -> Bilinear<'static, f64> {
        Bilinear {
            convention,
            grading: Grading::Proportional,
            constant: 0.0,
            state_lags: &[1, 48, 352, 371, 496],
            a: &[0.9744, 0.0171, -0.0028, 0.0040, 0.0009],
            product_lags: &[60, 66, 242, 249, 260, 276, 300, 409, 475, 491],
            b: &[0.0063],
            c: &[
                -0.0116, 0.0070, 0.0483, 0.0253, -0.0455, -0.0243, -0.0038, -0.0014, -0.0074,
                0.0138,
            ],
        }
    }

    /// What was issued, with the gain it will meet.
    struct Shifted<'a, P>(&'a P, usize);
    impl<P: Past<f64>> Past<f64> for Shifted<'_, P> {
        fn back(&self, lag: usize) -> f64 {
            // y at k + h read `lag` behind: known where lag ≥ h.
            self.0.back(lag - self.1)
        }
    }

    /// Runs the model under the law u = 1 ⇔ σ < σ* and compares (A1) with (A2).
    fn run(convention: LagConvention, reference: f64, drive: f64) -> (f64, f64, f64) {
        const H: usize = 49;
        let sliding = Sliding {
            recursion: Bilinear {
                constant: drive,
                ..recursion(convention)
            },
            delay: H,
        };
        let times = HoldTimes { on: 3, off: 3 };
        let (mut y, mut issued) = (DelayLine::<f64, 512>::new(), DelayLine::<f64, 512>::new());
        let mut in_flight = DelayLine::<f64, 64>::new();
        let (mut hold, mut sigma) = (Hold::closed(), 0.0);
        let (mut worst, mut sum, mut open) = (0.0_f64, 0.0, 0.0);
        let goal = sliding.set_point(reference);
        for k in 0..30_000 {
            let exact = sliding.value(&y, &in_flight);
            worst = worst.max((exact - sigma).abs());
            let on = hold.pass(&times, sigma < goal);
            let u = f64::from(u8::from(on));
            let arriving = sliding.gain(&Shifted(&y, H)) * u;
            sigma = sliding.next(sigma, y.back(0), arriving);
            in_flight.push(arriving);
            issued.push(u);
            let next = sliding.recursion.next(&y, &mut |_| issued.back(H));
            y.push(next);
            if k >= 10_000 {
                sum += next;
                open += u;
            }
        }
        (worst, sum / 20_000.0, open / 20_000.0)
    }

    /// Theory A.2: the identity holds to rounding, and the law leads y to y* at
    /// the equivalent duty.
    #[test]
    fn the_recursion_is_the_definition_and_leads_to_the_reference() {
        for convention in [LagConvention::Literal, LagConvention::OneStep] {
            for (reference, drive) in [(0.5, 0.0), (0.8, 0.0), (0.6, 0.0005)] {
                let (worst, mean, duty) = run(convention, reference, drive);
                assert!(worst < 1e-10, "{convention:?} {reference}: {worst:e}");
                assert!(
                    (mean - reference).abs() < 0.03,
                    "{convention:?} {reference}: {mean}"
                );
                // Literal lags let samples of odd and even number drift apart
                // (theory 0.2), and then y is no constant in u_eq.
                if convention == LagConvention::OneStep {
                    let sliding = Sliding {
                        recursion: Bilinear {
                            constant: drive,
                            ..recursion(convention)
                        },
                        delay: 49,
                    };
                    let u_eq = sliding.equivalent_duty(mean);
                    assert!((duty - u_eq).abs() < 0.02, "{duty} for {u_eq}");
                }
            }
        }
    }

    /// Theory A.2: 0 < u_eq < 1 ⇔ 0 < y* < y_ss(u = 1).
    #[test]
    fn a_sliding_motion_exists_below_steady_blowing() {
        let sliding = Sliding {
            recursion: recursion(LagConvention::OneStep),
            delay: 49,
        };
        let highest = 0.0063 / (1.0 - 0.9936 - 0.0004);
        for share in [0.01, 0.5, 0.99] {
            let duty = sliding.equivalent_duty(share * highest);
            assert!(duty > 0.0 && duty < 1.0, "{share}: {duty}");
        }
        assert!(sliding.equivalent_duty(1.01 * highest) > 1.0);
        assert!(sliding.equivalent_duty(-0.01) < 0.0);
    }
}
