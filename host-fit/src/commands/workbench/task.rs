//! A task: a request with its command and its results in the project.

use std::path::{Path, PathBuf};
use std::sync::Mutex;
use std::sync::atomic::AtomicBool;
use std::time::{Duration, Instant};

use host_fit::data::Plant;
use host_fit::model::Model;
use host_fit::output::write_atomic;
use host_fit::search::Snapshot;
use host_fit::steps::{self, Finding, Onlooker, Terms};
use serde_json::{Value, json};
use workbench::{Refusal, Work, beneath};

use super::bench::{Made, ModelBench, lock};
use super::data::Data;
use super::request::{Command, Line, Request};
use crate::commands::paragraph;
use crate::commands::words::{TRIALS, Words, every_candidate, trial_caption, trial_rows};
use crate::commands::{design, diagnose, discover, drawings, extend, identify, import, page};

/// A task that can be started.
pub(super) struct Task {
    pub(super) line: Line,
    /// Number of the model that the task starts from; 0 for none.
    from: u32,
    asked: Asked,
}

enum Asked {
    Identify(Box<identify::Args>),
    Diagnose(diagnose::Args),
    Discover(discover::Args),
    Extend(extend::Args),
    Design(design::Args),
    Import(Box<import::Args>),
}

/// Reports progress to the page.
struct Page<'a> {
    work: &'a Work,
    bench: &'a ModelBench,
    glimpse: Mutex<Glimpse>,
}

/// Schedule for showing the best model so far, because building it takes time from the search.
struct Glimpse {
    /// Earliest next time.
    due: Instant,
    evaluations: usize,
    /// The best value so far, and the value of the model shown last.
    best: f64,
    seen: f64,
}

impl<'a> Page<'a> {
    fn new(bench: &'a ModelBench, work: &'a Work) -> Self {
        Self {
            work,
            bench,
            glimpse: Mutex::new(Glimpse {
                // The first models of a search are not worth showing.
                due: Instant::now() + Duration::from_millis(300),
                evaluations: 0,
                best: f64::INFINITY,
                seen: f64::INFINITY,
            }),
        }
    }
}

impl Onlooker for Page<'_> {
    fn begins(&self, what: &str) {
        self.work.begins(what);
    }
    fn now(&self, what: &str) {
        self.work.now(what);
    }
    fn sees(&self, snapshot: &Snapshot) {
        self.work
            .best(snapshot.evaluations, snapshot.budget, snapshot.best);
        let mut glimpse = lock(&self.glimpse);
        (glimpse.evaluations, glimpse.best) = (snapshot.evaluations, snapshot.best);
    }
    fn finds(&self, best: &dyn Fn() -> Option<Model>) {
        /// The preview takes at most 1/SHARE of the time of the search.
        const SHARE: u32 = 50;
        let mut glimpse = lock(&self.glimpse);
        let started = Instant::now();
        if glimpse.best == glimpse.seen || started < glimpse.due {
            return;
        }
        glimpse.seen = glimpse.best;
        if let Some(model) = best() {
            self.bench.show_best(&model, glimpse.evaluations);
        }
        glimpse.due = Instant::now() + (SHARE * started.elapsed()).max(Duration::from_secs(1));
    }
    fn hears(&self, warning: &str) {
        self.work.warning(warning);
    }
    fn interrupt(&self) -> &AtomicBool {
        self.work.cancel()
    }
}

#[allow(clippy::needless_pass_by_value)]
fn told(error: anyhow::Error) -> Refusal {
    Refusal(paragraph(&error))
}

impl ModelBench {
    /// Checks a request and returns its task.
    pub(super) fn prepare(&self, request: &Value) -> Result<Task, Refusal> {
        let request = Request::read(request).map_err(Refusal)?;
        let command = request.command;
        let from = request.model.unwrap_or_default();
        let files: Vec<PathBuf> = match command {
            Command::Identify => vec![self.data()?.path.clone()],
            Command::Design | Command::Diagnose | Command::Discover | Command::Extend => {
                vec![self.path(from)?, self.data()?.path.clone()]
            }
            Command::Import => {
                let each = request.files.iter().map(|name| self.uploads.path(name));
                each.collect::<Result<_, _>>()?
            }
        };
        let to = match command {
            Command::Import => self.folder.join(super::IMPORTED),
            _ => self.folder.join(lock(&self.project).next_file()),
        };
        let line = Line::new(command, &files, request.options());
        let line = match command {
            Command::Identify | Command::Extend | Command::Import => line.file("output", &to),
            Command::Design => line.file("output", &to).file("csv", &loop_of(&to)),
            Command::Discover => {
                let report = self.beside("discovery", from, "html")?;
                line.file("output", &to).file("report", &report)
            }
            Command::Diagnose => line
                .file("report", &self.beside("diagnosis", from, "html")?)
                .file("experiment", &self.beside("experiment", from, "csv")?),
        };
        let (line, asked) = match command {
            Command::Identify => {
                let asked = Box::new(line.parse()?);
                (line, Asked::Identify(asked))
            }
            Command::Diagnose => {
                // Effects of the model are not tried again.
                let model = Model::load(&self.path(from)?)?;
                let line = self.offer(line, |name| {
                    model.effect_names().iter().all(|own| own != name)
                });
                let asked = line.parse()?;
                (line, Asked::Diagnose(asked))
            }
            Command::Discover => {
                let asked = line.parse()?;
                (line, Asked::Discover(asked))
            }
            Command::Extend => {
                let asked: extend::Args = line.parse()?;
                let line = self.offer(line, |name| asked.effects().iter().any(|own| own == name));
                let asked = line.parse()?;
                (line, Asked::Extend(asked))
            }
            Command::Design => {
                let asked = line.parse()?;
                (line, Asked::Design(asked))
            }
            Command::Import => {
                let asked = Box::new(line.parse()?);
                (line, Asked::Import(asked))
            }
        };
        Ok(Task { line, from, asked })
    }

    /// Adds the user's own effects with these names to a command.
    fn offer(&self, line: Line, wanted: impl Fn(&str) -> bool) -> Line {
        let files = self.own.files().into_iter();
        let files = files.filter(|file| {
            let name = file.file_stem().unwrap_or_default();
            wanted(&name.to_string_lossy())
        });
        files.fold(line, |line, file| line.file("effect-file", &file))
    }
}

/// A message about the reference of a law, with the option that sets it; the page replaces options by the labels of
/// its fields.
fn of_the_field(message: &str) -> String {
    message
        .replace("the reference", "--target")
        .replace("choose a reference inside", "choose a level inside")
}

/// Path of the closed loop's CSV, next to the model with the law.
fn loop_of(model: &Path) -> PathBuf {
    let stem = model.file_stem().unwrap_or_default().to_string_lossy();
    model.with_file_name(format!("{}.csv", stem.replace("model", "loop")))
}

/// Stores the answer of a step with the model that it made.
fn told_of(bench: &ModelBench, id: u32, told: &Value) -> Result<(), Refusal> {
    write(&bench.beside("made", id, "json")?, &told.to_string())
}

fn write(path: &Path, text: &str) -> Result<(), Refusal> {
    Ok(write_atomic(path, |out| out.write_all(text.as_bytes()))?)
}

impl Task {
    /// Runs the task.
    pub(super) fn run(&self, bench: &ModelBench, work: &Work) -> Result<(), Refusal> {
        let page = Page::new(bench, work);
        let current = lock(&bench.project).current();
        bench.forget_best();
        match &self.asked {
            Asked::Identify(args) => {
                let data = bench.data()?;
                let request = args.request(data.set.sample_period_s).map_err(told)?;
                let found = steps::identify(&data.set, &request, &page)?;
                let mut answer = found.answer.clone();
                answer.notes.extend(found.remarks.iter().cloned());
                let id = self.made(bench, &found.model, "identified", None, current)?;
                told_of(bench, id, &json!({"answer": answer}))?;
            }
            Asked::Extend(args) => {
                let mut model = self.model(bench)?;
                args.define(&mut model).map_err(told)?;
                let found = steps::extend(&model, &bench.data()?.set, args.effects(), &page)?;
                let step = format!("+ {}", args.effects().join(" + "));
                let id = self.made(bench, &found.model, &step, Some(self.from), current)?;
                let told = json!({"answer": found.answer, "parameters": found.parameters});
                told_of(bench, id, &told)?;
            }
            Asked::Diagnose(args) => {
                let (mut model, data) = (self.model(bench)?, bench.data()?);
                args.define(&mut model).map_err(told)?;
                let found = steps::diagnose(&model, &data.set, &args.options(), &page)?;
                self.diagnosed(bench, &data, &model, &found, args)?;
            }
            Asked::Discover(args) => {
                let (mut model, data) = (self.model(bench)?, bench.data()?);
                let options = args.prepare(&mut model).map_err(told)?;
                let found = steps::discover(&model, &data.set, &options, &page)?;
                self.discovered(bench, &data, &model, &found)?;
            }
            Asked::Design(args) => {
                page.begins("designing, and trying the law in the loop");
                let (model, data) = (self.model(bench)?, bench.data()?);
                let tried = args.tried(&model, Some(&data.set)).map_err(told);
                let tried = tried.map_err(|why| Refusal(of_the_field(&why.0)))?;
                let refused = tried.refused("the box “keep the law even if attachment is lost”");
                if let Some(refused) = refused.filter(|_| !args.force()) {
                    return Err(Refusal(refused));
                }
                let id = self.made(
                    bench,
                    &tried.design.model,
                    &args.goal_words(),
                    Some(self.from),
                    current,
                )?;
                let picture = drawings::proof_picture(&tried.proof, args.tracks());
                let drawn_to = args.picture();
                let name = drawn_to.file_name().unwrap_or_default();
                write(&beneath(&bench.folder, Path::new(name))?, &picture)?;
                write(
                    &bench.beside("loop", id, "csv")?,
                    &tried.proof.trace.to_csv(),
                )?;
                let kept = json!({
                    "answer": tried.answer,
                    "words": tried.design.words(),
                    "picture": picture.html(),
                    "margin": tried.margin.as_ref().map(|margin| drawings::margin_picture(margin).html()),
                    "columns": TRIALS.map(|(name, _)| name),
                    "rows": trial_rows(&tried.proof),
                    "caption": trial_caption(&tried.proof),
                });
                write(&bench.beside("law", id, "json")?, &kept.to_string())?;
            }
            Asked::Import(args) => {
                page.begins("reading the files");
                let found = args.import().map_err(told)?;
                for file in &found.files {
                    let remarks = file.remarks.iter();
                    remarks.for_each(|remark| work.warning(&format!("{}: {remark}", file.name)));
                }
                found.remarks.iter().for_each(|remark| work.warning(remark));
                bench.take(&found, &self.line.text())?;
            }
        }
        Ok(())
    }

    /// The model that the task starts from.
    fn model(&self, bench: &ModelBench) -> Result<Model, Refusal> {
        Ok(bench.compared(self.from)?.model.clone())
    }

    /// Stores the resulting model.
    fn made(
        &self,
        bench: &ModelBench,
        model: &Model,
        step: &str,
        from: Option<u32>,
        current: Option<u32>,
    ) -> Result<u32, Refusal> {
        bench.keep(&Made {
            model,
            from,
            step: step.to_owned(),
            command: self.line.text(),
            leaves: Some(current),
        })
    }

    fn diagnosed(
        &self,
        bench: &ModelBench,
        data: &Data,
        given: &Model,
        found: &Finding,
        args: &diagnose::Args,
    ) -> Result<(), Refusal> {
        let report = page::finding(
            given,
            &data.set,
            found,
            args.options().seed,
            &self.line.text(),
        );
        write(&bench.beside("diagnosis", self.from, "html")?, &report)?;
        let mut kept = serde_json::to_value(found)?;
        let separation = found.diagnosis.separation.as_ref();
        if let Some(separation) = separation {
            let path = bench.beside("experiment", self.from, "csv")?;
            separation.experiment.write_csv(&path)?;
        }
        if let Some(kept) = kept.as_object_mut() {
            // The page makes commands from the names in these rows.
            kept.insert(
                "rows".to_owned(),
                every_candidate(&found.diagnosis, Plant::Flow).into(),
            );
            let picture = drawings::ranking_picture(&found.diagnosis, found.plant);
            kept.insert("picture".to_owned(), picture.html().into());
            let experiment = separation.map(|s| drawings::experiment_picture(s).html());
            kept.insert("experiment_picture".to_owned(), experiment.into());
        }
        write(
            &bench.beside("diagnosis", self.from, "json")?,
            &kept.to_string(),
        )?;
        Ok(lock(&bench.project).note(&self.line.text())?)
    }

    fn discovered(
        &self,
        bench: &ModelBench,
        data: &Data,
        given: &Model,
        found: &Terms,
    ) -> Result<(), Refusal> {
        let terms = &found.discovery.terms;
        let line = match terms.first() {
            Some(first) => self
                .line
                .clone()
                .file("effect-out", &bench.own.file(&first.effect)),
            None => self.line.clone(),
        };
        let report = page::discovery(given, &data.set, found, &line.text());
        write(&bench.beside("discovery", self.from, "html")?, &report)?;
        let told: Vec<Value> = terms
            .iter()
            .map(|term| {
                json!({
                    "effect": term.effect,
                    "title": format!("{} by {}", term.changes, term.coordinate),
                    "formula": term.formula,
                    "is_formula": term.is_formula,
                    "picture": page::term_picture(term).html(),
                    "file": term.file,
                })
            })
            .collect();
        let kept = json!({"answer": found.answer, "terms": told});
        write(
            &bench.beside("discovery", self.from, "json")?,
            &kept.to_string(),
        )?;
        if terms.is_empty() {
            return Ok(lock(&bench.project).note(&line.text())?);
        }
        for term in terms {
            bench.own.keep(&term.file)?;
        }
        let names: Vec<&str> = terms.iter().map(|term| term.effect.as_str()).collect();
        bench.keep(&Made {
            model: &found.model,
            from: Some(self.from),
            step: format!("+ {}", names.join(" + ")),
            command: line.text(),
            // The page stays with the model that was diagnosed.
            leaves: None,
        })?;
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use model_core::control::{Reachable, Unreachable};

    #[test]
    fn a_level_that_cannot_be_held_names_its_field() {
        let error = Unreachable {
            reference: 99.0,
            reachable: Reachable {
                low: 0.0,
                high: 0.8,
            },
        };
        let told = of_the_field(&error.to_string());
        assert!(told.starts_with("--target 99 cannot be held"), "{told}");
        assert!(told.ends_with("choose a level inside"), "{told}");
    }
}
