//! The physical effects a plant can hide, with the names, parameters and units users read.

use thiserror::Error;

/// Why an effect could not be made.
#[derive(Debug, Clone, PartialEq, Error)]
pub enum EffectError {
    /// No effect of that name.
    #[error("there is no effect `{0}`; the names are: {names}", names = Effect::NAMES.join(", "))]
    UnknownEffect(String),
    /// The effect has no such parameter.
    #[error("`{effect}` has no parameter `{parameter}`; it has: {known}")]
    UnknownParameter {
        /// Name of the effect.
        effect: &'static str,
        /// The parameter asked for.
        parameter: String,
        /// What the effect does have.
        known: String,
    },
    /// A parameter is not a usable number.
    #[error("`{parameter}` of `{effect}` is {value}, it must be {requirement}; give another value")]
    OutOfRange {
        /// Name of the effect.
        effect: &'static str,
        /// Name of the parameter.
        parameter: &'static str,
        /// The value refused.
        value: f64,
        /// What is allowed.
        requirement: &'static str,
    },
}

/// A parameter of an effect: name, value, unit.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Parameter {
    /// Name as in model files and reports.
    pub name: &'static str,
    /// Value in `unit`.
    pub value: f64,
    /// Unit in words; "1" when dimensionless.
    pub unit: &'static str,
}

macro_rules! catalogue {
    ($(
        $(#[$doc:meta])*
        $variant:ident = $name:literal { $( $(#[$field_doc:meta])* $field:ident : $unit:literal ),* $(,)? }
    )*) => {
        /// One physical mechanism of the catalogue with its parameters.
        ///
        /// A "sample" is 1 ms here, whatever the integrator's step.
        #[derive(Debug, Clone, Copy, PartialEq)]
        pub enum Effect {
            $( $(#[$doc])* $variant { $( $(#[$field_doc])* $field: f64, )* }, )*
        }

        impl Effect {
            /// Every name of the catalogue, in its order.
            pub const NAMES: &'static [&'static str] = &[ $( $name, )* ];

            /// The name used in model files and reports.
            pub fn name(&self) -> &'static str {
                match self { $( Self::$variant { .. } => $name, )* }
            }

            /// The parameters, in the catalogue's order and units.
            pub fn parameters(&self) -> Vec<Parameter> {
                match self { $(
                    Self::$variant { $( $field, )* } => vec![
                        $( Parameter { name: stringify!($field), value: *$field, unit: $unit }, )*
                    ],
                )* }
            }

            /// The same effect with one parameter changed.
            ///
            /// # Errors
            /// [`EffectError::UnknownParameter`] when the effect has no such parameter.
            pub fn with(self, parameter: &str, new_value: f64) -> Result<Self, EffectError> {
                let mut changed = self;
                let known: Option<&mut f64> = match &mut changed { $(
                    Self::$variant { $( $field, )* } => match parameter {
                        $( stringify!($field) => Some($field), )*
                        _ => None,
                    },
                )* };
                match known {
                    Some(value) => {
                        *value = new_value;
                        Ok(changed)
                    }
                    None => Err(EffectError::UnknownParameter {
                        effect: self.name(),
                        parameter: parameter.to_owned(),
                        known: self.parameters().iter().map(|p| p.name).collect::<Vec<_>>().join(", "),
                    }),
                }
            }
        }
    };
}

catalogue! {
    /// h = floor + rise·exp(−rate·ỹ); replaces the base plant's delay.
    StateDependentDelay = "state-dependent-delay" {
        /// Delay of the attached flow.
        delay_floor: "samples",
        /// Extra delay of the separated flow.
        delay_rise: "samples",
        /// How fast the extra delay vanishes with the mean friction.
        delay_rate: "1/y",
    }
    /// Rising and falling edges travel for different times; replaces the base plant's delay.
    EdgeDependentDelay = "edge-dependent-delay" {
        /// Delay of a rising edge.
        rise_delay: "s",
        /// Delay of a falling edge.
        fall_delay: "s",
    }
    /// The valve opens and closes exponentially.
    ValveLag = "valve-lag" {
        /// Time constant while opening.
        opening_time: "s",
        /// Time constant while closing.
        closing_time: "s",
    }
    /// Blowing empties the plenum: Ṗ = (1 − P)/τ_r − κ·v·P, j = v·P.
    PlenumDroop = "plenum-droop" {
        /// Refill time constant τ_r.
        recovery_time: "s",
        /// Emptying rate κ at full opening.
        depletion_rate: "1/s",
    }
    /// The jet matters more or less as the measured free stream varies.
    FreeStreamVariation = "free-stream-variation" {
        /// Relative change of the jet per relative change of the free stream.
        gain: "1",
    }
    /// The jet arrives a second time, later.
    EchoPath = "echo-path" {
        /// Strength of the echo.
        gain: "1",
        /// How much later it arrives.
        echo_delay: "s",
    }
    /// Switching on sheds a vortex that adds to the jet.
    StartingVortex = "starting-vortex" {
        /// Strength.
        gain: "1",
        /// Time constant of its decay.
        decay_time: "s",
    }
    /// Switching off rolls up a vortex that works against the jet.
    StoppingVortex = "stopping-vortex" {
        /// Strength.
        gain: "1",
        /// Time constant of its decay.
        decay_time: "s",
    }
    /// Attached flow helps itself: a relay with two thresholds adds to the drive.
    AttachmentHysteresis = "attachment-hysteresis" {
        /// Friction above which the flow locks on.
        upper_threshold: "y",
        /// Friction below which it lets go.
        lower_threshold: "y",
        /// What the lock adds to the drive.
        gain: "y",
    }
    /// −γ·s³ in the drive.
    AmplitudeSaturation = "amplitude-saturation" {
        /// γ.
        cubic: "1/y^2",
    }
    /// A damped oscillation excited by the arriving jet, superposed on the friction.
    VortexShedding = "vortex-shedding" {
        /// Undamped natural frequency.
        frequency: "Hz",
        /// ζ, below 1 for a ringing flow.
        damping_ratio: "1",
        /// Size of the ringing in y.
        gain: "y",
    }
    /// King's law of the hot film, normalised to keep 0 and 1.
    HotFilmNonlinearity = "hot-film-nonlinearity" {
        /// κ, forced against natural convection.
        king_ratio: "1",
        /// Friction at which the convection would vanish.
        king_offset: "y",
    }
    /// The film follows with a first-order lag.
    HotFilmLag = "hot-film-lag" {
        /// Time constant.
        time_constant: "s",
    }
    /// The zero creeps while the film's support warms up.
    ThermalDrift = "thermal-drift" {
        /// Where the zero ends up.
        amplitude: "y",
        /// Time constant of the creep.
        time_constant: "s",
    }
    /// The sensor reads no further than its rails.
    SensorSaturation = "sensor-saturation" {
        /// Lower rail.
        lower_limit: "y",
        /// Upper rail.
        upper_limit: "y",
    }
    /// The valve current couples into the sensor cable.
    ElectricalPickup = "electrical-pickup" {
        /// Reading added while the valve is energised.
        gain: "y",
    }
    /// −F·sign(ṡ): the friction sticks and moves in jerks.
    DryFriction = "dry-friction" {
        /// F.
        level: "y per sample",
    }
    /// −d·Δs·|Δs| with Δs the change per sample.
    QuadraticDrag = "quadratic-drag" {
        /// d.
        coefficient: "samples/y",
    }
    /// The sensor cannot tell the direction of the flow.
    RectifyingSensor = "rectifying-sensor" {}
    /// The jet is a cubic of the valve opening.
    InputNonlinearity = "input-nonlinearity" {
        /// Coefficient of v².
        quadratic: "1",
        /// Coefficient of v³.
        cubic: "1",
    }
    /// Bouc–Wen hysteresis in the drive.
    BoucWenHysteresis = "bouc-wen-hysteresis" {
        /// A, the initial slope of the loop (only α·A shows in y: 1 by convention).
        stiffness: "1",
        /// β, how fast the loop saturates.
        beta: "1/y",
        /// γ, the loop's shape.
        gamma: "1/y",
        /// α, the loop's weight in the drive.
        alpha: "1",
    }
}

impl Effect {
    /// Checks the parameters against what the physics admits (not against what is usual).
    ///
    /// # Errors
    /// [`EffectError::OutOfRange`] naming the first bad parameter.
    pub fn validate(&self) -> Result<(), EffectError> {
        let effect = self.name();
        let refuse = |p: Parameter, requirement| {
            Err(EffectError::OutOfRange {
                effect,
                parameter: p.name,
                value: p.value,
                requirement,
            })
        };
        for p in self.parameters() {
            if !p.value.is_finite() {
                return refuse(p, "finite");
            }
            let is_time = p.unit == "s";
            if is_time && !(1e-4..=100.0).contains(&p.value) {
                return refuse(p, "between 0.0001 and 100 s");
            }
            let travels = matches!(p.name, "rise_delay" | "fall_delay" | "echo_delay");
            if travels && p.value > 1.0 {
                return refuse(p, "at most 1 s");
            }
            if matches!(p.name, "delay_floor" | "delay_rise") && !(0.0..=500.0).contains(&p.value) {
                return refuse(p, "between 0 and 500 samples");
            }
            let not_negative = matches!(
                p.name,
                "delay_rate"
                    | "depletion_rate"
                    | "level"
                    | "coefficient"
                    | "damping_ratio"
                    | "king_ratio"
                    | "king_offset"
            );
            if not_negative && p.value < 0.0 {
                return refuse(p, "0 or positive");
            }
            if p.name == "frequency" && !(0.01..=1000.0).contains(&p.value) {
                return refuse(p, "between 0.01 and 1000 Hz");
            }
        }
        match *self {
            Self::AttachmentHysteresis {
                upper_threshold,
                lower_threshold,
                ..
            } if lower_threshold >= upper_threshold => Err(EffectError::OutOfRange {
                effect,
                parameter: "lower_threshold",
                value: lower_threshold,
                requirement: "below upper_threshold",
            }),
            Self::SensorSaturation {
                lower_limit,
                upper_limit,
            } if lower_limit >= upper_limit => Err(EffectError::OutOfRange {
                effect,
                parameter: "lower_limit",
                value: lower_limit,
                requirement: "below upper_limit",
            }),
            Self::HotFilmNonlinearity { king_ratio, .. } if king_ratio == 0.0 => {
                Err(EffectError::OutOfRange {
                    effect,
                    parameter: "king_ratio",
                    value: king_ratio,
                    requirement: "above 0 (at 0 the film feels no flow)",
                })
            }
            _ => Ok(()),
        }
    }

    /// Whether the effect only shows with commands of more levels than off and on.
    pub fn needs_levels(&self) -> bool {
        matches!(
            self,
            Self::InputNonlinearity { .. } | Self::RectifyingSensor {}
        )
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_catalogue_has_its_21_names_once_each() {
        assert_eq!(Effect::NAMES.len(), 21);
        let mut sorted = Effect::NAMES.to_vec();
        sorted.sort_unstable();
        sorted.dedup();
        assert_eq!(sorted.len(), 21);
    }

    #[test]
    fn parameters_are_changed_by_name_and_checked() {
        let lag = Effect::ValveLag {
            opening_time: 0.01,
            closing_time: 0.02,
        };
        let slow = lag.with("closing_time", 0.03).unwrap();
        assert_eq!(slow.parameters()[1].value, 0.03);
        let message = lag.with("gain", 1.0).unwrap_err().to_string();
        assert!(
            message.contains("opening_time, closing_time"),
            "names the choices: {message}"
        );
        assert!(
            lag.with("closing_time", -1.0).unwrap().validate().is_err(),
            "a negative time"
        );
        let relay = Effect::AttachmentHysteresis {
            upper_threshold: 0.3,
            lower_threshold: 0.4,
            gain: 0.1,
        };
        assert!(relay.validate().is_err(), "thresholds in the wrong order");
    }
}
