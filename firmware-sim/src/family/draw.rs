//! Random flows, noise and commands.

use rand::seq::SliceRandom;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

use super::weight::Weight;
use super::{Family, NoiseKind, RigPlan};
use crate::command::Command;
use crate::instrument::{Instrument, Noise, Unrest};
use crate::plant::effects::exclude;
use crate::plant::{
    Altered, BasePlant, Beyond, Character, Effect, EffectError, Fault, FlowDelay, FreeStream,
    PastTerm, Place, PlantSpec, RateLaw, log_uniform,
};
use crate::recording::RigError;
use crate::stream::{Stream, stream};

/// Number of draws of an effect, after which the one with the largest weight so far is used.
const ATTEMPTS: usize = 12;

/// A drawn effect: of the catalogue, altered, or outside the catalogue.
enum Drawn {
    Effect(Effect),
    Altered(Altered),
    Beyond(Beyond),
}

impl Drawn {
    fn draw(name: &str, base: &BasePlant, rng: &mut ChaCha8Rng) -> Result<Self, EffectError> {
        if Altered::NAMES.contains(&name) {
            return Altered::draw(name, base, rng).map(Self::Altered);
        }
        if Beyond::NAMES.contains(&name) {
            return Beyond::draw(name, base, rng).map(Self::Beyond);
        }
        Effect::draw(name, base, rng)
            .map(Self::Effect)
            .map_err(|error| match error {
                EffectError::UnknownEffect { name, known } => EffectError::UnknownEffect {
                    name,
                    known: format!(
                        "{known}, {}, {}, {}",
                        Altered::NAMES.join(", "),
                        Beyond::NAMES.join(", "),
                        Fault::NAMES.join(", ")
                    ),
                },
                other => other,
            })
    }

    /// Name, similar effect of the catalogue, and place.
    fn identity(&self) -> (&'static str, &'static str, Place) {
        match self {
            Self::Effect(e) => (e.name(), e.resembles(), e.place()),
            Self::Altered(e) => (e.name(), e.resembles(), e.place()),
            Self::Beyond(e) => (e.name(), e.resembles(), e.place()),
        }
    }

    fn add_to(self, plant: &mut PlantSpec) {
        match self {
            Self::Effect(e) => plant.effects.push(e),
            Self::Altered(e) => plant.altered.push(e),
            Self::Beyond(e) => plant.beyond.push(e),
        }
    }
}

impl RigPlan {
    /// Checks that these effects can be hidden together in one rig.
    ///
    /// # Errors
    /// [`RigError`] for unknown names and for effects that exclude each other.
    pub fn check(hidden: &[&str]) -> Result<(), RigError> {
        let faulty = |name: &&str| Fault::NAMES.contains(name);
        let names: Vec<&str> = hidden.iter().copied().filter(|n| !faulty(n)).collect();
        Self::kinds(&names).map(|_| ())
    }

    /// The effects with arbitrary parameters.
    fn kinds(names: &[&str]) -> Result<Vec<Drawn>, RigError> {
        let mut rng = ChaCha8Rng::seed_from_u64(0);
        let base = BasePlant::draw(&mut rng);
        let mut kinds: Vec<Drawn> = Vec::new();
        for name in names {
            let kind = Drawn::draw(name, &base, &mut rng)?;
            let (own, resembles, place) = kind.identity();
            let mut others = kinds.iter().map(Drawn::identity);
            let clash = others.find(|other| exclude((other.1, other.2), (resembles, place)));
            if let Some((other, _, _)) = clash {
                return Err(RigError::Exclusive(other, own));
            }
            kinds.push(kind);
        }
        Ok(kinds)
    }

    /// Draws the named effects and adds them to the plant. Returns the smallest weight: at least 1 if all of them are
    /// detectable; infinite if `names` is empty.
    pub(super) fn hide(&mut self, names: &[&str]) -> Result<f64, RigError> {
        let mut rng = stream(self.seed, Stream::Effects);
        let faulty = |name: &&str| Fault::NAMES.contains(name);
        let (faults, names): (Vec<&str>, Vec<&str>) = names.iter().copied().partition(faulty);
        let draw = |name: &str| Fault::draw(name, &mut rng);
        self.plant.faults = faults.into_iter().filter_map(draw).collect();
        // The kinds of effects alone, not their parameters, determine the rest of the rig.
        let mut kinds = self.plant.clone();
        for kind in Self::kinds(&names)? {
            if kind.identity().2 == Place::Transport {
                // The hidden law replaces the delay of the base.
                self.plant.base = self.plant.base.with_fixed_delay(&mut rng);
            }
            kind.add_to(&mut kinds);
        }
        if kinds.effects.iter().any(Effect::needs_levels) {
            self.plant.base = self.plant.base.with_one_time_constant();
        }
        let beyond = kinds.beyond.iter().map(Beyond::channel);
        let mut channels = kinds.effects.iter().map(Effect::channel).chain(beyond);
        let wanders = channels.any(|channel| channel.is_some());
        self.free_stream = wanders || rng.random_bool(0.2);

        // Effects that depend on time or start late are visible only in the whole record.
        let late = !kinds.beyond.is_empty();
        let bare = self.plant.clone();
        // Sizes of effects are drawn for the friction that the flow reaches, not for its drive.
        let reached = BasePlant {
            gain: bare.base.gain / bare.character.overshoot(),
            ..bare.base
        };
        let command = Self {
            plant: kinds,
            ..self.clone()
        }
        .commands()
        .swap_remove(4)
        .0;
        let tunnel = wanders.then(|| {
            FreeStream::draw(&mut stream(self.seed, Stream::Tunnel), command.levels.len())
        });
        let standard_error = self.instrument.standard_error();
        let samples = if late {
            command.levels.len()
        } else {
            Weight::SAMPLES
        };
        let levels = &command.levels[..samples.min(command.levels.len())];
        let weight = Weight::new(&bare, levels, tunnel, standard_error)?;
        let mut lightest = f64::INFINITY;
        for name in names {
            let mut best: Option<(f64, PlantSpec)> = None;
            for _ in 0..ATTEMPTS {
                let mut alone = bare.clone();
                Drawn::draw(name, &reached, &mut rng)?.add_to(&mut alone);
                let found = weight.of(&alone)?;
                if best.as_ref().is_none_or(|(most, _)| found > *most) {
                    best = Some((found, alone));
                }
                if found >= 1.0 {
                    break;
                }
            }
            if let Some((found, alone)) = best {
                self.plant.effects.extend(alone.effects);
                self.plant.altered.extend(alone.altered);
                self.plant.beyond.extend(alone.beyond);
                lightest = lightest.min(found);
            }
        }
        Ok(lightest)
    }
}

impl Family {
    /// A flow of the family with its delay, without effects.
    pub(super) fn draw(self, rng: &mut ChaCha8Rng) -> PlantSpec {
        let mut base = BasePlant::draw(rng);
        let level = base.gain;
        let share = |rng: &mut ChaCha8Rng| rng.random_range(0.0..1.0);
        base.rate_law = match share(rng) {
            x if x < 0.45 => RateLaw::Interpolated,
            x if x < 0.80 => RateLaw::Bilinear,
            _ => RateLaw::Switched,
        };
        base.delay = match share(rng) {
            x if x < 0.25 => FlowDelay::Fixed {
                delay_s: rng.random_range(0.020..0.060),
            },
            x if x < 0.80 => base.delay,
            x if x < 0.92 => {
                let rise_s = rng.random_range(0.006..0.015);
                FlowDelay::Clamped {
                    floor_s: rng.random_range(0.020..0.045),
                    rise_s,
                    level: rng.random_range(0.3..0.8) * level,
                }
            }
            _ => {
                let rise_s = rng.random_range(0.020..0.060);
                let more = rng.random_range(0.008..0.025);
                FlowDelay::EdgeDependent {
                    rise_s,
                    fall_s: if rise_s > 0.040 {
                        rise_s - more
                    } else {
                        rise_s + more
                    },
                }
            }
        };
        if self != Self::FirstOrder {
            base.attach_s = log_uniform(rng, 0.020, 0.080);
            base.separate_s = base.attach_s * log_uniform(rng, 0.7, 2.0);
        }
        let character = match self {
            Self::FirstOrder => Character::FirstOrder,
            Self::Memory1 => {
                let gain = if rng.random_bool(0.75) {
                    -rng.random_range(0.03..0.12)
                } else {
                    rng.random_range(0.03..0.08)
                };
                let term = PastTerm::new(
                    rng.random_range(0.12..0.40),
                    gain,
                    rng.random_range(0.10..0.35),
                );
                Character::Memory(vec![with_form(term, level, rng)])
            }
            Self::Memory2 => {
                let mut term = |nearest: f64, furthest: f64| {
                    let mut signed = |low: f64, high: f64| {
                        let size = rng.random_range(low..high);
                        if rng.random_bool(0.5) { size } else { -size }
                    };
                    let (gain, lost) = (signed(0.02, 0.10), signed(0.03, 0.20));
                    let term = PastTerm::new(rng.random_range(nearest..furthest), gain, lost);
                    with_form(term, level, rng)
                };
                Character::Memory(vec![term(0.08, 0.20), term(0.22, 0.45)])
            }
            Self::Inertia => {
                let time_s = rng.random_range(0.006..0.014);
                if rng.random_bool(0.5) {
                    Character::Inertia { time_s }
                } else {
                    Character::SecondLag { time_s }
                }
            }
            Self::Wake => Character::Wake {
                time_s: rng.random_range(0.25..0.70),
                pull: rng.random_range(0.15..0.40),
            },
            Self::RateOfY => Character::RateOfFriction {
                slope: if rng.random_bool(0.6) {
                    rng.random_range(0.4..1.2)
                } else {
                    -rng.random_range(0.25..0.5)
                } / level,
            },
        };
        base.gain = level * character.overshoot();
        PlantSpec {
            character,
            ..PlantSpec::new(base, &[])
        }
    }
}

/// Two of five memories are outside the bilinear class: smeared or bounded.
fn with_form(term: PastTerm, level: f64, rng: &mut ChaCha8Rng) -> PastTerm {
    match rng.random_range(0..5) {
        0 => PastTerm {
            smear_s: rng.random_range(0.010..0.040),
            ..term
        },
        1 => PastTerm {
            limit: rng.random_range(0.6..1.5) * level,
            ..term
        },
        _ => term,
    }
}

impl NoiseKind {
    pub(super) fn draw(self, rng: &mut ChaCha8Rng) -> Instrument {
        let mut instrument = Instrument {
            noise: Noise {
                white: rng.random_range(0.020..0.035),
                coloured: rng.random_range(0.025..0.040),
                correlation_s: log_uniform(rng, 0.010, 0.040),
            },
            ..Instrument::default()
        };
        let unrest = &mut instrument.unrest;
        match self {
            Self::White => {
                instrument.noise.white = rng.random_range(0.030..0.050);
                instrument.noise.coloured = 0.0;
            }
            Self::Coloured => {}
            Self::Wander => {
                unrest.wander = rng.random_range(0.015..0.040);
                unrest.wander_s = log_uniform(rng, 0.5, 2.0);
            }
            Self::Scatter => instrument.level_scatter = rng.random_range(0.02..0.05),
            Self::HeavyTails => {
                instrument.noise.white = 0.0;
                unrest.tails = rng.random_range(0.025..0.045);
            }
            Self::Outliers => {
                *unrest = Unrest {
                    outliers: log_uniform(rng, 0.001, 0.004),
                    outlier_size: rng.random_range(0.2..0.6),
                    ..Unrest::default()
                };
            }
        }
        instrument
    }
}

/// Frequencies (Hz) and duties of five different square waves.
pub(super) fn squares(rng: &mut ChaCha8Rng) -> Vec<(f64, f64)> {
    let mut all = vec![
        (2.0, 0.3),
        (2.0, 0.6),
        (3.0, 0.5),
        (4.0, 0.5),
        (4.0, 0.8),
        (5.0, 0.4),
        (6.0, 0.6),
        (8.0, 0.5),
        (8.0, 0.8),
        (10.0, 0.5),
    ];
    all.shuffle(rng);
    all.truncate(5);
    all
}

/// A random on/off command with an individual duty and pace.
pub(super) fn telegraph(name: &str, rng: &mut ChaCha8Rng) -> Command {
    let [on, off] = [(); 2].map(|()| rng.random_range(200..=600));
    Command::telegraph(name, on, off, rng)
}
