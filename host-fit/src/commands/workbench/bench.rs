//! The state of the project for the page, and the actions that add models to the project.

use std::collections::HashMap;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use host_fit::data::Use;
use host_fit::indicators::{ErrorKind, score};
use host_fit::model::{Delay, Model};
use host_fit::picture::{
    Ladder, LadderStep, Picture, ladder, neutral_colour, packed, significant, time, workbench_page,
};
use host_fit::steps::{self, Comparison, ImportedSet};
use model_core::effect::Parameter;
use serde_json::{Value, json};
use workbench::{Bench, Download, Node, Project, Refusal, Work, beneath};

use super::colours;
use super::data::{Data, Uploads};
use super::own::OwnEffects;
use super::request::Line;
use crate::commands::demo::bundled_ramp;
use crate::commands::drawings::step_by_step;
use crate::commands::page_parts::{
    POLES, POLES_ARE, Run, check_figures, frequency_figures, pole_rows, stretch_figure,
    worst_stretch,
};
use crate::commands::words::{describe, score_rows};
use crate::commands::{page, paragraph};

/// A project with its data set and models.
pub(super) struct ModelBench {
    pub(super) folder: PathBuf,
    pub(super) project: Mutex<Project>,
    pub(super) uploads: Uploads,
    pub(super) own: OwnEffects,
    data: Mutex<Option<Arc<Data>>>,
    /// Free runs and failures by model.
    compared: Mutex<HashMap<u32, Arc<Compared>>>,
    /// What the page shows of a model, by hash of the data set and model.
    described: Mutex<HashMap<(String, u32), Value>>,
    /// Figures of models shown beside each other, by hash of the data set and models.
    figures: Mutex<HashMap<(String, Vec<u32>), Value>>,
    /// Number of parameters by model.
    counts: Mutex<HashMap<u32, usize>>,
    /// The free run of the best model of a running search: number of evaluations, and y per record.
    best: Mutex<Option<(usize, Vec<Vec<f64>>)>>,
    /// Whether a step runs. The data set is not exchanged meanwhile.
    busy: AtomicBool,
}

/// A model with its free runs, or with the error message if they diverge.
pub(super) struct Compared {
    pub(super) model: Model,
    pub(super) run: Result<Comparison, String>,
}

/// A step with its resulting model.
pub(super) struct Made<'a> {
    pub(super) model: &'a Model,
    /// The model from which the step started.
    pub(super) from: Option<u32>,
    /// The step in a few words.
    pub(super) step: String,
    /// The step as a command.
    pub(super) command: String,
    /// The model that was current when the step began, if the page should then show the new model. The page stays if
    /// the user has chosen another model meanwhile.
    pub(super) leaves: Option<Option<u32>>,
}

pub(super) fn lock<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    // A panic cannot leave partial values: each is replaced in one assignment.
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}

/// The body of the page; the script fills it.
const BODY: &str = include_str!("page.html");

impl ModelBench {
    /// Opens the project in `folder` with a data set, or with the one imported into the project, if any.
    pub(super) fn open(dataset: Option<&Path>, folder: &Path) -> anyhow::Result<Self> {
        let imported = beneath(folder, Path::new(super::IMPORTED))?;
        let path = match dataset {
            Some(path) => Some(path.to_owned()),
            None => imported.exists().then_some(imported),
        };
        let data = path.map(|path| Data::load(&path)).transpose()?;
        let project = Project::open(folder, data.as_ref().map(|data| data.set.hash.as_str()))?;
        Ok(Self {
            folder: folder.to_owned(),
            project: Mutex::new(project),
            uploads: Uploads::of(folder),
            own: OwnEffects::of(folder),
            data: Mutex::new(data.map(Arc::new)),
            compared: Mutex::default(),
            described: Mutex::default(),
            figures: Mutex::default(),
            counts: Mutex::default(),
            best: Mutex::default(),
            busy: AtomicBool::new(false),
        })
    }

    /// Copies a user's model into the project, unless it exists already.
    pub(super) fn bring(&self, path: &Path) -> anyhow::Result<()> {
        let model = Model::load(path)?;
        let known = {
            let project = lock(&self.project);
            let mut nodes = project.nodes().iter();
            let same = |node: &&Node| {
                let path = project.path(node);
                path.is_ok_and(|path| Model::load(&path).is_ok_and(|m| m == model))
            };
            nodes.find(same).map(|node| node.id)
        };
        match known {
            Some(id) => lock(&self.project).select(id)?,
            None => {
                let made = Made {
                    model: &model,
                    from: None,
                    step: "added by the user".to_owned(),
                    command: format!("# model {} added by the user", path.display()),
                    leaves: Some(lock(&self.project).current()),
                };
                self.keep(&made).map_err(|why| anyhow::anyhow!(why.0))?;
            }
        }
        Ok(())
    }

    /// The data set.
    pub(super) fn data(&self) -> Result<Arc<Data>, Refusal> {
        let none = || Refusal("there is no data set yet: import one".to_owned());
        lock(&self.data).clone().ok_or_else(none)
    }

    /// Makes an imported data set the project's.
    pub(super) fn take(&self, found: &ImportedSet, command: &str) -> Result<(), Refusal> {
        self.change_data(command, |folder| Ok(found.imported.save(folder)?))
    }

    /// Replaces the project's data set by the one that `save` writes. Models of the previous data set are moved aside
    /// with their data.
    fn change_data(
        &self,
        command: &str,
        save: impl FnOnce(&Path) -> Result<(), Refusal>,
    ) -> Result<(), Refusal> {
        let incoming = beneath(&self.folder, Path::new("incoming"))?;
        if incoming.exists() {
            std::fs::remove_dir_all(&incoming)?;
        }
        save(&incoming)?;
        let load = |folder: &Path| Data::load(folder).map_err(|e| Refusal(paragraph(&e)));
        let hash = load(&incoming)?.set.hash;
        let earlier = lock(&self.project).start_anew(&hash)?;
        lock(&self.compared).clear();
        lock(&self.described).clear();
        lock(&self.figures).clear();
        lock(&self.counts).clear();
        let folder = beneath(&self.folder, Path::new(super::IMPORTED))?;
        match earlier {
            Some(earlier) if folder.exists() => {
                std::fs::rename(&folder, earlier.join(super::IMPORTED))?;
            }
            _ if folder.exists() => std::fs::remove_dir_all(&folder)?,
            _ => {}
        }
        std::fs::rename(&incoming, &folder)?;
        *lock(&self.data) = Some(Arc::new(load(&folder)?));
        Ok(lock(&self.project).note(command)?)
    }

    /// Makes the bundled recordings the data set.
    fn bring_bundled(&self) -> Result<Value, Refusal> {
        self.change_data(
            "# the bundled recordings: a ramp with a hidden effect",
            |folder| {
                std::fs::create_dir_all(folder)?;
                for (name, text) in bundled_ramp() {
                    std::fs::write(folder.join(name), text)?;
                }
                Ok(())
            },
        )?;
        Ok(json!({}))
    }

    /// Chooses the validation records; `names` has one name per line.
    fn validate_on(&self, names: &str) -> Result<Value, Refusal> {
        let mut set = self.data()?.set.clone();
        let chosen: Vec<&str> = names.lines().collect();
        for record in &mut set.records {
            record.role = match chosen.contains(&record.name.as_str()) {
                true => Use::Validate,
                false => Use::Identify,
            };
        }
        if set
            .records
            .iter()
            .all(|record| record.role == Use::Validate)
        {
            return Err(Refusal(
                "all records are validation records, but a model is fitted to estimation records: unmark at least one"
                    .to_owned(),
            ));
        }
        let line = format!("# validation records: {}", chosen.join(", "));
        self.change_data(&line, |folder| Ok(set.save(folder)?))?;
        Ok(json!({}))
    }

    /// An error while a step runs.
    fn idle(&self) -> Result<(), Refusal> {
        match self.busy.load(Ordering::Relaxed) {
            true => Err(Refusal(
                "a task is running on these records: wait until it ends, or cancel it".to_owned(),
            )),
            false => Ok(()),
        }
    }

    /// Writes a model into the project and makes it the current one; returns its number.
    pub(super) fn keep(&self, made: &Made<'_>) -> Result<u32, Refusal> {
        let run = steps::compare(made.model, &self.data()?.set);
        let held_out = run.as_ref().ok().and_then(|run| run.scores.held_out());
        let finite = |value: f64| value.is_finite().then_some(value);
        let mut project = lock(&self.project);
        let file = project.next_file();
        made.model
            .save(&beneath(project.folder(), Path::new(&file))?)?;
        let before = project.current();
        let id = project.add(Node {
            id: 0,
            parent: made.from,
            step: made.step.clone(),
            command: made.command.clone(),
            file,
            rmse: held_out.and_then(|i| finite(i.rmse)),
            noise_rmse: held_out.and_then(|i| i.noise_rmse),
            fit_percent: held_out.and_then(|i| finite(i.fit_percent)),
        })?;
        if let Some(stays) = before.filter(|_| made.leaves != Some(before)) {
            project.select(stays)?;
        }
        drop(project);
        let compared = Compared {
            model: made.model.clone(),
            run: run.map_err(|e| Refusal::from(e).0),
        };
        lock(&self.compared).insert(id, Arc::new(compared));
        Ok(id)
    }

    /// Stores the best model of a running search for the page.
    pub(super) fn show_best(&self, model: &Model, evaluations: usize) {
        let Ok(data) = self.data() else { return };
        // Intermediate models may diverge.
        if let Ok((_, runs)) = score(model, &model.targets(&data.set.records)) {
            *lock(&self.best) = Some((evaluations, runs));
        }
    }

    /// Clears the stored model before the next search.
    pub(super) fn forget_best(&self) {
        *lock(&self.best) = None;
    }

    /// The free run of the best model so far, if it is newer than `seen`.
    fn best_since(&self, seen: &str) -> Value {
        match lock(&self.best).as_ref() {
            Some((evaluations, runs)) if evaluations.to_string() != seen => json!({
                "evaluations": evaluations,
                "runs": runs.iter().map(|run| packed(run)).collect::<Vec<_>>(),
            }),
            _ => json!({}),
        }
    }

    /// Path of a model's file.
    pub(super) fn path(&self, id: u32) -> Result<PathBuf, Refusal> {
        let project = lock(&self.project);
        Ok(project.path(project.node(id)?)?)
    }

    /// A model with its free runs.
    pub(super) fn compared(&self, id: u32) -> Result<Arc<Compared>, Refusal> {
        if let Some(known) = lock(&self.compared).get(&id) {
            return Ok(known.clone());
        }
        let model = Model::load(&self.path(id)?)?;
        let run = steps::compare(&model, &self.data()?.set).map_err(|e| Refusal::from(e).0);
        let found = Arc::new(Compared { model, run });
        lock(&self.compared).insert(id, found.clone());
        Ok(found)
    }

    /// Path of a result file of a step on a model.
    pub(super) fn beside(&self, what: &str, id: u32, ending: &str) -> Result<PathBuf, Refusal> {
        let name = format!("{what}-{id}.{ending}");
        Ok(beneath(&self.folder, Path::new(&name))?)
    }

    /// Stored result of a step on a model; none if the step was not done.
    fn kept(&self, what: &str, id: Option<u32>) -> Value {
        let read = id.and_then(|id| std::fs::read(self.beside(what, id, "json").ok()?).ok());
        let read = read.and_then(|text| serde_json::from_slice(&text).ok());
        read.unwrap_or_default()
    }

    /// The error from the first model of a branch to this one.
    fn ladder(&self, id: u32) -> Picture {
        let data = self.data();
        let kind = ErrorKind::on(data.as_ref().map_or(&[], |data| &data.set.records));
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
            title: &step_by_step(kind),
            error: kind.title(),
            scored: kind.records(),
            y_unit: "y",
            steps: &steps,
            records: &[],
            noise_rmse: path.last().and_then(|node| node.noise_rmse),
        })
    }

    /// Hash of the data set; empty without one.
    fn data_hash(&self) -> String {
        let data = self.data();
        data.map(|data| data.set.hash.clone()).unwrap_or_default()
    }

    /// What the page shows of a model without its figures.
    fn model_state(&self, id: u32) -> Value {
        let key = (self.data_hash(), id);
        if let Some(known) = lock(&self.described).get(&key) {
            return known.clone();
        }
        let compared = match self.compared(id) {
            Ok(compared) => compared,
            Err(why) => {
                return json!({
                    "describe": "", "effects": [], "columns": [], "rows": [], "where": [], "where_picture": "",
                    "ladder_picture": self.ladder(id).html(), "error": why.0, "parameters": [], "base": [],
                });
            }
        };
        let (rows, words, picture, error) = match &compared.run {
            Ok(run) => (
                score_rows(&run.scores).into_iter().map(Vec::from).collect(),
                run.failures.describe(),
                page::failures_picture(&run.failures).html(),
                None,
            ),
            Err(why) => (Vec::new(), Vec::new(), String::new(), Some(why)),
        };
        let state = json!({
            "parameters": effect_parameters(&compared.model),
            "base": base_parameters(&compared.model),
            "describe": describe(&compared.model),
            "effects": compared.model.effect_names(),
            "columns": ["record", "use", "FIT, %", "ρ", "RMSE", "noise", "ε", "inside"],
            "rows": rows,
            "where": words,
            "where_picture": picture,
            "ladder_picture": self.ladder(id).html(),
            "error": error,
        });
        lock(&self.described).insert(key, state.clone());
        state
    }

    /// Confidence intervals of the parameters of a model's effects, from the step that fitted them: of the model
    /// itself, or of the one that it was made from by a step that left the parameters unchanged.
    fn intervals(&self, id: u32) -> Option<Value> {
        let values = |id: u32| Some(self.compared(id).ok()?.model.values());
        let own = values(id)?;
        let mut at = Some(id);
        while let Some(model) = at.filter(|model| values(*model).as_ref() == Some(&own)) {
            let mut made = self.kept("made", Some(model));
            if let Some(parameters) = made.get_mut("parameters") {
                return Some(parameters.take());
            }
            at = lock(&self.project).node(model).ok()?.parent;
        }
        None
    }

    /// Number of parameters of a model.
    fn parameter_count(&self, id: u32) -> Option<usize> {
        if let Some(known) = lock(&self.counts).get(&id) {
            return Some(*known);
        }
        let model = Model::load(&self.path(id).ok()?).ok()?;
        let count = model.parameter_count();
        lock(&self.counts).insert(id, count);
        Some(count)
    }

    /// Every model of the project, with its number of parameters.
    fn models(&self, nodes: &[Node]) -> Vec<Value> {
        let each = nodes.iter().map(|node| {
            let mut told = json!(node);
            if let Some(told) = told.as_object_mut() {
                told.insert(
                    "parameters".to_owned(),
                    self.parameter_count(node.id).into(),
                );
            }
            told
        });
        each.collect()
    }

    /// Name of a model on the page.
    fn label(&self, id: u32) -> Result<String, Refusal> {
        Ok(format!("{id}. {}", lock(&self.project).node(id)?.step))
    }

    /// Largest error, residual tests, step response, poles and frequency response of the models in `list` (numbers
    /// with commas between them, the current one last). The largest error is also shown for the model that the
    /// current one was made from.
    fn figures(&self, list: &str) -> Result<Value, Refusal> {
        let wrong = |_| Refusal("models are numbers: 1,3".to_owned());
        let numbers = list.split(',').filter(|number| !number.is_empty());
        let ids: Vec<u32> = numbers
            .map(str::parse)
            .collect::<Result<_, _>>()
            .map_err(wrong)?;
        if ids.len() > MOST_FIGURES {
            let why = format!("at most {MOST_FIGURES} models are shown at once");
            return Err(Refusal(why));
        }
        let key = (self.data_hash(), ids);
        if let Some(known) = lock(&self.figures).get(&key) {
            return Ok(known.clone());
        }
        let found = self.figures_of(&key.1)?;
        let mut figures = lock(&self.figures);
        if figures.len() >= KEPT_FIGURES {
            figures.clear();
        }
        figures.insert(key, found.clone());
        Ok(found)
    }

    fn figures_of(&self, ids: &[u32]) -> Result<Value, Refusal> {
        let Some(current) = ids.last() else {
            return Ok(json!({"stretch": [], "checks": [], "poles": []}));
        };
        let parent = lock(&self.project).node(*current)?.parent;
        let parent = parent.filter(|parent| !ids.contains(parent));
        let all = parent.iter().chain(ids);
        let shown: Vec<(u32, String, Arc<Compared>)> = all
            .map(|id| Ok((*id, self.label(*id)?, self.compared(*id)?)))
            .collect::<Result<_, Refusal>>()?;
        let records = match shown.last() {
            Some((_, _, last)) => last.model.targets(&self.data()?.set.records),
            None => Vec::new(),
        };
        let runs: Vec<(u32, Run<'_>)> = shown
            .iter()
            .filter_map(|(id, label, compared)| {
                let run = Run {
                    label,
                    model: &compared.model,
                    runs: &compared.run.as_ref().ok()?.runs,
                    colour: Some(colours::index(*id)),
                };
                Some((*id, run))
            })
            .collect();
        let drawn = |(picture, caption): (Picture, String)| json!({"picture": picture.html(), "caption": caption});
        let pairs: Vec<(&str, &[Vec<f64>])> =
            runs.iter().map(|(_, run)| (run.label, run.runs)).collect();
        let own: Vec<String> = runs.iter().map(|(id, _)| colours::of(*id)).collect();
        // The interval in which the earliest of the models has its largest error.
        let worst = pairs
            .first()
            .and_then(|first| worst_stretch(&records, first.1));
        let stretch = worst.and_then(|worst| stretch_figure(&records, &pairs, worst));
        let stretch = stretch.map(|(picture, caption)| {
            json!({"picture": colours::recoloured(&picture.html(), &own), "caption": caption})
        });
        let tested: Vec<Run<'_>> = runs
            .into_iter()
            .filter(|(id, _)| ids.contains(id))
            .map(|(_, run)| run)
            .collect();
        let checks: Vec<Value> = match tested.is_empty() {
            true => Vec::new(),
            false => check_figures(&records, &tested)
                .into_iter()
                .chain(frequency_figures(&records, &tested))
                .map(drawn)
                .collect(),
        };
        Ok(json!({
            "stretch": stretch.into_iter().collect::<Vec<_>>(),
            "checks": checks,
            "poles": pole_rows(&tested),
            "pole_columns": POLES.map(|(name, _)| name),
            "poles_are": POLES_ARE,
        }))
    }

    /// The stored trials of the law of a model, with the law in the model's colour.
    fn law(&self, id: Option<u32>) -> Value {
        let mut law = self.kept("law", id);
        if let (Some(id), Some(picture)) = (id, law.get_mut("picture"))
            && let Some(html) = picture.as_str()
        {
            // The first series is the relay.
            *picture = colours::recoloured(html, &[neutral_colour(), colours::of(id)]).into();
        }
        law
    }
}

/// Largest number of models in the figures.
const MOST_FIGURES: usize = 6;
/// Number of sets of figures that are stored.
const KEPT_FIGURES: usize = 24;

/// Coefficients and delays of a model without effects: name, lag, value, unit.
fn base_parameters(model: &Model) -> Vec<[String; 4]> {
    let row = |name: String, lag: String, value: f64, unit: &str| {
        [name, lag, significant(value, 4), unit.to_owned()]
    };
    let samples = |lag: u16| match lag {
        1 => "sample",
        _ => "samples",
    };
    let long = |lag: u16| time(f64::from(lag) * model.sample_period_s, 3);
    let lag_of = |lag: u16| format!("{lag} {}, {}", samples(lag), long(lag));
    let mut rows = Vec::new();
    match &model.delay {
        Delay::Fixed { delays } => {
            for (input, delay) in (1..).zip(delays) {
                let name = format!("delay of input {input}");
                let unit = format!("{}, {}", samples(*delay), long(*delay));
                rows.push(row(name, String::new(), f64::from(*delay), &unit));
            }
        }
        Delay::Law(law) => {
            for (parameter, value) in law.spec.parameters.iter().zip(&law.parameters) {
                let name = format!("{}: {}", law.spec.name, parameter.name);
                rows.push(row(name, String::new(), *value, unit(parameter)));
            }
            let factors = (1..).zip(&law.factors);
            for (input, factor) in factors.filter(|_| law.factors.len() > 1) {
                let name = format!("delay of input {input} / delay");
                rows.push(row(name, String::new(), *factor, ""));
            }
        }
    }
    if model.constant != 0.0 {
        rows.push(row("d".to_owned(), String::new(), model.constant, ""));
    }
    let lags = model.state_lags.iter().zip(&model.a);
    for (i, (lag, value)) in (1..).zip(lags) {
        rows.push(row(format!("a{i}"), lag_of(*lag), *value, ""));
    }
    for (l, value) in (1..).zip(&model.b) {
        rows.push(row(format!("b{l}"), String::new(), *value, ""));
    }
    let lags = model.product_lags.iter().zip(1..);
    let each = (1..=model.inputs()).flat_map(|l| lags.clone().map(move |(lag, j)| (lag, j, l)));
    for ((lag, j, l), value) in each.zip(&model.c) {
        rows.push(row(format!("c{j}{l}"), lag_of(*lag), *value, ""));
    }
    rows
}

/// Unit of a parameter; empty for a ratio.
fn unit(parameter: &Parameter) -> &'static str {
    match parameter.unit.symbol() {
        "-" => "",
        unit => unit,
    }
}

/// Parameters of the effects of a model: effect, name, value, unit.
fn effect_parameters(model: &Model) -> Vec<[String; 4]> {
    let effects = model.effects.iter();
    let known = effects.filter_map(|added| Some((added, model.spec(&added.name)?)));
    let each = known.flat_map(|(added, spec)| {
        let pairs = spec.parameters.iter().zip(&added.parameters);
        pairs.map(|(parameter, value)| {
            let name = parameter.name.to_owned();
            let unit = unit(parameter).to_owned();
            [added.name.clone(), name, significant(*value, 3), unit]
        })
    });
    each.collect()
}

impl Bench for ModelBench {
    fn page(&self) -> String {
        workbench_page("Workbench", BODY)
    }

    fn state(&self) -> Value {
        let (current, models, log) = {
            let project = lock(&self.project);
            (project.current(), project.nodes().to_vec(), project.log())
        };
        json!({
            "data": self.data().ok().map(|data| data.state()),
            "project": self.folder.display().to_string(),
            "current": current,
            "models": self.models(&models),
            "log": log,
            "uploads": self.uploads.names(),
            "own": self.own.state(),
            "model": current.map(|id| self.model_state(id)),
            "diagnosis": self.kept("diagnosis", current),
            "discovery": self.kept("discovery", current),
            "law": self.law(current),
            "made": self.kept("made", current),
            "intervals": current.and_then(|id| self.intervals(id)),
        })
    }

    fn records(&self, models: &[u32]) -> Result<String, Refusal> {
        let data = self.data()?;
        let compared: Vec<(String, Arc<Compared>)> = models
            .iter()
            .map(|id| Ok((self.label(*id)?, self.compared(*id)?)))
            .collect::<Result<_, Refusal>>()?;
        let runs: Vec<(&str, &[Vec<f64>])> = compared
            .iter()
            .filter_map(|(name, c)| Some((name.as_str(), c.run.as_ref().ok()?.runs.as_slice())))
            .collect();
        // The last model is the current one: its bars are shown.
        let Some((_, last)) = compared.last() else {
            return Ok(page::living(&data.set.records, &[], None).json());
        };
        let records = last.model.targets(&data.set.records);
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

    fn ask(&self, question: &Value) -> Result<Value, Refusal> {
        let object = question.as_object().filter(|object| object.len() == 1);
        let asked = object.and_then(|object| object.iter().next());
        match asked.and_then(|(what, about)| Some((what.as_str(), about.as_str()?))) {
            Some(("check", text)) => Ok(OwnEffects::check(text)),
            Some(("keep", text)) => self.own.keep(text),
            Some(("forget", name)) => self.own.forget(name),
            Some(("inspect", file)) => self.uploads.inspect(file),
            Some(("figures", models)) => self.figures(models),
            Some(("best", seen)) => Ok(self.best_since(seen)),
            Some(("bundled", _)) => self.idle().and_then(|()| self.bring_bundled()),
            Some(("validate", names)) => self.idle().and_then(|()| self.validate_on(names)),
            _ => Err(Refusal(
                "the key must be one of `check`, `keep`, `forget`, `inspect`, `figures`, `best`, `bundled` and `validate`, with a text"
                    .to_owned(),
            )),
        }
    }

    fn upload(&self, name: &str, bytes: &[u8]) -> Result<Value, Refusal> {
        self.uploads.keep(name, bytes)
    }

    fn name(&self, request: &Value) -> Result<String, Refusal> {
        Ok(self.prepare(request)?.line.text())
    }

    fn run(&self, request: &Value, work: &Work) -> Result<(), Refusal> {
        let task = self.prepare(request)?;
        self.busy.store(true, Ordering::Relaxed);
        let done = task.run(self, work);
        self.busy.store(false, Ordering::Relaxed);
        done
    }

    fn file(&self, kind: &str, model: u32) -> Result<Download, Refusal> {
        let path = self.path(model)?;
        let written = |what: &str, name: String, kind: &'static str| {
            let ending = name.rsplit('.').next().unwrap_or_default();
            let content = std::fs::read(self.beside(what, model, ending)?);
            let content = content.map_err(|_| Refusal(format!("model {model} has no {what}")))?;
            Ok(Download {
                name,
                kind,
                content,
            })
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
                let (compared, data) = (self.compared(model)?, self.data()?);
                let run = compared.run.as_ref().map_err(|why| Refusal(why.clone()))?;
                let command = Line::compare(&path, &data.path);
                let page = page::comparison(&compared.model, &data.set, run, &command);
                Ok(Download {
                    name: format!("model-{model}.html"),
                    kind: "text/html; charset=utf-8",
                    content: page.into_bytes(),
                })
            }
            "diagnosis" | "discovery" => written(
                kind,
                format!("{kind}-{model}.html"),
                "text/html; charset=utf-8",
            ),
            "experiment" | "loop" => written(kind, format!("{kind}-{model}.csv"), "text/csv"),
            _ => Err(Refusal(
                "a file must be one of model, constants, report, diagnosis, discovery, experiment and loop"
                    .to_owned(),
            )),
        }
    }
}
