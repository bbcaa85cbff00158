//! Files made by other programs (`import/make.py`) give the expected record; damaged files give an error of one
//! paragraph.

use std::fs;
use std::path::{Path, PathBuf};

use proptest::prelude::*;
use recordings::DataSet;
use recordings::import::{Import, Imported, Mapping, import};

const FILES: [&str; 14] = [
    "v5.mat",
    "v7.mat",
    "struct.mat",
    "matrix.mat",
    "types.mat",
    "small-le.mat",
    "small-be.mat",
    "plain.npz",
    "packed.npz",
    "matrix.npy",
    "rows.npy",
    "german.csv",
    "long.csv",
    "tabs.txt",
];

fn file(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR"))
        .join("tests/import")
        .join(name)
}

fn some(name: &str) -> Option<String> {
    Some(name.to_owned())
}

fn with(change: impl FnOnce(&mut Mapping)) -> Mapping {
    let mut mapping = Mapping::default();
    change(&mut mapping);
    mapping
}

fn imported(name: &str, mapping: &Mapping) -> Imported {
    let request = Import {
        mapping: mapping.clone(),
        ..Import::default()
    };
    import(&[&file(name)], &request).unwrap_or_else(|e| panic!("{name}: {e}"))
}

fn message(name: &str, mapping: Mapping) -> String {
    let request = Import {
        mapping,
        ..Import::default()
    };
    let text = import(&[&file(name)], &request).unwrap_err().to_string();
    assert!(text.contains(name) && !text.contains('\n'), "{text}");
    text
}

/// y as `make.py` computes it.
fn shear(k: usize) -> f64 {
    ((0.25 + 0.5 * (0.3 * k as f64).sin()) * 1e4).round() / 1e4
}

#[test]
fn every_format_gives_the_same_record() {
    let on_off = with(|m| m.u_threshold = Some(2.5));
    let columns = |u: &str, y: &str, t: &str| Mapping {
        t: some(t),
        u: some(u),
        y: some(y),
        ..on_off.clone()
    };
    for (name, mapping, channel) in [
        ("v5.mat", on_off.clone(), true),
        ("v7.mat", on_off.clone(), true),
        ("struct.mat", on_off.clone(), true),
        (
            "matrix.mat",
            columns("data(:,2)", "data(:,3)", "data(:,1)"),
            false,
        ),
        ("plain.npz", on_off.clone(), true),
        ("packed.npz", on_off.clone(), true),
        (
            "matrix.npy",
            columns("matrix[:,1]", "matrix[:,2]", "matrix[:,0]"),
            false,
        ),
        (
            "rows.npy",
            columns("rows[1,:]", "rows[2,:]", "rows[0,:]"),
            false,
        ),
        ("german.csv", on_off.clone(), true),
        ("tabs.txt", on_off, false),
    ] {
        let found = imported(name, &mapping);
        let record = &found.set.records[0];
        assert_eq!(record.sample_period_s, 0.001, "{name}");
        assert_eq!((record.len(), record.t0), (40, 0.0), "{name}");
        for k in 0..40 {
            assert_eq!(record.u[k], f64::from(u8::from(k % 8 >= 4)), "{name} {k}");
            assert!((record.y[k] - shear(k)).abs() < 1e-12, "{name} {k}");
        }
        let wind = record
            .channels
            .iter()
            .find(|(name, _)| name.ends_with("u_inf"));
        assert_eq!(wind.is_some(), channel, "{name}");
        if let Some((_, wind)) = wind {
            assert_eq!(wind[2], 9.75, "{name}");
        }
    }
}

#[test]
fn integers_scales_and_stated_rates_are_understood() {
    let mapping = Mapping {
        u: some("valve"),
        y_scale: Some(1e-4),
        y_offset: Some(1.0),
        ..Mapping::default()
    };
    let found = imported("types.mat", &mapping);
    let record = &found.set.records[0];
    assert_eq!(record.sample_period_s, 0.001, "from fs");
    assert_eq!(record.u[4], 1.0);
    assert!((record.y[7] - 1.0 - shear(7)).abs() < 1e-4);
    let left_out = found.files[0].remarks.join("\n");
    assert!(
        left_out.contains("`z`") && left_out.contains("complex"),
        "{left_out}"
    );

    let single = imported("types.npz", &Mapping::default());
    assert_eq!(single.set.sample_period_s, 0.001, "from 32-bit times");
    assert!(single.set.is_on_off());
    assert!(single.files[0].remarks.join("\n").contains("`objects`"));

    for name in ["small-le.mat", "small-be.mat"] {
        let record = &imported(name, &with(|m| m.period_s = Some(0.5)))
            .set
            .records[0];
        assert_eq!((record.y[39], record.u[39]), (39.0, 1.0), "{name}");
    }
}

#[test]
fn the_folder_loads_and_keeps_the_mapping() {
    let folder = tempfile::tempdir().unwrap();
    let target = folder.path().join("set");
    let request = Import {
        mapping: with(|m| m.u_threshold = Some(2.5)),
        title: some("Ramp"),
        hold_out_from_s: Some(0.03),
        ..Import::default()
    };
    let (german, numpy) = (file("german.csv"), file("plain.npz"));
    let found = import(&[&german, &numpy], &request).unwrap();
    found.save(&target).unwrap();
    let set = DataSet::load(&target).unwrap();
    assert_eq!(set.records, found.set.records);
    let names: Vec<&str> = set.records.iter().map(|r| r.name.as_str()).collect();
    assert_eq!(
        names,
        ["german", "german-held-out", "plain", "plain-held-out"]
    );
    assert_eq!(set.validate().map(|r| r.len() - r.lead).sum::<usize>(), 20);
    let text = fs::read_to_string(target.join("dataset.toml")).unwrap();
    for line in [
        "[record.from]",
        "file = \"german.csv\"",
        "u = \"Ventil\"",
        "u_threshold = 2.5",
        "t_scale = 0.001",
        "u_inf = \"m/s\"",
    ] {
        assert!(text.contains(line), "no {line} in\n{text}");
    }
    // The same mapping reads the next run of the same rig.
    let again = Import {
        mapping: Mapping::of(&target).unwrap(),
        ..Import::default()
    };
    assert_eq!(again.mapping.u.as_deref(), Some("Ventil"));
    let next = import(&[&german], &again).unwrap();
    assert_eq!(next.set.records[0].u, set.records[1].u);
    assert!(Mapping::of(folder.path()).is_err());
}

#[test]
fn faults_name_the_variable_and_the_remedy() {
    for (name, mapping, parts) in [
        (
            "v7.mat",
            with(|m| m.u = some("vlave")),
            vec!["no variable `vlave`", "`valve` (0.02 to 4.97)"],
        ),
        (
            "matrix.mat",
            Mapping::default(),
            vec![
                "which variable is the command u",
                "--u \"data(:,2)\" --u-threshold 2.49",
                "`data(:,1)` (0 to 0.039)",
                "`Ts` = 0.001",
            ],
        ),
        (
            "small-le.mat",
            Mapping::default(),
            vec!["--t NAME", "--period"],
        ),
        (
            "v7.mat",
            with(|m| m.u_threshold = Some(9.0)),
            vec!["variable `valve`", "never crosses", "4.97"],
        ),
        (
            "types.mat",
            with(|m| m.y = some("z")),
            vec!["`z` is complex", "real("],
        ),
        (
            "struct.mat",
            with(|m| m.y = some("cells")),
            vec!["cell array"],
        ),
        (
            "v7.mat",
            with(|m| m.y_scale = Some(0.0)),
            vec!["y_scale", "other than 0"],
        ),
        (
            "records.npy",
            Mapping::default(),
            vec!["array of records", "numpy.savez"],
        ),
        (
            "german.csv",
            with(|m| m.t = some("T")),
            vec!["unit `°C`", "--t-scale"],
        ),
    ] {
        let text = message(name, mapping);
        for part in parts {
            assert!(text.contains(part), "{name}: no `{part}` in: {text}");
        }
    }
    // A voltage is not an on/off command; a remark says that it resembles one.
    let remarks = imported("v7.mat", &Mapping::default()).files[0]
        .remarks
        .join("\n");
    assert!(remarks.contains("--u-threshold 2.5"), "{remarks}");
}

#[test]
fn files_of_other_kinds_are_told_apart() {
    let folder = tempfile::tempdir().unwrap();
    let hdf = b"\x89HDF\r\n\x1a\n".as_slice();
    let mut header = b"MATLAB 7.3 MAT-file, Platform: GLNXA64".to_vec();
    header.resize(512, b' ');
    let new_matlab = [&header, hdf].concat();
    let workbook = fs::read(file("packed.npz")).unwrap();
    let renamed: Vec<u8> = String::from_utf8_lossy(b".npy").bytes().collect();
    let workbook = replace(&workbook, &renamed, b".xml");
    for (name, bytes, parts) in [
        (
            "run.mat",
            new_matlab.as_slice(),
            ["load('run.mat')", "save('run.mat', '-v7')"],
        ),
        ("run.mat", hdf, ["7.3", "'-v7'"]),
        ("run.h5", hdf, ["HDF5", "savez"]),
        (
            "run.mat",
            b"\0\0\0\0old",
            ["version 5 to 7", "save('run.mat'"],
        ),
        ("run.xlsx", &workbook, ["spreadsheet", "CSV"]),
        ("run.csv", b"\x00\x01\x02binary", ["UTF-8", "CSV"]),
        ("run.csv", b"", ["empty", "header"]),
    ] {
        let path = folder.path().join(name);
        fs::write(&path, bytes).unwrap();
        let text = import(&[&path], &Import::default())
            .unwrap_err()
            .to_string();
        for part in parts {
            assert!(text.contains(part), "{name}: no `{part}` in: {text}");
        }
    }
}

fn replace(bytes: &[u8], from: &[u8], to: &[u8]) -> Vec<u8> {
    let mut out = bytes.to_vec();
    for at in 0..out.len().saturating_sub(from.len()) {
        if out[at..].starts_with(from) {
            out[at..at + to.len()].copy_from_slice(to);
        }
    }
    out
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 1500, failure_persistence: None, ..ProptestConfig::default() })]

    /// The import of a changed file ends in valid records or in an error of one paragraph.
    #[test]
    fn damaged_files_never_panic(
        which in 0..FILES.len(),
        changes in prop::collection::vec((any::<prop::sample::Index>(), any::<u8>()), 0..12),
        cut in prop::option::of(any::<prop::sample::Index>()),
        fill_gaps_s in prop::option::of(0.002..1e9),
        split_by in prop::option::of(prop::sample::select(vec!["t", "u", "data(:,1)", "valve"])),
    ) {
        let mut bytes = fs::read(file(FILES[which])).unwrap();
        for (at, value) in changes {
            let at = at.index(bytes.len());
            bytes[at] = value;
        }
        if let Some(cut) = cut {
            bytes.truncate(cut.index(bytes.len()));
        }
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join(FILES[which]);
        fs::write(&path, &bytes).unwrap();
        let mapping = Mapping { u_threshold: Some(2.5), period_s: Some(0.001), fill_gaps_s, split_by: split_by.map(str::to_owned), ..Mapping::default() };
        match import(&[&path], &Import { mapping, ..Import::default() }) {
            Ok(found) => prop_assert!(found.set.records.iter().all(|record| record.len() >= 2)),
            Err(error) => {
                let text = error.to_string();
                prop_assert!(!text.contains('\n') && text.contains(FILES[which]), "{}", text);
            }
        }
    }
}

/// A variable can be named as in the file, with its unit.
#[test]
fn a_variable_is_found_by_its_heading() {
    let by = |t: &str, u: &str| {
        let mapping = Mapping {
            t: some(t),
            u: some(u),
            y: some("y"),
            u_threshold: Some(2.5),
            ..Mapping::default()
        };
        let set = imported("german.csv", &mapping).set;
        let [record] = &set.records[..] else {
            panic!("one file is one record");
        };
        (set.sample_period_s, record.u.clone(), record.y.clone())
    };
    assert_eq!(by("Zeit", "Ventil"), by("Zeit [ms]", "Ventil (V)"));
    let wrong = Mapping {
        t: some("Zeit [s]"),
        u: some("Ventil"),
        y: some("y"),
        ..Mapping::default()
    };
    assert!(message("german.csv", wrong).contains("no variable `Zeit [s]`"));
}
