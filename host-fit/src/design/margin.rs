//! Robustness margin: the region of errors of delay, gain and time constants within which a law works.
//!
//! The plant is the model with delays, gain and time constants multiplied by factors. Rays start at the model
//! in the planes of two logarithmic factors; bisection finds the point on each ray where attachment is lost
//! in one of several seeded runs, or the rms error exceeds twice that on the model. This is a sampled region
//! without a certificate: it gives no statement between the rays or about other model errors.

use super::bench::Player;
use super::noise::Noisy;
use super::proof::Attempt;
use super::rules::RULES;
use crate::model::{Delay, Model, Track};
use crate::parallel;
use closed_loop::{Controlled, ModelFlow};
use serde::Serialize;

/// The errors, in the order of [`Margin::intervals`].
pub const ERRORS: [&str; 3] = ["delay", "gain", "time constants"];

/// Errors that a law tolerates, as fractions: 0.2 is a plant with 20 % more than the model.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Margin {
    /// Lowest and highest tolerated error of each of [`ERRORS`] with the others at 0.
    pub intervals: [ErrorInterval; 3],
    /// Regions of two simultaneous errors.
    pub planes: Vec<MarginPlane>,
    /// The rms error on the model itself, mean of the seeded runs, y.
    pub rms: f64,
}

/// The tolerated interval of one error.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct ErrorInterval {
    /// The quantity in error.
    pub error: &'static str,
    /// Lowest tolerated error, as a share; above −1.
    pub low: f64,
    /// Highest tolerated error, as a share.
    pub high: f64,
    /// For each end, whether it is the limit of the search; if not, it is the limit of the law.
    pub open: [bool; 2],
}

/// Region of two simultaneous errors.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct MarginPlane {
    /// The errors on the horizontal and vertical axis.
    pub errors: [&'static str; 2],
    /// The contour of the region, as shares, around the model at (0, 0).
    pub contour: Vec<[f64; 2]>,
}

/// `model` with its delays and its gain multiplied by these factors.
fn mistaken(model: &Model, delay: f64, gain: f64) -> Model {
    let mut model = model.clone();
    if delay != 1.0 {
        model.delay_between_samples();
        if let Delay::Law(law) = &mut model.delay {
            law.factors.iter_mut().for_each(|factor| *factor *= delay);
        }
    }
    model.constant *= gain;
    model.b.iter_mut().for_each(|b| *b *= gain);
    model
}

/// A flow with all times, including its delay, multiplied by a factor.
#[derive(Clone)]
struct Slowed<F> {
    flow: F,
    times: f64,
    /// Time by which the flow must still be advanced, in its own samples.
    due: f64,
    reading: Option<f64>,
}

impl<F: Controlled> Controlled for Slowed<F> {
    fn sample_period_s(&self) -> f64 {
        self.flow.sample_period_s()
    }
    fn step(&mut self, command: bool) -> Option<f64> {
        self.due += 1.0 / self.times;
        while self.due >= 1.0 {
            self.due -= 1.0;
            self.reading = self.flow.step(command);
        }
        self.reading
    }
    fn friction(&self) -> f64 {
        self.flow.friction()
    }
}

/// The margin of the tracking `law` of `model`; pairs of errors are searched if `planes` is set. `noise` as
/// in [`Trials`](super::Trials).
#[must_use]
pub fn margin(model: &Model, law: &Track, noise: f64, seed: u64, planes: bool) -> Margin {
    let search = Search {
        model,
        law,
        bench: Player::of(model),
        noise,
        seed,
        most: f64::INFINITY,
    };
    let (_, rms) = search.worst([1.0; 3]);
    let search = Search {
        most: RULES.margin_rms * rms,
        ..search
    };
    // The first six rays go along the axes, downwards and upwards.
    let axes: Vec<End> = parallel::each(0..6, |way| {
        let mut direction = [0.0; 3];
        direction[way / 2] = if way % 2 == 0 { -1.0 } else { 1.0 };
        search.end(direction)
    });
    let interval = |error: usize| {
        let (low, high) = (axes[2 * error], axes[2 * error + 1]);
        ErrorInterval {
            error: ERRORS[error],
            low: low.shares[error],
            high: high.shares[error],
            open: [low.open, high.open],
        }
    };
    let pairs: &[[usize; 2]] = if planes {
        &[[0, 1], [0, 2], [1, 2]]
    } else {
        &[]
    };
    let plane = |[across, up]: &[usize; 2]| {
        let rays: Vec<u32> = (0..RULES.margin_rays).collect();
        let contour = parallel::each(rays, |ray| {
            let quarter = RULES.margin_rays / 4;
            let axis = match ray / quarter {
                0 => 2 * across + 1,
                1 => 2 * up + 1,
                2 => 2 * across,
                _ => 2 * up,
            };
            if ray % quarter == 0 {
                return [*across, *up].map(|error| axes[axis].shares[error]);
            }
            let angle = std::f64::consts::TAU * f64::from(ray) / f64::from(RULES.margin_rays);
            let mut direction = [0.0; 3];
            direction[*across] = angle.cos();
            direction[*up] = angle.sin();
            let end = search.end(direction);
            [*across, *up].map(|error| end.shares[error])
        });
        MarginPlane {
            errors: [ERRORS[*across], ERRORS[*up]],
            contour,
        }
    };
    Margin {
        intervals: [0, 1, 2].map(interval),
        planes: pairs.iter().map(plane).collect(),
        rms,
    }
}

/// End of a ray.
#[derive(Clone, Copy)]
struct End {
    /// The errors at the end, as shares.
    shares: [f64; 3],
    /// Whether the end is the limit of the search.
    open: bool,
}

struct Search<'a> {
    model: &'a Model,
    law: &'a Track,
    bench: Player<f32>,
    noise: f64,
    seed: u64,
    /// Largest allowed rms error, y.
    most: f64,
}

impl Search<'_> {
    /// Whether attachment is kept in every seeded run, and the mean rms error, y.
    fn worst(&self, factors: [f64; 3]) -> (bool, f64) {
        let [delay, gain, times] = factors;
        // A slower plant has a longer delay too.
        let bench = Player::<f64>::of(&mistaken(self.model, delay / times, gain));
        let runs = (0..RULES.margin_runs).map(|run| {
            let flow = ModelFlow::new(
                &bench.prepared,
                bench.at_rest(),
                bench.channels.clone(),
                bench.period_s,
            );
            let flow = Slowed {
                flow,
                times,
                due: 0.0,
                reading: None,
            };
            let flow = Noisy::new(flow, self.noise, self.seed.wrapping_add(run.into()));
            Attempt::of(&self.bench, self.law, &flow)
        });
        let runs: Vec<Attempt> = runs.collect();
        let rms = runs.iter().map(|run| run.rms).sum::<f64>() / runs.len() as f64;
        (runs.iter().all(|run| run.kept), rms)
    }

    fn works(&self, direction: [f64; 3], reach: f64) -> bool {
        let (kept, rms) = self.worst(direction.map(|d| (reach * d).exp()));
        kept && rms <= self.most
    }

    /// The largest error along a direction for which the law works, minus one bisection step, because rms
    /// errors scatter.
    fn end(&self, direction: [f64; 3]) -> End {
        let shares = |reach: f64| direction.map(|d| (reach * d).exp_m1());
        let (mut works, mut fails) = (0.0, RULES.margin_reach.ln());
        if self.works(direction, fails) {
            return End {
                shares: shares(fails),
                open: true,
            };
        }
        for _ in 0..RULES.margin_bisections {
            let middle = 0.5 * (works + fails);
            if self.works(direction, middle) {
                works = middle;
            } else {
                fails = middle;
            }
        }
        let inside: f64 = works - (fails - works);
        End {
            shares: shares(inside.max(0.0)),
            open: false,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::tracking::tests::paper_state_dependent;
    use super::super::{TrackRequest, track};
    use super::*;
    use model_core::recursion::LagConvention;

    fn first_order() -> Model {
        Model {
            a: vec![0.97],
            b: vec![0.02],
            c: vec![0.01],
            delay: Delay::Fixed { delays: vec![30] },
            ..Model::default()
        }
    }

    /// Figures of a step response: samples to 10 % of its final value, samples from 10 to 50 %, and the final value.
    fn step(model: &Model, times: f64) -> [f64; 3] {
        let bench = Player::<f64>::of(model);
        let channels = bench.channels.clone();
        let mut flow = Slowed {
            flow: ModelFlow::new(&bench.prepared, bench.at_rest(), channels, bench.period_s),
            times,
            due: 0.0,
            reading: None,
        };
        let run: Vec<f64> = (0..2000)
            .map(|_| {
                flow.step(true);
                flow.friction()
            })
            .collect();
        let end = run[1999];
        let to = |share: f64| run.iter().position(|y| *y > share * end).unwrap() as f64;
        [to(0.1), to(0.5) - to(0.1), end]
    }

    #[test]
    fn factors_move_what_they_name_and_nothing_else() {
        let model = first_order();
        let [delay, rise, end] = step(&model, 1.0);
        let near = |a: f64, b: f64| (a / b - 1.0).abs() < 0.06;
        let longer = step(&mistaken(&model, 2.0, 1.0), 1.0);
        assert!(near(longer[0], delay + 30.0) && near(longer[1], rise) && near(longer[2], end));
        let stronger = step(&mistaken(&model, 1.0, 1.5), 1.0);
        assert!(near(stronger[0], delay) && near(stronger[2], 1.5 * end));
        let slower = step(&mistaken(&model, 0.5, 1.0), 2.0);
        assert!(near(slower[0], 2.0 * delay - 30.0) && near(slower[1], 2.0 * rise));
        assert!(near(slower[2], end));
    }

    /// A plant that stays below the target under steady blowing is outside the margin.
    #[test]
    fn a_flow_too_weak_for_the_target_ends_the_margin() {
        let model = paper_state_dependent(LagConvention::OneStep);
        let law = track(&model, &TrackRequest::holding(0.8)).unwrap().law;
        let margin = margin(&model, &law, 1.0, 1, true);
        let [delay, gain, time] = margin.intervals;
        assert!(
            gain.low > 0.8 / 1.067 - 1.05 && gain.low < -0.05,
            "{gain:?}"
        );
        for interval in [delay, gain, time] {
            assert!(interval.low < 0.0 && interval.high > 0.0, "{interval:?}");
        }
        assert_eq!(margin.planes.len(), 3);
    }
}
