//! Flows that others published, simulated from their equations, behind the instruments of a real rig.
//!
//! Each file contains one model with its reference, equations and coefficients, and checks one response against the
//! publication. The models share no code or constants with the rigs of [`crate::family`], with the fitted model, or
//! with each other. They test a diagnosis that was tuned on our own rigs with flows for which it was not tuned.
//!
//! Signals, all of order 1: command u → valve (dead time) → jet strength → flow → reading y. Every model
//! scales its reading to 0 without jets and 1 under steady jets.

mod goman_khrabrov;
mod hidden;
mod mean_field;
mod reattaching_bubble;
mod setup;
mod supplied_valve;
mod vorticity_transport;
mod wrong_way;

pub use goman_khrabrov::GomanKhrabrov;
pub use hidden::Hidden;
pub use mean_field::MeanField;
pub use reattaching_bubble::ReattachingBubble;
pub use setup::{LiteraturePlan, UnknownName};
pub use supplied_valve::SuppliedValve;
pub use vorticity_transport::VorticityTransport;
pub use wrong_way::WrongWay;

use rand_chacha::ChaCha8Rng;

/// Step of all simulations (s): ten to a sample of 1 ms.
pub const STEP_S: f64 = 1e-4;

/// A published flow.
pub trait Flow {
    /// One step of [`STEP_S`] under jets of strength `jet` (0 closed, 1 open).
    fn step(&mut self, jet: f64);
    /// Present reading: 0 without jets, 1 under steady jets.
    fn reading(&self) -> f64;
    /// The random coefficients, by name and in SI units.
    fn coefficients(&self) -> Vec<(&'static str, f64)>;
}

/// A published model with its reference.
#[derive(Clone, Copy, Debug)]
pub struct Published {
    /// Name on the command line and in tables.
    pub name: &'static str,
    /// Reference of the publication.
    pub reference: &'static str,
    /// Effects of the catalogue that are part of its physics and therefore count as correct.
    pub also_right: &'static [&'static str],
    draw: fn(&mut ChaCha8Rng) -> Box<dyn Flow>,
}

/// All published models.
pub const PUBLISHED: [Published; 6] = [
    goman_khrabrov::PUBLISHED,
    wrong_way::PUBLISHED,
    vorticity_transport::PUBLISHED,
    mean_field::PUBLISHED,
    reattaching_bubble::PUBLISHED,
    supplied_valve::PUBLISHED,
];

impl Published {
    /// The model of that name.
    #[must_use]
    pub fn of(name: &str) -> Option<Self> {
        PUBLISHED.into_iter().find(|model| model.name == name)
    }

    /// The model at rest with random free coefficients.
    #[must_use]
    pub fn draw(&self, rng: &mut ChaCha8Rng) -> Box<dyn Flow> {
        (self.draw)(rng)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::SeedableRng;

    #[test]
    fn every_flow_rests_at_0_and_reaches_1() {
        for model in PUBLISHED {
            for seed in 0..5 {
                let mut flow = model.draw(&mut ChaCha8Rng::seed_from_u64(seed));
                let mut settle = |jet: f64, seconds: f64| {
                    (0..(seconds / STEP_S) as usize).for_each(|_| flow.step(jet));
                    flow.reading()
                };
                let rest = settle(0.0, 1.0);
                let blown = settle(1.0, 3.0);
                let again = settle(0.0, 4.0);
                let name = model.name;
                assert!(rest.abs() < 0.01, "{name}, seed {seed}: {rest} at rest");
                assert!((blown - 1.0).abs() < 0.02, "{name}, seed {seed}: {blown}");
                assert!(again.abs() < 0.02, "{name}, seed {seed}: {again} again");
                assert!(!flow.coefficients().is_empty());
            }
            assert_eq!(Published::of(model.name).map(|m| m.name), Some(model.name));
            assert!(model.reference.chars().any(|c| c.is_ascii_digit()));
        }
        assert!(Published::of("gremlin").is_none());
    }

    /// Hidden effects change the strength of the jets continuously, and the flows must still respond to pulses.
    #[test]
    fn every_flow_answers_pulses_through_every_effect() {
        for model in PUBLISHED {
            for name in Hidden::names() {
                let mut rng = ChaCha8Rng::seed_from_u64(5);
                let mut flow = model.draw(&mut rng);
                let mut hidden = Hidden::draw(name, &mut rng).expect("an effect");
                let half = (0.25 / STEP_S) as usize;
                let readings: Vec<f64> = (0..12 * half)
                    .map(|k| {
                        flow.step(hidden.jet(f64::from(u8::from(k / half % 2 == 1))));
                        flow.reading()
                    })
                    .collect();
                let last = readings.get(10 * half..).unwrap_or(&[]);
                let lowest = last.iter().copied().fold(f64::INFINITY, f64::min);
                let highest = last.iter().copied().fold(f64::NEG_INFINITY, f64::max);
                assert!(
                    highest - lowest > 0.3,
                    "{} with {name}: {lowest} to {highest}",
                    model.name
                );
            }
        }
    }
}
