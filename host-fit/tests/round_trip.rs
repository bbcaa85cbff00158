//! Written files can be read again with the same meaning: models with any valid numbers and names, the Rust
//! generated from them, data sets.

use host_fit::codegen;
use host_fit::data::{DataSet, Record, Use, visible};
use host_fit::model::{Delay, Law, Maximise, Model, Track};
use model_core::control::HoldTimes;
use model_core::effects::StateDependentDelay;
use proptest::prelude::*;

/// Any text; often with characters that control a terminal or end a line or a comment.
fn text() -> impl Strategy<Value = String> {
    let acting = prop::sample::select(vec![
        "\r",
        "\n",
        "\u{1b}[2J",
        "\u{202e}",
        "\u{2028}",
        "\0",
        "*/",
        "\"",
        "\\",
        "\u{feff}",
        "#\"",
        "é",
    ]);
    prop::collection::vec(
        prop_oneof![acting.prop_map(str::to_owned), "[ -~]{0,6}"],
        0..4,
    )
    .prop_map(|parts| parts.concat())
}

/// Numbers of every size, and NaN and infinity.
fn number() -> impl Strategy<Value = f64> {
    prop_oneof![
        4 => -2.0..2.0f64,
        1 => (-300.0..300.0f64).prop_map(|e| 10f64.powf(e)),
        1 => prop::sample::select(vec![0.0, -0.0, 1e-320, 1e300, -1e300, f64::INFINITY, f64::NEG_INFINITY, f64::NAN, f64::MAX]),
    ]
}

fn law() -> impl Strategy<Value = Option<Law>> {
    let hold = || (any::<u32>(), 0..50u32).prop_map(|(on, off)| HoldTimes { on: on >> 20, off });
    let track = (
        hold(),
        prop::collection::vec(number(), 8),
        any::<[u16; 3]>(),
        text(),
    )
        .prop_map(|(hold, x, [lead, opening, closing], lost)| {
            Law::Track(Track {
                reference: x[0],
                reachable: [x[1].min(x[0] - 1.0), x[2].max(x[0] + 1.0)],
                slope: x[3].abs(),
                hold,
                anticipation: Some([lead.into(), opening.into()]),
                switches: None,
                air: None,
                lead: lead / 2 + 1,
                opening: opening / 1000,
                closing: closing / 1000,
                look_ahead: lead.saturating_add(100),
                observer: 0.1,
                bias_rate: x[4].abs().min(1.0),
                integral_rate: 0.01,
                play: x[5].abs(),
                settled: 1.0,
                correction_limit: x[6].abs(),
                residual_limit: x[7].abs(),
                lost: vec![lost],
            })
        });
    let maximise = (any::<u32>(), any::<u32>(), any::<u32>(), number()).prop_map(
        |(period, first, length, price)| {
            Law::Maximise(Maximise {
                period,
                pulses: vec![(first >> 8, length >> 8)],
                hold: HoldTimes { on: 1, off: 1 },
                air_price: price,
                lost: Vec::new(),
            })
        },
    );
    prop_oneof![Just(None), track.prop_map(Some), maximise.prop_map(Some)]
}

fn model() -> impl Strategy<Value = Model> {
    let delay = prop_oneof![
        any::<u16>().prop_map(|h| Delay::Fixed { delays: vec![h] }),
        prop::collection::vec(number(), 4).prop_map(|x| Delay::of::<StateDependentDelay<f64>>(
            &x[..3],
            vec![x[3]],
            true
        )),
    ];
    let sizes = (
        prop_oneof![Just(250u32), any::<u32>()],
        any::<u16>(),
        any::<u16>(),
    );
    let texts = prop::collection::vec(text(), 4);
    let numbers = prop::collection::vec(number(), 8);
    (
        sizes,
        delay,
        numbers,
        texts,
        any::<u64>(),
        law(),
        -12.0..12.0f64,
    )
        .prop_map(
            |((window, own, product), delay, x, texts, seed, law, period)| {
                let mut model = Model {
                    sample_period_s: 10f64.powf(period),
                    state_lags: vec![own],
                    a: vec![0.5 * x[0].clamp(-1.0, 1.0)],
                    product_lags: vec![product],
                    b: vec![x[1]],
                    c: vec![0.1 * x[2].clamp(-1.0, 1.0)],
                    constant: x[3],
                    delay,
                    law,
                    ..Model::default()
                };
                model.averaging.window = window;
                let spec = model.spec("plenum-droop").expect("in the catalogue");
                model.add(spec, &[x[4], x[5]], None);
                let [hash, version, objective, surrogate] =
                    <[String; 4]>::try_from(texts).expect("four");
                model.training.data_hash = hash;
                model.training.tool_version = version;
                model.training.objective = objective;
                model.training.stand_ins = vec![surrogate];
                model.training.seed = seed;
                model.training.y_range = [0.0, 1.0];
                model.training.objective_value = x[6];
                model
            },
        )
}

/// Whether the file contains NaN, which is not equal to itself.
fn is_equal(a: &Model, b: &Model) -> bool {
    a == b || a.to_toml() == b.to_toml()
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(2000))]

    /// A file is refused with its key, or it gives the same model again. Its Rust then has no invisible characters
    /// and only finite numbers, and it parses.
    #[test]
    fn a_model_is_refused_or_survives_and_its_rust_compiles(model in model()) {
        let text = model.to_toml();
        let read = match Model::from_toml(&text, "m.toml") {
            Ok(read) => read,
            Err(error) => {
                let error = error.to_string();
                prop_assert!(error.starts_with("m.toml: key `"), "{error}\n{text}");
                return Ok(());
            }
        };
        prop_assert!(is_equal(&read, &model), "{text}");
        // Long reference runs of long memories are slow.
        if read.longest_lag().max(read.longest_delay()) > 2000 {
            return Ok(());
        }
        match codegen::generate(&read) {
            Ok(rust) => {
                prop_assert_eq!(&*visible(&rust), &rust);
                let parsed = syn::parse_file(&rust);
                prop_assert!(parsed.is_ok(), "{:?}\n{rust}", parsed.err());
                let code = rust.lines().filter(|line| !line.trim_start().starts_with("//"));
                for line in code {
                    prop_assert!(!line.contains("inf") && !line.contains("NaN"), "{line}");
                }
            }
            Err(error) => prop_assert!(!matches!(error, codegen::CodegenError::Malformed { .. }), "{error}"),
        }
    }

    /// A data set is refused when it is assembled, or it is saved and is the same when it is loaded.
    #[test]
    fn a_data_set_is_refused_or_survives(
        names in prop::collection::vec(text(), 2),
        y in prop::collection::vec(number(), 2..6),
        period in -15.0..12.0f64,
        t0 in prop_oneof![Just(0.0), number()],
        tidy in any::<bool>(),
    ) {
        let u = (0..y.len()).map(|k| (k % 2) as f64).collect();
        let period = 10f64.powf(if tidy { period.round() } else { period });
        let mut record = Record::new(&format!("r{}", names[0]), Use::Identify, period, u, y.clone());
        record.t0 = t0;
        record.channels.insert(format!("c{}", names[1]), y);
        let Ok(set) = DataSet::from_records(Some(names[1].clone()), vec![record]) else {
            return Ok(());
        };
        let folder = tempfile::tempdir().unwrap();
        let target = folder.path().join("set");
        set.save(&target).unwrap();
        let read = DataSet::load(&target);
        prop_assert!(read.is_ok(), "{}", read.unwrap_err());
        let read = read.unwrap();
        prop_assert_eq!(&read.records[0].y, &set.records[0].y);
        prop_assert_eq!(&read.records[0].channels, &set.records[0].channels);
        prop_assert_eq!((read.sample_period_s, &read.title), (set.sample_period_s, &set.title));
    }
}
