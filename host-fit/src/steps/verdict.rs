//! The answer of a diagnosis, in words.

use super::design::command_after;
use super::symptom::{effect_in_words, meant, shown};
use super::{Answer, Tone};
use crate::data::Plant;
use crate::diagnose::{
    Certificate, Curve, Diagnosis, FLOW_LAG, FLOW_MEMORY, HeldOutBy, Memory, RULES, Rung, Verdict,
};
use crate::discover::Glance;
use crate::model::Model;
use crate::picture::{listed, significant, time};
use crate::residual::NoiseSource;
use crate::terms::{RULES as TERMS, second_lag_s};
use model_core::effect::Place;
use model_core::effects::{NUISANCES, spec};

/// The reliability of p-values and intervals, measured on simulated plants (docs/evidence.md).
const CALIBRATED: &str = "Reliability of p-values and intervals, measured on simulated plants: of 40 without a \
     missing effect, one got a false name; 95 % intervals contained the true value in about 90 % of the cases.";

/// Smaller p-values are printed as this, because their size depends on the noise model, which is not known
/// accurately.
const LEAST_P: f64 = 1e-6;

/// A p-value that is an upper bound, with its sign of comparison.
#[must_use]
pub fn p_bound(p: f64) -> String {
    match p {
        p if p < LEAST_P => "< 10⁻⁶".to_owned(),
        p if p < 1.0 => format!("≤ {}", significant(p, 2)),
        _ => "= 1".to_owned(),
    }
}

/// The answer of a diagnosis. `judged_rmse` is the error used for the decision, y, if it is not that of whole
/// validation records; `channel` is a measured channel that the residual depends on, with its share of the
/// unexplained variance.
pub(super) fn answer(
    diagnosis: &Diagnosis,
    judged_rmse: Option<f64>,
    channel: Option<&(String, f64)>,
    plant: Plant,
) -> Answer {
    let mut answer = finding(diagnosis, plant);
    if let Some((channel, share)) = channel {
        if diagnosis.verdict == Verdict::Unexplained {
            answer.verdict = format!("the residual follows the channel {channel}");
        }
        answer.note(format!(
            "The measured channel {channel} explains {:.0} % of the unexplained variance (cross-validated): it acts on y and \
             is not in the model.",
            100.0 * share
        ));
    }
    for name in &diagnosis.missing {
        answer.note(meant(name, plant).unwrap_or_default());
    }
    for set in diagnosis.sets.iter().filter(|set| set.len() > 1) {
        answer.note(format!(
            "Not distinguishable on these data: {}.",
            named(set, plant).join(", ")
        ));
    }
    surrogates(&mut answer, diagnosis, plant);
    curves(&mut answer, diagnosis, plant);
    records(&mut answer, diagnosis, judged_rmse);
    answer.note(bench_check(&diagnosis.sets));
    dynamics(&mut answer, diagnosis);
    if let Some(separation) = &diagnosis.separation {
        answer.note(separation.words());
    }
    if !diagnosis.missing.is_empty() {
        answer.note(CALIBRATED);
    }
    answer
}

/// The surrogates that a curve explains better.
fn curves(answer: &mut Answer, diagnosis: &Diagnosis, plant: Plant) {
    for name in &diagnosis.stand_ins {
        let certificate = diagnosis.certificates.get(name);
        if let Some(curve) = certificate.and_then(Certificate::better_curve) {
            answer.note(replaced(&effect_in_words(name, plant), curve));
        }
    }
}

/// Why an effect is not named, if a curve explains the records as well.
fn replaced(effect: &str, curve: &Curve) -> String {
    format!(
        "{effect} is not named: a curve at the {} that depends on {} explains the records as well. `discover` fits \
         such curves.",
        curve.place.word(),
        on(&curve.coordinate)
    )
}

/// A coordinate as a noun.
fn on(coordinate: &str) -> String {
    match coordinate.strip_prefix("since ") {
        Some(edge) => format!("the time since {edge}"),
        None if coordinate == "y" => coordinate.to_owned(),
        None => format!("the {coordinate}"),
    }
}

/// First-order prediction of a term outside the catalogue, in words.
pub(super) fn beyond(glance: &Glance) -> String {
    format!(
        "A first estimate beyond the catalogue: a term at the {} that depends on {} would explain about \
         {:.0} % of the unexplained variance.",
        glance.place.word(),
        on(&glance.coordinate),
        glance.error_taken_percent
    )
}

/// An error over the noise level, if that is known.
fn over_noise(rmse: f64, diagnosis: &Diagnosis) -> Option<f64> {
    let is_known = diagnosis.noise_source != NoiseSource::Scatter && diagnosis.noise_estimate > 0.0;
    is_known.then(|| rmse / diagnosis.noise_estimate)
}

/// An error relative to the noise level, if that is known: "1.01 × the noise level (RMSE 0.0104)".
fn beside_noise(rmse: f64, diagnosis: &Diagnosis) -> String {
    let own = significant(rmse, 3);
    match over_noise(rmse, diagnosis) {
        Some(ratio) => format!("{} × the noise level (RMSE {own})", times(ratio)),
        None => format!("RMSE {own}"),
    }
}

/// Two errors relative to the noise level: "from 2.64 to 1.01 × the noise level (RMSE 0.0273 → 0.0104)".
fn from_to(before: f64, after: f64, diagnosis: &Diagnosis) -> String {
    let ratio = |rmse: f64| over_noise(rmse, diagnosis).map(times);
    let (from, to) = (significant(before, 3), significant(after, 3));
    match ratio(before).zip(ratio(after)) {
        Some((first, last)) => {
            format!("from {first} to {last} × the noise level (RMSE {from} → {to})")
        }
        None => format!("from RMSE {from} to {to}"),
    }
}

/// A ratio with two decimals, or three digits where it is large.
pub(super) fn times(ratio: f64) -> String {
    if ratio < 10.0 {
        format!("{ratio:.2}")
    } else {
        significant(ratio, 3)
    }
}

/// The effects in the words for this kind of plant.
fn named(names: &[String], plant: Plant) -> Vec<String> {
    let each = names.iter();
    each.map(|name| effect_in_words(name, plant)).collect()
}

fn finding(diagnosis: &Diagnosis, plant: Plant) -> Answer {
    let rmse = |rung: Option<&Rung>| rung.map_or(f64::NAN, |rung| rung.validate_rmse);
    let first = rmse(diagnosis.ladder.first());
    let last = rmse(diagnosis.ladder.last());
    let error = diagnosis.held_out_by.compared().name();
    let now = format!("The {error} is {}.", beside_noise(last, diagnosis));
    let add = |names: &[String]| {
        let with = |names: &[String]| -> String {
            let each = names.iter().map(|name| format!(" --effect {name}"));
            each.collect()
        };
        let effects = with(names);
        // Further effects are judged on a base that was identified with the channels, and with the effects it had.
        match of_channels(diagnosis).is_empty() || diagnosis.stand_ins.is_empty() {
            true => format!("host-fit extend model.toml DATASET{effects} -o better.toml"),
            false => {
                let had = with(&had_before(&diagnosis.model, names, &diagnosis.stand_ins));
                format!("host-fit identify DATASET{had}{effects} -o better.toml")
            }
        }
    };
    let discover = "host-fit discover model.toml DATASET -o new.toml";
    match diagnosis.verdict {
        Verdict::NothingMissing => Answer::new(Tone::Good, "no effect is missing")
            .evidence(now)
            .confidence(
                "No candidate of the catalogue lowers the error significantly and by more than additional lags do.",
            )
            .next(command_after(&diagnosis.model)),
        Verdict::EffectMissing => {
            let all = [diagnosis.missing.as_slice(), &diagnosis.stand_ins].concat();
            Answer::new(Tone::Finding, claim(diagnosis, plant))
                .evidence(match plant {
                    Plant::Flow => format!(
                        "{} The records show {}.",
                        fall(diagnosis, &listed(&all)),
                        behaviour(diagnosis)
                    ),
                    // The verdict has the behaviour.
                    _ if all.len() == 1 => fall(diagnosis, "this behaviour"),
                    _ => fall(diagnosis, "these behaviours"),
                })
                .confidence(confidence(diagnosis))
                .next(add(&diagnosis.missing))
        }
        Verdict::PartlyExplained if !diagnosis.certified.is_empty() && plant == Plant::Flow => {
            let names = &diagnosis.certified;
            let certificates = || names.iter().filter_map(|name| diagnosis.certificates.get(name));
            let share = certificates().map(|one| one.share).fold(1.0, f64::min);
            let alpha = certificates().map(|one| one.alpha).fold(0.0, f64::max);
            Answer::new(
                Tone::Finding,
                format!("{}, and something is unexplained", missing(&called(&diagnosis.model, names), &[])),
            )
            .evidence(fall(diagnosis, &listed(&diagnosis.stand_ins)))
            .confidence(format!(
                "Certified at a level of {} %. {} {:.0} % of the variance that {} unexplained without it. The \
                 cause of the remaining error is not identified.",
                significant(100.0 * alpha, 2),
                match names.len() {
                    1 => "It explains",
                    _ => "Each explains at least",
                },
                100.0 * share,
                match imitated(diagnosis) {
                    Some(_) => "the model with the fewest lags leaves",
                    None => "is",
                }
            ))
            .next(add(names))
        }
        Verdict::PartlyExplained => {
            let own = |name| diagnosis.certificates.get(name);
            let certificates: Vec<&Certificate> =
                diagnosis.stand_ins.iter().filter_map(own).collect();
            let unknown = |name: &String| !diagnosis.is_identified(name);
            let curve_is_better = certificates.iter().any(|one| one.better_curve().is_some());
            // Where a curve of the channel is better, the channel acts at another place.
            let channels = match curve_is_better {
                true => &[],
                false => of_channels(diagnosis),
            };
            let why = if !channels.is_empty() {
                "the model was identified without the measured channel, and the cause is decided after it is identified \
                 with the channel"
            } else if certificates.iter().any(|one| one.evidence_nats < 0.0) {
                "there is more evidence for a model without them"
            } else if certificates.iter().any(|one| !one.is_evident()) {
                "there is too little evidence against a model without them"
            } else if curve_is_better {
                "a curve explains the records as well"
            } else if diagnosis.stand_ins.iter().any(unknown) {
                "the records do not determine their parameters"
            } else {
                "too much variance stays unexplained"
            };
            Answer::new(Tone::Warning, "something is missing; its cause is not identified")
                .evidence(format!(
                    "With {} as surrogates the {error} falls {}.",
                    listed(&named(&diagnosis.stand_ins, plant)),
                    from_to(first, last, diagnosis)
                ))
                .confidence(format!(
                    "Surrogates describe the error and are not claimed as its cause: {why}."
                ))
                .next(match channels {
                    [] => discover.to_owned(),
                    channels => add(channels),
                })
        }
        Verdict::Unexplained => {
            let tried = diagnosis.ladder.last().map(|rung| listed(&named(&rung.effects, plant)));
            let tried = tried.filter(|tried| !tried.is_empty());
            Answer::new(
                Tone::Warning,
                "something is missing that no effect describes",
            )
            .evidence(match &tried {
                Some(tried) => format!(
                    "The best candidate, {tried}, lowers the {error} only {}; it is not in the model.",
                    from_to(first, last, diagnosis)
                ),
                None => now,
            })
            .confidence("No effect of the catalogue, alone or with others, explains most of the unexplained variance.")
            .next(discover)
        }
    }
}

/// The confidence in the named effects, with its test, and whether they leave an error.
fn confidence(diagnosis: &Diagnosis) -> String {
    let p = p_bound(diagnosis.p_value.unwrap_or(1.0));
    let last = diagnosis.ladder.last();
    let last = last.and_then(|rung| over_noise(rung.validate_rmse, diagnosis));
    let rest = last.map_or("", left);
    format!("Family-wise p {p} over {} models.{rest}", diagnosis.tried)
}

/// What an error at this multiple of the noise level leaves.
fn left(over_noise: f64) -> &'static str {
    match over_noise > TERMS.near_the_floor {
        true => " The remaining error above the noise level is unexplained.",
        false => "",
    }
}

/// The reduction of the error by the named effects. Where additional lags of the given model fit equally well, it is
/// compared with the lowest-order model.
fn fall(diagnosis: &Diagnosis, with: &str) -> String {
    let rmse = |rung: Option<&Rung>| rung.map_or(f64::NAN, |rung| rung.validate_rmse);
    let [given, last] = [diagnosis.ladder.first(), diagnosis.ladder.last()].map(rmse);
    let error = diagnosis.held_out_by.compared().name();
    match imitated(diagnosis) {
        Some(fewest) => format!(
            "On the model with the fewest lags, {with} lowers the {error} {}. Additional lags in its place fit equally well{}.",
            from_to(fewest.validate_rmse, last, diagnosis),
            match &diagnosis.parsimony {
                Some(parsimony) => format!(
                    ", with {} and {:.0} nats less evidence",
                    match parsimony.terms_fewer {
                        1 => "one parameter more".to_owned(),
                        fewer => format!("{fewer} parameters more"),
                    },
                    parsimony.nats
                ),
                None => String::new(),
            }
        ),
        None => format!(
            "With {with} the {error} falls {}.",
            from_to(given, last, diagnosis)
        ),
    }
}

/// The step of the ladder with the fewest lags, if the given model fits as well as the final one. The given model then
/// imitates the effects.
fn imitated(diagnosis: &Diagnosis) -> Option<&Rung> {
    let [given, last] = [diagnosis.ladder.first()?, diagnosis.ladder.last()?];
    let lags_do = last.validate_rmse > (1.0 - RULES.worthwhile) * given.validate_rmse;
    let fewest = diagnosis.ladder.get(1)?;
    (lags_do && fewest.effects.is_empty()).then_some(fewest)
}

/// The behaviour behind each missing effect, in words.
fn behaviour(diagnosis: &Diagnosis) -> String {
    let each = diagnosis.missing.iter().map(|name| {
        let text = shown(name, diagnosis.parameters.get(name));
        // For a user's own effect, its summary is used.
        let summary = || diagnosis.model.spec(name).map(|spec| spec.summary);
        text.or_else(|| summary().map(str::to_owned))
            .unwrap_or_else(|| format!("the behaviour of `{name}`"))
    });
    let each: Vec<String> = each.collect();
    match each.as_slice() {
        [before @ .., last] if !before.is_empty() => format!("{}; and {last}", before.join("; ")),
        _ => each.concat(),
    }
}

/// The claim of a diagnosis. In a flow, effects are stated by name, in other plants by behaviour,
/// each with its equivalence set.
fn claim(diagnosis: &Diagnosis, plant: Plant) -> String {
    match plant {
        Plant::Flow => {
            let called = |names: &Vec<String>| called(&diagnosis.model, names);
            let sets: Vec<Vec<String>> = diagnosis.sets.iter().map(called).collect();
            missing(&called(&diagnosis.missing), &sets)
        }
        _ => format!("missing: {}", behaviour(diagnosis)),
    }
}

/// Effects by name, measured inputs by their channel.
fn called(model: &Model, names: &[String]) -> Vec<String> {
    let input = |name: &str| model.measured_inputs().find(|spec| spec.name == name);
    let called = |name: &String| match input(name).and_then(|spec| spec.channel) {
        Some(channel) => format!("the measured input `{channel}`"),
        None => name.clone(),
    };
    names.iter().map(called).collect()
}

fn missing(names: &[String], sets: &[Vec<String>]) -> String {
    let each = names.iter().map(|name| {
        let set = sets.iter().find(|set| set.first() == Some(name));
        set.map_or_else(|| name.clone(), |set| set.join(" or "))
    });
    let each: Vec<String> = each.collect();
    match each.as_slice() {
        [one] => format!("{one} is missing"),
        several if sets.iter().all(|set| set.len() < 2) => {
            format!("{} are missing", listed(several))
        }
        several => format!("{} are missing", several.join(", and ")),
    }
}

/// The tool's own effects of measured channels, if they lead: other effects are decided on a base that was identified
/// with them.
fn of_channels(diagnosis: &Diagnosis) -> &[String] {
    let all = match diagnosis.missing.is_empty() {
        true => &diagnosis.stand_ins,
        false => &diagnosis.missing,
    };
    let of_a_channel = |name: &&String| diagnosis.model.is_of_a_channel(name);
    &all[..all.iter().take_while(of_a_channel).count()]
}

/// Effects of `model` that are neither base terms nor among `added` and `stand_ins`.
fn had_before(model: &Model, added: &[String], stand_ins: &[String]) -> Vec<String> {
    let is_old = |name: &String| {
        let is_base_term = NUISANCES.iter().any(|base| base.name == *name);
        !is_base_term && !added.contains(name) && !stand_ins.contains(name)
    };
    let names = model.effects.iter().map(|effect| &effect.name);
    names.filter(|name| is_old(name)).cloned().collect()
}

/// Surrogates in addition to named effects.
fn surrogates(answer: &mut Answer, diagnosis: &Diagnosis, plant: Plant) {
    if diagnosis.verdict != Verdict::EffectMissing || diagnosis.stand_ins.is_empty() {
        return;
    }
    let several = diagnosis.stand_ins.len() > 1;
    answer.note(format!(
        "{} {} in the model as {}: {}.",
        listed(&named(&diagnosis.stand_ins, plant)),
        if several { "are" } else { "is" },
        if several { "surrogates" } else { "a surrogate" },
        match of_channels(diagnosis).is_empty() {
            true => "not significant together with the named effects, or not identifiable on these records",
            false => "the model was identified without the measured channel, and what else is missing is decided after \
                      it is identified with the channel",
        }
    ));
}

/// The records that the errors refer to, and the source of the noise level.
fn records(answer: &mut Answer, diagnosis: &Diagnosis, judged_rmse: Option<f64>) {
    match diagnosis.noise_source {
        NoiseSource::Measured => {}
        NoiseSource::Repeats => answer.note(
            "The noise level was estimated from repeats of the command, because there is no `y_sd`.",
        ),
        NoiseSource::Scatter => answer.note(format!(
            "The noise level is unknown: no `y_sd`, no repeated command. The noise from one sample to the \
             next, rounding included, is {}.",
            significant(diagnosis.noise_estimate, 3)
        )),
    }
    match (diagnosis.held_out_by, &diagnosis.quoted) {
        (HeldOutBy::Records, Some(quoted)) => answer.note(format!(
            "Independent estimate on {}, which played no part in any choice: RMSE {} → {}{}.",
            listed(&quoted.records),
            significant(quoted.before_rmse, 3),
            significant(quoted.validate_rmse, 3),
            quoted.noise_rmse.map_or(String::new(), |noise| format!(
                ", {} × the noise level there",
                times(quoted.validate_rmse / noise)
            ))
        )),
        (HeldOutBy::Records, None) if diagnosis.tried > 0 => answer.note(
            "The structure was chosen on these validation records, so the error is optimistic. With four or more of \
             them, every third is set aside for an independent estimate.",
        ),
        (HeldOutBy::Records, None) => {}
        (HeldOutBy::Turns, _) => answer.note(
            "No record is marked `validate`, so errors come from cross-validation over the estimation records. \
             A validation record would give an independent estimate.",
        ),
        (HeldOutBy::End, _) => answer.note(
            "There is only one record: models are fitted to its beginning and validated on its end. A \
             validation record would give an independent estimate.",
        ),
    }
    let judged = judged_rmse.map(|rmse| significant(rmse, 3));
    if let Some(seconds) = diagnosis.restarted_s {
        answer.note(format!(
            "Free runs over whole records drift on this plant. The decision is therefore based on runs that \
                 restart from the measurement every {} s{}.",
            significant(seconds, 3),
            judged.map_or(String::new(), |rmse| format!(" (RMSE {rmse})"))
        ));
    } else if diagnosis.held_out_by != HeldOutBy::Records
        && let Some(rmse) = judged
    {
        let kind = diagnosis.held_out_by.judged();
        answer.note(format!("{}: RMSE {rmse}.", kind.title()));
    }
    if let Some(scatter) = diagnosis.level_scatter {
        answer.note(format!(
            "The level of y varies by {} % from record to record (`y_sd` grows with y); an error of this size that is \
                proportional to y counts as noise.",
            significant(100.0 * scatter, 2)
        ));
    }
}

/// Further lags of the model that these records show.
fn dynamics(answer: &mut Answer, diagnosis: &Diagnosis) {
    let named = diagnosis.sets.iter().flatten().any(|name| name == FLOW_LAG);
    if let Some(second) = second_lag_s(&diagnosis.model).filter(|_| !named) {
        answer.note(format!(
            "The model has a second lag of {} in series with the first; these records do not distinguish a lag of the \
             plant, of the sensor and of the actuator.",
            time(second, 2)
        ));
    }
    let lags: Vec<String> = (diagnosis.memory.iter())
        .map(|memory| significant(memory.lag_s, 3))
        .collect();
    let which = match lags.as_slice() {
        [] => return,
        [one] => format!("The plant has a memory of {one} s, with weight"),
        // Neighbouring lags share one memory, so that only the sum of their weights is known.
        several => format!(
            "The plant has memories of {} s, whose weights add up to",
            listed(several)
        ),
    };
    let sum = |weight: fn(&Memory) -> f64| -> String {
        significant(diagnosis.memory.iter().map(weight).sum(), 2)
    };
    answer.note(format!(
        "{which} {} while the command is off and {} while it is on.",
        sum(|memory| memory.weight),
        sum(|memory| memory.weight_blown)
    ));
}

/// The bench check for candidates that records do not distinguish, because lags in series commute.
fn bench_check(sets: &[Vec<String>]) -> &'static str {
    let places = |set: &[String]| {
        let of = |name: &String| match name.as_str() {
            FLOW_LAG | FLOW_MEMORY => Some(Place::Flow),
            name => spec(name).map(|spec| if spec.base { Place::Flow } else { spec.place }),
        };
        let mut places: Vec<Place> = Vec::new();
        for place in set.iter().filter_map(of) {
            if !places.contains(&place) {
                places.push(place);
            }
        }
        places
    };
    let sets: Vec<Vec<Place>> = sets.iter().map(|set| places(set)).collect();
    let across = |place: Place| sets.iter().any(|set| set.len() > 1 && set.contains(&place));
    match (across(Place::Jet), across(Place::Sensor)) {
        (true, _) => {
            "Bench check: play the same command with the tunnel off. The part of the response that remains \
             belongs to the actuator, the part that disappears to the flow."
        }
        (false, true) => {
            "Bench check: apply a step to the sensor alone (its heating current, or a shutter). The part of \
             the response that remains belongs to the sensor, the part that disappears to the flow."
        }
        (false, false) => "",
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::residual::plants::base_with_channel;

    #[test]
    fn a_bound_on_p_is_said_with_its_sign() {
        let said = [0.0, 0.012_34, 1.0].map(p_bound);
        assert_eq!(said, ["< 10⁻⁶", "≤ 0.012", "= 1"]);
    }

    /// A sensitivity that a channel changes is no input.
    #[test]
    fn a_measured_input_is_called_by_its_channel() {
        let model = base_with_channel("Fan 2");
        let names = ["input-fan-2", "scaled-by-fan-2", "valve-lag"].map(str::to_owned);
        assert!(names.iter().all(|name| model.spec(name).is_some()));
        assert_eq!(
            called(&model, &names),
            ["the measured input `Fan 2`", "scaled-by-fan-2", "valve-lag"]
        );
    }

    #[test]
    fn the_curve_that_replaces_an_effect_is_described() {
        let said = |place, coordinate: &str| {
            let curve = Curve {
                place,
                coordinate: coordinate.to_owned(),
                evidence_nats: -170.0,
            };
            replaced("starting-vortex", &curve)
        };
        let jet = said(crate::curves::Place::Jet, "since rising edge");
        assert!(jet.contains("at the jet that depends on the time since rising edge"));
        let flow = said(crate::curves::Place::Flow, "wind × y");
        assert!(flow.contains("at the flow that depends on the wind × y"));
    }

    /// A base that has an effect keeps it when it is identified with a channel.
    #[test]
    fn effects_of_the_given_model_stay() {
        let mut model = base_with_channel("q");
        for name in ["relaxed-by-q", "carried-by-q", "valve-lag", "zero-offset"] {
            let spec = model.spec(name).expect("known");
            let start: Vec<f64> = spec.parameters.iter().map(|card| card.starts[0]).collect();
            model.add(spec, &start, Some(300.0));
        }
        let added = ["carried-by-q".to_owned()];
        let had = had_before(&model, &added, &["valve-lag".to_owned()]);
        assert_eq!(had, ["relaxed-by-q"]);
    }

    #[test]
    fn what_cannot_be_told_from_a_name_stands_beside_it() {
        let said = |sets: &[&[&str]]| {
            let sets: Vec<Vec<String>> = (sets.iter())
                .map(|set| set.iter().map(|name| (*name).to_owned()).collect())
                .collect();
            let names: Vec<String> = sets.iter().map(|set| set[0].clone()).collect();
            missing(&names, &sets)
        };
        assert_eq!(said(&[&["valve-lag"]]), "valve-lag is missing");
        let alike = ["hot-film-lag", FLOW_LAG];
        assert_eq!(said(&[&alike]), "hot-film-lag or flow-lag is missing");
        let both = said(&[&["valve-lag"], &["echo-path"]]);
        assert_eq!(both, "valve-lag and echo-path are missing");
        let both = said(&[&alike, &["echo-path"]]);
        assert_eq!(both, "hot-film-lag or flow-lag, and echo-path are missing");
        let three = said(&[&["valve-lag"], &["echo-path"], &["dry-friction"]]);
        assert_eq!(three, "valve-lag, echo-path and dry-friction are missing");
    }

    #[test]
    fn an_error_above_the_noise_is_said_to_remain() {
        assert!(left(1.24).contains("unexplained"));
        assert!([1.03, f64::NAN].iter().all(|over| left(*over).is_empty()));
    }
}
