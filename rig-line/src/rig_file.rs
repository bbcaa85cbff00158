//! `rig.toml`: the properties of a rig, measured once and used by every build of its firmware.

use std::path::Path;

use recordings::output::write_atomic;
use recordings::visible;
use serde::{Deserialize, Serialize};

use crate::error::LineError;

/// The version of the file format.
pub(crate) const VERSION: u32 = 1;

/// A rig.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct RigFile {
    /// The version of this file, 1.
    pub format_version: u32,
    /// Sampling period, s.
    pub sample_period_s: f64,
    /// Largest residual, averaged over about 64 samples, beyond which the board closes the valve, y.
    pub residual_envelope: f64,
    /// The hot film.
    pub sensor: SensorEntry,
    /// The valve.
    pub valve: ValveEntry,
    /// The measured channel, if there is one.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub channel: Option<ChannelEntry>,
}

/// The sensor: y = (counts − zero) · per_count.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SensorEntry {
    /// Counts of the separated flow, y = 0.
    pub zero_counts: f64,
    /// y per count: steady blowing is y = 1.
    pub per_count: f64,
    /// Readings at or below this are at the lower rail, counts.
    pub lower_rail_counts: f64,
    /// Readings at or above this are at the upper rail, counts.
    pub upper_rail_counts: f64,
    /// Number of equal readings in a row after which the sensor counts as stuck.
    pub stuck_after_samples: u32,
    /// Standard deviation of the noise, counts: with the valve closed, and under steady blowing.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub noise_counts: Option<[f64; 2]>,
    /// Standard deviation of the noise in averages over 64 samples, counts: the larger of the values
    /// with the valve closed and under steady blowing. Used by `design --rig`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub slow_noise_counts: Option<f64>,
}

/// The valve.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ValveEntry {
    /// Shortest time open with a response of the flow, s.
    pub shortest_on_s: f64,
    /// Shortest time closed with a response of the flow, s.
    pub shortest_off_s: f64,
}

/// A measured channel: value = (counts − zero) · per_count.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ChannelEntry {
    /// Name of the channel in recordings and models.
    pub name: String,
    /// Unit of the channel.
    pub unit: String,
    /// Counts of 0.
    pub zero_counts: f64,
    /// Units per count.
    pub per_count: f64,
    /// Readings at or below this are at the lower rail, counts.
    pub lower_rail_counts: f64,
    /// Readings at or above this are at the upper rail, counts.
    pub upper_rail_counts: f64,
}

/// Largest count of the boards' converter.
pub(crate) const FULL_SCALE: f64 = 4095.0;
/// Longest time of a valve, s: an hour.
const LONGEST_S: f64 = 3600.0;

impl RigFile {
    /// Reads and checks a file.
    ///
    /// # Errors
    /// [`LineError::RigFile`] with the wrong key and the remedy.
    pub fn load(path: &Path) -> Result<Self, LineError> {
        let refused = |reason| LineError::RigFile {
            file: path.to_path_buf(),
            reason,
        };
        let text = std::fs::read_to_string(path).map_err(|e| {
            refused(format!(
                "it cannot be read ({e}); `host-fit record --calibrate` writes one"
            ))
        })?;
        let rig: Self = toml::from_str(&text).map_err(|e| refused(e.to_string()))?;
        rig.check().map_err(refused)?;
        Ok(rig)
    }

    /// Checks the numbers; an error names the key.
    ///
    /// # Errors
    /// The key, its problem, and the remedy.
    pub fn check(&self) -> Result<(), String> {
        if self.format_version != VERSION {
            return Err(format!(
                "key `format_version`: this program reads version {VERSION}, not {}; calibrate again",
                self.format_version
            ));
        }
        let positive = [
            ("sample_period_s", self.sample_period_s),
            ("residual_envelope", self.residual_envelope),
            ("valve.shortest_on_s", self.valve.shortest_on_s),
            ("valve.shortest_off_s", self.valve.shortest_off_s),
        ];
        for (key, value) in positive {
            if !(value > 0.0 && single(value)) {
                return Err(format!(
                    "key `{key}`: {value:?} is not a time or size above 0 that a board can represent"
                ));
            }
        }
        let [shortest, longest] = recordings::PERIODS_S;
        for (key, value, range) in [
            ("sample_period_s", self.sample_period_s, shortest..=longest),
            (
                "valve.shortest_on_s",
                self.valve.shortest_on_s,
                0.0..=LONGEST_S,
            ),
            (
                "valve.shortest_off_s",
                self.valve.shortest_off_s,
                0.0..=LONGEST_S,
            ),
        ] {
            if !range.contains(&value) {
                let (low, high) = range.into_inner();
                return Err(format!(
                    "key `{key}`: {value:?} s lies outside {low:?} to {high:?} s"
                ));
            }
        }
        let sensor = &self.sensor;
        line("sensor", sensor.zero_counts, sensor.per_count)?;
        rails("sensor", sensor.lower_rail_counts, sensor.upper_rail_counts)?;
        let between = sensor.lower_rail_counts..sensor.upper_rail_counts;
        if !between.contains(&sensor.zero_counts) {
            return Err(format!(
                "key `sensor.zero_counts`: {} is not between the rails, so the reading without blowing would \
                count as a fault",
                sensor.zero_counts
            ));
        }
        if sensor.stuck_after_samples < 2 {
            return Err(
                "key `sensor.stuck_after_samples`: give at least 2, because two equal readings in a row are \
                normal"
                    .into(),
            );
        }
        let noises = (sensor
            .noise_counts
            .iter()
            .flatten()
            .map(|n| ("noise_counts", n)))
        .chain(
            sensor
                .slow_noise_counts
                .iter()
                .map(|n| ("slow_noise_counts", n)),
        );
        for (key, noise) in noises {
            if !(0.0..=FULL_SCALE).contains(noise) {
                return Err(format!(
                    "key `sensor.{key}`: {noise:?} is not a noise level in converter counts; calibrate \
                    again"
                ));
            }
        }
        if let Some(channel) = &self.channel {
            line("channel", channel.zero_counts, channel.per_count)?;
            rails(
                "channel",
                channel.lower_rail_counts,
                channel.upper_rail_counts,
            )?;
            for (key, text) in [("name", &channel.name), ("unit", &channel.unit)] {
                // The name becomes a column header and a constant of the board.
                let acts = |c: char| c.is_control() || matches!(c, ',' | '"');
                if text.contains(acts)
                    || visible(text) != *text
                    || text.trim() != text
                    || text.len() > 100
                {
                    return Err(format!(
                        "key `channel.{key}`: `{text}` cannot be shown on one line, has a comma or a quote, or is longer than \
                         100 bytes"
                    ));
                }
            }
            if channel.name.is_empty()
                || ["t", "u", "y", "y_sd", "y_min", "y_max"].contains(&&*channel.name)
            {
                return Err(format!(
                    "key `channel.name`: `{}` is not a valid name of a channel",
                    channel.name
                ));
            }
        }
        Ok(())
    }

    /// Writes the file.
    ///
    /// # Errors
    /// [`LineError::Output`]; [`LineError::RigFile`] if the file could not be read again.
    pub fn save(&self, path: &Path) -> Result<(), LineError> {
        self.check().map_err(|reason| LineError::RigFile {
            file: path.to_path_buf(),
            reason,
        })?;
        let body = toml::to_string(self).unwrap_or_default();
        let text = format!(
            "# A rig, as measured by `host-fit record --calibrate`; `cargo xtask firmware --rig` builds the \
                 firmware with it.\n{body}"
        );
        Ok(write_atomic(path, |out| out.write_all(text.as_bytes()))?)
    }

    /// The valve's shortest times, samples, on and off.
    #[must_use]
    pub fn hold_samples(&self) -> [u32; 2] {
        [self.valve.shortest_on_s, self.valve.shortest_off_s]
            // A difference below a thousandth of a sample is rounding in the file.
            .map(|time| (time / self.sample_period_s - 1e-3).ceil().max(1.0) as u32)
    }

    /// y of a count.
    #[must_use]
    pub fn friction(&self, counts: f64) -> f64 {
        (counts - self.sensor.zero_counts) * self.sensor.per_count
    }
}

/// Whether single precision, which boards use, represents the value as a finite number other than 0.
fn single(value: f64) -> bool {
    (value as f32).is_normal() || value == 0.0
}

fn line(of: &str, zero: f64, per_count: f64) -> Result<(), String> {
    if !single(zero) {
        return Err(format!(
            "key `{of}.zero_counts`: {zero:?} is not a number that a board can represent"
        ));
    }
    if !(single(per_count) && per_count != 0.0) {
        return Err(format!(
            "key `{of}.per_count`: with {per_count:?} all readings are equal, or none is finite"
        ));
    }
    Ok(())
}

fn rails(of: &str, lower: f64, upper: f64) -> Result<(), String> {
    if !(0.0 <= lower && lower < upper && upper <= FULL_SCALE) {
        return Err(format!(
            "key `{of}.lower_rail_counts`, `{of}.upper_rail_counts`: {lower} and {upper} are not valid limits \
                 within 0 to {FULL_SCALE}"
        ));
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    pub(crate) fn rig() -> RigFile {
        RigFile {
            format_version: VERSION,
            sample_period_s: 0.001,
            residual_envelope: 0.4,
            sensor: SensorEntry {
                zero_counts: 1023.5,
                per_count: 0.000_976,
                lower_rail_counts: 8.0,
                upper_rail_counts: 4087.0,
                stuck_after_samples: 60,
                noise_counts: Some([47.0, 46.5]),
                slow_noise_counts: Some(23.5),
            },
            valve: ValveEntry {
                shortest_on_s: 0.012,
                shortest_off_s: 0.02,
            },
            channel: None,
        }
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
    fn a_file_is_read_as_it_was_written() {
        let folder = tempfile::tempdir().expect("a folder");
        let path = folder.path().join("rig.toml");
        let mut rig = rig();
        for channel in [None, Some(channel())] {
            rig.channel = channel;
            rig.save(&path).expect("written");
            assert_eq!(RigFile::load(&path).expect("read"), rig);
        }
        assert_eq!(rig.hold_samples(), [12, 20]);
    }

    #[test]
    fn what_is_wrong_is_refused_with_its_key() {
        type Change = fn(&mut RigFile);
        let wrong: [(&str, Change); 18] = [
            ("format_version", |r| r.format_version = 9),
            ("sample_period_s", |r| r.sample_period_s = f64::NAN),
            ("sensor.zero_counts", |r| r.sensor.zero_counts = 4090.0),
            ("sensor.per_count", |r| r.sensor.per_count = 0.0),
            ("sensor.upper_rail_counts", |r| {
                r.sensor.upper_rail_counts = 5000.0
            }),
            ("stuck_after_samples", |r| r.sensor.stuck_after_samples = 0),
            ("valve.shortest_on_s", |r| r.valve.shortest_on_s = -1.0),
            // A value that single precision does not represent would be written as `inf`, or as 0.
            ("residual_envelope", |r| r.residual_envelope = 1e300),
            ("residual_envelope", |r| r.residual_envelope = 1e-300),
            ("sensor.per_count", |r| r.sensor.per_count = 1e39),
            ("sensor.per_count", |r| r.sensor.per_count = -1e-300),
            ("valve.shortest_off_s", |r| r.valve.shortest_off_s = 1e9),
            ("sample_period_s", |r| r.sample_period_s = 1e-12),
            ("sensor.noise_counts", |r| {
                r.sensor.noise_counts = Some([1.0, f64::NAN])
            }),
            ("channel.zero_counts", |r| {
                r.channel = Some(ChannelEntry {
                    zero_counts: 1e300,
                    ..channel()
                })
            }),
            ("channel.name", |r| {
                r.channel = Some(ChannelEntry {
                    name: "a b,*/\n".into(),
                    ..channel()
                })
            }),
            ("channel.name", |r| {
                r.channel = Some(ChannelEntry {
                    name: "\u{202e}u".into(),
                    ..channel()
                })
            }),
            ("channel.unit", |r| {
                r.channel = Some(ChannelEntry {
                    unit: "m\r".into(),
                    ..channel()
                })
            }),
        ];
        for (key, change) in wrong {
            let mut rig = rig();
            change(&mut rig);
            let reason = rig.check().expect_err(key);
            assert!(reason.contains(key), "{reason}");
        }
        let folder = tempfile::tempdir().expect("a folder");
        let path = folder.path().join("rig.toml");
        std::fs::write(&path, "format_version = 1\nzeroo = 3\n").expect("written");
        let error = RigFile::load(&path).expect_err("refused").to_string();
        assert!(error.contains("zeroo"), "{error}");
    }
}
