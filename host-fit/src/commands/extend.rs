//! `host-fit extend`: adds effects, refits everything, shows what it gained.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use host_fit::diagnose::ParameterEstimate;
use host_fit::extend::{Extended, Structure, extend};
use host_fit::indicators::{Indicators, Scores, score};
use host_fit::model::Training;

use super::Console;
use super::compare::load;
use super::effect_files::EffectFiles;
use super::scores::{aligned, describe, role_name, short};

/// Add physical effects to a model, refit everything, and show the held-out error before and after.
#[derive(Debug, clap::Args)]
pub(crate) struct Args {
    /// The model to start from.
    #[arg(value_name = "model.toml")]
    model: PathBuf,
    /// Folder with dataset.toml, or one CSV file.
    #[arg(value_name = "DATASET")]
    dataset: PathBuf,
    /// Effect to add, by its name in `host-fit effects` or in an effect file; repeatable.
    #[arg(long, value_name = "NAME", required = true)]
    effect: Vec<String>,
    /// File for the new model.
    #[arg(short, long, value_name = "new.toml")]
    output: PathBuf,
    #[command(flatten)]
    effect_files: EffectFiles,
}

#[derive(serde::Serialize)]
struct Document<'a> {
    model: &'a Path,
    effect: serde_json::Value,
    parameters: BTreeMap<String, &'a ParameterEstimate>,
    before: Option<&'a Indicators>,
    after: Option<&'a Indicators>,
    structure: &'static str,
    records: Vec<Step<'a>>,
}

#[derive(serde::Serialize)]
struct Step<'a> {
    name: &'a str,
    before_rmse: Option<f64>,
    after_rmse: f64,
    noise_rmse: Option<f64>,
}

/// Parameters under their names; with the effect's before them where several were added.
pub(crate) fn flat(
    parameters: &BTreeMap<String, BTreeMap<String, ParameterEstimate>>,
) -> BTreeMap<String, &ParameterEstimate> {
    let several = parameters.len() > 1;
    let all = parameters.iter().flat_map(|(effect, own)| {
        own.iter().map(move |(name, estimate)| {
            let name = if several {
                format!("{effect}.{name}")
            } else {
                name.clone()
            };
            (name, estimate)
        })
    });
    all.collect()
}

/// Fitted parameters as an aligned table.
pub(crate) fn parameter_table(parameters: &BTreeMap<String, &ParameterEstimate>) -> String {
    let rows: Vec<Vec<String>> = parameters
        .iter()
        .map(|(name, p)| {
            vec![
                name.clone(),
                p.unit.clone(),
                short(p.value),
                format!("{} … {}", short(p.low), short(p.high)),
            ]
        })
        .collect();
    aligned(&["parameter", "unit", "value", "95 % interval"], &rows, 2)
}

/// Runs the command.
pub(crate) fn run(args: &Args, console: Console) -> anyhow::Result<()> {
    let (mut model, set) = load(&args.model, &args.dataset)?;
    args.effect_files.define(&mut model)?;
    let records = model.targets(&set.records);
    let bar = console.spinner("refitting everything");
    // A model that diverges on these records can still be extended.
    let before = score(&model, &records).ok().map(|(scores, _)| scores);
    let Extended {
        model: mut extended,
        structure,
        parameters,
        ..
    } = extend(&model, &records, &args.effect)?;
    let (after, _) = score(&extended, &records)?;
    bar.finish_and_clear();
    let learning: Vec<_> = set.identify().collect();
    extended.training = Training {
        data_hash: set.hash.clone(),
        tool_version: env!("CARGO_PKG_VERSION").to_owned(),
        seed: model.training.seed,
        objective: "free-run".to_owned(),
        objective_value: after.identify.as_ref().map_or(0.0, |i| i.epsilon),
        identify_fit_percent: after.identify.as_ref().map_or(0.0, |i| i.fit_percent),
        validate_fit_percent: after.validate.as_ref().map(|i| i.fit_percent),
        ..Training::envelope(&learning)
    };
    extended.save(&args.output)?;

    let parameters = flat(&parameters);
    console.say(&describe(&extended))?;
    if structure == Structure::Lean && model.state_lags.len() + model.product_lags.len() > 2 {
        console.say("the leanest structure (one lag each) with the effect fits as well as the given one: it is kept")?;
    }
    if !parameters.is_empty() {
        console.say(&parameter_table(&parameters))?;
    }
    console.say(&ladder(before.as_ref(), &after))?;
    console.say(&format!("written to {}", args.output.display()))?;
    let effect = match args.effect.as_slice() {
        [one] => serde_json::Value::from(one.as_str()),
        several => serde_json::Value::from(several.to_vec()),
    };
    let steps = after.records.iter().enumerate().map(|(index, after)| Step {
        name: &after.name,
        before_rmse: before
            .as_ref()
            .and_then(|b| Some(b.records.get(index)?.rmse)),
        after_rmse: after.rmse,
        noise_rmse: after.noise_rmse,
    });
    console.document(&Document {
        model: &args.output,
        effect,
        parameters,
        before: before.as_ref().and_then(Scores::held_out),
        after: after.held_out(),
        structure: match structure {
            Structure::Given => "given",
            Structure::Lean => "lean",
        },
        records: steps.collect(),
    })
}

/// RMSE before → after → noise floor, record by record, the held-out ones and all together.
fn ladder(before: Option<&Scores>, after: &Scores) -> String {
    let row = |name: &str, before: Option<&Indicators>, after: &Indicators| {
        vec![
            name.to_owned(),
            role_name(after.role).to_owned(),
            before.map_or_else(|| "diverges".into(), |b| format!("{:.5}", b.rmse)),
            "→".to_owned(),
            format!("{:.5}", after.rmse),
            after
                .noise_rmse
                .map_or_else(|| "–".into(), |noise| format!("{noise:.5}")),
        ]
    };
    let mut rows: Vec<Vec<String>> = after
        .records
        .iter()
        .enumerate()
        .map(|(index, a)| row(&a.name, before.and_then(|b| b.records.get(index)), a))
        .collect();
    let together = [
        (before.map(|b| &b.identify), &after.identify),
        (before.map(|b| &b.validate), &after.validate),
    ];
    for (b, a) in together {
        if let Some(a) = a {
            rows.push(row("together", b.and_then(Option::as_ref), a));
        }
    }
    aligned(
        &[
            "record",
            "use",
            "RMSE before",
            "",
            "RMSE after",
            "noise floor",
        ],
        &rows,
        2,
    )
}
