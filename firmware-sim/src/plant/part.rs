//! The runtime interface of effects in jet, flow and sensor.

use std::fmt::Debug;

use super::base::FlowDelay;
use super::free_stream::FreeStream;

/// Place of an effect, in signal order.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum Place {
    /// The transport from jet to sensor.
    Transport,
    /// The line from the coil to the valve.
    Line,
    /// The valve's moving part.
    Valve,
    /// The flow through an opening.
    Nozzle,
    /// The pressure behind the valve.
    Plenum,
    /// The stream into which the jet blows.
    FreeStream,
    /// A second path to the flow.
    Path,
    /// Vortices shed when the jet changes.
    Shedding,
    /// The flow itself.
    Flow,
    /// The sensor's input.
    Sense,
    /// Conversion from friction to voltage.
    Film,
    /// Lag of the voltage.
    FilmLag,
    /// The sensor's offset.
    Zero,
    /// The cable.
    Cable,
    /// Saturation of the amplifier.
    Rails,
}

/// Surroundings of a part at its creation.
#[derive(Debug, Clone, Copy, Default)]
pub(crate) struct Surroundings<'a> {
    /// The free stream during the record; constant if `None`.
    pub(crate) free_stream: Option<&'a FreeStream>,
}

/// A running part, by place.
pub(crate) enum Part {
    /// The part sets the transport delay.
    Delay(FlowDelay),
    /// The part shapes the jet.
    Jet(Box<dyn JetPart>),
    /// The part acts in the flow.
    Flow(Box<dyn FlowPart>),
    /// The part acts between flow and reading.
    Sensor(Box<dyn SensorPart>),
}

/// A linear piece of a signal.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Piece {
    /// Duration (s).
    pub(crate) dt: f64,
    /// The signal at the piece's start.
    pub(crate) from: f64,
    /// The signal at the piece's end.
    pub(crate) to: f64,
}

/// A link of the chain from coil to jet, independent of the flow.
pub(crate) trait JetPart: Debug + Send + Sync + BoxedJet {
    /// Output at `t` after the input has jumped between two levels.
    fn jump(&mut self, t: f64, from: f64, to: f64) -> f64;

    /// Output at `t`, the end of a piece.
    fn advance(&mut self, t: f64, piece: &Piece) -> f64;

    /// Time of the part's next spontaneous jump, if nothing else happens (s).
    fn next_event(&self) -> Option<f64> {
        None
    }

    /// Called at the time of [`next_event`](Self::next_event); [`jump`](Self::jump) follows.
    fn event(&mut self) {}

    /// Contribution to the jet after the last link.
    fn shed(&self) -> f64 {
        0.0
    }
}

/// Resistance of the flow: v + dry·sign(v) + drag·v·|v| = push.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub(crate) struct Resistance {
    /// Independent of the speed (y/s).
    pub(crate) dry: f64,
    /// Proportional to the square of the speed (s/y).
    pub(crate) drag: f64,
}

/// An effect in the flow, with one continuous state z that is integrated with the flow.
pub(crate) trait FlowPart: Debug + Send + Sync + BoxedFlow {
    /// Contribution to the level of the flow at friction `s` (y).
    fn drive(&self, _s: f64, _z: f64) -> f64 {
        0.0
    }

    /// ż at friction `s` with derivative `s_dot`.
    fn memory_rate(&self, _s: f64, _s_dot: f64, _z: f64) -> f64 {
        0.0
    }

    /// Resistance of the part to motion.
    fn resistance(&self) -> Resistance {
        Resistance::default()
    }

    /// The arriving jet jumps to `jet`.
    fn arrives(&mut self, _jet: f64) {}

    /// Called after a piece of the arriving jet; the friction is now `s`.
    fn passed(&mut self, _jet: &Piece, _s: f64) {}

    /// Contribution to the film's input while `jet` arrives (y).
    fn at_the_film(&self, _jet: f64) -> f64 {
        0.0
    }
}

/// Time and command of a reading.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Moment {
    /// Time since the start (s).
    pub(crate) t: f64,
    /// The valve's command.
    pub(crate) command: f64,
}

/// A link of the chain from the film's input to the reading.
pub(crate) trait SensorPart: Debug + Send + Sync + BoxedSensor {
    /// Whether [`advance`](Self::advance) differs from [`jump`](Self::jump) to the end of the piece.
    fn takes_time(&self) -> bool {
        false
    }

    /// Output of the film after its input has jumped to `to`.
    fn jump(&mut self, to: f64) -> f64 {
        to
    }

    /// Output of the film at the end of a piece.
    fn advance(&mut self, piece: &Piece) -> f64 {
        self.jump(piece.to)
    }

    /// The reading for the film's `signal`.
    fn read(&self, signal: f64, _at: &Moment) -> f64 {
        signal
    }
}

macro_rules! boxed {
    ($($boxed:ident: $part:ident),+) => { $(
        /// Copies a boxed part.
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
