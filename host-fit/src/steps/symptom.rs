//! The two parts of an effect's report: the behaviour that the records show, and its name in this kind of
//! plant.

use crate::data::Plant;
use crate::diagnose::{FLOW_LAG, FLOW_MEMORY, ParameterEstimate};
use crate::picture::significant;
use model_core::effects::spec;
use std::collections::BTreeMap;

/// Parameters of an effect by name.
pub(super) type Estimates = BTreeMap<String, ParameterEstimate>;

/// The behaviour that records show when `effect` is named, in words that fit any plant. The test certifies
/// this part. `{name}` is replaced by a fitted parameter.
const SHOWN: [(&str, &str); 23] = [
    (
        "valve-lag",
        "an additional lag between the command and its effect",
    ),
    (
        "plenum-droop",
        "a gain that falls while the command stays on and recovers at rest",
    ),
    (
        "free-stream-variation",
        "a gain that follows a measured channel",
    ),
    (
        "input-nonlinearity",
        "a response that is not proportional to the command",
    ),
    (
        "echo-path",
        "a second, later copy of the response to the command",
    ),
    (
        "starting-vortex",
        "an additional response after each rising edge that decays",
    ),
    (
        "stopping-vortex",
        "an undershoot after each falling edge that decays",
    ),
    (
        "state-dependent-delay",
        "a dead time that shortens as y rises",
    ),
    (
        "edge-dependent-delay",
        "different dead times of rising and falling edges",
    ),
    (
        "attachment-hysteresis",
        "two stable levels of y with hysteresis between them",
    ),
    (
        "amplitude-saturation",
        "a rate of change that depends on the cube of y",
    ),
    (
        "bouc-wen-hysteresis",
        "a smooth hysteresis loop between y and its restoring rate",
    ),
    (
        "dry-friction",
        "a constant resistance against the motion of y",
    ),
    (
        "quadratic-drag",
        "a resistance that grows with the square of the rate of y",
    ),
    (
        "vortex-shedding",
        "a lightly damped oscillation{frequency} that the command excites",
    ),
    ("rectifying-sensor", "a reading that loses the sign of y"),
    (
        "hot-film-nonlinearity",
        "a curved static characteristic of the reading",
    ),
    (
        "hot-film-lag",
        "an additional lag between y and its reading",
    ),
    (
        "thermal-drift",
        "a reading that drifts towards a final value during a record",
    ),
    (
        "electrical-pickup",
        "a share of the command in the reading without any delay",
    ),
    ("sensor-saturation", "a reading with a fixed limit"),
    (FLOW_LAG, "a second lag in series with the first"),
    (
        FLOW_MEMORY,
        "a response that depends on its own past over a long time",
    ),
];

/// The bench check that would confirm the interpretation in a flow.
const CHECKS: [(&str, &str); 21] = [
    (
        "valve-lag",
        "measure the jet velocity with the tunnel off: its rise after an edge shows the same lag",
    ),
    (
        "plenum-droop",
        "record the plenum pressure during a long pulse: it falls with the same time constant",
    ),
    (
        "free-stream-variation",
        "hold the free stream constant and repeat one record: the model error disappears",
    ),
    (
        "input-nonlinearity",
        "measure the jet velocity at several commands with the tunnel off",
    ),
    (
        "echo-path",
        "move the sensor or block one jet: the second response moves or disappears",
    ),
    (
        "starting-vortex",
        "take phase-locked images 10 to 50 ms after a rising edge",
    ),
    (
        "stopping-vortex",
        "take phase-locked images 10 to 50 ms after a falling edge",
    ),
    (
        "state-dependent-delay",
        "repeat single pulses at several levels of y and read off the dead times",
    ),
    (
        "edge-dependent-delay",
        "measure the jet velocity with the tunnel off: its rise and fall have different delays too",
    ),
    (
        "attachment-hysteresis",
        "raise and lower the duty cycle slowly and compare the levels of y",
    ),
    (
        "amplitude-saturation",
        "repeat one pulse train at several free-stream velocities",
    ),
    (
        "bouc-wen-hysteresis",
        "raise and lower the duty cycle slowly and compare the levels of y",
    ),
    (
        "dry-friction",
        "increase the command slowly from 0 and look for a dead zone",
    ),
    (
        "quadratic-drag",
        "repeat one step at several amplitudes: at small amplitudes the decay is slower",
    ),
    (
        "vortex-shedding",
        "look for the same frequency in a hot wire in the wake",
    ),
    (
        "rectifying-sensor",
        "turn the sensor by 180 degrees: a sensor that does not measure the sign reads the same",
    ),
    (
        "hot-film-nonlinearity",
        "calibrate the sensor against a Preston tube",
    ),
    (
        "hot-film-lag",
        "apply a step to the sensor alone, by its heating current or a shutter",
    ),
    (
        "thermal-drift",
        "let the sensor warm up for an hour and repeat one record",
    ),
    (
        "electrical-pickup",
        "play the command with the air shut off: the reading still follows it",
    ),
    (
        "sensor-saturation",
        "compare the largest readings with the range of the converter",
    ),
];

/// Candidates with a similar residual, and the measurement that distinguishes them.
const CONFUSED: [(&str, &str); 12] = [
    (
        "valve-lag",
        "`hot-film-lag` and a second lag of the flow: lags in series commute. Only a bench check distinguishes them.",
    ),
    (
        "hot-film-lag",
        "`valve-lag` and a second lag of the flow: lags in series commute. Only a bench check distinguishes them.",
    ),
    (
        "plenum-droop",
        "`echo-path` with a negative gain and `thermal-drift`: records with long and short rests distinguish them.",
    ),
    (
        "echo-path",
        "a longer memory of the flow, `starting-vortex`: random on-times distinguish them.",
    ),
    (
        "starting-vortex",
        "`plenum-droop` with a short recovery: single pulses after long rests distinguish them.",
    ),
    (
        "stopping-vortex",
        "`edge-dependent-delay`: pulses of several lengths distinguish them.",
    ),
    (
        "edge-dependent-delay",
        "`state-dependent-delay` and `valve-lag`: edges at several levels of y distinguish them.",
    ),
    (
        "state-dependent-delay",
        "`edge-dependent-delay`: edges at several levels of y distinguish them.",
    ),
    (
        "attachment-hysteresis",
        "`bouc-wen-hysteresis`: small loops inside the large one distinguish them.",
    ),
    (
        "bouc-wen-hysteresis",
        "`attachment-hysteresis`: small loops inside the large one distinguish them.",
    ),
    (
        "hot-film-nonlinearity",
        "`amplitude-saturation`: a calibration of the sensor alone distinguishes them.",
    ),
    (
        "thermal-drift",
        "a record-to-record offset and `plenum-droop`: one record repeated after an hour of warming up \
             distinguishes them.",
    ),
];

/// Behaviour, bench check and similar candidates of an effect, for the catalogue.
pub(super) fn described(effect: &str) -> [Option<&'static str>; 3] {
    let of = |table: &'static [(&str, &str)]| {
        let found = table.iter().find(|(name, _)| *name == effect);
        found.map(|(_, text)| *text)
    };
    [of(&SHOWN), of(&CHECKS), of(&CONFUSED)]
}

/// The behaviour that records show when `effect` is named.
pub(super) fn shown(effect: &str, parameters: Option<&Estimates>) -> Option<String> {
    let (_, text) = SHOWN.iter().find(|(name, _)| *name == effect)?;
    let frequency = parameters.and_then(|own| own.get("frequency"));
    let at = frequency.map_or_else(String::new, |f| {
        format!(" at {} Hz", significant(f.value, 3))
    });
    Some(text.replace("{frequency}", &at))
}

/// The meaning of `effect` in a plant of this kind, with its bench check; none if the name is not specific to
/// the plant.
pub(super) fn meant(effect: &str, plant: Plant) -> Option<String> {
    if plant != Plant::Flow {
        return None;
    }
    let summary = spec(effect)?.summary;
    let check = CHECKS.iter().find(|(name, _)| *name == effect);
    let check = check.map_or_else(String::new, |(_, check)| format!(" Bench check: {check}."));
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
            assert!(
                CHECKS.iter().any(|(name, _)| *name == card.name),
                "{}",
                card.name
            );
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
