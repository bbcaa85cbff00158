//! A rig as TOML text, for users and scoring scripts.

use std::fmt::Write as _;

use super::base::{FlowDelay, RateLaw};
use super::fault::Fault;
use super::rig::PlantSpec;

impl PlantSpec {
    /// The tables `[base]`, `[[effect]]`, `[[beyond]]` and `[[fault]]`.
    pub fn to_toml(&self) -> String {
        let base = &self.base;
        let mut text = format!(
            "[base]\nattach_s = {}\nseparate_s = {}\ngain = {}\nrate_law = \"{}\"\n",
            base.attach_s,
            base.separate_s,
            base.gain,
            match base.rate_law {
                RateLaw::Switched => "switched",
                RateLaw::Interpolated => "interpolated",
                RateLaw::Bilinear => "bilinear",
            }
        );
        // Writing to a String cannot fail.
        let _ = match self.delay() {
            FlowDelay::Fixed { delay_s } => writeln!(text, "delay_s = {delay_s}"),
            FlowDelay::StateDependent {
                floor_s,
                rise_s,
                rate,
            } => writeln!(
                text,
                "delay_floor_s = {floor_s}\ndelay_rise_s = {rise_s}\ndelay_rate = {rate}"
            ),
            FlowDelay::Clamped {
                floor_s,
                rise_s,
                level,
            } => writeln!(
                text,
                "delay_floor_s = {floor_s}\ndelay_rise_s = {rise_s}\ndelay_level = {level}"
            ),
            FlowDelay::EdgeDependent { rise_s, fall_s } => {
                writeln!(text, "rise_delay_s = {rise_s}\nfall_delay_s = {fall_s}")
            }
        };
        for (name, value) in self.character.properties() {
            let _ = writeln!(text, "{name} = {value}");
        }
        let effects = self
            .effects
            .iter()
            .map(|e| (e.name(), None, e.parameters()));
        let altered = self.altered.iter();
        let altered = altered.map(|e| (e.name(), Some(e.resembles()), e.parameters()));
        for (name, resembles, parameters) in effects.chain(altered) {
            let _ = writeln!(text, "\n[[effect]]\nname = \"{name}\"");
            if let Some(resembles) = resembles {
                let _ = writeln!(text, "resembles = \"{resembles}\"");
            }
            for p in parameters {
                let _ = writeln!(text, "{} = {} # {}", p.name, p.value, p.unit);
            }
        }
        for physics in &self.beyond {
            let truth = physics.truth();
            let _ = writeln!(
                text,
                "\n[[beyond]]\nname = \"{}\"\nplace = \"{}\"\ncoordinates = {:?}",
                physics.name(),
                truth.port.word(),
                truth.coordinates
            );
            for p in physics.parameters() {
                let _ = writeln!(text, "{} = {} # {}", p.name, p.value, p.unit);
            }
        }
        for fault in &self.faults {
            let _ = writeln!(text, "\n[[fault]]\nname = \"{}\"", fault.name());
            let _ = match *fault {
                Fault::MissingPulse { every } => writeln!(text, "every = {every}"),
                Fault::FreezingSensor { from_s, to_s } => {
                    writeln!(text, "from_s = {from_s}\nto_s = {to_s}")
                }
                Fault::StickingValve {
                    after_open_s,
                    stuck_s,
                } => writeln!(text, "after_open_s = {after_open_s}\nstuck_s = {stuck_s}"),
            };
        }
        text
    }
}
