//! The catalogues of the model and of the plants agree, although they share no code.

use firmware_sim::plant::{BasePlant, Effect};
use model_core::effects::SPECS;
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;

#[test]
fn names_parameters_units_and_channels_are_the_same() {
    let mut rng = ChaCha8Rng::seed_from_u64(1);
    let base = BasePlant::draw(&mut rng);
    let mut names: Vec<&str> = SPECS.iter().map(|spec| spec.name).collect();
    let mut plants = Effect::NAMES.to_vec();
    names.sort_unstable();
    plants.sort_unstable();
    assert_eq!(names, plants);
    for spec in SPECS {
        let effect = Effect::draw(spec.name, &base, &mut rng).expect("a plant's effect");
        // A parameter that a model file may omit need not exist in the plant. This applies to the delay of the
        // pickup, because in the plant the command of a sample is set before the reading.
        let stated = spec.parameters.iter().filter(|p| p.left_out.is_none());
        let model = stated.map(|p| (p.name, p.unit.to_string()));
        let plant = effect.parameters().into_iter();
        let plant = plant.map(|p| (p.name, p.unit.to_owned()));
        let [model, plant]: [Vec<_>; 2] = [model.collect(), plant.collect()];
        assert_eq!(model, plant, "{}", spec.name);
        assert_eq!(spec.channel, effect.channel(), "{}", spec.name);
    }
}

/// The usual values of a rig must be within the search range of the model.
#[test]
fn usual_values_lie_within_the_range_that_the_model_searches() {
    for spec in SPECS {
        for seed in 0..100 {
            let mut rng = ChaCha8Rng::seed_from_u64(seed);
            let base = BasePlant::draw(&mut rng);
            let effect = Effect::draw(spec.name, &base, &mut rng).expect("a plant's effect");
            for (found, card) in effect.parameters().iter().zip(spec.parameters) {
                assert!(
                    (card.low..=card.high).contains(&found.value),
                    "{}: {found:?} outside {} to {}",
                    spec.name,
                    card.low,
                    card.high
                );
            }
        }
    }
}
