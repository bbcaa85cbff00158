//! What an effect is while the plant runs: the hooks through which jet, flow and sensor call it.
//!
//! Every hook passes its signal through unless the part acts there. Rooms loop over their parts in the
//! order of [`Place`] and know none of them by name.

use std::fmt::Debug;

use super::base::FlowDelay;
use super::free_stream::FreeStream;

/// Where an effect sits, in the order in which the signals run.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum Place {
    /// The way from the jet's mouth to the sensor.
    Transport,
    /// The line from the coil to the valve.
    Line,
    /// The valve's moving part.
    Valve,
    /// What an opening lets through.
    Nozzle,
    /// The pressure behind the valve.
    Plenum,
    /// The stream into which the jet blows.
    FreeStream,
    /// A second way to the flow.
    Path,
    /// What is shed when the jet changes.
    Shedding,
    /// The flow itself.
    Flow,
    /// What the sensor can tell of the flow.
    Sense,
    /// From friction to voltage.
    Film,
    /// Voltage that takes its time.
    FilmLag,
    /// The sensor's zero.
    Zero,
    /// The cable.
    Cable,
    /// The range of the amplifier.
    Rails,
}

/// What a part may know of its surroundings when it is built.
#[derive(Debug, Clone, Copy, Default)]
pub(crate) struct Surroundings<'a> {
    /// What the tunnel does during the record; steady when `None`.
    pub(crate) free_stream: Option<&'a FreeStream>,
}

/// A running part, by the room it belongs to.
pub(crate) enum Part {
    /// It sets the transport delay.
    Delay(FlowDelay),
    /// It shapes the jet.
    Jet(Box<dyn JetPart>),
    /// It acts in the flow.
    Flow(Box<dyn FlowPart>),
    /// It acts between flow and reading.
    Sensor(Box<dyn SensorPart>),
}

/// A straight piece of a signal.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Piece {
    /// How long it takes (s).
    pub(crate) dt: f64,
    /// The signal at its beginning.
    pub(crate) from: f64,
    /// The signal at its end.
    pub(crate) to: f64,
}

/// A link of the chain from the coil to the jet. It does not feel the flow.
pub(crate) trait JetPart: Debug + Send + Sync + BoxedJet {
    /// What comes out at `t`, after what goes in has jumped between two levels without taking time.
    fn jump(&mut self, t: f64, from: f64, to: f64) -> f64;

    /// What comes out at `t`, the end of a piece.
    fn advance(&mut self, t: f64, piece: &Piece) -> f64;

    /// When it jumps by itself, if nothing else happens (s).
    fn next_event(&self) -> Option<f64> {
        None
    }

    /// The time of [`next_event`](Self::next_event) has come; [`jump`](Self::jump) follows.
    fn event(&mut self) {}

    /// What it adds to the jet behind the last link.
    fn shed(&self) -> f64 {
        0.0
    }
}

/// What slows the flow down: v + dry·sign(v) + drag·v·|v| = push.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub(crate) struct Resistance {
    /// Does not depend on the speed (y/s).
    pub(crate) dry: f64,
    /// Grows with the square of the speed (s/y).
    pub(crate) drag: f64,
}

/// Something in the flow. Each part has one continuous memory z, which is integrated with the flow.
pub(crate) trait FlowPart: Debug + Send + Sync + BoxedFlow {
    /// What it adds to the level that the flow goes to, at friction `s` (y).
    fn drive(&self, _s: f64, _z: f64) -> f64 {
        0.0
    }

    /// ż at friction `s`, which moves at `s_dot`.
    fn memory_rate(&self, _s: f64, _s_dot: f64, _z: f64) -> f64 {
        0.0
    }

    /// How it resists motion.
    fn resistance(&self) -> Resistance {
        Resistance::default()
    }

    /// The arriving jet jumps to `jet`.
    fn arrives(&mut self, _jet: f64) {}

    /// A piece of the arriving jet has passed; the friction is `s` now.
    fn passed(&mut self, _jet: &Piece, _s: f64) {}

    /// What it adds to the friction that the film feels while `jet` arrives (y).
    fn at_the_film(&self, _jet: f64) -> f64 {
        0.0
    }
}

/// When a reading is taken, and under which command.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Moment {
    /// Time since the start (s).
    pub(crate) t: f64,
    /// What the valve is told.
    pub(crate) command: f64,
}

/// A link of the chain from what the film feels to the reading.
pub(crate) trait SensorPart: Debug + Send + Sync + BoxedSensor {
    /// Whether [`advance`](Self::advance) differs from [`jump`](Self::jump) to the end of the piece.
    fn takes_time(&self) -> bool {
        false
    }

    /// What the film gives when what it feels has just jumped to `to`.
    fn jump(&mut self, to: f64) -> f64 {
        to
    }

    /// What the film gives at the end of a piece.
    fn advance(&mut self, piece: &Piece) -> f64 {
        self.jump(piece.to)
    }

    /// What is read of the film's `signal`.
    fn read(&self, signal: f64, _at: &Moment) -> f64 {
        signal
    }
}

macro_rules! boxed {
    ($($boxed:ident: $part:ident),+) => { $(
        /// Copies a part behind its box.
        pub(crate) trait $boxed {
            /// A copy with the same state.
            fn boxed(&self) -> Box<dyn $part>;
        }
        impl<P: $part + Clone + 'static> $boxed for P {
            fn boxed(&self) -> Box<dyn $part> {
                Box::new(self.clone())
            }
        }
        impl Clone for Box<dyn $part> {
            fn clone(&self) -> Self {
                (**self).boxed()
            }
        }
    )+ };
}
boxed!(BoxedJet: JetPart, BoxedFlow: FlowPart, BoxedSensor: SensorPart);
