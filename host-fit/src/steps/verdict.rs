//! A diagnosis in plain language.

use crate::diagnose::{Diagnosis, FLOW_LAG, FLOW_MEMORY, HeldOutBy, Rung, Verdict};
use crate::discover::Glance;
use crate::picture::significant;
use crate::residual::NoiseSource;
use crate::terms::{RULES as TERMS, second_lag_s};
use model_core::effect::Place;
use model_core::effects::spec;

/// Headline and meaning of a diagnosis, in words.
pub(super) fn words(diagnosis: &Diagnosis) -> (String, String) {
    let (headline, mut meaning) = finding(diagnosis);
    match diagnosis.held_out_by {
        HeldOutBy::Records => meaning.push_str(&quoted(diagnosis)),
        HeldOutBy::Turns => meaning.push_str(
            " No record is marked `validate`: each in turn was judged by models that had not seen it.",
        ),
        HeldOutBy::End => meaning.push_str(
            " There is one record only: its end was judged by models that saw its beginning; a second record would say more.",
        ),
    }
    if let Some(seconds) = diagnosis.restarted_s {
        meaning.push_str(&format!(
            " The rig integrates and its free run drifts: all errors here are of free runs that start anew from the measurement every {} s.",
            significant(seconds, 3)
        ));
    }
    if let Some(scatter) = diagnosis.level_scatter {
        meaning.push_str(&format!(
            " The level scatters between repeats (`y_sd` grows with y), by {} % from record to record: as much of an error along y is not held \
             against a model.",
            significant(100.0 * scatter, 2)
        ));
    }
    meaning.push_str(bench_check(&diagnosis.sets));
    let told = diagnosis.sets.iter().flatten().any(|name| name == FLOW_LAG);
    if let Some(second) = second_lag_s(&diagnosis.model).filter(|_| !told) {
        meaning.push_str(&format!(
            " The model has a second lag of {} ms in series with the flow's: these records cannot tell whether it is the flow's own, a film's or a \
             valve's. At the bench, with the tunnel off, the flow's goes.",
            significant(1e3 * second, 2)
        ));
    }
    for memory in &diagnosis.memory {
        meaning.push_str(&format!(
            " The flow feels its own past of {} s, with {} without jets and {} under them.",
            significant(memory.lag_s, 3),
            significant(memory.weight, 2),
            significant(memory.weight_blown, 2)
        ));
    }
    if let Some(separation) = &diagnosis.separation {
        meaning.push_str(&format!(" {}", separation.words()));
    }
    (headline, meaning)
}

/// On which records the last error stands.
fn quoted(diagnosis: &Diagnosis) -> String {
    match &diagnosis.quoted {
        Some(quoted) => format!(
            " On {}, by which nothing was chosen, it goes from {} to {}{}.",
            quoted.records.join(" and "),
            significant(quoted.before_rmse, 3),
            significant(quoted.validate_rmse, 3),
            quoted.noise_rmse.map_or(String::new(), |noise| format!(
                ", {} times the noise there",
                significant(quoted.validate_rmse / noise, 3)
            ))
        ),
        None if diagnosis.tried > 0 => {
            " The model was chosen by the same records; of four or more marked `validate`, some are kept back to quote on."
                .to_owned()
        }
        None => String::new(),
    }
}

/// What tells apart at the rig, without the flow, what records cannot: lags in series commute.
fn bench_check(sets: &[Vec<String>]) -> &'static str {
    let places = |set: &[String]| {
        let of = |name: &String| match name.as_str() {
            FLOW_LAG | FLOW_MEMORY => Some(Place::Flow),
            name => Some(spec(name)?.place),
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
            " At the bench: play the same command with the tunnel off. What the valve and its supply do shows in the jets and stays; what the flow does goes."
        }
        (false, true) => {
            " At the bench: give the sensor alone a step, of its heating current or behind a shutter. What the sensor does stays; what the flow does goes."
        }
        (false, false) => "",
    }
}

/// What a term beyond the catalogue promises, and how to go on.
pub(super) fn beyond(glance: &Glance) -> String {
    format!(
        " Beyond the catalogue, a term at the {} by {} promises to take {:.0} % of what is left; `host-fit discover` looks for it.",
        glance.place.word(),
        glance.coordinate,
        glance.error_taken_percent
    )
}

fn finding(diagnosis: &Diagnosis) -> (String, String) {
    let rmse = |rung: Option<&Rung>| rung.map_or(f64::NAN, |rung| rung.validate_rmse);
    let first = rmse(diagnosis.ladder.first());
    let last = rmse(diagnosis.ladder.last());
    let noise = diagnosis.noise_estimate;
    let floor = match diagnosis.noise_source {
        NoiseSource::Measured => format!(
            "the noise floor is {} ({:.2} times it is left)",
            significant(noise, 3),
            last / noise
        ),
        NoiseSource::Repeats => format!(
            "there is no y_sd; how y differs between repeats of the command puts the noise floor at {} ({:.2} times it is left)",
            significant(noise, 3),
            last / noise
        ),
        NoiseSource::Scatter => format!(
            "the noise floor is not known: there is no y_sd and no repeat; from sample to sample y scatters by {}",
            significant(noise, 3)
        ),
    };
    match diagnosis.verdict {
        Verdict::NothingMissing => (
            "nothing is missing".to_owned(),
            format!(
                "The model's held-out error is {}: {floor}. No effect of the catalogue lowers it by more than chance or than the flow's own memory does.",
                significant(last, 3)
            ),
        ),
        Verdict::EffectMissing => {
            let headline = claim(&diagnosis.missing, &diagnosis.sets);
            let with = match (diagnosis.missing.len(), diagnosis.stand_ins.as_slice()) {
                (1, []) => "it".to_owned(),
                (_, []) => "them".to_owned(),
                (_, others) => [&diagnosis.missing, others].concat().join(" and "),
            };
            let mut meaning = fall(diagnosis, &with, &floor);
            if let Some(p) = diagnosis.p_value {
                meaning.push_str(&format!(
                    " Noise alone would make one of {} alternatives do as much with p {} {}.",
                    diagnosis.alternatives,
                    if p > 1.0 / (TERMS.draws + 1) as f64 {
                        "="
                    } else {
                        "≤"
                    },
                    significant(p, 2)
                ));
            }
            let found = diagnosis
                .ranking
                .iter()
                .filter(|r| diagnosis.missing.contains(&r.effect));
            for entry in found.filter(|entry| !entry.confounded_with.is_empty()) {
                meaning.push_str(&format!(
                    " These records cannot tell {} from {}.",
                    entry.effect,
                    entry.confounded_with.join(", ")
                ));
            }
            if !diagnosis.stand_ins.is_empty() {
                let several = diagnosis.stand_ins.len() > 1;
                meaning.push_str(&format!(
                    " {} {} the rest only and may stand in for anything: without {} the held-out error is within what the noise floor is known to, or a second \
                     one of what is named does as well, or these records do not tell its parameters. The model is handed over with {}, marked.",
                    diagnosis.stand_ins.join(" and "),
                    if several { "take" } else { "takes" },
                    if several { "them" } else { "it" },
                    if several { "them" } else { "it" },
                ));
            }
            (headline, meaning)
        }
        Verdict::PartlyExplained => (
            "something is missing, and the catalogue describes part of it".to_owned(),
            format!(
                "With {} the held-out error falls from {} to {}; {floor}. They stand in for what is missing: too much is \
                 left to take them for its names. The model is handed over with them, marked as stand-ins.",
                diagnosis.stand_ins.join(" and "),
                significant(first, 3),
                significant(last, 3)
            ),
        ),
        Verdict::Unexplained => (
            "something is missing that the catalogue does not have".to_owned(),
            match diagnosis
                .ladder
                .last()
                .map(|rung| rung.effects.join(" and "))
            {
                Some(tried) if !tried.is_empty() => format!(
                    "The best that the catalogue does is {tried}: the held-out error is then {} and {floor}. \
                     That is too little to name them as the cause; they are not in the model \
                     (`host-fit extend` adds them all the same).",
                    significant(last, 3)
                ),
                _ => format!(
                    "The held-out error is {} and {floor}; no effect of the catalogue, nor several, explains most of it.",
                    significant(last, 3)
                ),
            },
        ),
    }
}

/// How the error falls with what is named. Who is named for making do with less than the flow's lags need does not
/// lower the error of the model as given; what it is named for shows beside the fewest lags.
fn fall(diagnosis: &Diagnosis, with: &str, floor: &str) -> String {
    let error =
        |rung: Option<&Rung>| significant(rung.map_or(f64::NAN, |rung| rung.validate_rmse), 3);
    let last = error(diagnosis.ladder.last());
    let fewest = diagnosis.ladder.get(1);
    match fewest.filter(|rung| diagnosis.p_value.is_none() && rung.effects.is_empty()) {
        Some(fewest) => format!(
            "With {with} fewer lags of the flow are enough: the held-out error of the fewest falls from {} to {last}; {floor}. Without \
             {with}, more lags do as well.",
            error(Some(fewest))
        ),
        None => format!(
            "With {with} the held-out error falls from {} to {last}; {floor}.",
            error(diagnosis.ladder.first())
        ),
    }
}

/// What is missing, each with what the records cannot tell from it: a name is a claim.
fn claim(missing: &[String], sets: &[Vec<String>]) -> String {
    let each = missing.iter().map(|name| {
        let set = sets.iter().find(|set| set.first() == Some(name));
        set.map_or_else(|| name.clone(), |set| set.join(" or "))
    });
    let each: Vec<String> = each.collect();
    match each.as_slice() {
        [one] => format!("{one} is missing"),
        several if sets.iter().all(|set| set.len() < 2) => {
            format!("{} are missing", several.join(" and "))
        }
        several => format!("{} are missing", several.join(", and ")),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_cannot_be_told_from_a_name_stands_beside_it() {
        let said = |sets: &[&[&str]]| {
            let sets: Vec<Vec<String>> = (sets.iter())
                .map(|set| set.iter().map(|name| (*name).to_owned()).collect())
                .collect();
            let missing: Vec<String> = sets.iter().map(|set| set[0].clone()).collect();
            claim(&missing, &sets)
        };
        assert_eq!(said(&[&["valve-lag"]]), "valve-lag is missing");
        let alike = ["hot-film-lag", FLOW_LAG];
        assert_eq!(said(&[&alike]), "hot-film-lag or flow-lag is missing");
        let both = said(&[&["valve-lag"], &["echo-path"]]);
        assert_eq!(both, "valve-lag and echo-path are missing");
        let both = said(&[&alike, &["echo-path"]]);
        assert_eq!(both, "hot-film-lag or flow-lag, and echo-path are missing");
    }
}
