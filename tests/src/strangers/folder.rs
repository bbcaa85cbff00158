//! The cases of a folder of sets.

use super::case::{Case, Expected, Right, Step};
use anyhow::{Context, Result, bail};
use std::fs;
use std::path::{Path, PathBuf};

const EXPECTED: &str = "expected.toml";
/// Commands by default.
const USUAL: [Step; 3] = [Step::Identify, Step::Delay, Step::Diagnose];
/// Commands for measured sets; `delay` needs an on/off command.
const MEASURED: [Step; 2] = [Step::Identify, Step::Diagnose];
/// Search depth for sets of the tests of `recordings`.
const DEPTH: usize = 4;

/// The sets of this project.
pub(super) fn bundled() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("data/strangers")
}

/// Every case of every set in `folder`: the cases of an `expected.toml`, there or in the bundled folder of the same
/// name; pairs of `*_train*.csv` and `*_test*.csv` are measured sets.
pub(super) fn cases(folder: &Path) -> Result<Vec<Case>> {
    let mut sets = Vec::new();
    let entries = fs::read_dir(folder).with_context(|| folder.display().to_string())?;
    for entry in entries {
        let path = entry.with_context(|| folder.display().to_string())?.path();
        if path.is_dir() {
            sets.push(path);
        }
    }
    sets.sort();
    let mut cases = Vec::new();
    for set in sets {
        let name = name_of(&set);
        let own = set.join(EXPECTED);
        let known = bundled().join(&name).join(EXPECTED);
        if own.is_file() {
            cases.extend(expected(&own, &set, &name)?);
        } else if known.is_file() {
            cases.extend(expected(&known, &set, &name)?);
        } else {
            cases.extend(measured(&set, &name)?);
        }
    }
    if cases.is_empty() {
        bail!(
            "{}: no set has {EXPECTED} or files *_train*.csv and *_test*.csv",
            folder.display()
        );
    }
    Ok(cases)
}

fn name_of(path: &Path) -> String {
    let name = path.file_name().unwrap_or_default();
    name.to_string_lossy().into_owned()
}

fn expected(file: &Path, set: &Path, name: &str) -> Result<Vec<Case>> {
    let text = fs::read_to_string(file).with_context(|| file.display().to_string())?;
    let expected: Expected = toml::from_str(&text).with_context(|| file.display().to_string())?;
    let mut cases = Vec::new();
    for case in expected.cases {
        let right: Right = case
            .right
            .try_into()
            .with_context(|| format!("{}, case {}", file.display(), case.name))?;
        let paths = |files: &[String]| -> Vec<PathBuf> {
            files.iter().map(|f| record_of(set, name, f)).collect()
        };
        cases.push(Case {
            set: name.to_owned(),
            kind: expected.kind.clone(),
            files: paths(&case.files),
            validate: paths(&case.validate),
            import: case.import,
            commands: case.commands.unwrap_or_else(|| USUAL.to_vec()),
            same_answer_as: case.same_answer_as,
            name: case.name,
            right,
        });
    }
    Ok(cases)
}

/// A file of a set, or of the set of that name in the tests of `recordings`.
fn record_of(set: &Path, name: &str, file: &str) -> PathBuf {
    let here = set.join(file);
    if here.is_file() {
        return here;
    }
    let recordings = Path::new(env!("CARGO_MANIFEST_DIR")).join("../recordings");
    elsewhere(&recordings, name, DEPTH)
        .map(|folder| folder.join(file))
        .filter(|path| path.is_file())
        .unwrap_or(here)
}

/// The first folder called `name` at most `depth` below `folder`.
fn elsewhere(folder: &Path, name: &str, depth: usize) -> Option<PathBuf> {
    let entries = fs::read_dir(folder).ok()?;
    let mut folders: Vec<PathBuf> = entries
        .filter_map(|entry| Some(entry.ok()?.path()))
        .filter(|path| path.is_dir())
        .collect();
    folders.sort();
    let found = folders.iter().find(|path| name_of(path) == name).cloned();
    found.or_else(|| {
        let below = depth.checked_sub(1)?;
        folders.iter().find_map(|path| elsewhere(path, name, below))
    })
}

/// A measured set: estimation files, and test files as validation records.
fn measured(set: &Path, name: &str) -> Result<Vec<Case>> {
    let entries = fs::read_dir(set).with_context(|| set.display().to_string())?;
    let (mut files, mut validate) = (Vec::new(), Vec::new());
    for entry in entries {
        let path = entry.with_context(|| set.display().to_string())?.path();
        let file = name_of(&path);
        if !file.ends_with(".csv") {
            continue;
        }
        if file.contains("_train") {
            files.push(path);
        } else if file.contains("_test") {
            validate.push(path);
        }
    }
    if files.is_empty() || validate.is_empty() {
        return Ok(Vec::new());
    }
    files.sort();
    validate.sort();
    Ok(vec![Case {
        set: name.to_owned(),
        name: "held-out".to_owned(),
        kind: "measured".to_owned(),
        files,
        validate,
        commands: MEASURED.to_vec(),
        ..Case::default()
    }])
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_bundled_sets_are_read_and_their_records_are_there() {
        let cases = cases(&bundled()).expect("every expected.toml");
        assert!(cases.len() > 20, "{}", cases.len());
        let elsewhere = ["logs", "rounded-clock", "two-clocks", "tclab-siso"];
        for case in &cases {
            let mut files = case.files.iter().chain(&case.validate);
            let there = files.all(|file| file.is_file());
            assert!(there || elsewhere.contains(&&*case.set), "{case:?}");
            if let Some(other) = &case.same_answer_as {
                let named = |c: &Case| c.set == case.set && c.name == *other;
                assert!(cases.iter().any(named), "{case:?}");
            }
        }
    }

    #[test]
    fn keys_that_nobody_knows_are_refused() {
        let folder = tempfile::tempdir().expect("a folder");
        let set = folder.path().join("set");
        fs::create_dir(&set).expect("a folder");
        let text = "kind = 'k'\n[[case]]\nname = 'a'\nfiles = ['a.csv']\ndelay = [1, 2]\n";
        fs::write(set.join(EXPECTED), text).expect("a file");
        let error = cases(folder.path()).expect_err("a key too many");
        assert!(format!("{error:#}").contains("delay"), "{error:#}");
    }

    #[test]
    fn train_and_test_files_are_a_measured_set() {
        let folder = tempfile::tempdir().expect("a folder");
        let set = folder.path().join("arm");
        fs::create_dir(&set).expect("a folder");
        for file in ["x_train.csv", "x_test_a.csv", "x_test_b.csv", "notes.txt"] {
            fs::write(set.join(file), "t,u,y\n").expect("a file");
        }
        let cases = cases(folder.path()).expect("one case");
        assert_eq!(cases.len(), 1);
        assert_eq!((cases[0].files.len(), cases[0].validate.len()), (1, 2));
    }
}
