//! The two parts of an effect's report: the behaviour that the records show, and its name in this kind of
//! plant.

use crate::data::Plant;
use crate::diagnose::{FLOW_LAG, FLOW_MEMORY, ParameterEstimate};
use crate::picture::significant;
use model_core::effects::spec;
use std::collections::BTreeMap;

/// Parameters of an effect by name.
pub(super) type Estimates = BTreeMap<String, ParameterEstimate>;

/// Texts on an effect in addition to its card.
#[derive(Clone, Copy)]
struct Symptom {
    effect: &'static str,
    /// The behaviour that records show when the effect is named, in words that fit any plant. The test certifies
    /// this part. `{frequency}` is replaced by the fitted parameter.
    shown: &'static str,
    /// The bench check that would confirm the interpretation in a flow.
    check: Option<&'static str>,
    /// Candidates with a similar residual, and the measurement that distinguishes them.
    confused: Option<&'static str>,
}

const fn of(effect: &'static str) -> Symptom {
    Symptom {
        effect,
        shown: "",
        check: None,
        confused: None,
    }
}

impl Symptom {
    const fn shown(self, shown: &'static str) -> Self {
        Self { shown, ..self }
    }

    const fn check(self, check: &'static str) -> Self {
        Self {
            check: Some(check),
            ..self
        }
    }

    const fn confused(self, confused: &'static str) -> Self {
        Self {
            confused: Some(confused),
            ..self
        }
    }
}

const SYMPTOMS: [Symptom; 23] = [
    of("valve-lag")
        .shown("an additional lag between the command and its effect")
        .check(
            "measure the jet velocity with the tunnel off: its rise after an edge shows the \
             same lag",
        )
        .confused(
            "`hot-film-lag` and a second lag of the flow: lags in series commute. Only a bench \
             check distinguishes them.",
        ),
    of("plenum-droop")
        .shown("a gain that falls while the command stays on and recovers at rest")
        .check(
            "record the plenum pressure during a long pulse: it falls with the same time \
             constant",
        )
        .confused(
            "`echo-path` with a negative gain and `thermal-drift`: records with long and short \
             rests distinguish them.",
        ),
    of("free-stream-variation")
        .shown("a gain that follows a measured channel")
        .check("hold the free stream constant and repeat one record: the model error disappears"),
    of("input-nonlinearity")
        .shown("a response that is not proportional to the command")
        .check("measure the jet velocity at several commands with the tunnel off"),
    of("echo-path")
        .shown("a second, later copy of the response to the command")
        .check("move the sensor or block one jet: the second response moves or disappears")
        .confused(
            "a longer memory of the flow, `starting-vortex`: random on-times distinguish them.",
        ),
    of("starting-vortex")
        .shown("an additional, decaying response after each rising edge")
        .check("take phase-locked images 10 to 50 ms after a rising edge")
        .confused(
            "`plenum-droop` with a short recovery: single pulses after long rests distinguish \
             them.",
        ),
    of("stopping-vortex")
        .shown("a decaying undershoot after each falling edge")
        .check("take phase-locked images 10 to 50 ms after a falling edge")
        .confused("`edge-dependent-delay`: pulses of several lengths distinguish them."),
    of("state-dependent-delay")
        .shown("a dead time that shortens as y rises")
        .check("repeat single pulses at several levels of y and read off the dead times")
        .confused("`edge-dependent-delay`: edges at several levels of y distinguish them."),
    of("edge-dependent-delay")
        .shown("different dead times of rising and falling edges")
        .check(
            "measure the jet velocity with the tunnel off: its rise and fall have different \
             delays too",
        )
        .confused(
            "`state-dependent-delay` and `valve-lag`: edges at several levels of y distinguish \
             them.",
        ),
    of("attachment-hysteresis")
        .shown("two stable levels of y with hysteresis between them")
        .check("raise and lower the duty cycle slowly and compare the levels of y")
        .confused("`bouc-wen-hysteresis`: small loops inside the large loop distinguish the two effects."),
    of("amplitude-saturation")
        .shown("a rate of change that depends on the cube of y")
        .check("repeat one pulse train at several free-stream velocities"),
    of("bouc-wen-hysteresis")
        .shown("a smooth hysteresis loop between y and the rate at which y returns to its level")
        .check("raise and lower the duty cycle slowly and compare the levels of y")
        .confused("`attachment-hysteresis`: small loops inside the large loop distinguish the two effects."),
    of("dry-friction")
        .shown("a constant resistance against the motion of y")
        .check("increase the command slowly from 0 and look for a dead zone"),
    of("quadratic-drag")
        .shown("a resistance that grows with the square of the rate of y")
        .check("repeat one step at several amplitudes: at small amplitudes the decay is slower"),
    of("vortex-shedding")
        .shown("a lightly damped oscillation{frequency} that the command excites")
        .check("look for the same frequency in a hot wire in the wake"),
    of("rectifying-sensor")
        .shown("a reading that loses the sign of y")
        .check(
            "turn the sensor by 180 degrees: a sensor that does not measure the sign reads the \
             same",
        ),
    of("hot-film-nonlinearity")
        .shown("a curved static characteristic of the reading")
        .check("calibrate the sensor against a Preston tube")
        .confused("`amplitude-saturation`: a calibration of the sensor alone distinguishes them."),
    of("hot-film-lag")
        .shown("an additional lag between y and its reading")
        .check("apply a step to the sensor alone, by its heating current or a shutter")
        .confused(
            "`valve-lag` and a second lag of the flow: lags in series commute. Only a bench \
             check distinguishes them.",
        ),
    of("thermal-drift")
        .shown("a reading that drifts towards a final value during a record")
        .check("let the sensor warm up for an hour and repeat one record")
        .confused(
            "a record-to-record offset and `plenum-droop`: one record repeated after an hour of \
             warming up distinguishes them.",
        ),
    of("electrical-pickup")
        .shown("a share of the command in the reading, delayed by at most two samples")
        .check("play the command with the air shut off: the reading still follows it"),
    of("sensor-saturation")
        .shown("a reading with a fixed limit")
        .check("compare the largest readings with the range of the converter"),
    of(FLOW_LAG).shown("a second lag in series with the first"),
    of(FLOW_MEMORY).shown("a response that depends on its own past over a long time"),
];

fn symptom(effect: &str) -> Option<&'static Symptom> {
    SYMPTOMS.iter().find(|symptom| symptom.effect == effect)
}

/// Behaviour, bench check and similar candidates of an effect, for the catalogue.
pub(super) fn described(effect: &str) -> [Option<&'static str>; 3] {
    match symptom(effect) {
        Some(of) => [Some(of.shown), of.check, of.confused],
        None => [None; 3],
    }
}

/// The behaviour that records show when `effect` is named.
pub(super) fn shown(effect: &str, parameters: Option<&Estimates>) -> Option<String> {
    let text = symptom(effect)?.shown;
    let frequency = parameters.and_then(|own| own.get("frequency"));
    let at = frequency.map_or_else(String::new, |f| {
        format!(" at {} Hz", significant(f.value, 3))
    });
    Some(text.replace("{frequency}", &at))
}

/// The words for `effect` in a plant of this kind: its name in a flow, the behaviour that the records show in other
/// plants. A user's own effect has its name everywhere.
#[must_use]
pub fn effect_in_words(effect: &str, plant: Plant) -> String {
    let behaviour = match plant {
        Plant::Flow => None,
        _ => shown(effect, None),
    };
    behaviour.unwrap_or_else(|| effect.to_owned())
}

/// The meaning of `effect` in a plant of this kind, with its bench check; none if the name is not specific to
/// the plant.
pub(super) fn meant(effect: &str, plant: Plant) -> Option<String> {
    if plant != Plant::Flow {
        return None;
    }
    let summary = spec(effect)?.summary;
    let check = symptom(effect).and_then(|of| of.check);
    let check = check.map_or_else(String::new, |check| format!(" Bench check: {check}."));
    Some(format!("In a flow this is `{effect}`: {summary}.{check}"))
}

#[cfg(test)]
mod tests {
    use super::*;
    use model_core::effects::SPECS;

    /// An effect must not be reported by its interpretation alone.
    #[test]
    fn every_effect_has_both_parts() {
        for card in SPECS {
            assert!(shown(card.name, None).is_some(), "{}", card.name);
            assert!(described(card.name)[1].is_some(), "{}", card.name);
            let meant = meant(card.name, Plant::Flow).unwrap();
            assert!(meant.contains(card.summary), "{meant}");
            assert_eq!(super::meant(card.name, Plant::Thermal), None);
        }
    }

    #[test]
    fn a_frequency_is_said_where_it_is_known() {
        let own = Estimates::from([(
            "frequency".to_owned(),
            ParameterEstimate {
                value: 23.71,
                unit: "Hz".to_owned(),
                low: 23.0,
                high: 24.4,
                determined: true,
            },
        )]);
        let text = shown("vortex-shedding", Some(&own)).unwrap();
        assert!(
            text.starts_with("a lightly damped oscillation at 23.7 Hz"),
            "{text}"
        );
        let text = shown("vortex-shedding", None).unwrap();
        assert!(
            text.starts_with("a lightly damped oscillation that"),
            "{text}"
        );
    }
}
