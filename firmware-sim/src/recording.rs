//! A session on a rig: commands in, recordings out.

use std::collections::BTreeMap;

use rand::RngExt;
use rand_chacha::ChaCha8Rng;
use recordings::{DataError, DataSet, Record, Use};
use thiserror::Error;

use crate::command::{Command, LEAD_SAMPLES};
use crate::instrument::{Instrument, InstrumentError};
use crate::nuisance::Nuisances;
use crate::plant::{
    Beyond, Effect, EffectError, Fault, FreeStream, PlantError, PlantSpec, Rig, SAMPLE_PERIOD_S,
    ShowsWith,
};
use crate::stream::{Stream, stream};

/// Why a rig could not be drawn or recorded.
#[derive(Debug, Error)]
pub enum RigError {
    /// An effect is unknown or impossible.
    #[error(transparent)]
    Effect(#[from] EffectError),
    /// The rig is impossible.
    #[error(transparent)]
    Plant(#[from] PlantError),
    /// The instrument is impossible.
    #[error(transparent)]
    Instrument(#[from] InstrumentError),
    /// The rig's readings are not a valid recording.
    #[error(transparent)]
    Data(#[from] DataError),
    /// No fault of that name.
    #[error("there is no fault `{0}`; the names are: {names}", names = Fault::NAMES.join(", "))]
    UnknownFault(String),
    /// Two effects act on the same part of the rig.
    #[error("`{0}` and `{1}` exclude each other; hide one of them")]
    Exclusive(&'static str, &'static str),
}

/// The units in which the samples of a recording are written.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Units {
    /// Factor from the rig's times to recorded times.
    pub time: f64,
    /// Factor from the rig's y to recorded y.
    pub y: f64,
}

impl Units {
    /// Seconds and friction gain, as simulated.
    pub const OWN: Self = Self { time: 1.0, y: 1.0 };
}

/// A data set with its readings without noise.
#[derive(Debug, Clone)]
pub struct Recorded {
    /// The data set, as a user of the tool has it.
    pub data: DataSet,
    /// The readings without noise, per record in the order of the data set (recorded y).
    pub noise_free: Vec<Vec<f64>>,
}

/// All properties except the commands that determine a data set bit for bit.
pub(crate) struct Session<'a> {
    pub(crate) plant: &'a PlantSpec,
    pub(crate) instrument: &'a Instrument,
    pub(crate) nuisances: Nuisances,
    /// Whether the free stream varies and is recorded as the channel `u_inf`.
    pub(crate) free_stream: bool,
    pub(crate) units: Units,
    /// Title of the data set, which does not name the hidden effects.
    pub(crate) title: String,
    pub(crate) seed: u64,
}

impl Session<'_> {
    /// Runs the rig through every command and measures it.
    pub(crate) fn record(&self, commands: Vec<(Command, Use)>) -> Result<Recorded, RigError> {
        let mut tunnel = stream(self.seed, Stream::Tunnel);
        let mut noise = stream(self.seed, Stream::Noise);
        let mut nuisance = stream(self.seed, Stream::Nuisances);
        let (mut records, mut noise_free) = (Vec::new(), Vec::new());
        for (index, (command, role)) in commands.into_iter().enumerate() {
            let n = command.levels.len();
            // A record that begins in mid-run is preceded by unrecorded samples.
            let lead = self.nuisances.lead_samples;
            let mut levels = Vec::with_capacity(lead + n);
            let mut u = command.levels;
            if lead > 0 {
                let before = Command::random("before", &mut nuisance).levels;
                levels.extend(before.into_iter().skip(LEAD_SAMPLES).take(lead));
                u.rotate_left(LEAD_SAMPLES);
            }
            let lead = levels.len();
            levels.extend(&u);
            let stream = (self.free_stream).then(|| FreeStream::draw(&mut tunnel, levels.len()));
            let readings = Rig::new(self.plant, stream.clone())?.play(&levels);
            let truth: Vec<f64> = readings
                .into_iter()
                .skip(lead)
                .enumerate()
                .map(|(k, y)| y + self.nuisances.zero(index * n + k, 8 * n))
                .collect();
            let measured = self.instrument.measure(&truth, noise.random())?;
            let time = |k: usize| (lead + k) as f64 * SAMPLE_PERIOD_S;
            let channels = stream.map_or_else(BTreeMap::new, |stream| {
                let measured = |of: fn(&FreeStream, f64) -> f64| -> Vec<f64> {
                    (0..n).map(|k| of(&stream, time(k))).collect()
                };
                let mut channels =
                    BTreeMap::from([("u_inf".to_owned(), measured(FreeStream::velocity))]);
                let mut beyond = self.plant.beyond.iter();
                if beyond.any(|physics| physics.channel() == Some(Beyond::TEMPERATURE)) {
                    let temperature = measured(FreeStream::temperature);
                    channels.insert(Beyond::TEMPERATURE.to_owned(), temperature);
                }
                channels
            });
            let scaled = |x: Vec<f64>| -> Vec<f64> { x.iter().map(|y| y * self.units.y).collect() };
            records.push(Record {
                y_sd: Some(scaled(measured.standard_error)),
                y_min: Some(scaled(measured.min)),
                y_max: Some(scaled(measured.max)),
                channels,
                ..Record::new(
                    &command.name,
                    role,
                    SAMPLE_PERIOD_S * self.units.time,
                    u,
                    scaled(measured.mean),
                )
            });
            noise_free.push(scaled(truth));
        }
        Ok(Recorded {
            data: DataSet::from_records(Some(self.title.clone()), records)?,
            noise_free,
        })
    }
}

/// The given on/off commands, changed to many levels if an effect requires it or the input is `graded`.
pub(crate) fn with_levels(
    commands: Vec<(Command, Use)>,
    effects: &[Effect],
    graded: bool,
    rng: &mut ChaCha8Rng,
) -> Vec<(Command, Use)> {
    if !graded && !effects.iter().any(Effect::needs_levels) {
        return commands;
    }
    let signed = (effects.iter()).any(|e| e.shows_with() == ShowsWith::SignedLevels);
    let low = if signed { -1.0 } else { 0.0 };
    let graded = |(command, role): (Command, Use)| (command.graded(low, rng), role);
    commands.into_iter().map(graded).collect()
}
