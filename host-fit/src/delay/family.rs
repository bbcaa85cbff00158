//! Dead times of simulated plants with known parameters, on records with typical user defects.

use super::{DelayMethod, DelayOptions, DelayStudy, study_delays};
use crate::data::{DataSet, Record, Use};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal};

/// A plant of two time constants (the second may be 0) behind a dead time, in small steps of the exact first-order
/// solution; `start` is its state before the first sample.
fn respond(t1: f64, t2: f64, delay: f64, u: &[f64], start: [f64; 2]) -> Vec<f64> {
    let steps = 40;
    let [mut x, mut y] = start;
    let decay = |tau: f64| (-1.0 / (f64::from(steps) * tau)).exp();
    let (first, second) = (decay(t1), if t2 > 0.0 { decay(t2) } else { 0.0 });
    let mut out = Vec::with_capacity(u.len());
    for k in 0..u.len() {
        out.push(if t2 > 0.0 { y } else { x });
        for s in 0..steps {
            let t = k as f64 + (f64::from(s) + 0.5) / f64::from(steps) - delay;
            let input = if t < 0.0 { u[0] } else { u[t as usize] };
            let before = x;
            x = input + (x - input) * first;
            let middle = f64::midpoint(before, x);
            y = middle + (y - middle) * second;
        }
    }
    out
}

struct Case {
    time_constants: f64,
    delay: f64,
    edges: usize,
    record: Record,
}

/// A random test case: first or second order, time constants 5 to 400 samples, dead time 0 to 100, 1 to 40 edges
/// on/off or graded, either sign, resting at any level, at rest with u = 0 or 1 or in mid-run, noise 0.1 to 3 % of
/// the step, quantised or not.
fn case(seed: u64, period: f64) -> Case {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let t1 = 5.0 * 80f64.powf(rng.random());
    let t2 = if rng.random::<bool>() {
        t1 * rng.random_range(0.05..0.9)
    } else {
        0.0
    };
    let sum = t1 + t2;
    let delay = (rng.random::<f64>() * 101.0).floor();
    let edges = [1, 1, 2, 3, 5, 10, 20, 40][rng.random_range(0..8)];
    let (mid_run, graded) = (rng.random::<f64>() < 0.3, rng.random::<f64>() < 0.2);
    let mut level = f64::from(u8::from(rng.random::<bool>()));
    let mut u = vec![level; 20 + (rng.random::<f64>() * sum) as usize];
    for i in 0..edges {
        let before = level;
        level = 1.0 - before;
        while graded && (level == 1.0 - before || (level - before).abs() < 0.25) {
            level = (rng.random::<f64>() * 10.0).floor() / 10.0;
        }
        let hold = if i + 1 == edges {
            delay + sum * rng.random_range(1.5..4.0) + 10.0
        } else {
            0.5 * delay + sum * rng.random_range(0.5..3.0) + 8.0
        };
        u.extend(std::iter::repeat_n(level, hold as usize));
    }
    let start = if mid_run {
        let x: f64 = rng.random();
        [x, x + 0.3 * (rng.random::<f64>() - 0.5)]
    } else {
        [u[0]; 2]
    };
    let gain = [1.0, -1.0, 30.0, -0.4][rng.random_range(0..4)];
    let rest = [0.0, 0.0, 21.0, -3.0, 250.0][rng.random_range(0..5)];
    let noise = 0.001 * 30f64.powf(rng.random());
    let reading = if rng.random::<f64>() < 0.3 { 0.01 } else { 0.0 };
    let y = respond(t1, t2, delay, &u, start)
        .into_iter()
        .map(|y| {
            let z: f64 = StandardNormal.sample(&mut rng);
            let noisy = y + noise * z;
            let read = if reading > 0.0 {
                (noisy / reading).round() * reading
            } else {
                noisy
            };
            rest + gain * read
        })
        .collect();
    Case {
        time_constants: sum,
        delay,
        edges,
        record: Record::new("r", Use::Identify, period, u, y),
    }
}

fn study(records: Vec<Record>) -> DelayStudy {
    let set = DataSet::from_records(None, records).unwrap();
    study_delays(&set, &DelayOptions::default()).unwrap()
}

#[test]
fn dead_times_of_known_plants_are_right_and_within_their_intervals() {
    let (mut held, mut edges, mut edges_off, mut unmeasured) = (0, 0, 0, 0);
    let mut off = Vec::new();
    let cases = 20;
    for seed in 0..cases {
        let case = case(1000 + seed, if seed % 2 == 0 { 0.01 } else { 8.0 });
        let study = study(vec![case.record]);
        let tolerance = 1.5f64.max(0.05 * case.time_constants);
        let found = study.dead_time.unwrap();
        assert!(found.standard_error > 0.0 && found.high > found.low);
        held += usize::from(found.low <= case.delay && case.delay <= found.high);
        if (found.samples - case.delay).abs() > tolerance {
            off.push((seed, found.samples, case.delay));
        }
        edges += case.edges;
        for edge in &study.edges {
            match edge.onset {
                Ok(onset) => edges_off += usize::from((onset.delay - case.delay).abs() > tolerance),
                Err(_) => unmeasured += 1,
            }
        }
        assert!(study.law.is_none(), "seed {seed}: {:?}", study.law);
    }
    assert!(held * 10 >= 9 * cases as usize, "{held} of {cases}");
    assert!(off.len() <= 1, "{off:?} of {cases}");
    assert!(edges_off * 50 <= edges, "{edges_off} of {edges}");
    assert!(unmeasured * 20 <= edges, "{unmeasured} of {edges}");
}

/// The response of a plant with two time constants resembles that of one time constant and a longer dead time.
#[test]
fn the_dead_time_before_three_lags_is_within_its_interval() {
    let (lags, delay) = ([50.0, 25.0, 15.0], 10);
    let mut held = 0;
    for seed in 0..8 {
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        let mut u = vec![0.0; 40];
        for i in 0..6 {
            let hold = rng.random_range(60..220);
            u.extend(std::iter::repeat_n(f64::from(u8::from(i % 2 == 0)), hold));
        }
        let steps = 40;
        let mut states = [0.0; 3];
        let y = (0..u.len())
            .map(|k| {
                let z: f64 = StandardNormal.sample(&mut rng);
                let now = states[2] + 0.005 * z;
                for _ in 0..steps {
                    let mut drive = if k < delay { 0.0 } else { u[k - delay] };
                    for (state, lag) in states.iter_mut().zip(lags) {
                        *state += (drive - *state) / (f64::from(steps) * lag);
                        drive = *state;
                    }
                }
                now
            })
            .collect();
        let found = study(vec![Record::new("r", Use::Identify, 1.0, u, y)])
            .dead_time
            .unwrap();
        held += usize::from((found.low..=found.high).contains(&(delay as f64)));
        assert!(found.high - found.low < 15.0, "{seed}: {found:?}");
    }
    assert!(held >= 7, "{held} of 8");
}

#[test]
fn level_scale_and_sign_of_y_and_of_u_change_nothing() {
    for seed in [1003, 1010, 1021] {
        let case = case(seed, 1.0);
        let plain = study(vec![case.record.clone()]).dead_time.unwrap();
        let mut moved = case.record.clone();
        moved.y.iter_mut().for_each(|y| *y = 400.0 - 7.0 * *y);
        let moved = study(vec![moved]).dead_time.unwrap();
        let mut inverted = case.record;
        inverted.u.iter_mut().for_each(|u| *u = 1.0 - *u);
        let inverted = study(vec![inverted]).dead_time.unwrap();
        for other in [moved, inverted] {
            assert!(
                (plain.samples - other.samples).abs() < 0.05,
                "{seed}: {plain:?} {other:?}"
            );
        }
    }
}

/// A record may begin anywhere (at rest, or 3, 9 and 18 samples after an edge): responses to earlier commands do
/// not bias the record's own edges.
#[test]
fn a_record_may_be_cut_anywhere() {
    let (delay, at) = (20.0, 500);
    for since in [200, 18, 9, 3] {
        let mut rng = ChaCha8Rng::seed_from_u64(since);
        let mut u = vec![0.0; at - since as usize];
        for (i, hold) in [260, 90, 140, 110, 80, 150].into_iter().enumerate() {
            u.extend(std::iter::repeat_n(f64::from(u8::from(i % 2 == 0)), hold));
        }
        let y: Vec<f64> = respond(30.0, 0.0, delay, &u, [0.0; 2])
            .into_iter()
            .map(|y| {
                let z: f64 = StandardNormal.sample(&mut rng);
                y + 0.01 * z
            })
            .collect();
        let part = |from: usize, to: usize| {
            let (u, y) = (u[from..to].to_vec(), y[from..to].to_vec());
            Record::new("r", Use::Identify, 0.001, u, y)
        };
        let found = study(vec![part(at, u.len())]).dead_time.unwrap();
        assert!((found.samples - delay).abs() < 1.0, "{since}: {found:?}");
    }
}

#[test]
fn heating_and_cooling_at_different_rates_have_one_dead_time() {
    let mut rng = ChaCha8Rng::seed_from_u64(9);
    for (on, off) in [(40.0, 60.0), (20.0, 60.0)] {
        for edges in [2usize, 7] {
            let mut u = vec![0.0; 60];
            for i in 0..edges {
                let hold = 150 + rng.random_range(0..60);
                u.extend(std::iter::repeat_n(f64::from(u8::from(i % 2 == 0)), hold));
            }
            let mut state: f64 = 0.0;
            let y = (0..u.len())
                .map(|k| {
                    let z: f64 = StandardNormal.sample(&mut rng);
                    let now = 21.0 + 30.0 * (state + 0.01 * z);
                    let input = if k < 15 { 0.0 } else { u[k - 15] };
                    let tau: f64 = if input > 0.5 { on } else { off };
                    state = input + (state - input) * (-1.0 / tau).exp();
                    now
                })
                .collect();
            let study = study(vec![Record::new("r", Use::Identify, 1.0, u, y)]);
            let found = study.dead_time.unwrap();
            assert!(
                (found.samples - 15.0).abs() < 1.0,
                "{on} {off} {edges}: {found:?}"
            );
            let plant = study.plant.unwrap();
            assert!(
                (plant.time_constants_on / on - 1.0).abs() < 0.1,
                "{plant:?}"
            );
            assert!(
                (plant.time_constants_off / off - 1.0).abs() < 0.1,
                "{plant:?}"
            );
        }
    }
}

/// A state-dependent delay at 10 ms: there are few samples between edges, so the time constants are estimated from
/// all edges together.
#[test]
fn a_rig_sampled_at_ten_milliseconds_is_measured_at_nearly_every_edge() {
    let mut rng = ChaCha8Rng::seed_from_u64(4);
    let records = (0..4)
        .map(|i| {
            let mut u = vec![0.0; 40];
            while u.len() < 1200 {
                let level = f64::from(u8::from(u[u.len() - 1] < 0.5));
                u.extend(std::iter::repeat_n(level, rng.random_range(8..18)));
            }
            u.truncate(1200);
            // The plant has h = 3 + 2·exp(−4·y) samples, different rates of attachment and
            // separation, and a gain that decreases during blowing.
            let steps = 20;
            let (mut value, mut store): (f64, f64) = (0.0, 1.0);
            let y = (0..u.len())
                .map(|k| {
                    let z: f64 = StandardNormal.sample(&mut rng);
                    let now = value + 0.01 * z;
                    let delay = 3.0 + 2.0 * (-4.0 * value).exp();
                    for s in 0..steps {
                        let t = k as f64 + f64::from(s) / f64::from(steps) - delay;
                        let input = if t < 0.0 { 0.0 } else { u[t as usize] };
                        store +=
                            (if input > 0.5 { 0.6 } else { 1.0 } - store) / 30.0 / f64::from(steps);
                        let tau = if input > 0.5 { 4.0 } else { 2.5 };
                        value += (input * store - value) / tau / f64::from(steps);
                    }
                    now
                })
                .collect();
            Record::new(&format!("r{i}"), Use::Identify, 0.01, u, y)
        })
        .collect();
    let study = study(records);
    let measured = study.edges.iter().filter(|e| e.onset.is_ok()).count();
    assert!(study.edges.len() > 300);
    assert!(
        measured * 10 >= study.edges.len() * 9,
        "{measured} of {}, {:?}",
        study.edges.len(),
        study.method
    );
    let found = study.dead_time.unwrap();
    assert!(
        (3.0..5.0).contains(&found.samples),
        "{found:?} {:?}",
        study.method
    );
}

#[test]
fn records_of_strangers_have_the_delays_that_their_readmes_state() {
    let folder = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("../tests/data/strangers");
    for (file, truth, edges) in [
        ("bump-test/step-at-20.csv", 15.0, 1),
        ("bump-test/step-at-60.csv", 15.0, 1),
        ("bump-test/step-at-200.csv", 15.0, 1),
        ("heat-cool-cycle/run.csv", 15.0, 2),
        ("normally-open/run.csv", 15.0, 10),
        ("thermostat/rest-at-0.csv", 15.0, 61),
        ("thermostat/rest-at-21.csv", 15.0, 61),
        ("hotend-bang/one-cycle.csv", 18.0, 2),
        ("hotend-bang/two-cycles.csv", 18.0, 4),
        ("hotend-bang/other-day.csv", 18.0, 2),
    ] {
        let set = DataSet::load(&folder.join(file)).unwrap();
        for reach in [None, Some(15), Some(60), Some(380)] {
            let options = DelayOptions {
                reach,
                ..DelayOptions::default()
            };
            let study = study_delays(&set, &options).unwrap();
            assert_eq!(study.method, DelayMethod::Trajectory, "{file}");
            assert_eq!(study.edges.len(), edges, "{file}");
            let found = study.dead_time.unwrap();
            assert!((found.samples - truth).abs() < 1.0, "{file}: {found:?}");
            assert!(found.low < truth && truth < found.high, "{file}: {found:?}");
            for onset in study.edges.iter().filter_map(|e| e.onset.ok()) {
                assert!((onset.delay - truth).abs() < 1.5, "{file}: {onset:?}");
                assert!(onset.standard_error > 0.4, "{file}: {onset:?}");
            }
            assert!(
                study.law.is_none() && study.law_not_kept.is_some(),
                "{file}"
            );
        }
    }
}

#[test]
fn a_longest_delay_that_is_asked_for_is_kept_to() {
    let folder = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("../");
    for (file, longest) in [
        ("tests/data/strangers/hotend-bang/one-cycle.csv", 10),
        ("data/ramp-cfd", 20),
    ] {
        let set = DataSet::load(&folder.join(file)).unwrap();
        let options = DelayOptions {
            max_delay: Some(longest),
            ..DelayOptions::default()
        };
        let study = study_delays(&set, &options).unwrap();
        for onset in study.edges.iter().filter_map(|e| e.onset.ok()) {
            assert!(onset.delay <= longest as f64 + 1e-9, "{file}: {onset:?}");
        }
    }
}

#[test]
fn nothing_that_moves_gives_edges_without_a_dead_time() {
    let mut u = vec![0.0; 100];
    u.extend(vec![1.0; 100]);
    let still = study(vec![Record::new(
        "r",
        Use::Identify,
        1.0,
        u.clone(),
        vec![3.0; 200],
    )]);
    assert_eq!(still.edges.len(), 1);
    assert!(still.dead_time.is_none() && still.edges[0].onset.is_err());
    let mut rng = ChaCha8Rng::seed_from_u64(3);
    let noise = (0..200).map(|_| StandardNormal.sample(&mut rng)).collect();
    let noisy = study(vec![Record::new("r", Use::Identify, 1.0, u, noise)]);
    assert!(noisy.dead_time.is_none(), "{:?}", noisy.dead_time);
}

/// A command of 2000 samples whose levels last 30 to 170 samples, and a normal deviate for each
/// sample.
fn switched(seed: u64) -> (Vec<f64>, Vec<f64>) {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let (mut u, mut level) = (vec![0.0; 60], 0.0);
    while u.len() < 2000 {
        level = 1.0 - level;
        u.extend(std::iter::repeat_n(level, rng.random_range(30..170)));
    }
    u.truncate(2000);
    let deviates = (0..2000).map(|_| StandardNormal.sample(&mut rng)).collect();
    (u, deviates)
}

/// Asserts that the dead time of each of six records lies within its interval, which is no longer than `longest`.
fn all_within(delay: f64, longest: f64, y: impl Fn(&[f64], &[f64]) -> Vec<f64>) {
    for seed in 0..6 {
        let (u, deviates) = switched(seed);
        let y = y(&u, &deviates);
        let study = study(vec![Record::new("r", Use::Identify, 0.1, u, y)]);
        let found = study.dead_time.expect("y responds");
        let holds = found.low <= delay && delay <= found.high;
        assert!(
            holds && found.high - found.low < longest,
            "seed {seed}, {delay}: {found:?} {:?} {:?}",
            study.method,
            study.plant
        );
    }
}

fn with_noise(y: Vec<f64>, deviates: &[f64]) -> Vec<f64> {
    y.iter().zip(deviates).map(|(y, z)| y + 0.01 * z).collect()
}

#[test]
fn a_slow_disturbance_does_not_hide_the_dead_time() {
    all_within(8.0, 5.0, |u, deviates| {
        let (mut walk, mut room) = (0.0, 0.0);
        let y = with_noise(respond(30.0, 0.0, 8.0, u, [0.0; 2]), deviates);
        y.into_iter()
            .zip(deviates.iter().rev())
            .map(|(y, z)| {
                walk += z;
                room += (walk - room) / 200.0;
                y + 0.006 * room
            })
            .collect()
    });
}

#[test]
fn single_wrong_readings_do_not_hide_the_dead_time() {
    all_within(8.0, 16.0, |u, deviates| {
        let y = with_noise(respond(30.0, 6.0, 8.0, u, [0.0; 2]), deviates);
        let wrong = |(k, y): (usize, f64)| y + if k % 211 == 100 { 1.4 } else { 0.0 };
        y.into_iter().enumerate().map(wrong).collect()
    });
}

#[test]
fn a_response_faster_than_the_samples_has_a_dead_time_of_few() {
    all_within(2.0, 6.0, |u, deviates| {
        with_noise(respond(0.2, 0.0, 2.0, u, [0.0; 2]), deviates)
    });
}

#[test]
fn an_integrator_has_a_dead_time() {
    all_within(8.0, 40.0, |u, deviates| {
        let mut level = 0.0;
        let flow = respond(15.0, 0.0, 8.0, u, [0.0; 2]).into_iter();
        let tank = flow.map(|flow| {
            let before = level;
            level += (flow - 0.5) / 40.0;
            before
        });
        with_noise(tank.collect(), deviates)
    });
}

/// Fourteen levels over the response: rounding hides noise, which then does not scatter from sample to sample.
#[test]
fn a_coarse_converter_does_not_hide_the_dead_time() {
    all_within(8.0, 20.0, |u, deviates| {
        let y = with_noise(respond(30.0, 4.0, 8.0, u, [0.0; 2]), deviates);
        y.into_iter().map(|y| (y / 0.07).round() * 0.07).collect()
    });
}

/// No response ends before the next edge, so that no edge is measured separately.
#[test]
fn a_binary_sequence_has_a_dead_time() {
    for seed in 0..6 {
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        let (mut u, mut level) = (Vec::new(), 0.0);
        while u.len() < 3000 {
            level = 1.0 - level;
            u.extend(std::iter::repeat_n(level, rng.random_range(1..6)));
        }
        let deviates: Vec<f64> = (0..u.len())
            .map(|_| StandardNormal.sample(&mut rng))
            .collect();
        let y = with_noise(respond(30.0, 0.0, 12.0, &u, [0.0; 2]), &deviates);
        let study = study(vec![Record::new("r", Use::Identify, 0.1, u, y)]);
        let found = study.dead_time.expect("the records respond as a whole");
        assert!(study.rising.is_none() && study.falling.is_none());
        let holds = found.low <= 12.0 && 12.0 <= found.high && found.high - found.low < 6.0;
        assert!(holds, "seed {seed}: {found:?}");
    }
}
