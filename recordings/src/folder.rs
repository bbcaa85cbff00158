//! A data set on disk: a folder with `dataset.toml` and CSV files, or one CSV file.

use std::fs;
use std::io::{self, Write};
use std::path::{Component, Path, PathBuf};

use crate::error::{DataError, DataProblem, FilePlace, printable};
use crate::import::{From, ImportProblem, Mapping};
use crate::output::{OutputError, Staging};
use crate::record::{Origin, Record, Use, check_period};
use crate::sampling::Stated;
use crate::set::{DataSet, MANIFEST, Plant};
use crate::table::Table;

#[derive(Debug, serde::Serialize, serde::Deserialize)]
#[serde(deny_unknown_fields)]
struct Manifest {
    #[serde(default, skip_serializing_if = "Option::is_none")]
    title: Option<String>,
    sample_period_s: f64,
    #[serde(default, skip_serializing_if = "Plant::is_flow")]
    plant: Plant,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    input: Option<Input>,
    #[serde(default)]
    record: Vec<Entry>,
}

/// Kind of the command, if stated in the file. Otherwise each record decides: a command of 0 and 1 is on/off,
/// any other is graded.
#[derive(Debug, Clone, Copy, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
#[serde(rename_all = "kebab-case")]
enum Input {
    OnOff,
    Graded,
}

#[derive(Debug, serde::Serialize, serde::Deserialize)]
#[serde(deny_unknown_fields)]
struct Entry {
    name: String,
    file: String,
    #[serde(rename = "use")]
    role: Use,
    /// Command before the first sample; the first value of u if omitted.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    u_before: Option<f64>,
    /// Number of unscored samples at the start.
    #[serde(default, skip_serializing_if = "is_zero")]
    lead_samples: usize,
    /// Mapping of an import, for users and for `host-fit import --like`; not needed for loading.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    from: Option<From>,
}

fn is_zero(samples: &usize) -> bool {
    *samples == 0
}

impl DataSet {
    /// Loads a folder with `dataset.toml`, or one CSV file (then one `identify` record named by the file's stem).
    ///
    /// ```
    /// let set = recordings::DataSet::load("../data/paper-like".as_ref())?;
    /// assert_eq!(set.sample_period_s, 0.001);
    /// assert!(set.is_on_off() && set.validate().count() > 0);
    /// # Ok::<(), recordings::DataError>(())
    /// ```
    ///
    /// # Errors
    /// [`DataError`] naming file, line and column (or TOML key) of the first fault found.
    pub fn load(path: &Path) -> Result<Self, DataError> {
        let kind = fs::metadata(path).map_err(|e| DataError::unreadable(path, e))?;
        if kind.is_dir() {
            return load_folder(path);
        }
        if path.file_name().is_some_and(|n| n == MANIFEST) {
            return load_folder(folder_of(path));
        }
        let name = path
            .file_stem()
            .map_or_else(|| "record".into(), |s| s.to_string_lossy().into_owned());
        let (record, origin) = Table::load(path, None)?.into_record(&name, Use::Identify)?;
        let set = DataSet::assemble(None, vec![record], vec![origin], &FilePlace::file(path))?;
        set.refuse_strays()?;
        Ok(set)
    }

    /// Writes `dataset.toml` and one CSV per record into the folder `dir`, all together or not at all.
    ///
    /// Numbers are written in the shortest form that reads back to the same bits.
    ///
    /// # Errors
    /// [`OutputError`] if the folder cannot be written; no partial output remains.
    pub fn save(&self, dir: &Path) -> Result<(), OutputError> {
        self.save_from(dir, &[])
    }

    /// The files in which the records are saved, in their order.
    pub(crate) fn file_names(&self) -> Vec<String> {
        let mut names: Vec<String> = Vec::with_capacity(self.records.len());
        for record in &self.records {
            let stem = file_stem(&record.name);
            let file = (1..)
                .map(|i| match i {
                    1 => format!("{stem}.csv"),
                    _ => format!("{stem}-{i}.csv"),
                })
                .find(|name| names.iter().all(|taken| !taken.eq_ignore_ascii_case(name)));
            names.push(file.unwrap_or_default());
        }
        names
    }

    /// As [`DataSet::save`], with the mapping of each record.
    pub(crate) fn save_from(&self, dir: &Path, from: &[From]) -> Result<(), OutputError> {
        let mut staging = Staging::new(dir)?;
        let mut entries: Vec<Entry> = Vec::with_capacity(self.records.len());
        for ((index, record), file) in self.records.iter().enumerate().zip(self.file_names()) {
            staging.write(&file, |w| write_record(record, w))?;
            entries.push(Entry {
                name: record.name.clone(),
                file,
                role: record.role,
                u_before: record.u_before,
                lead_samples: record.lead,
                from: from.get(index).cloned(),
            });
        }
        let manifest = Manifest {
            title: self.title.clone(),
            sample_period_s: self.sample_period_s,
            plant: self.plant,
            // Stray values were declared as graded, or the set was built in memory.
            input: self.refuse_strays().is_err().then_some(Input::Graded),
            record: entries,
        };
        let text = toml::to_string(&manifest).map_err(|e| OutputError::Io {
            path: dir.join(MANIFEST),
            cause: io::Error::other(e),
        })?;
        staging.write(MANIFEST, |w| w.write_all(text.as_bytes()))?;
        staging.commit()
    }
}

fn folder_of(manifest: &Path) -> &Path {
    match manifest.parent() {
        Some(parent) if !parent.as_os_str().is_empty() => parent,
        _ => Path::new("."),
    }
}

/// The mapping with which the records of an imported data set were made; the first one if they differ.
///
/// # Errors
/// [`DataError`] if there is no readable `dataset.toml`, or it contains no mapping.
pub(crate) fn mapping_of(folder: &Path) -> Result<Mapping, DataError> {
    let folder = match folder.file_name().is_some_and(|n| n == MANIFEST) {
        true => folder_of(folder),
        false => folder,
    };
    let (path, manifest) = read_manifest(folder)?;
    let mut from = manifest.record.into_iter().filter_map(|entry| entry.from);
    from.next()
        .map(|from| from.mapping)
        .ok_or_else(|| FilePlace::file(&path).error(ImportProblem::NoMapping.into()))
}

fn read_manifest(folder: &Path) -> Result<(PathBuf, Manifest), DataError> {
    let path = folder.join(MANIFEST);
    let bytes = match fs::read(&path) {
        Ok(bytes) => bytes,
        Err(e) if e.kind() == io::ErrorKind::NotFound => {
            return Err(FilePlace::file(folder)
                .error(DataProblem::NoManifest(folder.display().to_string())));
        }
        Err(e) => return Err(DataError::unreadable(&path, e)),
    };
    let place = FilePlace::file(&path);
    let text = String::from_utf8(bytes).map_err(|_| place.error(DataProblem::NotText))?;
    let text = text.strip_prefix('\u{feff}').unwrap_or(&text);
    let manifest = toml::from_str(text).map_err(|e| manifest_error(&path, text, &e))?;
    Ok((path, manifest))
}

fn load_folder(folder: &Path) -> Result<DataSet, DataError> {
    let (path, manifest) = read_manifest(folder)?;
    let place = FilePlace::file(&path);
    check_period(manifest.sample_period_s)
        .map_err(|problem| place.clone().at_key("sample_period_s").error(problem))?;
    let mut records: Vec<Record> = Vec::with_capacity(manifest.record.len());
    let mut origins = Vec::with_capacity(manifest.record.len());
    for entry in &manifest.record {
        let bad_name = entry.name.trim().is_empty() || entry.name.chars().any(char::is_control);
        if bad_name {
            return Err(place.at_key("name").error(DataProblem::BadName));
        }
        let file = resolve(folder, &entry.file, &place)?;
        let taken = records.iter().map(Record::bytes).sum();
        let stated = Stated {
            period_s: manifest.sample_period_s,
            by: "`sample_period_s` in dataset.toml is",
        };
        let table = Table::load_beside(&file, Some(stated), taken)?;
        let (mut record, origin): (Record, Origin) = table.into_record(&entry.name, entry.role)?;
        (record.u_before, record.lead) = (entry.u_before, entry.lead_samples);
        record.check_start(&place)?;
        records.push(record);
        origins.push(origin);
    }
    let mut set = DataSet::assemble(manifest.title, records, origins, &place)?;
    set.plant = manifest.plant;
    match manifest.input {
        Some(Input::OnOff) => set.require_on_off()?,
        Some(Input::Graded) => {}
        None => set.refuse_strays()?,
    }
    Ok(set)
}

/// The path of a record's file, which has to be a file inside the folder, also after following links.
fn resolve(folder: &Path, file: &str, manifest: &FilePlace) -> Result<PathBuf, DataError> {
    let place = || manifest.clone().at_key("file");
    let relative = Path::new(file);
    let plain = relative
        .components()
        .all(|c| matches!(c, Component::Normal(_) | Component::CurDir));
    if !plain || file.contains('\0') {
        return Err(place().error(DataProblem::OutsideFolder(printable(file))));
    }
    let path = folder.join(relative);
    let unreadable = |e: io::Error| DataError::unreadable(&path, e);
    let real = fs::canonicalize(&path).map_err(unreadable)?;
    let root = fs::canonicalize(folder).map_err(unreadable)?;
    if !real.starts_with(&root) {
        return Err(place().error(DataProblem::OutsideFolder(printable(file))));
    }
    if !real.is_file() {
        return Err(place().error(DataProblem::NotAFile(printable(file))));
    }
    Ok(path)
}

/// The TOML error in one paragraph, with its line and key.
fn manifest_error(path: &Path, text: &str, error: &toml::de::Error) -> DataError {
    let mut place = FilePlace::file(path);
    if let Some(span) = error.span() {
        let before = text.get(..span.start).unwrap_or(text);
        place.line = Some(before.matches('\n').count() as u64 + 1);
        let line_start = before.rfind('\n').map_or(0, |at| at + 1);
        let line = text.get(line_start..).and_then(|l| l.lines().next());
        place.key = line
            .and_then(|l| l.split_once('='))
            .map(|(key, _)| key.trim().to_owned())
            .filter(|key| !key.is_empty());
    }
    let message = error
        .message()
        .split_whitespace()
        .collect::<Vec<_>>()
        .join(" ");
    place.error(DataProblem::Manifest(message))
}

/// The record's name as a file name: letters, digits, `-`, `_` and `.` stay, other characters become `-`.
fn file_stem(name: &str) -> String {
    let stem: String = name
        .chars()
        .map(|c| match c {
            c if c.is_alphanumeric() || matches!(c, '-' | '_' | '.') => c,
            _ => '-',
        })
        .take(80)
        .collect();
    let stem = stem.trim_start_matches('.').to_owned();
    if stem.is_empty() {
        "record".into()
    } else {
        stem
    }
}

/// Writes a record as CSV, numbers in the shortest form that reads back to the same bits.
fn write_record(record: &Record, w: &mut dyn Write) -> io::Result<()> {
    let columns: Vec<(&str, &[f64])> = record.columns().collect();
    let mut csv = csv::Writer::from_writer(w);
    csv.write_field("t")?;
    for (name, _) in &columns {
        csv.write_field(name)?;
    }
    csv.write_record(None::<&[u8]>)?;
    let decimals = time_decimals(record);
    for k in 0..record.len() {
        csv.write_field(format!("{:.decimals$}", record.time(k)))?;
        for (_, values) in &columns {
            let value = values.get(k).copied().unwrap_or(f64::NAN);
            csv.write_field(shortest(value))?;
        }
        csv.write_record(None::<&[u8]>)?;
    }
    csv.flush()
}

/// The number in the fewest digits that read back to the same bits, never longer than 24 characters.
fn shortest(value: f64) -> String {
    let plain = value.to_string();
    match plain.len() <= 24 {
        true => plain,
        false => format!("{value:e}"),
    }
}

/// Number of decimals of the written times: enough that the sampling period and t0 read back exactly if possible
/// (0.001 → 3), at most 12.
fn time_decimals(record: &Record) -> usize {
    let exact = |decimals: usize| {
        let kept = |x: f64| format!("{x:.decimals$}").parse() == Ok(x);
        kept(record.sample_period_s) && kept(record.t0)
    };
    (0..12).find(|&d| exact(d)).unwrap_or(12)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn write(folder: &Path, name: &str, text: &str) {
        fs::write(folder.join(name), text).unwrap();
    }

    const CSV: &str = "t,u,y\n0.000,0,0\n0.001,1,0.5\n0.002,1,0.75\n";

    fn message(manifest: &str) -> String {
        let folder = tempfile::tempdir().unwrap();
        write(folder.path(), "a.csv", CSV);
        write(folder.path(), MANIFEST, manifest);
        let text = DataSet::load(folder.path()).unwrap_err().to_string();
        assert!(!text.contains('\n'), "one paragraph: {text}");
        text
    }

    #[test]
    fn folder_manifest_and_single_file_load() {
        let folder = tempfile::tempdir().unwrap();
        write(folder.path(), "a.csv", CSV);
        write(
            folder.path(),
            MANIFEST,
            "title = \"T\"\nsample_period_s = 0.001\n[[record]]\nname = \"one\"\nfile = \"a.csv\"\nuse = \"validate\"\n",
        );
        for path in [folder.path().to_path_buf(), folder.path().join(MANIFEST)] {
            let set = DataSet::load(&path).unwrap();
            assert_eq!(set.title.as_deref(), Some("T"));
            assert_eq!(set.records[0].name, "one");
            assert_eq!(set.records[0].role, Use::Validate);
        }
        let set = DataSet::load(&folder.path().join("a.csv")).unwrap();
        assert_eq!(
            (set.records[0].name.as_str(), set.records[0].role),
            ("a", Use::Identify)
        );
        assert_eq!(set.sample_period_s, 0.001);
    }

    #[test]
    fn manifest_faults_name_the_key() {
        let head = "sample_period_s = 0.001\n";
        let entry = |file: &str| {
            format!("{head}[[record]]\nname = \"a\"\nfile = \"{file}\"\nuse = \"identify\"\n")
        };
        for (manifest, part) in [
            (format!("{head}smaple = 1\n"), "smaple"),
            (format!("{}speed = 3\n", entry("a.csv")), "speed"),
            (entry("a.csv").replace("identify", "train"), "`train`"),
            (entry("a.csv").replace("use = \"identify\"\n", ""), "`use`"),
            (
                entry("a.csv").replace("0.001", "\"fast\""),
                "line 1, key `sample_period_s`",
            ),
            (
                entry("a.csv").replace("0.001", "-1"),
                "key `sample_period_s`",
            ),
            (
                entry("a.csv").replace("0.001", "0.002"),
                "a.csv, line 3, column `t`",
            ),
            (entry("../a.csv"), "key `file`: the path `../a.csv` leaves"),
            (entry("/etc/passwd"), "leaves the data set's folder"),
            (entry("."), "is not a file"),
            (entry("none.csv"), "none.csv: cannot be read"),
            (head.to_owned(), "[[record]]"),
            (
                entry("a.csv").replace(head, &format!("{head}input = \"analog\"\n")),
                "`analog`",
            ),
            (
                format!("{}{}", entry("a.csv"), entry("a.csv").replace(head, "")),
                "used twice",
            ),
            ("= 3".to_owned(), "line 1"),
            (entry("a.csv").replace("\"a\"", "\"\""), "key `name`"),
            (
                format!("{}lead_samples = 3\n", entry("a.csv")),
                "dataset.toml, key `lead_samples`: lead_samples is 3",
            ),
            (
                format!("{}u_before = inf\n", entry("a.csv")),
                "dataset.toml, key `u_before`",
            ),
        ] {
            let text = message(&manifest);
            assert!(text.contains(part), "{manifest}\n-> {text}");
        }
        let folder = tempfile::tempdir().unwrap();
        let text = DataSet::load(folder.path()).unwrap_err().to_string();
        assert!(text.contains("no dataset.toml"), "{text}");
    }

    /// A stray value in an on/off command is an error unless the set declares a graded input, which is saved
    /// with it.
    #[test]
    fn levels_of_a_graded_input_are_no_slips() {
        let folder = tempfile::tempdir().unwrap();
        let slip: String = (0..60).fold("t,u,y\n".to_owned(), |text, k| {
            let u = if k == 40 { 2 } else { k / 10 % 2 };
            format!("{text}{:.3},{u},{}\n", f64::from(k) * 0.001, k % 7)
        });
        write(folder.path(), "a.csv", &slip);
        let manifest = |input: &str| {
            format!(
                "sample_period_s = 0.001\n{input}[[record]]\nname = \"a\"\nfile = \"a.csv\"\nuse = \"identify\"\n"
            )
        };
        let load = |input: &str| {
            write(folder.path(), MANIFEST, &manifest(input));
            DataSet::load(folder.path())
        };
        for stated in ["", "input = \"on-off\"\n"] {
            let text = load(stated).unwrap_err().to_string();
            assert!(text.contains("a.csv, line 42, column `u`: u = 2"), "{text}");
        }
        let graded = load("input = \"graded\"\n").unwrap();
        assert_eq!(graded.records[0].u[40], 2.0);
        let copy = folder.path().join("copy");
        graded.save(&copy).unwrap();
        assert_eq!(DataSet::load(&copy).unwrap().hash, graded.hash);
    }

    #[cfg(unix)]
    #[test]
    fn a_link_may_not_lead_out_of_the_folder() {
        let (folder, other) = (tempfile::tempdir().unwrap(), tempfile::tempdir().unwrap());
        write(other.path(), "secret.csv", CSV);
        let link = folder.path().join("a.csv");
        std::os::unix::fs::symlink(other.path().join("secret.csv"), &link).unwrap();
        write(
            folder.path(),
            MANIFEST,
            "sample_period_s = 0.001\n[[record]]\nname = \"a\"\nfile = \"a.csv\"\nuse = \"identify\"\n",
        );
        let text = DataSet::load(folder.path()).unwrap_err().to_string();
        assert!(text.contains("leaves the data set's folder"), "{text}");
    }

    #[test]
    fn what_is_saved_loads_back_to_the_same_bits() {
        let folder = tempfile::tempdir().unwrap();
        let n = 300;
        let mut a = Record::new(
            "8 Hz / 50 %",
            Use::Identify,
            0.001,
            (0..n).map(|k| f64::from(k % 2)).collect(),
            (0..n).map(|k| (f64::from(k) * 0.1).sin() / 3.0).collect(),
        );
        a.y_sd = Some(vec![1e-7; n as usize]);
        a.channels
            .insert("wall, \"T\"".into(), vec![293.15; n as usize]);
        let mut b = a.clone();
        b.name = "8 Hz : 50 %".into();
        b.role = Use::Validate;
        b.t0 = 12.5;
        (b.u_before, b.lead) = (Some(0.25), 100);
        let set = DataSet::from_records(Some("A \"title\"".into()), vec![a, b]).unwrap();
        let target = folder.path().join("set");
        set.save(&target).unwrap();
        let again = DataSet::load(&target).unwrap();
        assert_eq!(again.records, set.records);
        assert_eq!((again.hash, again.title), (set.hash, set.title));
    }

    #[test]
    fn a_set_that_cannot_be_written_leaves_nothing() {
        let folder = tempfile::tempdir().unwrap();
        let record = Record::new("a", Use::Identify, 1.0, vec![0.0, 1.0], vec![0.0, 1.0]);
        let set = DataSet::from_records(None, vec![record]).unwrap();
        write(folder.path(), "file", "");
        assert!(set.save(&folder.path().join("file")).is_err());
        assert!(set.save(&folder.path().join("no/such/folder")).is_err());
        assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 1);
    }

    #[test]
    fn the_bundled_ramp_records_load() {
        let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../data/ramp-cfd");
        let set = DataSet::load(&folder).unwrap();
        assert_eq!(set.sample_period_s, 0.001);
        assert!(set.is_on_off());
        assert!(set.records.iter().all(|r| r.len() == 10_000));
        let names: Vec<&str> = set.validate().map(|r| r.name.as_str()).collect();
        assert_eq!(names, ["4Hz80"]);
    }

    #[test]
    fn real_recordings_load_with_their_own_sampling_periods() {
        let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../shared/data/real");
        for (file, period) in [
            ("silverbox/silverbox_train_multisine.csv", 0.0016384),
            ("emps/emps_train.csv", 0.001),
            ("gas_furnace/gas_furnace_train.csv", 9.0),
            ("dc_motor_generator/dc_motor_generator_train.csv", 1.0),
            ("robot_arm_abb/robot_arm_train.csv", 0.0005),
            (
                "wiener_hammerstein_2009/wh_train_first80000.csv",
                1.0 / 51200.0,
            ),
        ] {
            let path = folder.join(file);
            if path.exists() {
                assert_eq!(
                    DataSet::load(&path).unwrap().sample_period_s,
                    period,
                    "{file}"
                );
            }
        }
    }
}
