//! Memory and inputs of a model.
//!
//! Sizes of the memories: one source for the simulator, the design of laws and the generated code.

use super::{Added, Delay, Model};
use model_core::Real;
use model_core::effect::Place;

/// Samples per word of the board's command memory.
const BITS: usize = 32;

/// The memory of a model.
#[derive(Clone, Debug, PartialEq)]
pub struct Footprint {
    /// Stored outputs, samples: more than the longest lag, at least the averaging window.
    pub outputs: usize,
    /// Stored jet strengths, samples: more than the longest input delay.
    pub jets: usize,
    /// Whether jets have strengths between on and off; otherwise one bit per sample is enough.
    pub graded: bool,
    /// Measured channels of the effects, in the order in which they are passed.
    pub channels: Vec<Channel>,
}

/// A measured channel.
#[derive(Clone, Debug, PartialEq)]
pub struct Channel {
    /// Name of the channel in records and model files.
    pub name: String,
    /// Reference value of the channel, in its unit; 1 if the model file contains no reference.
    pub reference: f64,
}

impl Model {
    /// Memory of the model.
    #[must_use]
    pub fn memory(&self) -> Footprint {
        self.memory_for(self.longest_delay())
    }

    /// Memory of the model for input delays up to `delay` samples.
    #[must_use]
    pub fn memory_for(&self, delay: usize) -> Footprint {
        let window = self.averaging.window as usize;
        let averaged = if self.averaging.averaged_model {
            window
        } else {
            0
        };
        let shapes_jet = |name: &str| self.spec(name).is_none_or(|spec| spec.place == Place::Jet);
        let names = self.effects.iter().map(|added| added.name.as_str());
        Footprint {
            outputs: (self.longest_lag() + 1).max(window).max(2),
            // One sample for interpolation, one for rounding up in single precision, and the newest one.
            jets: delay + 3 + averaged,
            graded: matches!(&self.delay, Delay::Law(law) if law.shapes_command())
                || names.into_iter().any(shapes_jet),
            channels: self.measured(),
        }
    }

    fn measured(&self) -> Vec<Channel> {
        let of = |name: String| {
            let owner = self
                .effects
                .iter()
                .find(|added| added.channel.as_ref() == Some(&name));
            Channel {
                reference: owner.map_or(Added::NO_REFERENCE, Added::reference),
                name,
            }
        };
        self.channels().into_iter().map(of).collect()
    }
}

impl Footprint {
    /// Words for jets that are on or off.
    #[must_use]
    pub fn words(&self) -> usize {
        self.jets.div_ceil(BITS)
    }

    /// The reference values of the channels.
    #[must_use]
    pub fn references<T: Real>(&self) -> Vec<T> {
        let each = self.channels.iter();
        each.map(|channel| T::from_f64(channel.reference)).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lags_delays_and_windows_are_kept() {
        let mut model = Model {
            state_lags: vec![1, 300],
            delay: Delay::Fixed {
                delays: vec![40, 60],
            },
            ..Model::default()
        };
        model.averaging.window = 250;
        let memory = model.memory();
        // Lag 300 of the one-step convention is 299 samples behind the newest.
        assert_eq!((memory.outputs, memory.jets), (300, 63));
        assert_eq!((memory.graded, memory.words()), (false, 2));
        model.averaging.averaged_model = true;
        assert_eq!(model.memory().jets, 313);
        model.state_lags = vec![1, 2];
        assert_eq!(model.memory().outputs, 250);
    }

    #[test]
    fn jets_between_on_and_off_are_numbers() {
        let mut model = Model::default();
        let add = |model: &mut Model, name: &str| {
            let spec = model_core::effects::spec(name).expect("in the catalogue");
            model.add(spec, &[0.1, 0.1], None);
        };
        add(&mut model, "hot-film-lag");
        assert!(!model.memory().graded);
        add(&mut model, "plenum-droop");
        assert!(model.memory().graded);
    }

    #[test]
    fn a_channel_has_one_reference_for_all() {
        let added = |reference| Added {
            name: "free-stream-variation".to_owned(),
            parameters: vec![-1.0],
            channel: Some("u_inf".to_owned()),
            reference,
        };
        let mut model = Model {
            effects: vec![added(Some(10.0)), added(Some(10.0))],
            ..Model::default()
        };
        let channels = model.memory().channels;
        assert_eq!(channels.len(), 1);
        assert_eq!(
            (channels[0].name.as_str(), channels[0].reference),
            ("u_inf", 10.0)
        );
        model.effects = vec![added(None)];
        assert_eq!(model.memory().references::<f32>(), [1.0]);
    }
}
