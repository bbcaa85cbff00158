//! A designed law with its trials in closed loop.

use closed_loop::{Figures, span};
use host_fit::design::{Case, CaseGroup, Margin, Proof, RULES};
use host_fit::picture::significant;
use host_fit::steps::{Answer, Design, DesignOutcome, TargetVerdict, Tone};
use model_core::control::period::loop_period_us;
use serde::Serialize;
use std::fmt;

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
    /// Where the sensor noise of the trials comes from.
    pub(super) noise_from: NoiseFrom,
    /// The user's command with the nearest target that passes.
    #[serde(skip)]
    pub(super) again: Option<String>,
    /// The file of the law, quoted for a shell.
    #[serde(skip)]
    pub(super) file: String,
    /// The answer of these trials.
    pub(super) answer: Answer,
}

/// Where the sensor noise of trials comes from.
#[derive(Clone, Copy, Serialize)]
#[serde(rename_all = "kebab-case")]
pub(super) enum NoiseFrom {
    /// The calibrated rig.
    Rig,
    /// The error of the model on the records.
    Records,
    /// The records are averages, or there are none: a typical hot film.
    HotFilm,
}

impl fmt::Display for NoiseFrom {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Rig => "measured by `record --calibrate`",
            Self::Records => "the error of the model on the records",
            Self::HotFilm => "as of a hot film",
        })
    }
}

impl Tried {
    /// Why the law must not be written; `switch` is the option that overrides this.
    pub(super) fn refused(&self, switch: &str) -> Option<String> {
        let lost = self.design.law.lost();
        (!lost.is_empty()).then(|| {
            format!(
                "the law was not written: it loses attachment on {}: {}. {} {switch} writes it anyway, with a note in the file",
                self.deciding_plants(),
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
            "No target in the reachable interval passes: allow shorter times of the valve, or record more varied \
             commands and identify again."
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
        let held = self.held();
        let (tone, said) = match (self.proof.lost().is_empty(), held) {
            (true, Held::Yes) => (Tone::Good, "the law keeps attachment"),
            (true, Held::NoSwitch) => (
                Tone::Warning,
                "the law does not hold the target: the valve does not switch",
            ),
            (true, Held::No) => (
                Tone::Warning,
                "the law keeps attachment, but does not hold the target",
            ),
            (false, _) => (Tone::Warning, "the law loses attachment"),
        };
        let on_the_model = self.on_the_model().map_or_else(String::new, |figures| {
            let period_s = self.proof.trace.sample_period_s;
            let [from, until] = [RULES.trial_from, RULES.trial]
                .map(|samples| significant(span(samples, period_s) as f64 * period_s, 3));
            format!(
                " On the model with sensor noise of {} rms ({}), from {from} to {until} s: mean y {}, rms error {}, {} \
                 switches/s.",
                significant(self.design.noise_rms(), 2),
                self.noise_from,
                significant(figures.mean, 3),
                significant(figures.rms, 3),
                significant(figures.switches_per_s, 2)
            )
        });
        let margin = self.margin.as_ref().map(Words::words);
        let mut answer = Answer::new(tone, said)
            .evidence(format!("{}.{on_the_model}", capitalised(evidence)))
            .confidence(margin.map_or_else(String::new, |margin| {
                format!("{}.", capitalised(margin.trim_end_matches('.')))
            }))
            .next(match held {
                Held::Yes if loop_period_us(self.design.sample_period_s).is_some() => {
                    format!("host-fit codegen {} -o identified.rs", self.file)
                }
                // The boards' timers are not made for slow loops.
                Held::Yes => format!("host-fit codegen {} --lang c -o controlled.c", self.file),
                // If no target is known to pass, the remarks say what to change.
                Held::No | Held::NoSwitch => String::new(),
            });
        if let Some(again) = &self.again {
            answer = answer.next(again.clone());
        }
        if held == Held::NoSwitch {
            for remark in self
                .remarks()
                .iter()
                .filter(|remark| remark.contains("does not switch"))
            {
                answer.note(capitalised(remark));
            }
        }
        for line in lines.chain(self.not_tried.iter().map(String::as_str)) {
            answer.note(line);
        }
        answer
    }

    /// The figures of a tracking law on the model with a noisy sensor, the trial of the picture.
    fn on_the_model(&self) -> Option<&Figures> {
        let tracks = matches!(self.design.outcome, DesignOutcome::Track(_));
        self.proof.on_its_model().filter(|_| tracks)
    }

    /// Whether the law holds its target on the model.
    fn held(&self) -> Held {
        match self.on_the_model() {
            None => Held::Yes,
            Some(figures) if figures.settling_s.is_some() => Held::Yes,
            Some(figures) if figures.switches_per_s == 0.0 => Held::NoSwitch,
            Some(_) => Held::No,
        }
    }

    /// Remarks of the design of a tracking law.
    fn remarks(&self) -> &[String] {
        match &self.design.outcome {
            DesignOutcome::Track(design) => &design.remarks,
            DesignOutcome::Maximise(_) => &[],
        }
    }

    /// The plants whose trials decide. Without records these are the trials on the model alone.
    fn deciding_plants(&self) -> &'static str {
        let from_records = |case: &Case| case.group == CaseGroup::Possible;
        match self.proof.cases.iter().any(from_records) {
            true => "plants that are consistent with the records",
            false => "the model",
        }
    }

    /// The result of the trials in two sentences.
    pub(super) fn verdict(&self) -> String {
        let decide = self.proof.cases.iter().filter(|case| case.group.decides());
        let (decide, lost) = (decide.count(), self.proof.lost());
        let plants = self.deciding_plants();
        let mut text = if lost.is_empty() && decide == 1 {
            "attachment is kept in the trial on the model; no other trial decides".to_owned()
        } else if lost.is_empty() {
            let all = match decide {
                2 => "both".to_owned(),
                _ => format!("all {decide}"),
            };
            format!("attachment is kept in {all} trials on {plants}")
        } else {
            format!(
                "attachment is lost in {} of {decide} trials on {plants}: {}",
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

/// Whether a law holds its target on the model.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Held {
    /// The mean of y settles at the target; also for pulses, which have no target.
    Yes,
    /// The mean of y stays away from the target.
    No,
    /// The valve stays in one position.
    NoSwitch,
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
