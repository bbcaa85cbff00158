//! A control law in words.

use super::Words;
use closed_loop::{Figures, span};
use host_fit::design::{
    Case, CaseGroup, Certificate, Margin, Optimum, Proof, RULES, TrackDesign, Weighed, judged,
};
use host_fit::picture::{fixed, listed, signed, significant, time};
use host_fit::steps::{Design, DesignOutcome};

impl Words for Design {
    fn words(&self) -> String {
        let period_s = self.model.sample_period_s;
        match &self.outcome {
            DesignOutcome::Track(design) => track_words(design, period_s),
            DesignOutcome::Maximise(optimum) => optimum_words(optimum, period_s),
        }
    }
}

impl Words for Proof {
    fn words(&self) -> String {
        case_table(self)
    }
}

/// A number of samples as a time, ms, rounded to remove binary representation errors.
fn milliseconds(samples: f64, period_s: f64) -> f64 {
    (1e6 * samples * period_s).round() / 1e3
}

/// The length of a run in words: whole minutes, else seconds.
fn duration(samples: usize, period_s: f64) -> String {
    let seconds = 1e-3 * milliseconds(span(samples, period_s) as f64, period_s);
    let minutes = seconds / 60.0;
    if minutes == 4.0 {
        "four minutes".to_owned()
    } else if minutes >= 10.0 {
        format!("{minutes:.0} minutes")
    } else {
        format!("{seconds} s")
    }
}

fn track_words(design: &TrackDesign, period_s: f64) -> String {
    let law = &design.law;
    let length = |samples: u32| time(f64::from(samples) * period_s, 4);
    let mut text = format!(
        "target {}, reachable levels {:.3} to {:.3}; duty {:.3} on the model ({:.3} by the formula for u_eq)\n\
         shortest times {} open, {} closed; predicts up to {} ahead{}",
        design.target,
        design.reachable[0],
        design.reachable[1],
        design.duty,
        design.equivalent_duty,
        length(law.hold.on),
        length(law.hold.off),
        length(law.look_ahead.into()),
        every(period_s)
    );
    text.push('\n');
    text.push_str(&certificate_words(&design.certificate));
    for remark in &design.remarks {
        text.push_str("\nnote: ");
        text.push_str(remark);
    }
    text
}

/// The proven bound, or the reason why there is no bound.
fn certificate_words(certificate: &Certificate) -> String {
    match certificate {
        Certificate::Bound(bound) => format!(
            "certificate: from any initial state, y of the model ends between {:.3} below and {:.3} above the target; with \
             a prediction error of {:.3}, between {:.3} below and {:.3} above",
            bound.below, bound.above, bound.error, bound.below_with_error, bound.above_with_error
        ),
        Certificate::None { reason } => {
            format!("no certificate: {reason}; the trials and the margin are simulations")
        }
    }
}

/// The loop's period in words; empty for the usual period.
fn every(period_s: f64) -> String {
    match milliseconds(1.0, period_s) {
        1.0 => String::new(),
        _ => format!("; a sample every {}", time(period_s, 4)),
    }
}

fn optimum_words(optimum: &Optimum, period_s: f64) -> String {
    let law = &optimum.law;
    let length = |samples: u32| time(f64::from(samples) * period_s, 4);
    let mut text = if law.period == 1 {
        format!("best: steady blowing, mean y {:.3}", optimum.mean)
    } else {
        let pulses: Vec<String> = law
            .pulses
            .iter()
            .map(|(first, long)| format!("{} from {}", length(*long), length(*first)))
            .collect();
        format!(
            "best: period {}, open {}; mean y {:.3} with {:.1} % of the air ({} under steady blowing){}",
            length(law.period),
            listed(&pulses),
            optimum.mean,
            100.0 * optimum.duty,
            optimum
                .steady_mean
                .map_or("the model diverges".to_owned(), |mean| format!("{mean:.3}")),
            every(period_s)
        )
    };
    text.push('\n');
    text.push_str(&weighed_words(&optimum.weighed, law.period == 1));
    text.push_str(&format!(
        "\nafter {}: mean y {:.3}; with a period that differs by 2 %: mean y {:.3}; pole moduli {:.5} with the valve \
            closed, {:.5} with it open",
        duration(RULES.long_until, period_s),
        optimum.mean_after_minutes,
        optimum.mean_detuned,
        optimum.moduli[0],
        optimum.moduli[1]
    ));
    if optimum.mean_detuned < 0.9 * optimum.mean {
        text.push_str(
            "\nnote: the optimum is at a sharp resonance of the model; test it on the rig first",
        );
    }
    if let Some(mean) = optimum.refused_mean {
        text.push_str(&format!(
            "\nrejected: {} pulse trains with a higher mean (up to {mean:.3}), because the model diverges under them in a long run; they excite instabilities of the model",
            optimum.refused
        ));
    }
    if let Some(planned) = &optimum.planned {
        text.push_str(&format!(
            "\nbest non-periodic command over {} s from rest ({}, a decision every {}): value {:.3} with {:.1} % of the air (steady blowing: value {:.3}); {}",
            planned.horizon_s,
            if planned.exact { "all tried" } else { "beam search" },
            time(planned.block_s, 3),
            planned.value,
            100.0 * planned.duty,
            planned.steady_value,
            match planned.cycle_s {
                None => "a receding-horizon law stops switching, or the model diverges under it".to_owned(),
                Some(cycle_s) => format!(
                    "a receding-horizon law ends in a limit cycle of {} ({:.0} % of it irregular), \
                    and this cycle was evaluated like the other pulse trains",
                    time(cycle_s, 3),
                    100.0 * planned.irregular
                ),
            }
        ));
    }
    match &optimum.outside {
        None => text.push_str("\nnote: the model file has no training envelope; the optimum may be an extrapolation"),
        Some(outside) if outside.is_inside() => text.push_str("\ninside the training envelope"),
        Some(outside) => text.push_str(&format!(
            "\noutside the training envelope: y by {:.3}, duty by {:.3}, on-times by a factor {:.2}",
            outside.friction, outside.duty, outside.on_time_factor
        )),
    }
    text
}

/// The objective, and the reason if steady blowing is better than pulses.
fn weighed_words(weighed: &Weighed, is_steady: bool) -> String {
    let mut text = format!(
        "objective: mean y − {} × share of time open; the value is the lowest over periods that differ by up to 2 %",
        weighed.air_price
    );
    let (Some(pulses), Some(steady)) = (weighed.pulses, weighed.steady_value) else {
        return text;
    };
    text.push_str(&format!(
        "\nvalue of steady blowing {steady:.3}; value of the best pulses {:.3} (mean y {:.3} with {:.1} % of the air)",
        pulses.value,
        pulses.mean,
        100.0 * pulses.duty
    ));
    if let Some(price) = weighed.pulses_pay_from
        && is_steady
    {
        text.push_str(&format!(
            "\nsteady blowing is best: pulses lose more friction than the saved air is worth. With --air-price \
                {price:.3} or more, pulses are better"
        ));
    }
    text
}

impl Words for Margin {
    fn words(&self) -> String {
        let percent = |share: f64, open: bool| {
            let (sign, beyond) = match share < 0.0 {
                true => ("−", " or below"),
                false => ("+", " or above"),
            };
            let beyond = if open { beyond } else { "" };
            format!("{sign}{:.0} %{beyond}", (100.0 * share.abs()).floor())
        };
        let each = self.intervals.iter().map(|interval| {
            let [low, high] = interval.open;
            format!(
                "{} {} … {}",
                interval.error,
                percent(interval.low, low),
                percent(interval.high, high)
            )
        });
        format!(
            "robustness margin, one error at a time: {}. Inside this margin attachment is kept, and the rms error stays below twice \
             that on the model ({} in the shorter runs of the margin)",
            each.collect::<Vec<_>>().join(", "),
            significant(self.rms, 3)
        )
    }
}

/// The label of a trial's likelihood.
fn likelihood(case: &Case) -> String {
    match (case.group, case.p_value) {
        (CaseGroup::Model, _) => "model".to_owned(),
        (CaseGroup::Unseen, _) => "unseen".to_owned(),
        (_, Some(p)) => format!("p {p:.3}"),
        (_, None) => "stress".to_owned(),
    }
}

/// The interval of the trials that is judged, in words.
fn judged_interval(proof: &Proof) -> String {
    let period_s = proof.trace.sample_period_s;
    let [from, until] = [RULES.trial_from, RULES.trial]
        .map(|n| 1e-3 * milliseconds(span(n, period_s) as f64, period_s));
    format!("closed loop, from {from} s to {until} s")
}

/// Which trials decide.
const DECIDING: &str = "Cases `model` and `p` (one-sided p-value on the records) decide. Cases `unseen` (excluded by the records, but too small for a diagnosis) and `stress` (outside the records) only warn";

/// Columns of [`trial_rows`]: the name, and whether the column holds numbers.
pub(crate) const TRIALS: [(&str, bool); 11] = [
    ("trial", false),
    ("likely", false),
    ("attachment", false),
    ("mean y", true),
    ("rms error", true),
    ("offset", true),
    ("peak to peak", true),
    ("switches/s", true),
    ("air", true),
    ("settles", true),
    ("steady blowing", true),
];

/// Caption of the table of trials.
pub(crate) fn trial_caption(proof: &Proof) -> String {
    let interval = judged_interval(proof);
    let mut letters = interval.chars();
    let first = letters.next().into_iter().flat_map(char::to_uppercase);
    let sentence: String = first.chain(letters).collect();
    format!("{sentence}. {DECIDING}.")
}

/// The trials of a law, the reference run last.
pub(crate) fn trial_rows(proof: &Proof) -> Vec<Vec<String>> {
    let row = |name: &str, likely: String, kept: &str, f: &Figures, steady: String| {
        let mut cells = vec![name.to_owned(), likely, kept.to_owned()];
        cells.extend([f.mean, f.rms].map(|v| fixed(v, 3, false)));
        cells.push(signed(f.offset, 3));
        cells.push(format!("{:.3}", f.peak_to_peak));
        cells.push(significant(f.switches_per_s, 2));
        cells.push(format!("{:.3}", f.air));
        let settling = f.settling_s.map(|s| format!("{s:.2} s"));
        cells.push(settling.unwrap_or_else(|| "never".to_owned()));
        cells.push(steady);
        cells
    };
    let cases = proof.cases.iter().map(|case| {
        let kept = if case.kept { "kept" } else { "LOST" };
        let steady = fixed(case.steady, 3, false);
        row(&case.name, likelihood(case), kept, &case.figures, steady)
    });
    let compared = judged(&proof.compared);
    let last = row(
        proof.compared_name,
        String::new(),
        "",
        &compared,
        String::new(),
    );
    cases.chain([last]).collect()
}

/// Whether the table in a terminal shows this trial. It shows the trial on the model, every trial that lost attachment,
/// and for each likelihood the trial with the largest error.
fn is_shown(case: &Case, proof: &Proof) -> bool {
    let kind = |case: &Case| (case.group.decides(), case.group == CaseGroup::Unseen);
    let rms = case.figures.rms;
    let mut alike = proof.cases.iter().filter(|other| kind(other) == kind(case));
    !case.kept
        || case.group == CaseGroup::Model
        || !alike.any(|other| other.figures.rms > rms && other.group != CaseGroup::Model)
}

/// Largest number of characters of a trial's name in the table of a terminal.
const NAME: usize = 44;

fn case_table(proof: &Proof) -> String {
    let mut text = format!(
        "{:<NAME$} {:>7} {:>6} {:>6} {:>7} {:>6} {:>6} {:>6} {:>7} {:>6}  attachment",
        judged_interval(proof),
        "likely",
        "mean",
        "rms",
        "offset",
        "p2p",
        "sw/s",
        "air",
        "settle",
        "steady"
    );
    let shown = proof.cases.iter().map(|case| is_shown(case, proof));
    let omitted = shown.clone().filter(|shown| !shown).count();
    // The reference run is the last row.
    for (cells, shown) in trial_rows(proof).iter().zip(shown.chain([true])) {
        let [
            name,
            likely,
            kept,
            mean,
            rms,
            offset,
            p2p,
            switches,
            air,
            settling,
            steady,
        ] = cells.as_slice()
        else {
            continue;
        };
        if !shown {
            continue;
        }
        // The page and `--json` have the parameters of every plant.
        let name = match name.split_once(" (") {
            Some((short, _)) if name.chars().count() > NAME => short,
            _ => name,
        };
        let name = match name.rsplit_once(',') {
            Some((short, _)) if name.chars().count() > NAME => short,
            _ => name,
        };
        text.push_str(&format!(
            "\n{name:<NAME$} {likely:>7} {mean:>6} {rms:>6} {offset:>7} {p2p:>6} {switches:>6} {air:>6} {settling:>7} {steady:>6}  {kept}"
        ));
    }
    text.push('\n');
    text.push_str(DECIDING);
    text.push('.');
    if omitted > 0 {
        text.push_str(&format!(
            " {omitted} more trials keep attachment with smaller errors; `--report` and `--json` have all."
        ));
    }
    text
}
