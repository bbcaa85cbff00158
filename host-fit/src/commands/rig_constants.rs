//! A rig's constants for the firmware, and a check that they fit a model.

use host_fit::model::{Law, Model};
use rig_line::RigFile;

/// The constants as Rust: plain numbers, for the firmware's `identified::rig`.
pub(crate) fn rust(rig: &RigFile) -> String {
    let sensor = &rig.sensor;
    let mut text = format!(
        "//! Constants of a rig. Generated from its rig.toml; to change them, calibrate the rig again.\n\n\
         /// Counts of the separated flow, y = 0.\n\
         pub const ZERO: f32 = {:?};\n\
         /// y per count.\n\
         pub const PER_COUNT: f32 = {:?};\n\
         /// Readings at or beyond these are at a rail, counts.\n\
         pub const RAILS: [f32; 2] = [{:?}, {:?}];\n\
         /// Duration of equal readings after which the sensor counts as stuck, s.\n\
         pub const STUCK_AFTER_S: f32 = {:?};\n\
         /// Largest residual, averaged over about 64 samples, y.\n\
         pub const RESIDUAL_ENVELOPE: f32 = {:?};\n\
         /// The valve's shortest times open and shut, s.\n\
         pub const SHORTEST_S: [f32; 2] = [{:?}, {:?}];\n",
        sensor.zero_counts as f32,
        sensor.per_count as f32,
        sensor.lower_rail_counts as f32,
        sensor.upper_rail_counts as f32,
        (f64::from(sensor.stuck_after_samples) * rig.sample_period_s) as f32,
        rig.residual_envelope as f32,
        rig.valve.shortest_on_s as f32,
        rig.valve.shortest_off_s as f32,
    );
    text.push_str(
        "/// The measured channel: counts at 0, units per count, lower and upper rail in counts; `None` if no channel was measured.\n",
    );
    text.push_str(&match &rig.channel {
        None => "pub const CHANNEL: Option<[f32; 4]> = None;\n".to_owned(),
        Some(channel) => format!(
            "// {} in {}.\npub const CHANNEL: Option<[f32; 4]> = Some([{:?}, {:?}, {:?}, {:?}]);\n",
            channel.name.escape_default(),
            channel.unit.escape_default(),
            channel.zero_counts as f32,
            channel.per_count as f32,
            channel.lower_rail_counts as f32,
            channel.upper_rail_counts as f32,
        ),
    });
    text
}

/// Checks that `rig` was measured at the sample period of `model`: its noise refers to averages over a number
/// of samples.
///
/// # Errors
/// Both periods, the key of both files, and the remedy.
pub(crate) fn same_period(rig: &RigFile, model: &Model) -> Result<(), String> {
    if model.is_sampled_at(rig.sample_period_s) {
        return Ok(());
    }
    Err(format!(
        "`sample_period_s`: the rig was measured at {} s and the model is for {} s; calibrate with the board at \
            the model's period, or identify a model at the rig's period",
        rig.sample_period_s, model.sample_period_s
    ))
}

/// Checks that `model` can run on `rig`.
///
/// # Errors
/// The contradiction with the keys of both files, and the remedy.
pub(crate) fn fits(rig: &RigFile, model: &Model) -> Result<(), String> {
    same_period(rig, model)?;
    let sensor = &rig.sensor;
    let ends = [sensor.lower_rail_counts, sensor.upper_rail_counts].map(|c| rig.friction(c));
    let (low, high) = (ends[0].min(ends[1]), ends[0].max(ends[1]));
    let inside = |y: f64| low < y && y < high;
    let [least, most] = model.training.y_range;
    // A model without records has no range to check.
    if least < most && !(inside(least) && inside(most)) {
        return Err(format!(
            "`sensor` and the model's training range: y from {least:.3} to {most:.3} was recorded, but this \
            rig's converter covers {low:.3} to \
             {high:.3}; the model belongs to another rig or voltage divider: calibrate again, or identify on this \
             rig"
        ));
    }
    if let Some(Law::Track(track)) = &model.law
        && !inside(track.reference)
    {
        return Err(format!(
            "`sensor` and `law.reference`: y* = {} is outside the range of this rig's converter, {low:.3} to \
            {high:.3}; design for another target",
            track.reference
        ));
    }
    let hold = match &model.law {
        Some(Law::Track(track)) => Some(track.hold),
        Some(Law::Maximise(maximise)) => Some(maximise.hold),
        _ => None,
    };
    let [on, off] = rig.hold_samples();
    if let Some(hold) = hold
        && (hold.on < on || hold.off < off)
    {
        return Err(format!(
            "`valve` and `law.hold`: the valve's shortest times are {on} samples open and {off} shut, but the law \
                assumes {} and {}; design with --min-on {} --min-off {}",
            hold.on, hold.off, rig.valve.shortest_on_s, rig.valve.shortest_off_s
        ));
    }
    for needed in model.memory().channels {
        let Some(channel) = &rig.channel else {
            return Err(format!(
                "`channel`: the model's effects need `{}`, and the rig file has no channel; calibrate with --channel",
                needed.name
            ));
        };
        if channel.name != needed.name {
            return Err(format!(
                "`channel.name`: the model's effects need `{}`, and the rig's channel is `{}`",
                needed.name, channel.name
            ));
        }
        let counts = needed.reference / channel.per_count + channel.zero_counts;
        if !(channel.lower_rail_counts < counts && counts < channel.upper_rail_counts) {
            return Err(format!(
                "`channel`: the model's reference, {} {}, would read {counts:.0} counts, which is at an \
                    end of the converter's range; check the unit",
                needed.reference, channel.unit
            ));
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use rig_line::{ChannelEntry, SensorEntry, ValveEntry};

    fn model() -> Model {
        let text = include_str!("../../../firmware/identified/models/full.toml");
        Model::from_toml(text, "full.toml").expect("a model file")
    }

    fn rig() -> RigFile {
        RigFile {
            format_version: 1,
            sample_period_s: 0.001,
            residual_envelope: 0.5,
            sensor: SensorEntry {
                zero_counts: 800.0,
                per_count: 0.0005,
                lower_rail_counts: 8.0,
                upper_rail_counts: 4087.0,
                stuck_after_samples: 500,
                noise_counts: None,
                slow_noise_counts: None,
            },
            valve: ValveEntry {
                shortest_on_s: 0.02,
                shortest_off_s: 0.02,
            },
            channel: None,
        }
    }

    #[test]
    fn what_contradicts_is_refused_with_both_keys() {
        assert_eq!(fits(&rig(), &model()), Ok(()));
        type Change = fn(&mut RigFile, &mut Model);
        let wrong: [(&str, Change); 7] = [
            ("sample_period_s", |r, _| r.sample_period_s = 0.002),
            ("training range", |_, m| m.training.y_range = [-0.1, 2.0]),
            ("law.reference", |r, _| r.sensor.per_count = 1e-4),
            ("--min-on 0.03", |r, _| r.valve.shortest_on_s = 0.03),
            ("no channel", |_, m| needs(m, "u_inf")),
            ("channel is `u_inf`", |r, m| {
                r.channel = Some(channel());
                needs(m, "temperature");
            }),
            ("at an end of the converter", |r, m| {
                r.channel = Some(ChannelEntry {
                    per_count: 1e-3,
                    ..channel()
                });
                needs(m, "u_inf");
            }),
        ];
        for (word, change) in wrong {
            let (mut rig, mut model) = (rig(), model());
            change(&mut rig, &mut model);
            let reason = fits(&rig, &model).expect_err(word);
            assert!(reason.contains(word), "{reason}");
        }
        let (mut rig, mut model) = (rig(), model());
        rig.channel = Some(channel());
        needs(&mut model, "u_inf");
        assert_eq!(fits(&rig, &model), Ok(()));
    }

    fn needs(model: &mut Model, channel: &str) {
        model.effects.push(host_fit::model::Added {
            name: "free-stream-variation".to_owned(),
            parameters: vec![-1.0],
            channel: Some(channel.to_owned()),
            reference: Some(10.0),
        });
    }

    fn channel() -> ChannelEntry {
        ChannelEntry {
            name: "u_inf".into(),
            unit: "m/s".into(),
            zero_counts: 0.0,
            per_count: 0.005,
            lower_rail_counts: 8.0,
            upper_rail_counts: 4087.0,
        }
    }

    #[test]
    fn the_constants_are_the_files() {
        let text = rust(&rig());
        for line in [
            "pub const ZERO: f32 = 800.0;",
            "pub const PER_COUNT: f32 = 0.0005;",
            "pub const STUCK_AFTER_S: f32 = 0.5;",
            "pub const SHORTEST_S: [f32; 2] = [0.02, 0.02];",
            "pub const CHANNEL: Option<[f32; 4]> = None;",
        ] {
            assert!(text.contains(line), "{text}");
        }
    }
}
