//! A measured channel as a second input of the plant (a second heater, a fan, the ambient temperature), as a factor of
//! the reading (the dynamic pressure at a balance, the temperature at a hot film), of the jets (the supply's pressure or
//! voltage) or of the plant's relaxation rate (the wind that cools, the water that leaves a heater), and as the speed that
//! carries the response to the sensor (the free stream, a belt).

use super::RULES;
use crate::data::Record;
use crate::model::Model;
use crate::order;
use crate::parallel;
use crate::preparation::FirstOrder;
use crate::residual::correlation;
use crate::user_effect::Definition;
use model_core::effects::SPECS;

/// Channels are ranked with this many samples, averages over all records, to limit the time.
const RANKED: usize = 256;
const RANKED_SAMPLES: usize = 2000;

/// The effects of measured channels that a diagnosis of `given` tries. If there are many channels, those whose response
/// (a first-order lag with dead time) explains most of the residual of `given`.
#[must_use]
pub(crate) fn leading_inputs(given: &Model, records: &[Record]) -> Vec<&'static Definition> {
    let inputs = channels_that_vary(records);
    if inputs.len() <= RULES.inputs {
        return effects_of(inputs.iter());
    }
    let samples: usize = records.iter().map(Record::len).sum();
    let stride = samples.div_ceil(RANKED_SAMPLES).max(1);
    let thinned = |series: &[f64]| -> Vec<f64> {
        let each = series.chunks(stride);
        each.map(|c| c.iter().sum::<f64>() / c.len() as f64)
            .collect()
    };
    let left: Vec<Vec<f64>> = records
        .iter()
        .map(|record| match given.free_run(record) {
            Ok(run) => {
                let left: Vec<f64> = record.y.iter().zip(&run).map(|(y, run)| y - run).collect();
                thinned(&left)
            }
            Err(_) => thinned(&record.y),
        })
        .collect();
    let inputs = &inputs[..inputs.len().min(RANKED)];
    let mut ranked = parallel::each(inputs, |input| {
        let follows: Vec<Record> = records
            .iter()
            .zip(&left)
            .map(|(record, left)| {
                let u = record
                    .channels
                    .get(input.name)
                    .map(|values| thinned(values));
                let period = record.sample_period_s * stride as f64;
                Record::new(
                    &record.name,
                    record.role,
                    period,
                    u.unwrap_or_default(),
                    left.clone(),
                )
            })
            .collect();
        (
            FirstOrder::fitted(&follows).map_or(0.0, |found| found.explained),
            input,
        )
    });
    order::descending(&mut ranked, |(explained, _)| *explained);
    let leading = ranked.into_iter().take(RULES.inputs);
    effects_of(leading.map(|(_, input)| input))
}

/// A signal over all records, joined.
fn joined(records: &[Record], of: impl Fn(&Record) -> Vec<f64>) -> Vec<f64> {
    records.iter().flat_map(of).collect()
}

/// A measured channel with its range over all records.
struct Channel<'a> {
    name: &'a str,
    low: f64,
    high: f64,
}

impl Channel<'_> {
    fn keeps_its_sign(&self) -> bool {
        self.low * self.high > 0.0
    }

    /// Whether no value has the other sign; the light at night is 0.
    fn has_one_sign(&self) -> bool {
        self.low * self.high >= 0.0
    }
}

/// Up to five effects for each measured channel of `records`. One adds a response to the channel to the reading: a
/// first-order lag with dead time of the channel's deviation from its first value, as a fraction of its range; at rest
/// the channel has its first value and the response is 0. Two multiply the reading or the jets by a power of the channel,
/// if the channel does not change its sign. In the fourth the relaxation rate grows with the channel. In the fifth the
/// channel, if positive, is the speed that carries the response to the sensor. A channel must be in all records, vary, and
/// not be a copy of y, the command or a clock; for a channel that an effect of the catalogue reads there is only the fifth.
#[must_use]
pub(crate) fn measured_inputs(records: &[Record]) -> Vec<&'static Definition> {
    effects_of(channels_that_vary(records).iter())
}

fn effects_of<'a>(channels: impl Iterator<Item = &'a Channel<'a>>) -> Vec<&'static Definition> {
    let read = |channel: &Channel<'_>| SPECS.iter().any(|spec| spec.channel == Some(channel.name));
    let each = |channel: &Channel<'_>| {
        let new = || {
            [
                measured_input(channel),
                scaled_by(channel),
                driven_by(channel),
                relaxed_by(channel),
            ]
        };
        let new = (!read(channel)).then(new).into_iter().flatten();
        new.chain([carried_by(channel)])
            .flatten()
            .collect::<Vec<_>>()
    };
    channels.flat_map(each).collect()
}

/// The channels that fulfil the conditions of [`measured_inputs`].
fn channels_that_vary(records: &[Record]) -> Vec<Channel<'_>> {
    let Some(first) = records.first() else {
        return Vec::new();
    };
    let everywhere = |name: &str| records.iter().all(|r| r.channels.contains_key(name));
    let names = first.channels.keys().filter(|name| everywhere(name));
    let known = [
        joined(records, |r| r.y.clone()),
        joined(records, |r| r.u.clone()),
        joined(records, |r| (0..r.len()).map(|k| k as f64).collect()),
    ];
    let varying = names.filter_map(|name| {
        let own = joined(records, |r| r.channels[name].clone());
        let low = own.iter().copied().fold(f64::INFINITY, f64::min);
        let high = own.iter().copied().fold(f64::NEG_INFINITY, f64::max);
        let range = high - low;
        if !(range.is_finite() && range > 0.0) {
            return None;
        }
        // Correlations are computed with numbers of order one.
        let scaled: Vec<f64> = own.iter().map(|v| (v - low) / range).collect();
        let is_again = |known: &Vec<f64>| {
            correlation(&scaled, known).is_some_and(|(r, _)| r.abs() > RULES.same_quantity)
        };
        (!known.iter().any(is_again)).then_some(Channel { name, low, high })
    });
    varying.collect()
}

/// The tool's own effect `prefix-CHANNEL` at a place; `what` precedes the channel in its summary, and `body` is the
/// expression with states and parameters. `None` if the name is too long for an effect.
fn of_channel(
    [prefix, place]: [&str; 2],
    channel: &Channel<'_>,
    [what, source]: [&str; 2],
    body: &str,
) -> Option<&'static Definition> {
    let words = channel.name.to_lowercase();
    let words = words.split(|c: char| !c.is_ascii_alphanumeric());
    let words: Vec<&str> = words.filter(|word| !word.is_empty()).collect();
    let name = words.join("-");
    let summary = format!("{what} the measured channel `{}`", channel.name);
    let [quoted, summary] = [channel.name.to_owned(), summary].map(toml::Value::String);
    let text = format!(
        r#"name = "{prefix}-{name}"
place = "{place}"
summary = {summary}
source = "{source}"
channel = {quoted}
scales = true
{body}"#
    );
    Definition::from_toml(&text, channel.name).ok()
}

/// The lines of an expression in which `numerator / denominator` is the relative change of (v/v_mean)^gain with the
/// channel v: its Padé approximant, which is exact for the powers −1, 0 and 1.
const POWER: &str = "let numerator = gain * (channel / reference - 1.0);
let denominator = max(1.0 + 0.5 * (1.0 - gain) * (channel / reference - 1.0), 0.1);";

/// The range of that power.
const POWERS: &str = r#"[[parameter]]
name = "gain"
unit = "-"
low = -10.0
high = 10.0
starts = [1.0, -0.5]
"#;

/// The reading, above the level that does not depend on the channel, times a power of the channel.
fn scaled_by(channel: &Channel<'_>) -> Option<&'static Definition> {
    if !channel.keeps_its_sign() {
        return None;
    }
    let body = format!(
        r#"expression = """
{POWER}
reading + numerator / denominator * (reading - zero)"""
{POWERS}[[parameter]]
name = "zero"
unit = "reading"
low = -100.0
high = 100.0
starts = [0.0, -2.0]
"#
    );
    let texts = [
        "the reading scales with",
        "calibration: the sensitivity is a power of the channel",
    ];
    of_channel(["scaled-by", "sensor"], channel, texts, &body)
}

/// The jets times a power of the channel.
fn driven_by(channel: &Channel<'_>) -> Option<&'static Definition> {
    if !channel.keeps_its_sign() {
        return None;
    }
    let body = format!(
        r#"expression = """
{POWER}
jet + numerator / denominator * jet"""
{POWERS}"#
    );
    let texts = [
        "the response to the command scales with",
        "the supply of the jets: their strength is a power of its pressure or voltage",
    ];
    of_channel(["driven-by", "jet"], channel, texts, &body)
}

/// A relaxation rate that grows with the channel: the flow returns faster to the level `pull / gain`.
///
/// Both parameters are factors of the channel: with the level itself instead of `pull`, a fit may end at a gain of 0 with
/// an infinite level.
fn relaxed_by(channel: &Channel<'_>) -> Option<&'static Definition> {
    if !channel.has_one_sign() {
        return None;
    }
    let body = r#"expression = "relaxation * (channel / reference - 1.0) * (pull - gain * y)"
[[parameter]]
name = "gain"
unit = "-"
low = -10.0
high = 10.0
starts = [1.0, -0.5]
[[parameter]]
name = "pull"
unit = "y"
low = -10.0
high = 10.0
starts = [0.0, -0.3]
"#;
    let texts = [
        "the relaxation rate grows with",
        "balance: a loss in proportion to the channel, as of a tank to its outflow",
    ];
    of_channel(["relaxed-by", "flow"], channel, texts, body)
}

/// The state that is 0 at the first sample of a record.
const HAS_BEGUN: &str = r#"[[state]]
name = "has_begun"
update = "1.0"
"#;

/// The slowest speed counts as the fastest divided by this, because the delay must be bounded.
const MOST_SLOWER: f64 = 5.0;

/// The response travels with the channel's speed: its delay is inversely proportional to the speed of the last transit,
/// a mean with the age of that transit.
fn carried_by(channel: &Channel<'_>) -> Option<&'static Definition> {
    let Channel { low, high, .. } = *channel;
    if low <= 0.0 {
        return None;
    }
    let slowest = low.max(high / MOST_SLOWER);
    let longest = high / slowest;
    let body = format!(
        r#"dead_time = "transit"
expression = "delayed(jet, transit * reference / max(mean_speed, {slowest:?}), transit * {longest:?})"
[[state]]
name = "mean_speed"
update = """
if has_begun > 0.5 {{
    mean_speed + (1.0 - exp(-2.0 * period * mean_speed / (transit * reference))) * (channel - mean_speed)
}} else {{ channel }}"""
{HAS_BEGUN}[[parameter]]
name = "transit"
unit = "s"
low = 0.001
high = 0.5
starts = [0.01, 0.03, 0.06, 0.1]
"#
    );
    let texts = [
        "the dead time is inversely proportional to",
        "convection: a distance divided by the speed",
    ];
    of_channel(["carried-by", "jet"], channel, texts, &body)
}

/// The response to the channel.
fn measured_input(channel: &Channel<'_>) -> Option<&'static Definition> {
    let range = channel.high - channel.low;
    let body = format!(
        r#"expression = "reading + gain * lagged"
[[state]]
name = "first_value"
update = "if has_begun > 0.5 {{ first_value }} else {{ channel }}"
[[state]]
name = "lagged"
update = """
lagged + (1.0 - exp(-period / lag)) * (delayed((channel - first_value) / {range:?}, dead_time) - lagged)"""
{HAS_BEGUN}[[parameter]]
name = "gain"
unit = "y"
low = -5.0
high = 5.0
starts = [-0.2, 0.2]
[[parameter]]
name = "lag"
unit = "s"
low = 0.0005
high = 3.0
starts = [0.005, 0.03, 0.12, 0.5]
[[parameter]]
name = "dead_time"
unit = "s"
low = 0.0
high = 0.5
starts = [0.0, 0.02, 0.08, 0.25]
"#
    );
    let texts = [
        "a response of y to",
        "superposition: a measured disturbance behind a first-order lag with dead time",
    ];
    of_channel(["input", "sensor"], channel, texts, &body)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::data::Use;
    use model_core::effects::ZERO_OFFSET;

    const SPEED: Channel<'_> = Channel {
        name: "q",
        low: 2.0,
        high: 5.0,
    };

    fn record(names: &[&str]) -> Record {
        let u = vec![0.0; 900];
        let mut record = Record::new("r", Use::Identify, 0.001, u.clone(), u);
        for name in names {
            let channel = (0..900).map(|k| 2.0 + 3.0 * f64::from(u8::from(k >= 300)));
            record
                .channels
                .insert((*name).to_owned(), channel.collect());
        }
        record
    }

    #[test]
    fn each_channel_that_varies_and_has_a_name_is_an_input() {
        let mut records = [record(&["Heater 2", "u_inf", "still"])];
        records[0]
            .channels
            .insert("still".to_owned(), vec![1.0; 900]);
        let inputs = measured_inputs(&records);
        let names: Vec<&str> = inputs.iter().map(|input| input.spec().name).collect();
        let of_heater = [
            "input-heater-2",
            "scaled-by-heater-2",
            "driven-by-heater-2",
            "relaxed-by-heater-2",
            "carried-by-heater-2",
        ];
        // The catalogue has an effect of the free stream on the strength of the jets.
        assert_eq!(names[..5], of_heater);
        assert_eq!(names[5..], ["carried-by-u-inf"]);
        // The channels are the reading in another unit, a copy of the command, and a clock.
        for record in &mut records {
            record.u = (0..900)
                .map(|k| f64::from(u8::from(k % 200 > 100)))
                .collect();
            record.y = (0..900).map(|k| (f64::from(k) / 50.0).sin()).collect();
            let y = record.y.iter().map(|y| 32.0 + 1.8 * y).collect();
            record.channels.insert("fahrenheit".to_owned(), y);
            let u = record.u.iter().map(|u| 100.0 * u).collect();
            record.channels.insert("percent".to_owned(), u);
            let clock = (0..900).map(f64::from).collect();
            record.channels.insert("row".to_owned(), clock);
        }
        let names: Vec<&str> = measured_inputs(&records)
            .iter()
            .map(|i| i.spec().name)
            .collect();
        assert_eq!(names[..5], of_heater);
        assert_eq!(names.len(), 6);
        // One record lacks the channel.
        assert!(measured_inputs(&[records[0].clone(), record(&[])]).is_empty());
    }

    /// The names in the expressions of an effect may not hide its channel.
    #[test]
    fn channels_may_be_called_as_they_like() {
        for name in [
            "speed",
            "level",
            "x",
            "first",
            "period",
            "t",
            "reference",
            "U inf",
            "gain",
            "lag",
            "transit",
            "channel",
        ] {
            let names = measured_inputs(&[record(&[name])]).len();
            assert_eq!(names, 5, "{name}");
        }
    }

    #[test]
    fn of_many_channels_those_are_tried_that_explain_what_is_left() {
        let mut record = record(&[]);
        for i in 0..12_u32 {
            let channel =
                (0..900_u32).map(|k| f64::from(u8::from((k + 37 * i) / (60 + 7 * i) % 2 == 0)));
            record.channels.insert(format!("c{i}"), channel.collect());
        }
        let mut s = 0.0;
        record.y = record.channels["c7"]
            .iter()
            .map(|v| {
                s += 0.05 * (v - s);
                s
            })
            .collect();
        let names: Vec<&str> = leading_inputs(&Model::default(), &[record])
            .iter()
            .map(|i| i.spec().name)
            .collect();
        // The other channels begin at 0, so that neither reading nor jets scale with them.
        assert_eq!((names.len(), names[0]), (2 * RULES.inputs, "input-c7"));
    }

    /// The square of the channel, of all that is above 1; the offset of 3 is part of the reading.
    #[test]
    fn the_reading_is_a_power_of_the_channel() {
        let mut records = [record(&["q"])];
        let near = |k: usize| if k < 300 { 3.2 } else { 4.8 };
        let q = (0..900).map(near).collect();
        records[0].channels.insert("q".to_owned(), q);
        let scaled = scaled_by(&SPEED).expect("of one sign");
        let mut model = Model::default();
        model.define(scaled).expect("a new name");
        model.add(scaled.spec(), &[2.0, 1.0], Some(4.0));
        model.add(ZERO_OFFSET, &[3.0], None);
        let y = model.free_run(&records[0]).expect("it does not diverge");
        for (k, y) in y.iter().enumerate() {
            let power = (near(k) / 4.0_f64).powi(2);
            let expected = 3.0 + (power - 1.0) * (3.0 - 1.0);
            assert!((y - expected).abs() < 0.02, "{k}: {y}");
        }
        assert!(
            scaled_by(&Channel {
                name: "t",
                low: -2.0,
                high: 5.0
            })
            .is_none()
        );
    }

    /// A model whose y is the jet strength of the sample before.
    fn jets(own: &'static Definition, parameters: &[f64], reference: f64) -> Model {
        let mut model = Model {
            b: vec![1.0],
            ..Model::default()
        };
        model.define(own).expect("a new name");
        model.add(own.spec(), parameters, Some(reference));
        model
    }

    #[test]
    fn the_jets_arrive_after_a_distance() {
        let mut record = record(&["q"]);
        let command = |k: usize| f64::from(u8::from(k / 100 % 2 == 1));
        record.u = (0..900).map(command).collect();
        let carried = carried_by(&SPEED).expect("positive");
        let y = jets(carried, &[0.040], 4.0)
            .free_run(&record)
            .expect("it does not diverge");
        // A distance of 4 · 0.040: 80 samples at the speed 2, 32 at 5, some time after the change.
        for (range, delay) in [(90..295, 80), (400..890, 32)] {
            for k in range {
                let expected = command(k - 1 - delay);
                assert!((y[k] - expected).abs() < 0.05, "{k}: {}", y[k]);
            }
        }
    }

    /// The power of a heater at another voltage.
    #[test]
    fn the_jets_are_a_power_of_the_channel() {
        let mut record = record(&["q"]);
        record.u = vec![1.0; 900];
        let driven = driven_by(&SPEED).expect("of one sign");
        for gain in [-1.0, 1.0, 2.0] {
            let y = jets(driven, &[gain], 4.5)
                .free_run(&record)
                .expect("it does not diverge");
            let expected = (5.0_f64 / 4.5).powf(gain);
            assert!((y[800] - expected).abs() < 0.001, "{gain}: {}", y[800]);
        }
    }

    /// Water that leaves a heater takes its warmth along.
    #[test]
    fn the_relaxation_rate_is_the_channels() {
        let mut record = record(&["q"]);
        record.u = vec![1.0; 900];
        let relaxed = relaxed_by(&SPEED).expect("of one sign");
        let mut model = jets(relaxed, &[1.0, 0.0], 4.0);
        (model.a[0], model.b[0]) = (0.98, 0.02);
        let y = model.free_run(&record).expect("it does not diverge");
        let mut s = 0.0;
        for (y, q) in y.iter().zip(&record.channels["q"]) {
            assert!((y - s).abs() < 1e-9, "{y} {s}");
            s += 0.02 * (1.0 - s * q / 4.0);
        }
    }

    #[test]
    fn the_response_is_a_lag_with_dead_time_from_rest() {
        let records = [record(&["fan"])];
        let input = measured_inputs(&records)[0];
        let mut model = Model::default();
        model.define(input).expect("a new name");
        model.add(input.spec(), &[0.6, 0.05, 0.1], Some(2.0));
        let y = model.free_run(&records[0]).expect("it does not diverge");
        assert!(y[..400].iter().all(|y| y.abs() < 1e-12));
        for (k, y) in y.iter().enumerate().skip(400) {
            let expected = 0.6 * (1.0 - (-((k - 400 + 1) as f64) / 50.0).exp());
            assert!((y - expected).abs() < 1e-9, "{k}: {y}");
        }
    }
}
