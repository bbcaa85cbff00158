//! Whatever bytes a user's files contain, loading ends in valid data or in an error of one paragraph that names the
//! file. It never panics and never leaves a partial output.

use std::fs;
use std::path::Path;
use std::process::Command;

use host_fit::data::{Averaging, DataSet, InputFile, average_files};
use host_fit::excitation::Excitation;
use proptest::prelude::*;

fn csv(rows: usize) -> String {
    let mut text = String::from("t,u,y,y_sd,y_min,y_max,u_inf\n");
    for k in 0..rows {
        let y = (k as f64 * 0.3).sin();
        text.push_str(&format!(
            "{:.3},{},{y},0.01,{},{},9.8\n",
            k as f64 * 0.001,
            (k / 5) % 2,
            y - 0.1,
            y + 0.1
        ));
    }
    text
}

const MANIFEST: &str = "title = \"T\"\nsample_period_s = 0.001\n\n[[record]]\nname = \"a\"\nfile = \"a.csv\"\nuse = \"identify\"\n";

/// One change of a text file.
#[derive(Debug, Clone)]
enum Mutation {
    Flip(prop::sample::Index, u8),
    Insert(prop::sample::Index, Vec<u8>),
    Remove(prop::sample::Index, usize),
    Cut(prop::sample::Index),
}

fn mutation() -> impl Strategy<Value = Mutation> {
    let telling = prop_oneof![
        Just(b",".to_vec()),
        Just(b"\n".to_vec()),
        Just(b"\r".to_vec()),
        Just(b"\"".to_vec()),
        Just(b"nan".to_vec()),
        Just(b"-1e999".to_vec()),
        Just(b"\xff\xfe".to_vec()),
        Just(b"\0".to_vec()),
        Just(b"../".to_vec()),
        Just(b"= [[".to_vec()),
        prop::collection::vec(any::<u8>(), 1..8),
    ];
    prop_oneof![
        (any::<prop::sample::Index>(), any::<u8>()).prop_map(|(i, b)| Mutation::Flip(i, b)),
        (any::<prop::sample::Index>(), telling).prop_map(|(i, b)| Mutation::Insert(i, b)),
        (any::<prop::sample::Index>(), 1..40usize).prop_map(|(i, n)| Mutation::Remove(i, n)),
        any::<prop::sample::Index>().prop_map(Mutation::Cut),
    ]
}

fn mutate(text: &str, mutations: &[Mutation]) -> Vec<u8> {
    let mut bytes = text.as_bytes().to_vec();
    for m in mutations {
        if bytes.is_empty() {
            break;
        }
        match m {
            Mutation::Flip(i, b) => {
                let at = i.index(bytes.len());
                bytes[at] = *b;
            }
            Mutation::Insert(i, new) => {
                let at = i.index(bytes.len());
                bytes.splice(at..at, new.iter().copied());
            }
            Mutation::Remove(i, n) => {
                let at = i.index(bytes.len());
                bytes.drain(at..(at + n).min(bytes.len()));
            }
            Mutation::Cut(i) => bytes.truncate(i.index(bytes.len())),
        }
    }
    bytes
}

/// Loads the folder (or file): either the data are valid, or the message is one paragraph that names one of its
/// files.
fn judge(path: &Path, names: &[&str]) {
    match DataSet::load(path) {
        Ok(set) => {
            assert!(!set.records.is_empty());
            for r in &set.records {
                assert!(r.len() >= 2 && r.y.len() == r.len());
                assert!(r.sample_period_s.is_finite() && r.sample_period_s > 0.0);
                let columns = [Some(&r.u), Some(&r.y), r.y_sd.as_ref(), r.y_min.as_ref()];
                for column in columns.into_iter().flatten().chain(r.channels.values()) {
                    assert_eq!(column.len(), r.len());
                    assert!(column.iter().all(|v| v.is_finite() && v.abs() <= 1e100));
                }
            }
            let _ = Excitation::of(&set, 10);
        }
        Err(e) => {
            let text = e.to_string();
            assert!(names.iter().any(|n| text.contains(n)), "{text}");
            assert!(!text.contains('\n') && text.len() < 2000, "{text}");
        }
    }
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 400, failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn arbitrary_bytes_as_csv(bytes in prop::collection::vec(any::<u8>(), 0..400)) {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("wild.csv");
        fs::write(&path, bytes).unwrap();
        judge(&path, &["wild.csv"]);
        if let Err(e) = InputFile::load(&path, None) {
            prop_assert!(e.to_string().contains("wild.csv"));
        }
    }

    #[test]
    fn csv_like_text(text in "t,u,y\n([0-9.,e+\\-naif\"\r \t]{0,12}[,\n]){0,30}") {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("wild.csv");
        fs::write(&path, text).unwrap();
        judge(&path, &["wild.csv"]);
    }

    #[test]
    fn mutated_csv(mutations in prop::collection::vec(mutation(), 1..4)) {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.csv");
        fs::write(&path, mutate(&csv(40), &mutations)).unwrap();
        judge(&path, &["a.csv"]);
        fs::write(folder.path().join("dataset.toml"), MANIFEST).unwrap();
        judge(folder.path(), &["a.csv"]);
    }

    #[test]
    fn mutated_manifest(mutations in prop::collection::vec(mutation(), 1..4)) {
        let folder = tempfile::tempdir().unwrap();
        fs::write(folder.path().join("a.csv"), csv(20)).unwrap();
        fs::write(folder.path().join("dataset.toml"), mutate(MANIFEST, &mutations)).unwrap();
        judge(folder.path(), &["dataset.toml", "a.csv", folder.path().to_str().unwrap()]);
    }

    #[test]
    fn arbitrary_manifest(bytes in prop::collection::vec(any::<u8>(), 0..200)) {
        let folder = tempfile::tempdir().unwrap();
        fs::write(folder.path().join("dataset.toml"), bytes).unwrap();
        judge(folder.path(), &["dataset.toml"]);
    }

    #[test]
    fn mutated_raw_recordings(mutations in prop::collection::vec(mutation(), 0..6), period in 0.0..0.05f64) {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("raw.csv");
        let text = csv(60).lines().map(|l| l.splitn(7, ',').take(3).collect::<Vec<_>>().join(",") + "\n").collect::<String>();
        fs::write(&path, mutate(&text, &mutations)).unwrap();
        match average_files(&[&path], &[], &Averaging::over(period), &mut |_, _| {}) {
            Ok((set, summaries)) => {
                prop_assert!(set.records[0].y.iter().all(|y| y.is_finite()));
                prop_assert!(summaries[0].periods_used >= 1);
            }
            Err(e) => {
                let text = e.to_string();
                prop_assert!(text.contains("raw.csv") || text.contains("period of"), "{}", text);
                prop_assert!(!text.contains('\n'));
            }
        }
    }
}

fn host_fit(arguments: &[&str]) -> (Option<i32>, String, String) {
    let out = Command::new(env!("CARGO_BIN_EXE_host-fit"))
        .args(arguments)
        .output()
        .unwrap();
    (
        out.status.code(),
        String::from_utf8(out.stdout).unwrap(),
        String::from_utf8(out.stderr).unwrap(),
    )
}

#[test]
fn the_program_exits_1_on_bad_data_2_on_bad_usage_and_leaves_nothing() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.csv");
    let file = path.to_str().unwrap();
    let out = folder.path().join("out");
    let out = out.to_str().unwrap();
    fs::write(&path, "t,u,y\n0,0,0\n0.001,0,x\n").unwrap();
    for arguments in [
        vec!["delay", file, "--out", out],
        vec!["--json", "delay", file],
        vec!["average", file, "--period", "0.5", "--out", out],
        vec!["delay", "no/such/folder"],
    ] {
        let (code, stdout, stderr) = host_fit(&arguments);
        assert_eq!(code, Some(1), "{arguments:?}: {stderr}");
        assert!(stdout.is_empty());
        assert!(
            stderr.starts_with("error: ") && stderr.trim_end().lines().count() == 1,
            "{stderr}"
        );
        assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 1);
    }
    for arguments in [
        vec!["delay"],
        vec!["average", file, "--period", "0", "--out", out],
        vec!["nonsense"],
    ] {
        assert_eq!(host_fit(&arguments).0, Some(2), "{arguments:?}");
    }
}

/// A data set is not replaced without `--force`, errors on files of other programs mention `import`, and no cause
/// is reported twice.
#[test]
fn imports_replace_nothing_unasked_and_are_named_where_they_are_needed() {
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name).to_str().unwrap().to_owned();
    let (log, set, model) = (at("log.csv"), at("set"), at("m.toml"));
    fs::write(
        &log,
        "time,heater,temp\n10:00:00,ON,21\n10:00:01,OFF,22\n10:00:02,ON,23\n",
    )
    .unwrap();
    let import = ["import", &log, "-o", &set];
    let (code, stdout, _) = host_fit(&import);
    assert_eq!(code, Some(0));
    for part in [
        "sampling period 1 s",
        "ON is 1, OFF is 0",
        "There is no validation record",
    ] {
        assert!(stdout.contains(part), "no `{part}` in {stdout}");
    }
    let (code, _, stderr) = host_fit(&import);
    assert_eq!(code, Some(1));
    assert!(
        stderr.contains("set: contains a data set already") && stderr.contains("--force"),
        "{stderr}"
    );
    let (code, stdout, _) = host_fit(&[&import[..], &["--force", "--json"]].concat());
    let document: serde_json::Value = serde_json::from_str(&stdout).unwrap();
    assert_eq!(
        (code, document["sample_period_s"].as_f64()),
        (Some(0), Some(1.0))
    );
    assert_eq!(document["remarks"].as_array().unwrap().len(), 1);

    let matlab = concat!(
        env!("CARGO_MANIFEST_DIR"),
        "/../recordings/tests/import/v7.mat"
    );
    for arguments in [
        vec!["identify", matlab, "-o", &model],
        vec!["delay", matlab],
        vec!["average", matlab, "--period", "1", "--out", &model],
        vec!["delay", folder.path().to_str().unwrap()],
    ] {
        let (code, _, stderr) = host_fit(&arguments);
        assert_eq!(code, Some(1), "{arguments:?}");
        assert!(stderr.contains("host-fit import"), "{stderr}");
    }
    let (_, _, stderr) = host_fit(&["compare", "none.toml", &set]);
    assert_eq!(stderr.matches("os error 2").count(), 1, "{stderr}");
}

/// A log with missing values and lost rows is imported with `--fill-gaps`, which every refusal names.
#[test]
fn gaps_of_a_log_are_filled_on_request() {
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name).to_str().unwrap().to_owned();
    let write = |name: &str, no_y: &[usize], no_fan: &[usize], lost: &[usize]| {
        let rows = (0..60).filter(|k| !lost.contains(k)).map(|k| {
            let or = |rows: &[usize], mark: &str, value: String| match rows.contains(&k) {
                true => mark.to_owned(),
                false => value,
            };
            let (y, fan) = (or(no_y, "", k.to_string()), or(no_fan, "NaN", "7".into()));
            format!("{k},{},{y},{fan}\n", k / 10 % 2)
        });
        fs::write(
            at(name),
            "t,u,y,fan\n".to_owned() + &rows.collect::<String>(),
        )
        .unwrap();
        at(name)
    };
    for (log, place) in [
        (write("cells.csv", &[10], &[], &[]), "line 12, column `y`"),
        (write("marks.csv", &[], &[10], &[]), "line 12, column `fan`"),
        (
            write("rows.csv", &[], &[], &[10, 30, 31]),
            "line 12, column `t`",
        ),
    ] {
        let (code, _, stderr) = host_fit(&["import", &log, "--channel", "fan", "-o", &at("none")]);
        assert_eq!(code, Some(1));
        assert!(
            stderr.contains(place) && stderr.contains("--fill-gaps SECONDS"),
            "{stderr}"
        );
    }
    let log = write("log.csv", &[10, 20, 21], &[5], &[40, 41]);
    let set = at("set");
    let (code, stdout, stderr) = host_fit(&["import", &log, "-o", &set, "--fill-gaps", "3"]);
    assert_eq!(code, Some(0), "{stderr}");
    for part in [
        "`y`: 3 of 58 values are interpolated (lines 12, 22, 23)",
        "`fan`: 1 of 58 values are interpolated (line 7)",
        "2 missing row(s) are inserted (before line 42)",
    ] {
        assert!(stdout.contains(part), "no `{part}` in {stdout}");
    }
    let record = &DataSet::load(Path::new(&set)).unwrap().records[0];
    let expected: Vec<f64> = (0..60).map(f64::from).collect();
    assert!(
        record
            .y
            .iter()
            .zip(&expected)
            .all(|(a, b)| (a - b).abs() < 1e-9)
    );
    assert_eq!((record.len(), record.u[40], record.u[41]), (60, 1.0, 1.0));
    assert_eq!(record.channels["fan"], [7.0; 60]);
    let manifest = fs::read_to_string(folder.path().join("set/dataset.toml")).unwrap();
    assert!(manifest.contains("fill_gaps_s = 3.0"), "{manifest}");
    let (code, _, stderr) = host_fit(&["import", &log, "-o", &at("next"), "--like", &set]);
    assert_eq!(code, Some(0), "{stderr}");
}

/// Records with too little data are refused with their file, and a wrong value of an on/off command with its line.
#[test]
fn what_a_fit_cannot_use_is_refused_with_its_file() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("poor.csv");
    let out = folder.path().join("model.toml");
    let of = |rows: usize, u: &dyn Fn(usize) -> f64, y: &dyn Fn(usize) -> f64| {
        (0..rows).fold("t,u,y\n".to_owned(), |text, k| {
            format!("{text}{:.3},{},{}\n", k as f64 * 0.001, u(k), y(k))
        })
    };
    let square = |k: usize| f64::from(u8::from(k % 40 >= 20));
    let wave = |k: usize| (k as f64 * 0.1).sin();
    let slip = |k: usize| if k == 30 { 2.0 } else { square(k) };
    let (file, model) = (path.to_str().unwrap(), out.to_str().unwrap());
    for (text, options, parts) in [
        (
            of(2, &|k| k as f64, &wave),
            &[][..],
            ["poor.csv: ", "1 equations for 4"],
        ),
        (
            of(60, &square, &wave),
            &["--max-lag", "60"],
            ["poor.csv: ", "60 samples"],
        ),
        (
            of(60, &square, &wave),
            &["--max-lag", "59"],
            ["poor.csv: ", "60 samples"],
        ),
        (
            of(40, &square, &wave),
            &["--max-lag", "30", "--n1", "30", "--n2", "30"],
            ["poor.csv: ", "39 equations for 62"],
        ),
        (
            of(900, &|_| 1.0, &wave),
            &[],
            ["poor.csv: ", "the command is constant (1)"],
        ),
        (
            of(900, &square, &|_| 0.25),
            &[],
            ["poor.csv: ", "the output is constant (0.25)"],
        ),
        (
            of(900, &slip, &wave),
            &[],
            ["poor.csv, line 32, column `u`: u = 2", "graded"],
        ),
    ] {
        fs::write(&path, text).unwrap();
        let arguments = [&["identify", file, "-o", model], options].concat();
        let (code, stdout, stderr) = host_fit(&arguments);
        assert_eq!(code, Some(1), "{stderr}");
        assert!(stdout.lines().all(|line| line.starts_with("warning: ")));
        assert_eq!(stderr.trim_end().lines().count(), 1, "{stderr}");
        for part in parts {
            assert!(stderr.contains(part), "{part}: {stderr}");
        }
        assert!(!out.exists());
    }
}

#[test]
fn json_is_one_document_and_nothing_else() {
    let folder = tempfile::tempdir().unwrap();
    let raw = folder.path().join("run.csv");
    let mut text = String::from("t,u,y\n");
    for k in 0..1000 {
        let on = k % 100 >= 20 && k % 100 < 60;
        text.push_str(&format!(
            "{:.3},{},{}\n",
            f64::from(k) * 0.001,
            u8::from(on),
            f64::from(k % 100)
        ));
    }
    fs::write(&raw, text).unwrap();
    let out = folder.path().join("set");
    let (raw, out) = (raw.to_str().unwrap(), out.to_str().unwrap());
    let (code, stdout, stderr) =
        host_fit(&["average", raw, "--period", "0.1", "--out", out, "--json"]);
    assert_eq!((code, stderr.as_str()), (Some(0), ""));
    let document: serde_json::Value = serde_json::from_str(&stdout).unwrap();
    assert_eq!(document["recordings"][0]["periods_used"], 10);
    assert_eq!(
        document["hash"],
        DataSet::load(Path::new(out)).unwrap().hash
    );
    let (code, stdout, _) = host_fit(&["delay", out, "--json"]);
    assert_eq!(code, Some(0));
    let document: serde_json::Value = serde_json::from_str(&stdout).unwrap();
    assert_eq!(document["edges"].as_array().unwrap().len(), 2);
    assert_eq!(document["verdict"], "too-few-edges");
}
