//! Delays in words.

use std::fmt::Write as _;

use super::{Words, lines};
use host_fit::delay::{DeadTime, DelayMethod, DelayStudy, DelayVerdict, EdgeDelay, Spread};
use host_fit::steps::DelayReport;

impl Words for DelayReport {
    fn words(&self) -> String {
        let told = std::iter::once(study_words(self));
        let remarks = self.remarks.iter();
        lines(told.chain(remarks.map(|r| format!("Remark on the commands: {r}"))))
    }
}

fn study_words(report: &DelayReport) -> String {
    let study = &report.study;
    let period = report.sample_period_s;
    let mut text = String::new();
    // Writing to a String cannot fail.
    let _ = writeln!(
        text,
        "Delays in samples of {period} s: mean ± standard error (edges measured)"
    );
    let _ = writeln!(
        text,
        "{:<12} {:>18} {:>18}  not measured",
        "record", "rising", "falling"
    );
    for name in &report.records {
        let of: Vec<&EdgeDelay> = study.edges.iter().filter(|e| e.record == *name).collect();
        let side = |rising: bool| -> String {
            let mine = of.iter().filter(|e| e.edge.rising == rising);
            let delays: Vec<(f64, f64)> = mine
                .filter_map(|e| e.onset.ok())
                .map(|o| (o.delay, o.standard_error))
                .collect();
            mean_words(&delays)
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
            "{:<12} {:>18} {:>18}  {}",
            name,
            side(true),
            side(false),
            if reasons.is_empty() {
                "–".into()
            } else {
                reasons.join("; ")
            }
        );
    }
    text.push_str(&dead_time_words(study, period));
    law_words(&mut text, study);
    if let Some(s) = &study.statistics {
        let r = |r: Option<f64>| r.map_or_else(|| "n/a".into(), |r| format!("{r:.2}"));
        if s.all.count > 1 {
            let _ = writeln!(
                text,
                "edges: mean {:.2}, scatter {:.2} samples ({:.4} s); correlation with the command {}, with ỹ {}",
                s.all.mean,
                s.all.sd,
                s.all.sd * period,
                r(s.correlation_input),
                r(s.correlation_output)
            );
        }
        if let Some(q) = &s.sequence {
            let Spread { mean, sd, .. } = q.spread;
            let _ = writeln!(
                text,
                "law evaluated at all samples: mean {mean:.2}, sd {sd:.2} samples; correlation with u {}, with y {}",
                r(q.correlation_input),
                r(q.correlation_output)
            );
        }
    }
    text.push_str(&study.words);
    text
}

/// The dead time of all edges with its interval, in both units, and its method.
fn dead_time_words(study: &DelayStudy, period: f64) -> String {
    let mut text = String::new();
    let both = |time: DeadTime| {
        let seconds = time.scaled(period);
        format!(
            "{:.1} samples (95 %: {:.1} … {:.1}) = {} s (95 %: {} … {})",
            time.samples,
            time.low,
            time.high,
            brief(seconds.samples),
            brief(seconds.low),
            brief(seconds.high)
        )
    };
    let Some(dead_time) = study.dead_time else {
        text.push_str("Dead time: no response to an edge was found in the identify records.\n");
        return text;
    };
    let _ = writeln!(text, "Dead time: {}", both(dead_time));
    let how = match (study.plant, study.method) {
        (Some(plant), DelayMethod::Trajectory) => {
            let (on, off) = (plant.time_constants_on, plant.time_constants_off);
            let order = if plant.order == 1 {
                "first order"
            } else {
                "second order"
            };
            let sum = if (on - off).abs() < 1e-6 * on {
                format!("{on:.1} samples, {} s", brief(on * period))
            } else {
                format!(
                    "{on:.1} samples with the command on, {off:.1} off ({} and {} s)",
                    brief(on * period),
                    brief(off * period)
                )
            };
            format!(
                "from {}, {order} (sum of time constants {sum}); the interval allows for first and second order",
                study.method.words()
            )
        }
        (_, DelayMethod::Window) => format!(
            "from {}; one plant with one dead time does not fit the records",
            study.method.words()
        ),
        _ => format!(
            "from {}; one plant does not fit the records. The interval includes the change of the result with \
                 --reach (here {} samples, {} s)",
            study.method.words(),
            study.reach,
            brief(study.reach as f64 * period)
        ),
    };
    let _ = writeln!(text, "  {how}");
    if let (Some(rising), Some(falling)) = (study.rising, study.falling)
        && (rising.high < falling.low || falling.high < rising.low)
    {
        let _ = writeln!(text, "  rising edges: {}", both(rising));
        let _ = writeln!(text, "  falling edges: {}", both(falling));
    }
    text
}

fn law_words(text: &mut String, study: &DelayStudy) {
    if let Some(law) = &study.law {
        let _ = writeln!(
            text,
            "law (2): h = p0 + p1·exp(−p2·ỹ), {} edges, residual {:.2} samples, explains {:.0} %",
            law.edges,
            law.residual_sd,
            100.0 * law.explained
        );
        for (name, e, unit) in [
            ("p0", law.p0, "samples"),
            ("p1", law.p1, "samples"),
            ("p2", law.p2, "1/unit of y"),
        ] {
            let _ = writeln!(
                text,
                "  {name} = {:.3} {unit}  (95 %: {:.3} … {:.3})",
                e.value, e.low, e.high
            );
        }
        if !law.outliers.is_empty() {
            let _ = writeln!(text, "  {} outlying edge(s) excluded", law.outliers.len());
        }
    } else if let Some(reason) = &study.law_not_kept {
        let otherwise = match study.verdict {
            DelayVerdict::EdgeDependent | DelayVerdict::EdgeAndStateDependent => "",
            _ => " The delay is constant.",
        };
        let _ = writeln!(text, "delay law (2) is rejected: {reason}.{otherwise}");
    }
}

/// Three significant figures.
fn brief(value: f64) -> String {
    host_fit::picture::significant(value, 3)
}

/// Mean and standard error of some delays, each with its own standard error; never 0, because edges share a
/// clock.
fn mean_words(delays: &[(f64, f64)]) -> String {
    if delays.is_empty() {
        return "–".into();
    }
    let n = delays.len() as f64;
    let mean = delays.iter().map(|d| d.0).sum::<f64>() / n;
    let scatter = delays.iter().map(|d| (d.0 - mean).powi(2)).sum::<f64>();
    let scatter = (scatter / (n - 1.0).max(1.0) / n).sqrt();
    // The standard error of every edge contains the part that all edges share.
    let shared = delays.iter().map(|d| d.1).fold(f64::INFINITY, f64::min);
    let error = scatter.max(shared).max(0.1);
    format!("{mean:.1} ± {error:.1} ({})", delays.len())
}
