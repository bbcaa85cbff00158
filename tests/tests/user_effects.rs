//! A rig with an effect outside the catalogue: found if the user provides the effect. These are the worked examples
//! of `docs/user-effects.md`.

use host_fit::data::{Record, Use};
use host_fit::diagnose::{Diagnosis, Options, Verdict, diagnose};
use host_fit::model::Model;
use host_fit::user_effect::Definition;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use scenarios::{FIXED_DELAY, first_order};
use std::sync::atomic::AtomicBool;

const PERIOD: f64 = 0.001;
const SUBSTEPS: usize = 20;
const NOISE: f64 = 0.008;

/// The physics of the rig, without code of the tool: jet and reading as functions of the present signals.
struct Rig {
    /// Strength of an open jet, `since` seconds after the last edge.
    jet: fn(since: f64) -> f64,
    /// Temperature of the air, °C, over time.
    air: fn(time: f64) -> f64,
    /// Reading, from friction and film temperature.
    reading: fn(friction: f64, film: f64) -> f64,
}

impl Rig {
    fn record(&self, name: &str, role: Use, u: Vec<f64>, seed: u64) -> Record {
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        let delay = 41 * SUBSTEPS;
        let step = PERIOD / SUBSTEPS as f64;
        let mut sent = Vec::new();
        let (mut friction, mut film, mut edge, mut last) = (0.0, 20.0, -1e3, 0.0);
        let (mut y, mut temperature) = (Vec::new(), Vec::new());
        for (k, u) in u.iter().enumerate() {
            let start = k as f64 * PERIOD;
            if *u != last {
                (edge, last) = (start, *u);
            }
            // The sum of twelve uniform numbers is nearly normal.
            let noise: f64 = (0..12).map(|_| rng.random_range(-0.5..0.5)).sum();
            y.push((self.reading)(friction, film) + NOISE * noise);
            temperature.push((self.air)(start));
            for i in 0..SUBSTEPS {
                let time = start + i as f64 * step;
                sent.push(u * (self.jet)(time - edge));
                let arrived = sent.len().checked_sub(delay).map_or(0.0, |at| sent[at]);
                let drive = 20.0 * arrived - (12.0 + 8.0 * arrived) * friction;
                friction += step * drive;
                film += step * ((self.air)(time) - film) / 0.5;
            }
        }
        let mut record = Record::new(name, role, PERIOD, u, y);
        record.y_sd = Some(vec![NOISE; record.y.len()]);
        record
            .channels
            .insert("temperature".to_owned(), temperature);
        record
    }

    fn records(&self) -> Vec<Record> {
        let square = |hertz: f64, duty: f64| -> Vec<f64> {
            let on = |k: usize| (k as f64 * PERIOD * hertz).fract() < duty;
            (0..5000)
                .map(|k| f64::from(u8::from(k > 200 && on(k))))
                .collect()
        };
        let random = |seed: u64| -> Vec<f64> {
            let mut rng = ChaCha8Rng::seed_from_u64(seed);
            let mut u = vec![0.0; 200];
            while u.len() < 5000 {
                let next = 1.0 - u.last().copied().unwrap_or(0.0);
                let length = rng.random_range(30..300);
                u.extend(std::iter::repeat_n(next, length));
            }
            u.truncate(5000);
            u
        };
        vec![
            self.record("square-2", Use::Identify, square(2.0, 0.5), 1),
            self.record("square-4", Use::Identify, square(4.0, 0.8), 2),
            self.record("random", Use::Identify, random(3), 3),
            self.record("held-out-square-3", Use::Validate, square(3.0, 0.4), 4),
            self.record("held-out-random", Use::Validate, random(5), 5),
        ]
    }
}

fn diagnosis(rig: &Rig, guess: &str, definitions: &[&str]) -> Diagnosis {
    let mut model = Model::from_toml(guess, "guess.toml").expect("a model");
    for text in definitions {
        let definition = Definition::from_toml(text, "effect.toml").expect("an effect");
        model.define(definition).expect("a new name");
    }
    let options = Options {
        most_effects: 1,
        ..Options::default()
    };
    let found = diagnose(
        &model,
        &rig.records(),
        &options,
        &AtomicBool::new(false),
        &|_| (),
    );
    let found = found.expect("a diagnosis");
    for rung in &found.ladder {
        println!("{:<40} {:.5}", rung.step, rung.validate_rmse);
    }
    for entry in found.ranking.iter().take(3) {
        println!(
            "{} {:.1} % {:?}",
            entry.effect, entry.error_reduction_percent, entry.parameters
        );
    }
    found
}

fn assert_found(found: &Diagnosis, name: &str, truth: &[(&str, f64)]) {
    assert_eq!(found.missing, [name]);
    assert_eq!(found.verdict, Verdict::EffectMissing);
    let last = found.ladder.last().expect("rungs");
    assert!(last.validate_rmse < 1.1 * NOISE, "{}", last.validate_rmse);
    let entry = found.ranking.iter().find(|entry| entry.effect == name);
    let entry = entry.expect("in the ranking");
    for (parameter, value) in truth {
        let estimate = &entry.parameters[*parameter];
        let error = (estimate.value / value - 1.0).abs();
        assert!(
            error < 0.15,
            "{parameter} {} instead of {value}",
            estimate.value
        );
    }
    let text = found.model.to_toml();
    let read = Model::from_toml(&text, "found.toml").expect("its own file stands alone");
    assert_eq!(read, found.model);
}

const RINGING: &str = include_str!("../../docs/effects/supply-line-ringing.toml");
const WARM_FILM: &str = include_str!("../../docs/effects/warm-film.toml");

#[test]
fn a_ringing_supply_line_is_found_when_it_is_offered() {
    let rig = Rig {
        jet: |since| {
            1.0 - 0.45 * (-since / 0.08).exp() * (2.0 * std::f64::consts::PI * 22.0 * since).cos()
        },
        air: |_| 20.0,
        reading: |friction, _| friction,
    };
    // A fixed delay is a whole number of samples and stays at the base model's value; a delay law is refitted with
    // the effect.
    let law = "law = \"state-dependent\"\ndelay_floor = 40.0\ndelay_rise = 1.0\ndelay_rate = 4.0\nfactors = [1.0]\ninterpolated = true";
    let guess = first_order(0.98, 0.02, law);
    let found = diagnosis(&rig, &guess, &[RINGING]);
    // The gain depends on the flow's response to jets of part strength, which these records do not identify.
    let truth = [("frequency", 22.0), ("decay_time", 0.08)];
    assert_found(&found, "supply-line-ringing", &truth);
}

#[test]
fn a_film_that_feels_the_temperature_is_found_when_it_is_offered() {
    let rig = Rig {
        jet: |_| 1.0,
        air: |time| 20.0 + 3.0 * (1.7 * time).sin() + 2.0 * (4.1 * time).sin(),
        reading: |friction, film| friction * (1.0 - 0.04 * (film - 20.0)),
    };
    let found = diagnosis(&rig, &first_order(0.98, 0.02, FIXED_DELAY), &[WARM_FILM]);
    let truth = [("sensitivity", 0.04), ("warming_time", 0.5)];
    assert_found(&found, "warm-film", &truth);
}
