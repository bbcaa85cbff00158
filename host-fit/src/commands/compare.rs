//! `host-fit compare`: indicators of a model on a data set, and where it fails.

use std::path::{Path, PathBuf};

use host_fit::data::DataSet;
use host_fit::indicators::{Indicators, Scores, score};
use host_fit::model::Model;
use host_fit::output::{Staging, write_atomic};
use host_fit::picture::{KeyNumber, Report, WhereItFails};
use host_fit::residual::{Failures, Where, where_it_fails};

use super::Console;
use super::scores::{describe, overlays, report_table, short, table};

/// Run a model free over every record and say how well it matches, and where it does not.
#[derive(Debug, clap::Args)]
pub(crate) struct Args {
    /// The model.
    #[arg(value_name = "model.toml")]
    model: PathBuf,
    /// Folder with dataset.toml, or one CSV file.
    #[arg(value_name = "DATASET")]
    dataset: PathBuf,
    /// Write a report page with pictures.
    #[arg(long, value_name = "out.html")]
    report: Option<PathBuf>,
    /// Write one picture (SVG) per record into this folder.
    #[arg(long, value_name = "DIR")]
    pictures: Option<PathBuf>,
}

#[derive(serde::Serialize)]
struct Document<'a> {
    records: &'a [Indicators],
    identify: &'a Option<Indicators>,
    validate: &'a Option<Indicators>,
    #[serde(rename = "where")]
    places: &'a [Where],
    words: &'a [String],
}

/// A model and the records it is judged on, as it sees them.
pub(crate) fn load(model: &Path, dataset: &Path) -> anyhow::Result<(Model, DataSet)> {
    let model = Model::load(model)?;
    let set = DataSet::load(dataset)?;
    let apart = (set.sample_period_s / model.sample_period_s - 1.0).abs();
    if apart > 1e-6 {
        anyhow::bail!(
            "{}: `sample_period_s` is {}, but the model was made for {} s; its lags would mean other times. \
             Identify a model on this data, or resample it",
            dataset.display(),
            set.sample_period_s,
            model.sample_period_s
        );
    }
    Ok((model, set))
}

/// Runs the command.
pub(crate) fn run(args: &Args, console: Console) -> anyhow::Result<()> {
    let (model, set) = load(&args.model, &args.dataset)?;
    let records = model.targets(&set.records);
    let (scores, runs) = score(&model, &records)?;
    let failures = where_it_fails(&model, &records)?;
    let words = failures.describe();
    let pictures = || overlays(&records, &[("model", &runs)]);
    if let Some(folder) = &args.pictures {
        let mut staging = Staging::new(folder)?;
        for (index, (name, svg)) in pictures().iter().enumerate() {
            let file = format!("{}-{}.svg", index + 1, file_name(name));
            staging.write(&file, |out| out.write_all(svg.as_bytes()))?;
        }
        staging.commit()?;
    }
    if let Some(path) = &args.report {
        let page = page(&model, &set, &scores, &failures, &pictures());
        write_atomic(path, |out| out.write_all(page.as_bytes()))?;
    }
    console.say(&describe(&model))?;
    console.say(&table(&scores))?;
    for sentence in &words {
        console.say(sentence)?;
    }
    for path in args.report.iter().chain(&args.pictures) {
        console.say(&format!("written to {}", path.display()))?;
    }
    console.document(&Document {
        records: &scores.records,
        identify: &scores.identify,
        validate: &scores.validate,
        places: &failures.by,
        words: &words,
    })
}

/// A record's name with only what every file system takes.
fn file_name(name: &str) -> String {
    let plain = |c: char| {
        if c.is_ascii_alphanumeric() || c == '-' || c == '_' {
            c
        } else {
            '_'
        }
    };
    name.chars().map(plain).collect()
}

fn page(
    model: &Model,
    set: &DataSet,
    scores: &Scores,
    failures: &Failures,
    pictures: &[(String, String)],
) -> String {
    let title = set.title.as_deref().unwrap_or("data set");
    let mut report = Report::new("Comparison", title);
    report.section("How well the model matches");
    report.paragraph(&describe(model));
    if let Some(all) = scores.held_out() {
        let noise = all.noise_rmse.map_or_else(|| "–".to_owned(), short);
        report.key_numbers(&[
            KeyNumber::new("FIT", format!("{:.1} %", all.fit_percent), "free run"),
            KeyNumber::new("RMSE", short(all.rmse), "in y"),
            KeyNumber::new("noise floor", noise, "a perfect model's RMSE"),
        ]);
    }
    report_table(&mut report, scores);
    report_failures(&mut report, failures);
    report.section("Record by record");
    for (_, svg) in pictures {
        report.figure(svg, "");
    }
    provenance(&mut report, set);
    report.html()
}

/// The part of a page that says where the model fails.
pub(crate) fn report_failures(report: &mut Report, failures: &Failures) {
    report.section("Where it fails");
    for sentence in failures.describe() {
        report.paragraph(&sentence);
    }
    let plot = WhereItFails {
        title: "Error of the free run on the held-out records",
        y_label: "rms error, y",
        views: &failures.views(),
    };
    report.figure(
        &host_fit::picture::where_it_fails(&plot),
        "Each panel splits the same error by one coordinate.",
    );
}

/// What a page was made from.
pub(crate) fn provenance(report: &mut Report, set: &DataSet) {
    report.provenance("tool", concat!("host-fit ", env!("CARGO_PKG_VERSION")));
    report.provenance("data", &set.hash);
    report.provenance("records", &set.records.len().to_string());
}
