//! Memory of the flow: dependence on y at large lags.

use super::RULES;
use crate::model::Model;
use model_core::effects::SLOW_WAKE;
use serde::Serialize;

/// A memory of the flow: dependence on y at one large lag.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Memory {
    /// The lag, s.
    pub lag_s: f64,
    /// Change of the steady level per unit of y at that lag, without jets.
    pub weight: f64,
    /// Change of the steady level per unit of y at that lag, at full jet strength.
    pub weight_blown: f64,
}

/// The memories of the flow of `model`: each term a·y(t − τ) of the recursion divided by the relaxation rate,
/// and a slow wake.
pub(super) fn memory(model: &Model) -> Vec<Memory> {
    let behind = |lag: &u16| model.convention.behind_newest(*lag);
    let is_memory = |lag: &u16| behind(lag) >= RULES.shortest_memory;
    let pairs = || model.state_lags.iter().zip(&model.a);
    let products = || model.product_lags.iter().zip(&model.c);
    let short: f64 = pairs()
        .filter(|(lag, _)| !is_memory(lag))
        .map(|(_, a)| a)
        .sum();
    let blown: f64 = products()
        .filter(|(lag, _)| !is_memory(lag))
        .map(|(_, c)| c)
        .sum();
    // If the short lags nearly cancel, their sum is not a relaxation rate, and the dominant pole is used instead.
    // If a strong memory hides that pole, the rate of the short lags is used.
    let slowest = model.sample_period_s / model.time_constant();
    let or_slowest = |rate: f64| {
        if slowest.is_finite() && rate <= RULES.cancelled * slowest {
            slowest
        } else {
            rate
        }
    };
    let (rate, rate_blown) = (or_slowest(1.0 - short), or_slowest(1.0 - short - blown));
    let mut lags: Vec<u16> = pairs().chain(products()).map(|(lag, _)| *lag).collect();
    lags.retain(is_memory);
    lags.sort_unstable();
    lags.dedup();
    let wakes = model.effects.iter().filter(|e| e.name == SLOW_WAKE.name);
    let wakes = wakes.filter_map(|wake| match wake.parameters.as_slice() {
        [time_constant, pull] => Some(Memory {
            lag_s: *time_constant,
            weight: -pull,
            weight_blown: -pull,
        }),
        _ => None,
    });
    lags.iter()
        .map(|lag| {
            let a: f64 = pairs().filter(|(l, _)| *l == lag).map(|(_, a)| a).sum();
            let c: f64 = products().filter(|(l, _)| *l == lag).map(|(_, c)| c).sum();
            Memory {
                lag_s: behind(lag) as f64 * model.sample_period_s,
                weight: a / rate,
                weight_blown: (a + c) / rate_blown,
            }
        })
        .chain(wakes)
        // An integrator has no relaxation rate, so its weight is not finite.
        .filter(|memory| memory.weight.is_finite() && memory.weight_blown.is_finite())
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::model::Added;

    /// A flow with these lags and gains of y and of u·y.
    fn model(a: &[(u16, f64)], c: &[(u16, f64)]) -> Model {
        let (state_lags, a) = a.iter().copied().unzip();
        let (product_lags, c) = c.iter().copied().unzip();
        Model {
            state_lags,
            a,
            product_lags,
            c,
            ..Model::default()
        }
    }

    #[test]
    fn a_late_lag_is_a_memory_weighed_by_the_rate_of_the_flow_and_a_short_one_is_none() {
        let only_short = model(&[(1, 0.8), (6, 0.1)], &[(1, -0.1)]);
        assert_eq!(memory(&only_short), []);
        let found = memory(&model(&[(1, 0.9), (201, -0.02)], &[(1, -0.1), (201, 0.06)]));
        let [one] = found.as_slice() else {
            panic!("{found:?}")
        };
        assert!((one.lag_s - 0.2).abs() < 1e-12);
        // The relaxation rate is 0.1 per sample without jets and 0.2 under them.
        assert!((one.weight + 0.2).abs() < 1e-9, "{one:?}");
        assert!((one.weight_blown - 0.2).abs() < 1e-9, "{one:?}");
    }

    #[test]
    fn lags_that_cancel_leave_no_rate_to_weigh_by() {
        // The coefficient of lag 1 is 1, so the lag of 31 samples alone relaxes the flow: −0.02 in 1 − 31·0.02 samples.
        let found = memory(&model(&[(1, 1.0), (31, -0.02)], &[]));
        let [one] = found.as_slice() else {
            panic!("{found:?}")
        };
        assert!((one.weight + 0.38).abs() < 1e-9, "{one:?}");
    }

    #[test]
    fn an_integrator_has_no_rate_to_weigh_by() {
        assert_eq!(memory(&model(&[(1, 1.0), (31, 0.0)], &[])), []);
    }

    #[test]
    fn a_slow_wake_is_a_memory_that_pulls_back() {
        let mut model = model(&[(1, 0.9)], &[]);
        model.effects.push(Added {
            name: SLOW_WAKE.name.to_owned(),
            parameters: vec![0.4, 0.3],
            channel: None,
            reference: None,
        });
        let wake = Memory {
            lag_s: 0.4,
            weight: -0.3,
            weight_blown: -0.3,
        };
        assert_eq!(memory(&model), [wake]);
    }
}
