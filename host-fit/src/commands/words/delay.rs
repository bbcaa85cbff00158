//! Delays in words.

use std::fmt::Write as _;

use super::{Words, lines};
use host_fit::delay::{EdgeDelay, Spread};
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
    let mut text = String::new();
    // Writing to a String cannot fail.
    let _ = writeln!(
        text,
        "{:<12} {:>16} {:>16}  not measured",
        "record", "rising", "falling"
    );
    for name in &report.records {
        let of: Vec<&EdgeDelay> = study.edges.iter().filter(|e| e.record == *name).collect();
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
