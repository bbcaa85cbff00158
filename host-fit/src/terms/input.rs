//! A measured channel as a second input of the plant (a second heater, a fan, the ambient temperature), and as a
//! factor of the reading (the dynamic pressure at a balance, the temperature at a hot film).

use super::RULES;
use crate::data::Record;
use crate::model::Model;
use crate::order;
use crate::parallel;
use crate::preparation::FirstOrder;
use crate::residual::correlation;
use crate::user_effect::{Definition, channel_signal};
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

/// Two effects for each measured channel of `records`. One adds a response to the channel to the reading: a first-order
/// lag with dead time of the channel's deviation from its first value, as a fraction of its range; at rest the channel
/// has its first value and the response is 0. The other multiplies the reading by a linear function of the channel, if
/// the channel does not change its sign. A channel must be in all records, vary, not be read by an effect of the
/// catalogue, and not be a copy of y, the command or a clock.
#[must_use]
pub(crate) fn measured_inputs(records: &[Record]) -> Vec<&'static Definition> {
    effects_of(channels_that_vary(records).iter())
}

fn effects_of<'a>(channels: impl Iterator<Item = &'a Channel<'a>>) -> Vec<&'static Definition> {
    let both = |channel: &Channel<'_>| [measured_input(channel), scaled_by(channel)];
    channels.flat_map(both).flatten().collect()
}

/// The channels that fulfil the conditions of [`measured_inputs`].
fn channels_that_vary(records: &[Record]) -> Vec<Channel<'_>> {
    let Some(first) = records.first() else {
        return Vec::new();
    };
    let read = |name: &str| SPECS.iter().any(|spec| spec.channel == Some(name));
    let everywhere = |name: &str| records.iter().all(|r| r.channels.contains_key(name));
    let names = first.channels.keys();
    let names = names.filter(|name| !read(name) && everywhere(name));
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

/// The tool's own effect `prefix-CHANNEL` on the reading; `what` precedes the channel in its summary, and `body` is the
/// expression with states and parameters. `None` if the name is too long for an effect.
fn of_channel(
    prefix: &str,
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
place = "sensor"
summary = {summary}
source = "{source}"
channel = {quoted}
scales = true
{body}"#
    );
    Definition::from_toml(&text, channel.name).ok()
}

/// The reading as a multiple of a linear function of the channel, beginning at the reading that does not depend on it.
fn scaled_by(channel: &Channel<'_>) -> Option<&'static Definition> {
    if channel.low * channel.high <= 0.0 {
        return None;
    }
    let signal = channel_signal(channel.name);
    let body = format!(
        r#"expression = "reading + gain * ({signal} / reference - 1.0) * (reading - zero)"
[[parameter]]
name = "gain"
unit = "-"
low = -10.0
high = 10.0
starts = [1.0, -0.5]
[[parameter]]
name = "zero"
unit = "reading"
low = -100.0
high = 100.0
starts = [0.0, -2.0]
"#
    );
    let texts = [
        "the reading scales with",
        "calibration: to first order the sensitivity is a linear function of the channel",
    ];
    of_channel("scaled-by", channel, texts, &body)
}

/// The response to the channel.
fn measured_input(channel: &Channel<'_>) -> Option<&'static Definition> {
    let signal = channel_signal(channel.name);
    let range = channel.high - channel.low;
    let body = format!(
        r#"expression = "reading + gain * level"
[[state]]
name = "first"
update = "if begun > 0.5 {{ first }} else {{ {signal} }}"
[[state]]
name = "level"
update = """
level + (1.0 - exp(-period / lag)) * (delayed(({signal} - first) / {range:?}, dead_time) - level)"""
[[state]]
name = "begun"
update = "1.0"
[[parameter]]
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
    of_channel("input", channel, texts, &body)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::data::Use;
    use model_core::effects::ZERO_OFFSET;

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
        assert_eq!(names, ["input-heater-2", "scaled-by-heater-2"]);
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
        assert_eq!(names, ["input-heater-2", "scaled-by-heater-2"]);
        // One record lacks the channel.
        assert!(measured_inputs(&[records[0].clone(), record(&[])]).is_empty());
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
        // The other channels begin at 0, so that nothing scales with them.
        assert_eq!((names.len(), names[0]), (RULES.inputs, "input-c7"));
    }

    /// Twice the channel's relative change, of all that is above 1; the offset of 3 is part of the reading.
    #[test]
    fn the_reading_is_a_multiple_of_a_linear_function_of_the_channel() {
        let records = [record(&["q"])];
        let scaled = scaled_by(&Channel {
            name: "q",
            low: 2.0,
            high: 5.0,
        })
        .expect("of one sign");
        let mut model = Model::default();
        model.define(scaled).expect("a new name");
        model.add(scaled.spec(), &[2.0, 1.0], Some(4.0));
        model.add(ZERO_OFFSET, &[3.0], None);
        let y = model.free_run(&records[0]).expect("it does not diverge");
        for (k, y) in y.iter().enumerate() {
            let q = if k < 300 { 2.0 } else { 5.0 };
            let expected = 3.0 + 2.0 * (q / 4.0 - 1.0) * (3.0 - 1.0);
            assert!((y - expected).abs() < 1e-9, "{k}: {y}");
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
