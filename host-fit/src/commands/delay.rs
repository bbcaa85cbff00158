//! `host-fit delay`: edge delays, the exponential law (2), its statistics.

use std::fmt::Write as _;
use std::path::PathBuf;

use host_fit::data::{DataSet, Excitation};
use host_fit::delay::{
    DelayLawFit, DelayOptions, DelayStatistics, DelayStudy, DelayVerdict, EdgeDelay, Spread,
    draw_delays, study_delays,
};
use host_fit::output::Staging;

use super::Console;

/// Measure the delay of the response to every edge of the command, and fit the law h = p0 + p1·exp(−p2·ỹ).
///
/// A delay is the time from an edge to the kink where y starts to head elsewhere, located by least squares between
/// the neighbouring responses. The law is fitted to the identify records.
#[derive(Debug, clap::Args)]
pub(crate) struct Args {
    /// Folder with dataset.toml, or one CSV file.
    #[arg(value_name = "DATASET")]
    dataset: PathBuf,
    /// W of the averaged output ỹ, in samples.
    #[arg(long, value_name = "SAMPLES", default_value_t = 250, value_parser = clap::value_parser!(u32).range(2..=1_000_000))]
    window: u32,
    /// Longest delay that is looked for, in samples.
    #[arg(long, value_name = "SAMPLES", default_value_t = 250, value_parser = clap::value_parser!(u32).range(1..=100_000))]
    max_delay: u32,
    /// Samples of y used on either side of the start of a response.
    #[arg(long, value_name = "SAMPLES", default_value_t = 30, value_parser = clap::value_parser!(u32).range(8..=10_000))]
    reach: u32,
    /// Seed of the permutation tests.
    #[arg(long, default_value_t = 0)]
    seed: u64,
    /// Folder for edges.csv (every edge) and delays.svg (the picture).
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,
}

#[derive(serde::Serialize)]
struct Document<'a> {
    sample_period_s: f64,
    window_samples: u32,
    law: Option<&'a DelayLawFit>,
    statistics: Option<&'a DelayStatistics>,
    verdict: DelayVerdict,
    words: &'a str,
    remarks: &'a [String],
    p_law: Option<f64>,
    p_law_within_direction: Option<f64>,
    p_direction: Option<f64>,
    direction_offset_samples: Option<f64>,
    edges: Vec<EdgeLine<'a>>,
}

/// One edge as written to JSON and CSV.
#[derive(serde::Serialize)]
struct EdgeLine<'a> {
    record: &'a str,
    #[serde(rename = "use")]
    role: host_fit::data::Use,
    edge: &'static str,
    sample: usize,
    time_s: f64,
    delay_samples: Option<f64>,
    standard_error_samples: Option<f64>,
    half_response_samples: Option<f64>,
    mean_output: Option<f64>,
    not_measured: Option<&'static str>,
}

impl<'a> EdgeLine<'a> {
    fn new(e: &'a EdgeDelay) -> Self {
        let onset = e.onset.ok();
        Self {
            record: &e.record,
            role: e.role,
            edge: if e.edge.rising { "rising" } else { "falling" },
            sample: e.edge.sample,
            time_s: e.time_s,
            delay_samples: onset.map(|o| o.delay),
            standard_error_samples: onset.map(|o| o.standard_error),
            half_response_samples: onset.and_then(|o| o.half_response),
            mean_output: e.mean_output,
            not_measured: e.onset.err().map(|u| u.words()),
        }
    }
}

/// Runs the command.
pub(crate) fn run(args: &Args, console: Console) -> anyhow::Result<()> {
    let set = DataSet::load(&args.dataset)?;
    let options = DelayOptions {
        window: args.window as usize,
        max_delay: args.max_delay as usize,
        reach: args.reach as usize,
        seed: args.seed,
    };
    let study = study_delays(&set, &options)?;
    let lines: Vec<EdgeLine<'_>> = study.edges.iter().map(EdgeLine::new).collect();
    if let Some(out) = &args.out {
        let mut staging = Staging::new(out)?;
        staging.write("edges.csv", |w| {
            let mut csv = csv::Writer::from_writer(w);
            for line in &lines {
                csv.serialize(line)?;
            }
            csv.flush()
        })?;
        let title = set.title.as_deref().unwrap_or_default();
        let picture = draw_delays(&study, title, set.sample_period_s);
        staging.write("delays.svg", |w| w.write_all(picture.as_bytes()))?;
        staging.commit()?;
    }
    let excitation = Excitation::of(&set, args.max_delay as usize);
    console.say(&words(&set, &study))?;
    for remark in &excitation.remarks {
        console.say(&format!("Remark on the commands: {remark}"))?;
    }
    console.document(&Document {
        sample_period_s: set.sample_period_s,
        window_samples: args.window,
        law: study.law.as_ref(),
        statistics: study.statistics.as_ref(),
        verdict: study.verdict,
        words: &study.words,
        remarks: &excitation.remarks,
        p_law: study.p_law,
        p_law_within_direction: study.p_law_within_direction,
        p_direction: study.p_direction,
        direction_offset_samples: study.direction_offset,
        edges: lines,
    })
}

fn words(set: &DataSet, study: &DelayStudy) -> String {
    let mut text = String::new();
    // Writing to a String cannot fail.
    let _ = writeln!(
        text,
        "{:<12} {:>16} {:>16}  not measured",
        "record", "rising", "falling"
    );
    for record in &set.records {
        let of: Vec<&EdgeDelay> = study
            .edges
            .iter()
            .filter(|e| e.record == record.name)
            .collect();
        let side = |rising: bool| -> String {
            let delays: Vec<f64> = of
                .iter()
                .filter(|e| e.edge.rising == rising)
                .filter_map(|e| Some(e.onset.ok()?.delay))
                .collect();
            spread_words(&delays)
        };
        let mut reasons: Vec<(&str, usize)> = Vec::new();
        for reason in of.iter().filter_map(|e| e.onset.err()) {
            match reasons.iter_mut().find(|r| r.0 == reason.words()) {
                Some(entry) => entry.1 += 1,
                None => reasons.push((reason.words(), 1)),
            }
        }
        let reasons: Vec<String> = reasons.iter().map(|(r, n)| format!("{n} {r}")).collect();
        let _ = writeln!(
            text,
            "{:<12} {:>16} {:>16}  {}",
            record.name,
            side(true),
            side(false),
            if reasons.is_empty() {
                "–".into()
            } else {
                reasons.join("; ")
            }
        );
    }
    if let Some(law) = &study.law {
        let _ = writeln!(
            text,
            "law (2): h = p0 + p1·exp(−p2·ỹ), {} edges, residual {:.2} samples, explains {:.0} %",
            law.edges,
            law.residual_sd,
            100.0 * law.explained
        );
        for (name, e) in [("p0", law.p0), ("p1", law.p1), ("p2", law.p2)] {
            let _ = writeln!(
                text,
                "  {name} = {:.3}  (95 %: {:.3} … {:.3})",
                e.value, e.low, e.high
            );
        }
        if !law.outliers.is_empty() {
            let _ = writeln!(text, "  {} edge(s) far off set aside", law.outliers.len());
        }
    }
    if let Some(s) = &study.statistics {
        let r = |r: Option<f64>| r.map_or_else(|| "n/a".into(), |r| format!("{r:.2}"));
        let _ = writeln!(
            text,
            "edges: mean {:.2}, sd {:.2} samples; correlation with the command {}, with ỹ {}",
            s.all.mean,
            s.all.sd,
            r(s.correlation_input),
            r(s.correlation_output)
        );
        if let Some(q) = &s.sequence {
            let Spread { mean, sd, .. } = q.spread;
            let _ = writeln!(
                text,
                "law over all samples: mean {mean:.2}, sd {sd:.2} samples; correlation with u {}, with y {}",
                r(q.correlation_input),
                r(q.correlation_output)
            );
        }
    }
    text.push_str(&study.words);
    text
}

fn spread_words(delays: &[f64]) -> String {
    if delays.is_empty() {
        return "–".into();
    }
    let n = delays.len() as f64;
    let mean = delays.iter().sum::<f64>() / n;
    let sd = (delays.iter().map(|d| (d - mean).powi(2)).sum::<f64>() / (n - 1.0).max(1.0)).sqrt();
    format!("{mean:.1} ± {sd:.1} ({})", delays.len())
}
