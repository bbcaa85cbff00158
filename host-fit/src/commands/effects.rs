//! `host-fit effects`: the catalogue of physical effects.

use anyhow::bail;
use host_fit::extend::nearest_name;
use model_core::effect::{Place, Spec};
use model_core::effects::{SPECS, spec};

use super::Console;
use super::scores::{aligned, short};

/// List the physical effects that can be missing, and added.
#[derive(Debug, clap::Args)]
pub(crate) struct Args {
    /// Only this effect, with its equation and parameters.
    #[arg(value_name = "NAME")]
    name: Option<String>,
}

#[derive(serde::Serialize)]
struct Entry {
    name: &'static str,
    place: &'static str,
    summary: &'static str,
    equation: &'static str,
    channel: Option<&'static str>,
    source: &'static str,
    parameters: Vec<ParameterEntry>,
}

#[derive(serde::Serialize)]
struct ParameterEntry {
    name: &'static str,
    unit: &'static str,
    low: f64,
    high: f64,
}

fn place(place: Place) -> &'static str {
    match place {
        Place::Jet => "jet",
        Place::Delay => "delay",
        Place::Flow => "flow",
        Place::Sensor => "sensor",
    }
}

fn entry(spec: &Spec) -> Entry {
    let parameters = spec.parameters.iter().map(|p| ParameterEntry {
        name: p.name,
        unit: p.unit.symbol(),
        low: p.low,
        high: p.high,
    });
    Entry {
        name: spec.name,
        place: place(spec.place),
        summary: spec.summary,
        equation: spec.equation,
        channel: spec.channel,
        source: spec.source,
        parameters: parameters.collect(),
    }
}

/// Runs the command.
pub(crate) fn run(args: &Args, console: Console) -> anyhow::Result<()> {
    let Some(name) = &args.name else {
        let rows: Vec<Vec<String>> = SPECS
            .iter()
            .map(|spec| {
                vec![
                    spec.name.to_owned(),
                    place(spec.place).to_owned(),
                    spec.summary.to_owned(),
                ]
            })
            .collect();
        console.say(&aligned(&["effect", "place", "what it is"], &rows, 3))?;
        return console.document(&SPECS.iter().map(entry).collect::<Vec<_>>());
    };
    let Some(spec) = spec(name) else {
        let known: Vec<&str> = SPECS.iter().map(|spec| spec.name).collect();
        bail!("{}", nearest_name(name, &known));
    };
    console.say(&words(spec))?;
    console.document(&entry(spec))
}

fn words(spec: &Spec) -> String {
    let mut text = format!(
        "{} ({})\n{}\n{}",
        spec.name,
        place(spec.place),
        spec.summary,
        spec.equation
    );
    if let Some(channel) = spec.channel {
        text.push_str(&format!("\nneeds the measured channel `{channel}`"));
    }
    let rows: Vec<Vec<String>> = spec
        .parameters
        .iter()
        .map(|p| {
            vec![
                p.name.to_owned(),
                p.unit.to_string(),
                short(p.low),
                short(p.high),
            ]
        })
        .collect();
    if !rows.is_empty() {
        text.push('\n');
        text.push_str(&aligned(&["parameter", "unit", "low", "high"], &rows, 2));
    }
    text.push_str(&format!("\nsource: {}", spec.source));
    text
}
