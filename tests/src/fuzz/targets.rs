//! The readers of untrusted input, with the properties that must hold.

use std::cell::RefCell;
use std::fmt::Display;
use std::path::{Path, PathBuf};

use host_fit::codegen;
use host_fit::data::import::{Import, Source, import};
use host_fit::data::{Averaging, DataSet, InputFile, Record, average_files, visible};
use host_fit::model::Model;
use host_fit::simulate::Signals;
use host_fit::user_effect::Definition;
use rig_line::{Command, RigFile};
use wire::frame::{Frame, Receiver};
use wire::reply::Reply;
use wire::request::Request;
use wire::samples::Samples;

/// A reader under test.
#[derive(Clone, Copy)]
pub struct Target {
    /// Name of the target and of its folder of stored inputs.
    pub name: &'static str,
    /// Seeds of the mutation.
    pub seeds: fn() -> Vec<Vec<u8>>,
    /// Words of the input's language.
    pub words: &'static [&'static str],
    /// Reads an input and describes it or its error. Panics if a property does not hold.
    pub run: fn(&[u8]) -> String,
}

/// All of them.
pub const TARGETS: &[Target] = &[
    Target {
        name: "csv",
        seeds: || {
            texts(&[
                "t,u,y\n0,0,0.5\n0.001,1,0.25\n0.002,1,1e-3\n",
                "\u{feff}t,u,y,u_inf\r\n0.0,0,1,9\r\n0.5,1,2,9.5\r\n1.0,0,3,9\r\n",
            ])
        },
        words: &[
            "t", "u", "y", "y_sd", "y_min", ",", ";", "\n", "\r\n", "\"", "NaN", "\t",
        ],
        run: csv,
    },
    Target {
        name: "dataset",
        seeds: || {
            texts(&[
                "title = \"a\"\nsample_period_s = 0.001\ninput = \"graded\"\n[[record]]\nname = \"a\"\nfile = \"a.csv\"\nuse = \"identify\"\nu_before = 0.5\nlead_samples = 1\n",
            ])
        },
        words: &[
            "[[record]]\n",
            "name = ",
            "file = ",
            "use = ",
            "\"a.csv\"",
            "\"../a.csv\"",
            "\"validate\"",
            "u_before = ",
            "from = { file = \"x\" }\n",
        ],
        run: dataset,
    },
    Target {
        name: "import",
        seeds: imports,
        words: &[
            "time",
            "Zeit [ms]",
            "valve",
            "on",
            "OFF",
            "12:00:01.5",
            "2024-01-01",
            ";",
            "\t",
            ",",
            "\r\n",
            " AM",
            "%",
            "µs",
            "\u{feff}",
        ],
        run: imported,
    },
    Target {
        name: "average",
        seeds: || texts(&[&raw()]),
        words: &["t,u,y\n", "0,", "1,", ",,", "\n", "NaN", "-"],
        run: averaged,
    },
    Target {
        name: "model",
        seeds: || {
            texts(&[
                include_str!("../../data/hostile/model.toml"),
                include_str!("../../../firmware/identified/models/full.toml"),
                include_str!("../../../data/paper/table-2-state-dependent.toml"),
            ])
        },
        words: &[
            "[[effect]]\n",
            "[[definition]]\n",
            "name = \"valve-lag\"\n",
            "[law]\n",
            "law = \"fixed\"\n",
            "goal = \"maximise\"\n",
            "state_lags = [1, 2]\n",
            "inf",
            "nan",
            "[",
            "]",
        ],
        run: model,
    },
    Target {
        name: "effect",
        seeds: || {
            texts(&[
                "name = \"warm\"\nplace = \"jet\"\nsummary = \"one line\"\nexpression = \"jet * gain + s\"\n[[state]]\nname = \"s\"\nupdate = \"s + period * (jet - s) / (0.1 + gain)\"\n[[parameter]]\nname = \"gain\"\nunit = \"-\"\nlow = 0.1\nhigh = 2.0\nstarts = [1.0]\n",
            ])
        },
        words: &[
            "if jet > s { 1.0 } else { s }",
            "let a = jet; a",
            "delayed(jet, 0.1)",
            "table(jet, 0.0, 1.0, 2.0, 3.0)",
            "exp(",
            ".max(",
            "(",
            ")",
            "{",
            "}",
            "-",
            "!",
            "while",
            "u",
            "reading",
            "y",
        ],
        run: effect,
    },
    Target {
        name: "rig",
        seeds: || {
            texts(&[
                "format_version = 1\nsample_period_s = 0.001\nresidual_envelope = 0.5\n[sensor]\nzero_counts = 800.0\nper_count = 0.0005\nlower_rail_counts = 8.0\nupper_rail_counts = 4087.0\nstuck_after_samples = 500\n[valve]\nshortest_on_s = 0.004\nshortest_off_s = 0.004\n[channel]\nname = \"u_inf\"\nunit = \"m/s\"\nzero_counts = 0.0\nper_count = 0.005\nlower_rail_counts = 8.0\nupper_rail_counts = 4087.0\n",
            ])
        },
        words: &["noise_counts = [1.0, 2.0]\n", "inf", "nan", "\"\\r\""],
        run: rig,
    },
    Target {
        name: "command",
        seeds: || texts(&["t,u\n0,0\n0.001,1\n0.002,1\n0.003,0\n"]),
        words: &["t,u\n", "0", "1", "\n", ","],
        run: command,
    },
    Target {
        name: "frames",
        seeds: frames,
        words: &["\0", "\u{20}", "\u{22}", "\u{30}", "\u{40}"],
        run: framed,
    },
];

fn texts(texts: &[&str]) -> Vec<Vec<u8>> {
    texts.iter().map(|text| text.as_bytes().to_vec()).collect()
}

/// A raw recording: twelve repeats of 50 samples.
fn raw() -> String {
    (0..600).fold("t,u,y\n".to_owned(), |text, k| {
        let on = u8::from(k % 50 >= 10 && k % 50 < 30);
        format!(
            "{text}{:.3},{on},{}\n",
            f64::from(k) * 0.001,
            f64::from(k % 13) * 0.1
        )
    })
}

thread_local! {
    /// Folder for inputs that are read from files.
    static ROOM: RefCell<Option<tempfile::TempDir>> = const { RefCell::new(None) };
}

/// A folder for files; in memory if possible, because saved files are flushed to disk.
fn room() -> PathBuf {
    ROOM.with_borrow_mut(|room| {
        let room = room.get_or_insert_with(|| {
            let within = tempfile::tempdir_in("/dev/shm");
            within.or_else(|_| tempfile::tempdir()).expect("a folder")
        });
        room.path().to_owned()
    })
}

/// The path of a file with this content.
fn file(name: &str, content: &[u8]) -> PathBuf {
    let path = room().join(name);
    std::fs::write(&path, content).expect("written");
    path
}

/// An error message: one paragraph that names the file.
fn fault(error: impl Display, names: &str) -> String {
    let text = error.to_string();
    assert!(text.contains(names), "no `{names}` in: {text}");
    assert!(text.len() < 20_000, "{} bytes", text.len());
    text
}

/// A loaded set is unchanged after saving and loading.
fn survives(set: &DataSet) {
    for record in &set.records {
        assert!(
            record.y.iter().chain(&record.u).all(|v| v.is_finite()),
            "a value that is none"
        );
    }
    let target = room().join("saved");
    set.save(&target).expect("saved");
    let again =
        DataSet::load(&target).unwrap_or_else(|error| panic!("saved, and refused: {error}"));
    assert_eq!(again.records.len(), set.records.len());
    for (again, record) in again.records.iter().zip(&set.records) {
        // Times have 12 decimals.
        let t0 = record.t0;
        assert!(
            (again.t0 - t0).abs() <= 1e-12 + f64::EPSILON * t0.abs(),
            "t0 {t0}"
        );
        assert_eq!(
            *again,
            Record {
                t0: again.t0,
                ..record.clone()
            }
        );
    }
}

fn csv(input: &[u8]) -> String {
    let path = file("a.csv", input);
    let _ = InputFile::load(&path, None);
    match DataSet::load(&path) {
        Ok(set) => {
            survives(&set);
            format!("{} channels", set.records[0].channels.len())
        }
        Err(error) => fault(error, "a.csv"),
    }
}

fn dataset(input: &[u8]) -> String {
    let folder = file("a.csv", b"t,u,y\n0,0,0.5\n0.001,1,0.25\n0.002,1,1\n");
    file("dataset.toml", input);
    match DataSet::load(folder.parent().expect("a folder")) {
        Ok(set) => {
            survives(&set);
            format!("{} records", set.records.len())
        }
        // Names in the message come from the input.
        Err(error) => fault(error, "").replace(|c: char| !c.is_ascii(), ""),
    }
}

fn imports() -> Vec<Vec<u8>> {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../recordings/tests/import");
    let entries = std::fs::read_dir(folder).into_iter().flatten().flatten();
    let mut paths: Vec<PathBuf> = entries.map(|entry| entry.path()).collect();
    paths.sort();
    let small = paths
        .iter()
        .filter_map(|path| std::fs::read(path).ok())
        .filter(|bytes| bytes.len() <= super::LARGEST);
    let mut seeds: Vec<Vec<u8>> = small.collect();
    seeds.extend(texts(&[
        "Zeit [ms];Ventil;tau / Pa\r\n0,0;0;1,25\r\n1,0;5;-1,5e-3\r\n",
        "12:00:00.1 -> t:0 u:1 y:3.5\n12:00:00.2 -> t:1 u:0 y:3.6\n12:00:00.3 -> t:2 u:1 y:3\n",
        "\"t\" \"u\" \"y\"\n\"1\" 0.0 1 2\n\"2\" 0.5 1 2\n",
        "date,heater,temp\n2024-01-01 10:00:00,ON,21\n2024-01-01 10:00:01,OFF,22\n2024-01-01 10:00:02,ON,23\n",
    ]));
    seeds
}

fn imported(input: &[u8]) -> String {
    if let Err(error) = Source::read(Path::new("x.mat"), input) {
        return fault(error, "x.mat");
    }
    let path = file("run.csv", input);
    match import(&[&path], &Import::default()) {
        Ok(found) => {
            survives(&found.set);
            found.files[0].dialect.clone()
        }
        Err(error) => fault(error, ""),
    }
}

fn averaged(input: &[u8]) -> String {
    let path = file("raw.csv", input);
    match average_files(&[&path], &[], &Averaging::over(0.05), &mut |_, _| {}) {
        Ok((set, summaries)) => {
            survives(&set);
            format!("{} periods", summaries[0].periods_used.min(20))
        }
        Err(error) => fault(error, ""),
    }
}

fn model(input: &[u8]) -> String {
    let Ok(text) = std::str::from_utf8(input) else {
        return "no text".to_owned();
    };
    let model = match Model::from_toml(text, "m.toml") {
        Ok(model) => model,
        Err(error) => return fault(error, "m.toml"),
    };
    let written = model.to_toml();
    let again = Model::from_toml(&written, "again")
        .unwrap_or_else(|error| panic!("written, and refused: {error}"));
    assert_eq!(again.to_toml(), written);
    let u: Vec<f64> = (0..300).map(|k| f64::from(k / 40 % 2)).collect();
    let ran = match model.channels().is_empty() {
        true => model.run_free(&Signals::commanded(&model, &u)).is_ok(),
        false => false,
    };
    // The reference run of a long memory is slow.
    if model.longest_lag().max(model.longest_delay()) > 500 {
        return format!("long, ran {ran}");
    }
    match codegen::generate(&model) {
        Ok(rust) => {
            assert_eq!(visible(&rust), rust);
            format!("{} effects, ran {ran}", model.effects.len())
        }
        Err(error) => {
            assert!(
                !matches!(error, codegen::CodegenError::Malformed { .. }),
                "{error}"
            );
            fault(error, "")
        }
    }
}

fn effect(input: &[u8]) -> String {
    match std::str::from_utf8(input) {
        Ok(text) => match Definition::check(text, "own.toml") {
            Ok(checked) => format!("a name of {} bytes", checked.name.len().min(9)),
            Err(error) => {
                let _ = error.place_in(text);
                fault(error, "own.toml")
            }
        },
        Err(_) => "no text".to_owned(),
    }
}

fn rig(input: &[u8]) -> String {
    let path = file("rig.toml", input);
    match RigFile::load(&path) {
        Ok(rig) => {
            let again = path.with_file_name("again.toml");
            rig.save(&again)
                .unwrap_or_else(|error| panic!("loaded, and not written: {error}"));
            assert_eq!(RigFile::load(&again).expect("own file"), rig);
            let [on, off] = rig.hold_samples();
            assert!(on > 0 && off > 0);
            for value in [
                rig.sensor.per_count,
                rig.residual_envelope,
                rig.valve.shortest_on_s,
            ] {
                assert!((value as f32).is_normal(), "{value}");
            }
            format!("channel {}", rig.channel.is_some())
        }
        Err(error) => fault(error, "rig.toml"),
    }
}

fn command(input: &[u8]) -> String {
    match Command::load(&file("c.csv", input)) {
        Ok(command) => {
            let samples = command.samples();
            let rested = command.clone().with_rest(1000);
            assert!(rested.samples() >= samples.max(1000));
            format!("{} runs", command.runs.len().min(20))
        }
        Err(error) => fault(error, "c.csv"),
    }
}

fn frames() -> Vec<Vec<u8>> {
    let load = Request::load(7, 0x1234_5678, 0, &[0, 30, 20, 10]);
    let mut hello = vec![0x20, 1, 0, 1, 0, 0, 0];
    let samples = [
        &[0x40, 1, 0, 0, 0, 0, 0, 0, 0, 2][..],
        &[8; 24 * 3],
        &[0; 8],
    ]
    .concat();
    let frames = [Frame::new(&hello), Frame::new(&samples)];
    hello[0] = 0x30;
    let mut seeds: Vec<Vec<u8>> = frames.iter().map(|frame| frame.bytes().to_vec()).collect();
    seeds.push(load.bytes().to_vec());
    seeds.push(
        Frame::new(&[&hello[..], &[1; 80]].concat())
            .bytes()
            .to_vec(),
    );
    seeds
}

/// Passes bytes from the line to either end, and passes the same bytes as the content of a valid frame,
/// because the checksum would reject them otherwise.
fn framed(input: &[u8]) -> String {
    let mut receiver = Receiver::new();
    let mut said = (0, 0, "");
    for byte in input {
        match receiver.receive(*byte) {
            Some(Ok(content)) => {
                said.0 += 1;
                content_of(content);
            }
            Some(Err(_)) => said.1 += 1,
            None => {}
        }
    }
    let content = &input[..input.len().min(200)];
    said.2 = content_of(content);
    let frame = Frame::new(content);
    let mut receiver = Receiver::new();
    let mut came = Vec::new();
    for byte in frame.bytes() {
        if let Some(Ok(content)) = receiver.receive(*byte) {
            came.push(content.to_vec());
        }
    }
    // Content that is too long for a frame gives no frame.
    assert!(
        came.iter().all(|came| content.starts_with(came)),
        "a frame came changed"
    );
    let some = |count: i32| if count > 0 { "some" } else { "none" };
    format!(
        "frames {} damaged {} and as content {}",
        some(said.0),
        some(said.1),
        said.2
    )
}

fn content_of(content: &[u8]) -> &'static str {
    if let Some(samples) = Samples::read(content) {
        let count = samples.iter().count();
        assert!(count <= 255);
        return "samples";
    }
    if let Some(reply) = Reply::read(content) {
        let again = reply.frame();
        assert!(!again.bytes().is_empty());
        return "a reply";
    }
    if let Some(request) = Request::read(content) {
        let again = request.frame();
        assert!(!again.bytes().is_empty());
        return "a request";
    }
    "nothing"
}
