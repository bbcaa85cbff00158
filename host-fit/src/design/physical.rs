//! The physical flow that a model resembles most: a plant to try a law on that
//! is not the model.

use super::DesignError;
use super::bench::Bench;
use super::steady::steady;
use crate::model::{Delay, Model};
use firmware_sim::plant::{BasePlant, DelayLaw, Effect, PlantSpec, RateLaw};

/// A first-order flow with the model's levels, its time constants of attachment
/// and separation, its transport delay in continuous time, and its effects as
/// continuous-time physics.
///
/// # Errors
/// [`DesignError`] when the model does not settle, or has an effect that the
/// simulated plants do not know.
pub fn nearest_plant(model: &Model) -> Result<PlantSpec, DesignError> {
    let bare = Model {
        effects: Vec::new(),
        ..model.clone()
    };
    let (low, high) = (
        steady(&bare, false)?.friction,
        steady(&bare, true)?.friction,
    );
    if high <= low {
        return Err(DesignError::NoEffect { low, high });
    }
    let [attach_s, separate_s] = time_constants(&bare, low, high);
    let period = model.sample_period_s;
    let delay = match &model.delay {
        Delay::Fixed { delays } => DelayLaw::Fixed {
            delay_s: f64::from(delays.iter().copied().min().unwrap_or(0)) * period,
        },
        Delay::StateDependent {
            delay_floor,
            delay_rise,
            delay_rate,
            factors,
            ..
        } => {
            let factor = factors.iter().copied().fold(f64::INFINITY, f64::min);
            DelayLaw::StateDependent {
                floor_s: factor * delay_floor * period,
                rise_s: factor * delay_rise * period,
                rate: *delay_rate,
            }
        }
        Delay::EdgeDependent {
            rise_delay,
            fall_delay,
        } => DelayLaw::EdgeDependent {
            rise_s: *rise_delay,
            fall_s: *fall_delay,
        },
    };
    let base = BasePlant {
        attach_s,
        separate_s,
        gain: high,
        delay,
        rate_law: RateLaw::default(),
    };
    let effects = model
        .effects
        .iter()
        .map(physical_effect)
        .collect::<Result<Vec<_>, _>>()?;
    Ok(PlantSpec::new(base, &effects))
}

/// From the arrival of an edge to 1 − 1/e of the way between the levels `low` and
/// `high`, opening and closing, s (0.001–10).
pub(super) fn time_constants(model: &Model, low: f64, high: f64) -> [f64; 2] {
    let bench = Bench::<f64>::of(model);
    let mut state = bench.at_rest();
    let per_second = (1.0 / model.sample_period_s).round() as usize;
    [true, false].map(|on| {
        let (from, to) = if on { (low, high) } else { (high, low) };
        let goal = from + (to - from) * (1.0 - (-1.0_f64).exp());
        let mut arrived = None;
        for k in 0..30 * per_second {
            let output = bench.step(&mut state, on);
            if (output.arrived > 0.5) == on && arrived.is_none() {
                arrived = Some(k);
            }
            let there = if on {
                output.next >= goal
            } else {
                output.next <= goal
            };
            if let (Some(arrived), true) = (arrived, there) {
                let time = (k + 1 - arrived) as f64 * model.sample_period_s;
                // Settle before the next edge.
                for _ in 0..10 * per_second {
                    bench.step(&mut state, on);
                }
                return time.clamp(0.001, 10.0);
            }
        }
        10.0
    })
}

fn physical_effect(added: &crate::model::Added) -> Result<Effect, DesignError> {
    use rand::SeedableRng;
    let plant = |error: &dyn std::fmt::Display| DesignError::Plant(error.to_string());
    // The kind by its name, the values from the model.
    let mut rng = rand_chacha::ChaCha8Rng::seed_from_u64(0);
    let base = BasePlant::draw(&mut rng);
    let mut effect = Effect::draw(&added.name, &base, &mut rng).map_err(|e| plant(&e))?;
    let names = model_core::effects::spec(&added.name).map_or(&[][..], |spec| spec.parameters);
    for (parameter, value) in names.iter().zip(&added.parameters) {
        effect = effect.with(parameter.name, *value).map_err(|e| plant(&e))?;
    }
    Ok(effect)
}

#[cfg(test)]
mod tests {
    use super::super::tracking::tests::paper_state_dependent;
    use super::*;
    use firmware_sim::plant::Rig;
    use model_core::recursion::LagConvention;

    /// The paper's model rises to .62 in 0.5 s and to .84 in 1 s; the nearest plant must be near.
    #[test]
    fn the_plant_rises_as_the_model() {
        let mut model = paper_state_dependent(LagConvention::OneStep);
        let spec = model_core::effects::spec("plenum-droop").unwrap();
        model.add(spec, &[1.0, 0.0], None);
        let spec = nearest_plant(&model).unwrap();
        assert_eq!(spec.effects.len(), 1);
        let mut rig = Rig::new(&spec, None).unwrap();
        let y = rig.play(&[1.0; 4000]);
        assert!(y[46] == 0.0);
        assert!((y[500] - 0.62).abs() < 0.08, "{}", y[500]);
        assert!((y[1000] - 0.84).abs() < 0.08, "{}", y[1000]);
        assert!((y[3999] - 1.067).abs() < 0.03, "{}", y[3999]);
    }
}
