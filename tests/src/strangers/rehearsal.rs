//! A complete run of a case.

use super::answer::{Answer, ask};
use super::case::{Case, Step};
use super::check::{Heard, wrong};
use super::{Options, Row};
use host_fit::baseline::{BaselineFits, Baselines};
use host_fit::data::{DataSet, Record, Use};
use serde_json::Value;
use std::fs;
use std::path::{Path, PathBuf};

/// The effect for `extend`; plausible on any rig.
const EFFECT: &str = "hot-film-lag";

/// Runs every command of `case` in a folder of its own.
pub(super) fn rehearse(case: &Case, options: &Options) -> Row {
    let mut row = Row {
        set: case.set.clone(),
        case: case.name.clone(),
        kind: case.kind.clone(),
        ..Row::default()
    };
    let missing = case.files.iter().chain(&case.validate);
    if let Some(path) = missing.into_iter().find(|path| !path.is_file()) {
        let name = path.file_name().unwrap_or_default().to_string_lossy();
        row.skipped = Some(format!("{name} is not there"));
        return row;
    }
    let scratch = match tempfile::tempdir() {
        Ok(folder) => folder,
        Err(error) => {
            row.skipped = Some(format!("no temporary folder: {error}"));
            return row;
        }
    };
    let heard = Stage {
        case,
        options,
        scratch: scratch.path(),
    }
    .play();
    describe(&mut row, &heard);
    row.wrong = wrong(case, &heard);
    row
}

/// Working folder of a case.
struct Stage<'a> {
    case: &'a Case,
    options: &'a Options,
    scratch: &'a Path,
}

fn text(path: &Path) -> String {
    path.to_string_lossy().into_owned()
}

impl Stage<'_> {
    fn ask(&self, name: &str, arguments: &[&str]) -> Answer {
        let arguments: Vec<String> = arguments.iter().map(|a| (*a).to_owned()).collect();
        ask(name, &arguments, self.scratch, self.options.limit)
    }

    fn play(&self) -> Heard {
        let mut heard = Heard::default();
        let data = match self.data(&mut heard) {
            Ok(data) => data,
            Err(reason) => {
                heard.unusable = Some(reason);
                return heard;
            }
        };
        heard.data = DataSet::load(&data).ok();
        let mut steps = self.case.commands.clone();
        if self.options.all_commands && !steps.is_empty() {
            steps.extend([Step::Discover, Step::Extend]);
        }
        steps.retain(|step| !self.options.without.contains(step));
        steps.sort_unstable();
        steps.dedup();
        let data = text(&data);
        let model = text(&self.scratch.join("model.toml"));
        for step in steps {
            let found = match step {
                Step::Identify => self.ask("identify", &["identify", &data, "-o", &model]),
                Step::Delay => {
                    heard.delay = Some(self.ask("delay", &["delay", &data]));
                    continue;
                }
                _ if !Path::new(&model).is_file() => continue,
                Step::Diagnose => self.handing_over("diagnose", &model, &data, &[]),
                Step::Discover => self.handing_over("discover", &model, &data, &[]),
                Step::Extend => self.handing_over("extend", &model, &data, &["--effect", EFFECT]),
            };
            let file = match step {
                Step::Identify => PathBuf::from(&model),
                _ => self.scratch.join(format!("{}.toml", found.command)),
            };
            let name = format!("compare-{}", found.command);
            let compared = file.is_file().then(|| {
                let file = text(&file);
                self.ask(&name, &["compare", &file, &data])
            });
            heard.models.push((step, found, compared));
        }
        heard.judge_baselines();
        heard
    }

    fn handing_over(&self, name: &str, model: &str, data: &str, more: &[&str]) -> Answer {
        let out = text(&self.scratch.join(format!("{name}.toml")));
        let mut arguments = vec![name, model, data, "-o", &out];
        arguments.extend(more);
        self.ask(name, &arguments)
    }

    /// Input of the commands: a file, an imported folder, or a folder created here.
    fn data(&self, heard: &mut Heard) -> Result<PathBuf, String> {
        let folder = self.scratch.join("data");
        if let Some(options) = &self.case.import {
            let files: Vec<String> = self.case.files.iter().map(|f| text(f)).collect();
            let out = text(&folder);
            let mut arguments = vec!["import"];
            arguments.extend(files.iter().map(String::as_str));
            arguments.extend(options.iter().map(String::as_str));
            arguments.extend(["-o", &out]);
            let answer = self.ask("import", &arguments);
            let complaint = answer.complaint();
            let exit = answer.exit;
            heard.import = Some(answer);
            return match exit {
                Some(0) => Ok(folder),
                _ => Err(format!("import: {complaint}")),
            };
        }
        if let ([file], []) = (&*self.case.files, &*self.case.validate) {
            return Ok(file.clone());
        }
        put_together(self.case, &folder).map(|()| folder)
    }
}

/// A folder with the records of a case and a `dataset.toml`.
fn put_together(case: &Case, folder: &Path) -> Result<(), String> {
    let first = case.files.first().ok_or("no estimation record")?;
    let period = DataSet::load(first).map_err(|error| error.to_string())?;
    fs::create_dir_all(folder).map_err(|error| error.to_string())?;
    let mut manifest = format!("sample_period_s = {}\n", period.sample_period_s);
    let parts = [("identify", &case.files), ("validate", &case.validate)];
    for (role, files) in parts {
        for file in files {
            let name = file.file_name().unwrap_or_default();
            fs::copy(file, folder.join(name)).map_err(|error| error.to_string())?;
            let (name, stem) = (text(Path::new(name)), file.file_stem().unwrap_or_default());
            let stem = stem.to_string_lossy();
            manifest +=
                &format!("\n[[record]]\nname = \"{stem}\"\nfile = \"{name}\"\nuse = \"{role}\"\n");
        }
    }
    fs::write(folder.join("dataset.toml"), manifest).map_err(|error| error.to_string())
}

impl Heard {
    /// Fits the baselines and scores them on the samples that the program scored.
    fn judge_baselines(&mut self) {
        let (Some(data), Some(compared)) = (&self.data, self.compared(Step::Identify)) else {
            return;
        };
        let learning: Vec<&Record> = data.identify().collect();
        let found = Baselines::fit(&learning);
        let role = if data.validate().count() > 0 {
            Use::Validate
        } else {
            Use::Identify
        };
        let scored = |record: &Record| {
            let samples = rows(compared).find(|row| row["name"] == *record.name);
            samples.and_then(|row| row["samples"].as_u64()).unwrap_or(0) as usize
        };
        let judged: Vec<_> = data
            .records
            .iter()
            .filter(|record| record.role == role)
            .map(|record| {
                (
                    record,
                    record.len().saturating_sub(scored(record))..record.len(),
                )
            })
            .collect();
        self.fits = found.fit_percent(&judged);
        // Without scored samples a baseline is meaningless.
        if judged.iter().all(|(_, scored)| scored.is_empty()) {
            self.fits = BaselineFits::default();
        }
    }
}

/// The rows of records in a document of `compare` or `identify`.
pub(super) fn rows(document: &Value) -> impl Iterator<Item = &Value> {
    document["records"].as_array().into_iter().flatten()
}

/// The row of the validation records, or of the estimation records if there are none.
pub(super) fn judged(document: &Value) -> &Value {
    match &document["validate"] {
        Value::Null => &document["identify"],
        some => some,
    }
}

fn describe(row: &mut Row, heard: &Heard) {
    row.seconds = heard.answers().map(|answer| answer.seconds).sum();
    row.baselines = heard.fits;
    if let Some(data) = &heard.data {
        row.samples = data.records.iter().map(Record::len).sum();
    }
    if let Some(compared) = heard.compared(Step::Identify) {
        let scored = rows(compared).filter_map(|row| row["samples"].as_u64());
        row.scored = scored.sum::<u64>() as usize;
        let judged = judged(compared);
        row.judged = judged["use"].as_str().unwrap_or_default().to_owned();
        row.fit_percent = judged["fit_percent"].as_f64();
    }
    if let Some(found) = heard.found(Step::Identify) {
        row.structure = super::check::structure(&found.document);
    }
    if let Some(delay) = &heard.delay {
        row.edge_delay_samples = delay.document["statistics"]["all"]["mean"].as_f64();
    }
    if let Some(found) = heard.found(Step::Diagnose) {
        row.verdict = found.document["verdict"].as_str().map(str::to_owned);
        let names = found.document["missing"].as_array().into_iter().flatten();
        row.names = names
            .filter_map(|n| n.as_str().map(str::to_owned))
            .collect();
    }
}
