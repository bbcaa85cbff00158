//! A measured channel as a second input of the plant: a heater beside the first one, a fan, the ambient temperature.

use super::Definition;
use crate::data::Record;
use std::collections::BTreeMap;

/// For each channel of all `records` that varies and that no effect of the catalogue reads, the effect that adds its
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
        .filter(|(name, _)| !known.contains(name))
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
    use crate::model::Model;

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
        // A record that lacks the channel.
        assert!(measured_inputs(&[records[0].clone(), record(&[])]).is_empty());
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
