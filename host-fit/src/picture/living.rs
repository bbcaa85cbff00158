//! Data for interactive records with models on a page.
//!
//! The script and its styles are bundled from `host-fit/web` and checked in, so that only cargo is needed to
//! build.

use base64::Engine as _;
use base64::engine::general_purpose::STANDARD;
use serde::Serialize;

use crate::data::Record;

/// A page's script, its styles, and the script's hash for the page's security policy.
pub(super) struct Bundle {
    pub(super) script: &'static str,
    pub(super) style: &'static str,
    pub(super) hash: &'static str,
}

macro_rules! bundle {
    ($name:literal) => {
        Bundle {
            script: include_str!(concat!("../../web/bundle/", $name, ".js")),
            style: include_str!(concat!("../../web/bundle/", $name, ".css")),
            hash: include_str!(concat!("../../web/bundle/", $name, ".sha256")),
        }
    };
}

pub(super) const REPORT: Bundle = bundle!("report");
pub(super) const WORKBENCH: Bundle = bundle!("workbench");

/// Samples of one record by bin of a coordinate, in order: the bin and the number of samples; no bin where
/// the coordinate is undefined or outside the table.
pub type Stretches = Vec<(Option<u16>, usize)>;

/// Data of an interactive page. Serialises to the input of the page's script; samples are in single
/// precision, which exceeds the resolution of any converter.
#[derive(Clone, Debug, Default, Serialize)]
pub struct Living {
    /// Label of the y axis.
    label: String,
    records: Vec<LivingRecord>,
    /// Names of the models.
    runs: Vec<String>,
    /// Runs that are hidden at first.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    off: Vec<usize>,
    coordinates: Vec<Coordinate>,
    /// Initial view, from and to, s since a record's start; everything if omitted.
    #[serde(skip_serializing_if = "Option::is_none")]
    view: Option<[f64; 2]>,
}

#[derive(Clone, Debug, Serialize)]
struct LivingRecord {
    name: String,
    #[serde(rename = "use")]
    role: String,
    t0: f64,
    period: f64,
    n: usize,
    u: Command,
    y: String,
    #[serde(skip_serializing_if = "Option::is_none")]
    sd: Option<String>,
    #[serde(skip_serializing_if = "Option::is_none")]
    low: Option<String>,
    #[serde(skip_serializing_if = "Option::is_none")]
    high: Option<String>,
    runs: Vec<Option<String>>,
}

/// A command: its switching samples, or its values.
#[derive(Clone, Debug, Serialize)]
#[serde(rename_all = "lowercase")]
enum Command {
    Edges(Vec<usize>),
    Values(String),
}

#[derive(Clone, Debug, Serialize)]
struct Coordinate {
    name: String,
    unit: String,
    /// Per record: bin, samples, bin, samples … (bin −1: none).
    places: Vec<Vec<i64>>,
}

impl Living {
    /// Records with labelled free runs; `role` gives the use of a record in words.
    #[must_use]
    pub fn new(
        label: &str,
        records: &[Record],
        runs: &[(&str, &[Vec<f64>])],
        role: impl Fn(&Record) -> String,
    ) -> Self {
        let record = |(index, record): (usize, &Record)| LivingRecord {
            name: record.name.clone(),
            role: role(record),
            t0: record.t0,
            period: record.sample_period_s,
            n: record.len(),
            u: command(record),
            y: packed(&record.y),
            sd: record.y_sd.as_deref().map(packed),
            low: record.y_min.as_deref().map(packed),
            high: record.y_max.as_deref().map(packed),
            runs: runs
                .iter()
                .map(|(_, runs)| {
                    let run = runs.get(index)?;
                    (run.len() == record.len()).then(|| packed(run))
                })
                .collect(),
        };
        Self {
            label: label.to_owned(),
            records: records.iter().enumerate().map(record).collect(),
            runs: runs.iter().map(|(name, _)| (*name).to_owned()).collect(),
            off: Vec::new(),
            coordinates: Vec::new(),
            view: None,
        }
    }

    /// Sets the initial view, s since a record's start.
    pub fn view(&mut self, from: f64, to: f64) -> &mut Self {
        self.view = (from < to).then_some([from, to]);
        self
    }

    /// Hides these runs at first.
    pub fn off(&mut self, runs: impl IntoIterator<Item = usize>) -> &mut Self {
        self.off.extend(runs);
        self
    }

    /// Adds a coordinate of "where it fails": the bin of each sample, per record. Add coordinates in the order of
    /// the panels.
    pub fn coordinate(&mut self, name: &str, unit: &str, places: &[Stretches]) -> &mut Self {
        let flat = |stretches: &Stretches| {
            let pairs = stretches.iter();
            pairs
                .flat_map(|(bin, count)| [bin.map_or(-1, i64::from), *count as i64])
                .collect()
        };
        self.coordinates.push(Coordinate {
            name: name.to_owned(),
            unit: unit.to_owned(),
            places: places.iter().map(flat).collect(),
        });
        self
    }

    /// As JSON without a sequence that ends an HTML element.
    #[must_use]
    pub fn json(&self) -> String {
        let json = serde_json::to_string(self).unwrap_or_else(|_| "{}".to_owned());
        json.replace('<', "\\u003c")
            .replace('>', "\\u003e")
            .replace('&', "\\u0026")
    }
}

/// Samples for the page's script: single precision, base64.
#[must_use]
pub fn packed(values: &[f64]) -> String {
    let bytes: Vec<u8> = values
        .iter()
        .flat_map(|v| (*v as f32).to_le_bytes())
        .collect();
    STANDARD.encode(bytes)
}

fn command(record: &Record) -> Command {
    if !record.is_on_off() {
        return Command::Values(packed(&record.u));
    }
    let mut before = 0.0;
    let edges = record.u.iter().enumerate().filter_map(|(k, u)| {
        let edge = *u != before;
        before = *u;
        edge.then_some(k)
    });
    Command::Edges(edges.collect())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::data::Use;

    #[test]
    fn a_payload_says_what_the_record_does() {
        let u = vec![0.0, 1.0, 1.0, 0.0, 1.0];
        let record = Record::new(
            "</script>&",
            Use::Validate,
            0.5,
            u,
            vec![0.0, 1.0, -2.5, 0.25, 1e-3],
        );
        let run = vec![vec![1.0; 5]];
        let mut living = Living::new("y", &[record], &[("m", &run), ("none", &[])], |_| {
            "held out".to_owned()
        });
        living.coordinate("level", "y", &[vec![(None, 2), (Some(3), 3)]]);
        let json = living.json();
        assert!(!json.contains('<') && !json.contains('&'));
        let value: serde_json::Value = serde_json::from_str(&json).unwrap();
        let first = &value["records"][0];
        assert_eq!(first["name"], "</script>&");
        assert_eq!(first["u"]["edges"], serde_json::json!([1, 3, 4]));
        assert!(first["runs"][1].is_null());
        assert_eq!(
            value["coordinates"][0]["places"][0],
            serde_json::json!([-1, 2, 3, 3])
        );
        let y = STANDARD.decode(first["y"].as_str().unwrap()).unwrap();
        assert_eq!(y[8..12], (-2.5f32).to_le_bytes());
    }

    /// Eight records of 10 000 samples with three models and their scatter stay below the size limit of a
    /// page.
    #[test]
    fn eighty_thousand_samples_of_three_models_stay_under_five_megabytes() {
        let n = 10_000;
        let wave = |k: usize| (k as f64 * 0.37).sin();
        let records: Vec<Record> = (0..8)
            .map(|i| {
                let u = (0..n).map(|k| f64::from(u8::from(k % 250 < 100))).collect();
                let mut record = Record::new(
                    &format!("r{i}"),
                    Use::Validate,
                    0.001,
                    u,
                    (0..n).map(wave).collect(),
                );
                record.y_sd = Some((0..n).map(|k| 0.01 + 0.001 * wave(k)).collect());
                record
            })
            .collect();
        let runs: Vec<Vec<f64>> = vec![(0..n).map(wave).collect(); 8];
        let mut living = Living::new(
            "y",
            &records,
            &[("a", &runs), ("b", &runs), ("c", &runs)],
            |_| String::new(),
        );
        // A dozen coordinates that change every few samples, like a noisy channel.
        for _ in 0..12 {
            let places = vec![(0..n / 5).map(|i| (Some((i % 30) as u16), 5)).collect(); 8];
            living.coordinate("c", "", &places);
        }
        let mut report = crate::picture::Report::new("a", "b");
        report.living(&living);
        let size = report.html().len();
        assert!(size < 5_000_000, "{size} bytes");
    }
}
