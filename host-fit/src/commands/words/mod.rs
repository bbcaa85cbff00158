//! Results in words: the output of a command without `--json`.

mod delay;
mod design;
mod finding;

pub(crate) use design::{TRIALS, trial_caption, trial_rows};
pub(crate) use finding::{
    every_candidate, interval, is_told, ladder_caption, ladder_rows, named_first, ranking_rows,
    screened_only,
};

use std::collections::BTreeMap;
use std::fmt::Write as _;

use host_fit::data::{AverageSummary, Use};
use host_fit::diagnose::ParameterEstimate;
use host_fit::identify::Refinement;
use host_fit::indicators::{Indicators, Scores};
use host_fit::model::{Delay, Law, Model, TransportLaw};
use host_fit::picture::{listed, significant, time};
use host_fit::rules::Rulebook;
use host_fit::steps::{
    Average, Beside, BoardConstants, Comparison, EffectEntry, Extension, Identification,
    ImportedSet, NamedComparison, SideBySide, Simulation,
};

use model_core::effect::Unit;

/// A result with a text form.
pub(crate) trait Words {
    /// The result as lines of text.
    fn words(&self) -> String;
}

/// Joins non-empty texts by line ends.
fn lines(pieces: impl IntoIterator<Item = String>) -> String {
    pieces.into_iter().collect::<Vec<_>>().join("\n")
}

impl Words for Average {
    fn words(&self) -> String {
        let each = self.recordings.iter().map(Words::words);
        lines(each.chain([format!("hash {}", self.hash)]))
    }
}

impl Words for ImportedSet {
    fn words(&self) -> String {
        let name = |n: &Option<String>| n.clone().unwrap_or_default();
        let each = self.files.iter().map(|file| {
            let taken = &file.mapping;
            let time = match &taken.t {
                Some(t) => format!("t is `{t}`"),
                None => "t is the row number".to_owned(),
            };
            let mut text = format!(
                "{}: {}; {} samples, {} s apart; {time}, u is `{}`, y is `{}`",
                file.name,
                file.dialect,
                file.samples,
                file.sample_period_s,
                name(&taken.u),
                name(&taken.y),
            );
            for remark in &file.remarks {
                text.push_str(&format!("\n  {remark}"));
            }
            text
        });
        let period = self.sample_period_s;
        let rate: f64 = format!("{:.3e}", 1.0 / period)
            .parse()
            .unwrap_or(1.0 / period);
        let rate = format!("sampling period {period} s ({rate} Hz)");
        let remarks = self.remarks.iter().cloned();
        let end = [rate].into_iter().chain(remarks);
        lines(each.chain(end).chain([format!("hash {}", self.hash)]))
    }
}

impl Words for AverageSummary {
    fn words(&self) -> String {
        let mut text = format!(
            "{}: {} periods of {} samples ({} s) averaged, aligned on {}",
            self.name,
            self.periods_used,
            self.period_samples,
            self.period_samples as f64 * self.sample_period_s,
            if self.aligned_on_edges {
                "edges"
            } else {
                "the period"
            },
        );
        match self.mean_standard_error {
            Some(e) => text.push_str(&format!("; standard error of y {e:.2e} (rms)")),
            None => text.push_str("; one period alone gives no standard error"),
        }
        for d in &self.dropped {
            text.push_str(&format!(
                "\n  dropped {}: {}, first at line {}",
                d.periods,
                d.defect.words(),
                d.first_line
            ));
        }
        if self.left_over_samples > 0 {
            text.push_str(&format!(
                "\n  {} samples at the end are not a whole period",
                self.left_over_samples
            ));
        }
        text
    }
}

impl Words for Identification {
    fn words(&self) -> String {
        let mut told = vec![
            self.answer.words(),
            String::new(),
            describe(&self.model),
            format!(
                "state lags {:?}, product lags {:?}",
                self.model.state_lags, self.model.product_lags
            ),
            format!(
                "{} {} after {} evaluations in {:.1} s; {}",
                self.objective.name(),
                short(self.objective_value),
                self.evaluations,
                self.wall_time_s,
                self.stop
            ),
        ];
        told.extend(self.refinement.as_ref().map(refinement_words));
        told.extend(self.remarks.iter().cloned());
        told.push(table(&self.scores));
        told.extend(beside_words(&self.beside));
        lines(told)
    }
}

/// The baselines, and the samples that were scored.
fn beside_words(beside: &Beside) -> Vec<String> {
    let mut told = beside.words.clone();
    if beside.scored_samples < beside.samples {
        told.push(format!(
            "{} of {} samples are scored",
            beside.scored_samples, beside.samples
        ));
    }
    told
}

fn refinement_words(refinement: &Refinement) -> String {
    let pair = |(before, after): (f64, f64)| format!("{} → {}", short(before), short(after));
    let mut text = format!(
        "refined on the free run: estimation ε {}",
        pair(refinement.identify)
    );
    if let Some(validate) = refinement.validate {
        text.push_str(&format!(", validation ε {}", pair(validate)));
    }
    text.push_str(if refinement.kept {
        "; kept"
    } else {
        "; not kept"
    });
    text
}

impl Words for Comparison {
    fn words(&self) -> String {
        let table = [format!("{}\n", self.answer.words()), table(&self.scores)].into_iter();
        let beside = beside_words(&self.beside).into_iter();
        lines(table.chain(beside).chain(self.words.iter().cloned()))
    }
}

impl Words for SideBySide {
    fn words(&self) -> String {
        let rows: Vec<Vec<String>> = side_by_side_rows(self);
        let table = aligned(&SIDE_BY_SIDE, &rows, 1);
        let baselines = self.models.first();
        let beside = baselines
            .into_iter()
            .flat_map(|m| beside_words(&m.comparison.beside));
        let answer = format!("{}\n", self.answer.words());
        lines([answer, table].into_iter().chain(beside))
    }
}

/// The head of [`side_by_side_rows`].
pub(crate) const SIDE_BY_SIDE: [&str; 7] = [
    "model",
    "FIT %, estimation",
    "FIT %, validation",
    "RMSE",
    "noise",
    "RMSE / noise",
    "parameters",
];

/// A row for each model; errors are those of the validation records if there are any.
pub(crate) fn side_by_side_rows(found: &SideBySide) -> Vec<Vec<String>> {
    let none = || "–".to_owned();
    let row = |named: &NamedComparison| {
        let scores = &named.comparison.scores;
        let fit =
            |of: Option<&Indicators>| of.map_or_else(none, |of| format!("{:.2}", of.fit_percent));
        let judged = scores.held_out();
        let noise = judged.and_then(|of| of.noise_rmse);
        let ratio = judged.zip(noise).filter(|(_, noise)| *noise > 0.0);
        vec![
            named.model.clone(),
            fit(scores.identify.as_ref()),
            fit(scores.validate.as_ref()),
            judged.map_or_else(none, |of| format!("{:.5}", of.rmse)),
            noise.map_or_else(none, |noise| format!("{noise:.5}")),
            ratio.map_or_else(none, |(of, noise)| format!("{:.2}", of.rmse / noise)),
            named.parameters.to_string(),
        ]
    };
    found.models.iter().map(row).collect()
}

impl Words for Extension {
    fn words(&self) -> String {
        let mut told = vec![self.answer.words(), String::new(), describe(&self.model)];
        told.extend(dropped_terms(self));
        if !self.parameters.is_empty() {
            let rows = parameter_rows(&self.parameters);
            told.push(aligned(&PARAMETERS, &rows, 2));
        }
        told.push(changes(self.scores_before.as_ref(), &self.scores_after));
        lines(told)
    }
}

/// Terms of the given model that are no longer needed.
pub(crate) fn dropped_terms(found: &Extension) -> Option<String> {
    let (effects, dropped) = (listed(&found.effects), found.dropped.join(", "));
    (!dropped.is_empty()).then(|| format!("No longer needed with {effects}: {dropped}."))
}

/// Columns of [`parameter_rows`].
pub(crate) const PARAMETERS: [&str; 4] = ["parameter", "unit", "value", "95 % interval"];

/// A row for each fitted parameter.
pub(crate) fn parameter_rows(parameters: &BTreeMap<String, ParameterEstimate>) -> Vec<Vec<String>> {
    parameters
        .iter()
        .map(|(name, p)| vec![name.clone(), p.unit.clone(), short(p.value), interval(p)])
        .collect()
}

/// RMSE before → after → noise level, per record and in total.
fn changes(before: Option<&Scores>, after: &Scores) -> String {
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
            "noise level",
        ],
        &rows,
        2,
    )
}

impl Words for Simulation {
    fn words(&self) -> String {
        let run = format!(
            "{} samples ({} s): mean y {:.4}, between {:.4} and {:.4}",
            self.samples,
            self.samples as f64 * self.sample_period_s,
            self.mean,
            self.lowest,
            self.highest,
        );
        let outside = self.outside_training.iter();
        lines(std::iter::once(run).chain(outside.map(|w| format!("extrapolation: {w}"))))
    }
}

impl Words for BoardConstants {
    fn words(&self) -> String {
        format!(
            "N1 = {}, N2 = {}, N3 = {}, effects: {}, law: {}",
            self.sizes[0],
            self.sizes[1],
            self.sizes[2],
            match self.effects.as_slice() {
                [] => "none".to_owned(),
                names => names.join(", "),
            },
            match &self.law {
                None => "none".to_owned(),
                Some(Law::Track(law)) =>
                    format!("holds {}", significant(law.reference + self.sensor_zero, 4)),
                Some(Law::Maximise(law)) => format!("pulses every {} samples", law.period),
            }
        )
    }
}

/// The effects with their summaries.
pub(crate) fn effect_table(effects: &[EffectEntry]) -> String {
    let row = |e: &EffectEntry| [e.name, e.place, e.summary].map(str::to_owned).to_vec();
    let rows: Vec<Vec<String>> = effects.iter().map(row).collect();
    aligned(&["effect", "place", "what it is"], &rows, 3)
}

impl Words for EffectEntry {
    fn words(&self) -> String {
        let mut told = vec![
            format!("{} ({})", self.name, self.place),
            self.summary.to_owned(),
            self.equation.to_owned(),
        ];
        let parts = [
            ("records show", self.shows.as_deref()),
            ("bench check", self.check),
            ("confused with", self.confused_with),
        ];
        for (label, text) in parts {
            told.extend(text.map(|text| format!("{label}: {text}")));
        }
        if let Some(channel) = self.channel {
            told.push(format!("needs the measured channel `{channel}`"));
        }
        let parameters = self.parameters.iter().map(|p| {
            vec![
                p.name.to_owned(),
                p.unit.to_owned(),
                short(p.low),
                short(p.high),
            ]
        });
        let rows: Vec<Vec<String>> = parameters.collect();
        if !rows.is_empty() {
            told.push(aligned(&["parameter", "unit", "low", "high"], &rows, 2));
        }
        told.push(format!("source: {}", self.source));
        lines(told)
    }
}

impl Words for Rulebook {
    fn words(&self) -> String {
        let rows: Vec<Vec<String>> = self
            .rules
            .iter()
            .map(|rule| {
                vec![
                    rule.name.clone(),
                    rule.value.to_string(),
                    rule.unit.to_owned(),
                ]
            })
            .collect();
        let table = aligned(&["rule", "value", "unit"], &rows, 3);
        let mut told = vec![format!("{}: {}", self.room, self.about)];
        let mut rows = table.lines();
        told.extend(rows.next().map(str::to_owned));
        for (row, rule) in rows.zip(&self.rules) {
            told.push(row.to_owned());
            told.push(format!("    {}", rule.meaning));
            told.push(format!("    ({})", rule.calibrated));
        }
        told.push(String::new());
        lines(told)
    }
}

/// `identify` or `validate`.
pub(crate) fn role_name(role: Use) -> &'static str {
    match role {
        Use::Identify => "identify",
        Use::Validate => "validate",
    }
}

/// The model in short: structure, delays and effects.
pub(crate) fn describe(model: &Model) -> String {
    let delay = match &model.delay {
        Delay::Fixed { delays } => format!("fixed delay {delays:?} samples"),
        Delay::Law(law) => format!("delay {}", law_in_words(law)),
    };
    let kind = if model.averaging.averaged_model {
        "averaged model"
    } else {
        "model"
    };
    let mut text = format!(
        "{kind} N1 = {}, N2 = {}, N3 = {}; {delay}",
        model.state_lags.len(),
        model.product_lags.len(),
        model.inputs()
    );
    if !model.effects.is_empty() {
        let names: Vec<&str> = model.effects.iter().map(|e| e.name.as_str()).collect();
        let _ = write!(text, "; with {}", names.join(", "));
    }
    text
}

/// The law with its values in their units.
fn law_in_words(law: &TransportLaw) -> String {
    let mut words = law
        .spec
        .law
        .map_or(law.spec.name, |card| card.words)
        .to_owned();
    for (parameter, value) in law.spec.parameters.iter().zip(&law.parameters) {
        let value = match parameter.unit {
            Unit::Second => time(*value, 3),
            _ => significant(*value, 4),
        };
        words = words.replacen("{}", &value, 1);
    }
    // A negative coefficient is written with a minus instead of a plus.
    words.replace("+ −", "− ")
}

const HEAD: [&str; 8] = [
    "record", "use", "FIT %", "rho", "RMSE", "noise", "epsilon", "inside",
];

fn row(i: &Indicators) -> [String; 8] {
    // A diverged free run has no indicators.
    let number = |value: f64, digits: usize| {
        if value.is_finite() {
            format!("{value:.digits$}")
        } else {
            "–".to_owned()
        }
    };
    [
        i.name.clone(),
        role_name(i.role).to_owned(),
        number(i.fit_percent, 2),
        number(i.correlation, 4),
        number(i.rmse, 5),
        i.noise_rmse
            .map_or_else(|| "–".into(), |n| format!("{n:.5}")),
        number(i.epsilon, 4),
        i.inside_envelope
            .map_or_else(|| "–".into(), |f| format!("{:.1} %", 100.0 * f)),
    ]
}

/// The indicators, per record and in total.
pub(crate) fn score_rows(scores: &Scores) -> Vec<[String; 8]> {
    let mut all: Vec<[String; 8]> = scores.records.iter().map(row).collect();
    for together in [&scores.identify, &scores.validate].into_iter().flatten() {
        let mut together = row(together);
        together[0] = "together".into();
        all.push(together);
    }
    all
}

/// Whether a record has the measurement's envelope, `y_min` and `y_max`.
pub(crate) fn has_envelope(scores: &Scores) -> bool {
    scores.records.iter().any(|of| of.inside_envelope.is_some())
}

/// The indicators as an aligned table.
fn table(scores: &Scores) -> String {
    let rows: Vec<Vec<String>> = score_rows(scores).into_iter().map(Vec::from).collect();
    // The column of the envelope is the last one.
    let columns = HEAD.len() - usize::from(!has_envelope(scores));
    aligned(HEAD.get(..columns).unwrap_or(&HEAD), &rows, 2)
}

/// Rows under a head, the first `left` columns left-aligned, the others right-aligned.
pub(crate) fn aligned(head: &[&str], rows: &[Vec<String>], left: usize) -> String {
    let width = |column: usize| {
        rows.iter()
            .filter_map(|row| row.get(column))
            .map(|cell| cell.chars().count())
            .chain(head.get(column).map(|cell| cell.chars().count()))
            .max()
            .unwrap_or(0)
    };
    let widths: Vec<usize> = (0..head.len()).map(width).collect();
    let line = |cells: &[String]| {
        let padded = cells.iter().zip(&widths).enumerate();
        let text: Vec<String> = padded
            .map(|(column, (cell, width))| {
                if column < left {
                    format!("{cell:<width$}")
                } else {
                    format!("{cell:>width$}")
                }
            })
            .collect();
        text.join("  ").trim_end().to_owned()
    };
    let head: Vec<String> = head.iter().map(|cell| (*cell).to_owned()).collect();
    let mut text = line(&head);
    for row in rows {
        text.push('\n');
        text.push_str(&line(row));
    }
    text
}

/// A number with three significant digits, for text.
pub(crate) fn short(value: f64) -> String {
    significant(value, 3)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn columns_line_up_whatever_the_letters() {
        let rows = [
            vec!["ρ-set".to_owned(), "1.0".to_owned()],
            vec!["b".to_owned(), "–".to_owned()],
        ];
        let text = aligned(&["name", "value"], &rows, 1);
        let lines: Vec<&str> = text.lines().collect();
        assert_eq!(lines, ["name   value", "ρ-set    1.0", "b          –"]);
    }
}
