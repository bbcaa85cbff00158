//! A measured channel as a second input of the plant: a heater beside the first one, a fan, the ambient temperature.

use super::RULES;
use crate::data::Record;
use crate::model::Model;
use crate::order;
use crate::parallel;
use crate::preparation::FirstOrder;
use crate::residual::correlation;
use crate::user_effect::Definition;
use std::collections::BTreeMap;

/// Channels are ranked among so many, by averages of all records to so many samples: for the time it takes.
const RANKED: usize = 256;
const RANKED_SAMPLES: usize = 2000;

/// Those of [`measured_inputs`] that a diagnosis of `given` tries: where there are many, those of which a first-order lag with
/// dead time explains most of what `given` leaves.
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

/// Whether a channel is y, the command or a clock in other units.
fn is_known(records: &[Record], name: &str) -> bool {
    let all =
        |of: &dyn Fn(&Record) -> Vec<f64>| -> Vec<f64> { records.iter().flat_map(of).collect() };
    let own = all(&|r| r.channels.get(name).cloned().unwrap_or_default());
    let (low, high) = own
        .iter()
        .fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), v| {
            (low.min(*v), high.max(*v))
        });
    // Correlations are of numbers of order one.
    let own: Vec<f64> = own.iter().map(|v| (v - low) / (high - low)).collect();
    let goes_with = |other: Vec<f64>| {
        correlation(&own, &other).is_some_and(|(r, _)| r.abs() > RULES.same_quantity)
    };
    goes_with(all(&|r| r.y.clone()))
        || goes_with(all(&|r| r.u.clone()))
        || goes_with(all(&|r| (0..r.len()).map(|k| k as f64).collect()))
}

/// For each channel of all `records` that varies, that no effect of the catalogue reads, and that is not y, the command or a
/// clock again, the effect that adds its
/// response to the reading: a first-order lag with dead time of the channel's deviation from its first value, in parts of its
/// range. The reading's zero is that of a record at rest, when the channel had that value.
/// A channel whose name is no name of the language is left out.
#[must_use]
pub(crate) fn measured_inputs(records: &[Record]) -> Vec<&'static Definition> {
    let known = model_core::effects::SPECS.iter().filter_map(|s| s.channel);
    let known: Vec<&str> = known.collect();
    let Some(first) = records.first() else {
        return Vec::new();
    };
    let mut ranges: BTreeMap<&str, [f64; 2]> = BTreeMap::new();
    for name in first.channels.keys() {
        let all: Option<Vec<&Vec<f64>>> = records.iter().map(|r| r.channels.get(name)).collect();
        let values = all.iter().flatten().flat_map(|values| values.iter());
        let range = values.fold([f64::INFINITY, f64::NEG_INFINITY], |[low, high], v| {
            [low.min(*v), high.max(*v)]
        });
        ranges.insert(name, range);
    }
    ranges
        .into_iter()
        .filter(|(name, [low, high])| high > low && !known.contains(name))
        .filter(|(name, _)| !is_known(records, name))
        .filter_map(|(name, [low, high])| measured_input(name, high - low))
        .collect()
}

/// The effect of the channel called `name`, which covers `range`.
fn measured_input(name: &str, range: f64) -> Option<&'static Definition> {
    let usable = range.is_finite() && range > 0.0;
    let own = name.to_lowercase().replace('_', "-");
    let text = format!(
        r#"name = "input-{own}"
place = "sensor"
summary = "a response of y to the measured channel `{name}`"
source = "superposition: a measured disturbance behind a first-order lag with dead time"
channel = "{name}"
scales = true
expression = "reading + gain * level"
[[state]]
name = "first"
update = "if begun > 0.5 {{ first }} else {{ {name} }}"
[[state]]
name = "level"
update = """
level + (1.0 - exp(-period / lag)) * (delayed(({name} - first) / {range:?}, dead_time) - level)"""
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
    usable.then(|| Definition::from_toml(&text, name).ok())?
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
        let mut records = [record(&["heater_2", "u_inf", "y", "still"])];
        records[0]
            .channels
            .insert("still".to_owned(), vec![1.0; 900]);
        let inputs = measured_inputs(&records);
        let names: Vec<&str> = inputs.iter().map(|input| input.spec().name).collect();
        assert_eq!(names, ["input-heater-2"]);
        // The reading in another unit, a copy of the command, a clock.
        for (k, record) in records.iter_mut().enumerate() {
            assert_eq!(k, 0);
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
        // A record that lacks the channel.
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
