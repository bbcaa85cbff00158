//! A measured channel as a second input of the plant: a second heater, a fan, the ambient temperature.

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

/// The [`measured_inputs`] that a diagnosis of `given` tries. If there are many, the inputs whose response (a
/// first-order lag with dead time) explains most of the residual of `given`.
#[must_use]
pub(crate) fn leading_inputs(given: &Model, records: &[Record]) -> Vec<&'static Definition> {
    let inputs = measured_inputs(records);
    if inputs.len() <= RULES.inputs {
        return inputs;
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
        let channel = input.spec().channel.unwrap_or_default();
        let follows: Vec<Record> = records
            .iter()
            .zip(&left)
            .map(|(record, left)| {
                let u = record.channels.get(channel).map(|values| thinned(values));
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
            *input,
        )
    });
    order::descending(&mut ranked, |(explained, _)| *explained);
    ranked
        .into_iter()
        .take(RULES.inputs)
        .map(|(_, input)| input)
        .collect()
}

/// A signal over all records, joined.
fn joined(records: &[Record], of: impl Fn(&Record) -> Vec<f64>) -> Vec<f64> {
    records.iter().flat_map(of).collect()
}

/// An effect for each measured channel of `records`: it adds a response to the channel to the reading. A channel
/// must be in all records, vary, not be read by an effect of the catalogue, and not be a copy of y, the command or
/// a clock. The response is a first-order lag with dead time of the channel's deviation from its first value, as a
/// fraction of its range. At rest the channel has its first value and the response is 0.
#[must_use]
pub(crate) fn measured_inputs(records: &[Record]) -> Vec<&'static Definition> {
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
    let inputs = names.filter_map(|name| {
        let own = joined(records, |r| r.channels[name].clone());
        let low = own.iter().copied().fold(f64::INFINITY, f64::min);
        let range = own.iter().copied().fold(f64::NEG_INFINITY, f64::max) - low;
        if !(range.is_finite() && range > 0.0) {
            return None;
        }
        // Correlations are computed with numbers of order one.
        let scaled: Vec<f64> = own.iter().map(|v| (v - low) / range).collect();
        let is_again = |known: &Vec<f64>| {
            correlation(&scaled, known).is_some_and(|(r, _)| r.abs() > RULES.same_quantity)
        };
        (!known.iter().any(is_again)).then(|| measured_input(name, range))?
    });
    inputs.collect()
}

/// The effect of the channel called `channel`, which covers `range`.
fn measured_input(channel: &str, range: f64) -> Option<&'static Definition> {
    let words = channel.to_lowercase();
    let words = words.split(|c: char| !c.is_ascii_alphanumeric());
    let words: Vec<&str> = words.filter(|word| !word.is_empty()).collect();
    let (name, signal) = (words.join("-"), channel_signal(channel));
    let summary = format!("a response of y to the measured channel `{channel}`");
    let [quoted, summary] = [channel.to_owned(), summary].map(toml::Value::String);
    let text = format!(
        r#"name = "input-{name}"
place = "sensor"
summary = {summary}
source = "superposition: a measured disturbance behind a first-order lag with dead time"
channel = {quoted}
scales = true
expression = "reading + gain * level"
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
    // A name that is too long is not valid for an effect.
    Definition::from_toml(&text, channel).ok()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::data::Use;

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
        assert_eq!(names, ["input-heater-2"]);
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
        assert_eq!(names, ["input-heater-2"]);
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
        assert_eq!((names.len(), names[0]), (RULES.inputs, "input-c7"));
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
