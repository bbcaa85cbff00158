//! The steps of the library, done for the page and kept in the project folder.

use std::collections::HashMap;
use std::path::{Path, PathBuf};
use std::sync::atomic::AtomicBool;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use host_fit::data::DataSet;
use host_fit::diagnose::Options;
use host_fit::excitation::Excitation;
use host_fit::model::Model;
use host_fit::output::write_atomic;
use host_fit::picture::{Ladder, LadderStep, ladder, workbench_page};
use host_fit::search::Snapshot;
use host_fit::steps::{self, Comparison, Onlooker};
use serde_json::{Value, json};
use workbench::{Bench, Download, Node, Project, Refusal, Work};

use super::request::Request;
use crate::commands::page;
use crate::commands::words::{describe, role_name, score_rows};

/// A data set, and the models that are made of it.
pub(super) struct ModelBench {
    /// As the user named it, for commands.
    dataset: String,
    set: DataSet,
    /// What the commands of the set can tell: asked for once.
    remarks: Vec<String>,
    project: Mutex<Project>,
    /// Free runs and failures by model; those that diverge by what is said of it.
    compared: Mutex<HashMap<u32, Arc<Compared>>>,
}

struct Compared {
    model: Model,
    run: Result<Comparison, String>,
}

fn lock<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    // A panic in between leaves whole values: each is replaced at once.
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}

/// The page, listening to a step.
struct Page<'a>(&'a Work);

impl Onlooker for Page<'_> {
    fn begins(&self, what: &str) {
        self.0.now(what);
    }
    fn now(&self, what: &str) {
        self.0.now(what);
    }
    fn sees(&self, snapshot: &Snapshot) {
        self.0.best(snapshot.evaluations, snapshot.best);
    }
    fn hears(&self, warning: &str) {
        self.0.warning(warning);
    }
    fn interrupt(&self) -> &AtomicBool {
        self.0.cancel()
    }
}

/// What the page makes of the project: the script fills the places in.
const BODY: &str = include_str!("page.html");

impl ModelBench {
    pub(super) fn open(dataset: &Path, set: DataSet, folder: &Path) -> anyhow::Result<Self> {
        let shortest = set.records.iter().map(host_fit::data::Record::len).min();
        let longest_lag = 500.min(shortest.unwrap_or(4) / 4);
        Ok(Self {
            dataset: dataset.display().to_string(),
            remarks: Excitation::of(&set, longest_lag).remarks,
            project: Mutex::new(Project::open(folder, &set.hash)?),
            set,
            compared: Mutex::default(),
        })
    }

    /// Takes a model that the user has into the project, unless the current one is that already.
    pub(super) fn bring(&self, path: &Path) -> anyhow::Result<()> {
        let model = Model::load(path)?;
        let known = {
            let project = lock(&self.project);
            let mut nodes = project.nodes().iter();
            let same = |node: &&Node| Model::load(&project.path(node)).is_ok_and(|m| m == model);
            nodes.find(same).map(|node| node.id)
        };
        match known {
            Some(id) => lock(&self.project).select(id)?,
            None => {
                let command = format!("# {} brought along", path.display());
                self.keep(&model, None, "brought along", &command)
                    .map_err(|why| anyhow::anyhow!(why.0))?;
            }
        }
        Ok(())
    }

    /// Writes a model into the project and makes it the current one.
    fn keep(
        &self,
        model: &Model,
        parent: Option<u32>,
        step: &str,
        command: &str,
    ) -> Result<(), Refusal> {
        let run = steps::compare(model, &self.set);
        let held_out = run
            .as_ref()
            .ok()
            .and_then(|run| run.scores.held_out().cloned());
        let mut project = lock(&self.project);
        let file = project.next_file();
        model.save(&project.folder().join(&file))?;
        let finite = |value: f64| value.is_finite().then_some(value);
        let id = project.add(Node {
            id: 0,
            parent,
            step: step.to_owned(),
            command: command.to_owned(),
            file,
            rmse: held_out.as_ref().and_then(|i| finite(i.rmse)),
            noise_rmse: held_out.as_ref().and_then(|i| i.noise_rmse),
            fit_percent: held_out.as_ref().and_then(|i| finite(i.fit_percent)),
        })?;
        drop(project);
        let compared = Compared {
            model: model.clone(),
            run: run.map_err(|e| Refusal::from(e).0),
        };
        lock(&self.compared).insert(id, Arc::new(compared));
        Ok(())
    }

    /// A model with its free runs.
    fn compared(&self, id: u32) -> Result<Arc<Compared>, Refusal> {
        if let Some(known) = lock(&self.compared).get(&id) {
            return Ok(known.clone());
        }
        let path = {
            let project = lock(&self.project);
            project.path(project.node(id)?)
        };
        let model = Model::load(&path)?;
        let run = steps::compare(&model, &self.set).map_err(|e| Refusal::from(e).0);
        let found = Arc::new(Compared { model, run });
        lock(&self.compared).insert(id, found.clone());
        Ok(found)
    }

    /// The held-out error from the first model of a branch to this one.
    fn ladder(&self, id: u32) -> String {
        let project = lock(&self.project);
        let mut path = Vec::new();
        let mut at = Some(id);
        while let Some(node) = at.and_then(|id| project.node(id).ok()) {
            path.push(node);
            at = node.parent;
        }
        path.reverse();
        let steps: Vec<LadderStep<'_>> = path
            .iter()
            .filter_map(|node| {
                let rmse = node.rmse?;
                Some(LadderStep {
                    label: &node.step,
                    rmse,
                })
            })
            .collect();
        ladder(&Ladder {
            title: "Held-out error, step by step",
            y_unit: "y",
            steps: &steps,
            records: &[],
            noise_rmse: path.last().and_then(|node| node.noise_rmse),
        })
    }

    fn diagnosis_file(&self, id: u32) -> PathBuf {
        lock(&self.project)
            .folder()
            .join(format!("diagnosis-{id}.json"))
    }

    fn model_state(&self, id: u32) -> Value {
        let compared = match self.compared(id) {
            Ok(compared) => compared,
            Err(why) => {
                return json!({
                    "describe": "", "columns": [], "rows": [], "where": [], "where_picture": "",
                    "ladder_picture": self.ladder(id), "error": why.0,
                });
            }
        };
        let (rows, words, picture, error) = match &compared.run {
            Ok(run) => (
                score_rows(&run.scores).into_iter().map(Vec::from).collect(),
                run.failures.describe(),
                page::failures_picture(&run.failures),
                None,
            ),
            Err(why) => (Vec::new(), Vec::new(), String::new(), Some(why)),
        };
        json!({
            "describe": describe(&compared.model),
            "columns": ["record", "use", "FIT, %", "ρ", "RMSE", "noise", "ε", "inside"],
            "rows": rows,
            "where": words,
            "where_picture": picture,
            "ladder_picture": self.ladder(id),
            "error": error,
        })
    }
}

impl Bench for ModelBench {
    fn page(&self) -> String {
        workbench_page("Workbench", BODY)
    }

    fn state(&self) -> Value {
        let (current, models, log, folder) = {
            let project = lock(&self.project);
            let folder = project.folder().display().to_string();
            (
                project.current(),
                project.nodes().to_vec(),
                project.log(),
                folder,
            )
        };
        let diagnosis = current.and_then(|id| {
            let text = std::fs::read(self.diagnosis_file(id)).ok()?;
            serde_json::from_slice::<Value>(&text).ok()
        });
        let records: Vec<Value> = self
            .set
            .records
            .iter()
            .map(|r| json!({"name": r.name, "use": role_name(r.role), "samples": r.len()}))
            .collect();
        json!({
            "data": {
                "title": self.set.title.as_deref().unwrap_or("data set"),
                "path": self.dataset,
                "hash": self.set.hash,
                "period": self.set.sample_period_s,
                "records": records,
                "remarks": self.remarks,
            },
            "project": folder,
            "current": current,
            "models": models,
            "log": log,
            "model": current.map(|id| self.model_state(id)),
            "diagnosis": diagnosis,
        })
    }

    fn records(&self, models: &[u32]) -> Result<String, Refusal> {
        let compared: Vec<(String, Arc<Compared>)> = models
            .iter()
            .map(|id| {
                let step = lock(&self.project).node(*id)?.step.clone();
                Ok((format!("{id}. {step}"), self.compared(*id)?))
            })
            .collect::<Result<_, Refusal>>()?;
        let runs: Vec<(&str, &[Vec<f64>])> = compared
            .iter()
            .filter_map(|(name, c)| Some((name.as_str(), c.run.as_ref().ok()?.runs.as_slice())))
            .collect();
        // The last one is worked on: its bars are on the page.
        let Some((_, last)) = compared.last() else {
            return Ok(page::living(&self.set.records, &[], None).json());
        };
        let records = last.model.targets(&self.set.records);
        let delay = last.model.longest_delay();
        let samples = last.run.as_ref().ok().map(|run| {
            let places = run.failures.samples(&records, &run.runs, delay);
            (&run.failures, places)
        });
        let lit = samples
            .as_ref()
            .map(|(failures, places)| (*failures, places.as_slice()));
        Ok(page::living(&records, &runs, lit).json())
    }

    fn select(&self, model: u32) -> Result<(), Refusal> {
        Ok(lock(&self.project).select(model)?)
    }

    fn name(&self, request: &Value) -> Result<String, Refusal> {
        Request::read(request).map(|r| r.name()).map_err(Refusal)
    }

    fn run(&self, request: &Value, work: &Work) -> Result<(), Refusal> {
        let request = Request::read(request).map_err(Refusal)?;
        let page = Page(work);
        let to = lock(&self.project).next_file();
        let in_folder = |file: &str| {
            let project = lock(&self.project);
            project.folder().join(file).display().to_string()
        };
        let command = |from: &str| request.command(&self.dataset, from, &in_folder(&to));
        match &request {
            Request::Identify { .. } => {
                let asked = request.identify().unwrap_or_default();
                let found = steps::identify(&self.set, &asked, &page)?;
                self.keep(&found.model, None, "identified", &command(""))
            }
            Request::Extend { model, effect } => {
                let given = self.compared(*model)?;
                let from = in_folder(&lock(&self.project).node(*model)?.file.clone());
                let effects = std::slice::from_ref(effect);
                let found = steps::extend(&given.model, &self.set, effects, &page)?;
                let step = format!("+ {effect}");
                self.keep(&found.model, Some(*model), &step, &command(&from))
            }
            Request::Diagnose { model, seed } => {
                let given = self.compared(*model)?;
                let file = lock(&self.project).node(*model)?.file.clone();
                let options = Options {
                    seed: *seed,
                    ..Options::default()
                };
                let found = steps::diagnose(&given.model, &self.set, &options, &page)?;
                let mut kept = serde_json::to_value(&found)?;
                if let Some(kept) = kept.as_object_mut() {
                    kept.insert("headline".to_owned(), found.headline.clone().into());
                    kept.insert("meaning".to_owned(), found.meaning.clone().into());
                    let picture = page::ranking_picture(&found.diagnosis);
                    kept.insert("picture".to_owned(), picture.into());
                }
                let text = serde_json::to_vec(&kept)?;
                write_atomic(&self.diagnosis_file(*model), |out| out.write_all(&text))?;
                lock(&self.project).note(&command(&in_folder(&file)))?;
                Ok(())
            }
        }
    }

    fn file(&self, kind: &str, model: u32) -> Result<Download, Refusal> {
        let path = {
            let project = lock(&self.project);
            project.path(project.node(model)?)
        };
        match kind {
            "model" => Ok(Download {
                name: format!("model-{model}.toml"),
                kind: "application/toml",
                content: std::fs::read(path)?,
            }),
            "constants" => Ok(Download {
                name: "identified.rs".to_owned(),
                kind: "text/plain; charset=utf-8",
                content: steps::constants(&Model::load(&path)?)?.text.into_bytes(),
            }),
            "report" => {
                let compared = self.compared(model)?;
                let run = compared.run.as_ref().map_err(|why| Refusal(why.clone()))?;
                Ok(Download {
                    name: format!("model-{model}.html"),
                    kind: "text/html; charset=utf-8",
                    content: page::comparison(&compared.model, &self.set, run).into_bytes(),
                })
            }
            _ => Err(Refusal("files are model, constants and report".to_owned())),
        }
    }
}
