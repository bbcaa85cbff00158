//! A designed law with its trials in closed loop.

use host_fit::design::{Margin, Proof};
use host_fit::picture::significant;
use host_fit::steps::{Answer, Design, DesignOutcome, TargetVerdict, Tone};
use serde::Serialize;

use super::words::Words;

/// A law with its trials.
#[derive(Serialize)]
pub(super) struct Tried {
    #[serde(flatten)]
    pub(super) design: Design,
    #[serde(flatten)]
    pub(super) proof: Proof,
    /// The robustness margin; none for pulses, and for a law that loses attachment on its own model.
    pub(super) margin: Option<Margin>,
    /// Targets that pass, if the requested target does not.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub(super) targets: Vec<TargetVerdict>,
    /// Trials that were not possible, one sentence each.
    pub(super) not_tried: Vec<String>,
    /// The file of the law, quoted for a shell.
    #[serde(skip)]
    pub(super) file: String,
    /// The answer of these trials.
    pub(super) answer: Answer,
}

impl Tried {
    /// Why the law must not be written; `switch` is the option that overrides this.
    pub(super) fn refused(&self, switch: &str) -> Option<String> {
        let lost = self.design.law.lost();
        (!lost.is_empty()).then(|| {
            format!(
                "the law was not written: it loses attachment on plants that are consistent with the records: {}. {} {switch} \
                 writes it anyway, with a note in the file",
                few(lost),
                self.next_step()
            )
        })
    }

    /// The remedy after a rejection.
    fn next_step(&self) -> String {
        let passing: Vec<String> = self
            .targets
            .iter()
            .filter(|target| target.passes)
            .map(|target| target.target.to_string())
            .collect();
        if self.targets.is_empty() {
            "Record more varied commands, and identify again.".to_owned()
        } else if passing.is_empty() {
            "No target in the reachable interval passes: record more varied commands, and identify again."
                .to_owned()
        } else {
            format!("Targets that pass: {}.", passing.join(", "))
        }
    }

    /// Adds the answer: whether the law keeps attachment, in which trials, and with which margin.
    pub(super) fn answered(self) -> Self {
        let answer = self.concluded();
        Self { answer, ..self }
    }

    fn concluded(&self) -> Answer {
        let verdict = self.verdict();
        let mut lines = verdict.lines();
        let evidence = lines.next().unwrap_or_default();
        // For a tracking law, the evidence is its errors on the model without noise.
        let tracks = matches!(self.design.outcome, DesignOutcome::Track(_));
        let model = self.proof.cases.first().filter(|_| tracks);
        let settles = model.is_none_or(|case| case.figures.settling_s.is_some());
        let (tone, said) = match (self.proof.lost().is_empty(), settles) {
            (true, true) => (Tone::Good, "the law keeps attachment"),
            (true, false) => (
                Tone::Warning,
                "the law keeps attachment, but does not settle at the target",
            ),
            (false, _) => (Tone::Warning, "the law loses attachment"),
        };
        let on_the_model = model.map_or_else(String::new, |case| {
            let figures = &case.figures;
            format!(
                " On the model: mean y {}, rms error {}, {:.1} switches/s.",
                significant(figures.mean, 3),
                significant(figures.rms, 3),
                figures.switches_per_s
            )
        });
        let margin = self.margin.as_ref().map(Words::words);
        let mut answer = Answer::new(tone, said)
            .evidence(format!("{}.{on_the_model}", capitalised(evidence)))
            .confidence(margin.map_or_else(String::new, |margin| {
                format!("{}.", capitalised(margin.trim_end_matches('.')))
            }))
            .next(format!("host-fit codegen {} -o identified.rs", self.file));
        for line in lines.chain(self.not_tried.iter().map(String::as_str)) {
            answer.note(line);
        }
        answer
    }

    /// The result of the trials in two sentences.
    pub(super) fn verdict(&self) -> String {
        let decide = self.proof.cases.iter().filter(|case| case.group.decides());
        let (decide, lost) = (decide.count(), self.proof.lost());
        let mut text = if lost.is_empty() && decide == 1 {
            "attachment is kept in the trial on the model; no other trial decides".to_owned()
        } else if lost.is_empty() {
            format!(
                "attachment is kept in all {decide} trials on plants that are consistent with the records"
            )
        } else {
            format!(
                "attachment is lost in {} of {decide} trials on plants that are consistent with the records: {}",
                lost.len(),
                few(&lost)
            )
        };
        let beyond = self.proof.lost_beyond_the_records();
        if !beyond.is_empty() {
            text.push_str(&format!(
                "\nwarning: on plants that are not consistent with the records, attachment is lost in these trials: {}",
                few(&beyond)
            ));
        }
        text
    }
}

/// A sentence with a capital letter.
fn capitalised(text: &str) -> String {
    let mut letters = text.chars();
    let first = letters.next().map(|c| c.to_uppercase().to_string());
    first.unwrap_or_default() + letters.as_str()
}

/// The first names of a list, and the number of the others.
fn few(names: &[String]) -> String {
    const SHOWN: usize = 4;
    let mut text = names[..names.len().min(SHOWN)].join("; ");
    if names.len() > SHOWN {
        text.push_str(&format!("; and {} more", names.len() - SHOWN));
    }
    text
}

impl Words for Tried {
    fn words(&self) -> String {
        let answer = format!("{}\n", self.answer.words());
        [answer, self.design.words(), self.proof.words()].join("\n")
    }
}
