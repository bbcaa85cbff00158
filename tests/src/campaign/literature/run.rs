//! Runs a case like a user: a folder, `identify`, `diagnose`.

use std::fs;
use std::path::Path;

use super::case::Case;
use super::row::Row;
use crate::campaign::program::Program;

/// Runs a case. A failure gives a result too.
#[must_use]
pub fn run(case: &Case, program: &Program) -> Row {
    let mut row = Row::of(case);
    let key = row.key.clone();
    let fill = |row: &mut Row, folder: &Path| fill(row, case, program, folder);
    row.failure = program.in_folder(&key, &mut row, fill, |_| false);
    row
}

fn fill(row: &mut Row, case: &Case, program: &Program, folder: &Path) -> Result<(), String> {
    let plan = case.plan().map_err(|e| e.to_string())?;
    let also_right = plan.model.also_right.iter();
    row.also_right = also_right.map(|name| (*name).to_owned()).collect();
    let inside = |name: &str| folder.join(name).to_string_lossy().into_owned();
    let [data, given, found] = ["set", "given.toml", "found.toml"].map(&inside);
    // These files may be left over from an earlier run.
    let _ = fs::remove_dir_all(&data);
    let _ = fs::remove_file(&found);
    fs::create_dir_all(folder).map_err(|e| e.to_string())?;
    let set = plan.build().map_err(|e| e.to_string())?.data;
    set.save(Path::new(&data)).map_err(|e| e.to_string())?;
    fs::write(inside("answer.toml"), plan.answer()).map_err(|e| e.to_string())?;
    row.identify = program.json(&["identify", &data, "-o", &given], folder)?.1;
    let document;
    (document, row.diagnose) = program.json(&["diagnose", &given, &data, "-o", &found], folder)?;
    row.hear(&document)
}
