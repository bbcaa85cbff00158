//! The texts that the templates of all languages share.

use super::piece::{Constant, Piece, Tongue};
use super::sheet::Sheet;
use super::template::Holes;
use crate::model::{Delay, Law, Track};
use crate::user_effect::program::Signal;
use model_core::Real;
use model_core::effect::Place;
use model_core::recursion::Grading;

/// The signal on which an effect acts, and the statement that receives the effect's result in place
/// of `{}`.
pub(super) type Port<'a> = [&'a str; 2];

/// Where effects act, in the words of a language.
pub(super) struct Ports<'a> {
    pub(super) jet: Port<'a>,
    pub(super) delay: Port<'a>,
    pub(super) sensor: Port<'a>,
    pub(super) flow: Port<'a>,
}

/// The texts with numbers of type `T` for a control law.
pub(super) fn holes<T: Real>(sheet: &Sheet<'_>, tongue: &dyn Tongue, ports: &Ports<'_>) -> Holes {
    let (model, memory) = (sheet.model, &sheet.memory);
    let averaged = model.averaging.averaged_model;
    let transport = sheet.transport.as_ref();
    let number = |value: f64| tongue.number(value);
    let mut holes = Holes::default();
    holes
        .flag("average", sheet.follows && !averaged)
        .flag("averaged", averaged)
        .flag("clocked", sheet.clocked)
        .flag("transport", transport.is_some())
        .flag("rounded", transport.is_some_and(|t| t.rounded))
        .flag("senses", sheet.at(Place::Sensor).next().is_some())
        .flag("graded", sheet.graded())
        .flag("drives", sheet.drives)
        .flag("rates", sheet.graded() || sheet.drives)
        .flag("switched", model.grading == Grading::Switched)
        .flag("proportional", model.grading == Grading::Proportional)
        .flag("channels", !memory.channels.is_empty())
        .flag("law", sheet.law().is_some())
        .flag("track", matches!(sheet.law(), Some(Law::Track(_))))
        .flag("maximise", matches!(sheet.law(), Some(Law::Maximise(_))))
        .set("period", number(model.sample_period_s))
        .set("outputs", memory.outputs)
        .set("jets", memory.jets)
        .set("window", model.averaging.window)
        .set("held", sheet.held)
        .set("zero", number(sheet.zero))
        .set("rate_off", number(sheet.pace.0))
        .set("rate_on", number(sheet.pace.1))
        .set("constant", number(model.constant))
        .set("cards", cards(sheet, tongue))
        .set("derived", derived(sheet, tongue))
        .set(
            "jet_effects",
            effects(sheet, tongue, Place::Jet, ports.jet).concat(),
        )
        .set(
            "sensor_effects",
            effects(sheet, tongue, Place::Sensor, ports.sensor).concat(),
        );
    let flow = effects(sheet, tongue, Place::Flow, ports.flow).into_iter();
    let flow = flow.map(|effect| {
        let mut row = Holes::default();
        row.set("effect", effect);
        row
    });
    holes.list("flow_effects", flow.collect());
    if let Some(transport) = transport {
        let delay = statements(&transport.effect.piece, tongue, ports.delay);
        holes.set("delay", lines(delay));
        if let Some(command) = &transport.command {
            let edges = statements(command, tongue, ports.jet);
            holes.set("command", tongue.block("delayed edges", &edges));
        }
    }
    match sheet.law() {
        Some(Law::Track(track)) => {
            holes.set("law_constants", law_constants::<T>(track, tongue));
        }
        Some(Law::Maximise(law)) => {
            holes
                .set("law_period", law.period.max(1))
                .set("law_on", law.hold.on.max(1))
                .set("law_off", law.hold.off.max(1));
        }
        None => {}
    }
    holes
}

/// Sets the texts of the recursion and of its inputs; `sum` writes a sum of products of coefficients and past values
/// of the flow at given lags.
pub(super) fn recursion(
    holes: &mut Holes,
    sheet: &Sheet<'_>,
    tongue: &dyn Tongue,
    sum: impl Fn(&[f64], &[usize]) -> String,
) {
    let model = sheet.model;
    let order = sheet.pace.2.unwrap_or(usize::MAX);
    let split = |coefficients: &[f64], back: &[usize], is_short: bool| {
        let pairs = coefficients.iter().zip(back);
        let pairs = pairs.filter(|(_, lag)| (**lag < order) == is_short);
        let (c, b): (Vec<f64>, Vec<usize>) = pairs.map(|(c, b)| (*c, *b)).unzip();
        sum(&c, &b)
    };
    if sheet.graded() {
        holes
            .set("free", split(&model.a, &sheet.state_back, true))
            .set("past", split(&model.a, &sheet.state_back, false))
            .set("gain", split(&sheet.rows[0], &sheet.product_back, true))
            .set(
                "past_gain",
                split(&sheet.rows[0], &sheet.product_back, false),
            )
            .set("drive", tongue.number(model.b[0]));
    } else {
        holes.set("free", sum(&model.a, &sheet.state_back));
    }
    let delays = match &model.delay {
        Delay::Fixed { delays } => delays.as_slice(),
        Delay::Law(_) => &[],
    };
    holes.set("nearest", delays.iter().min().copied().unwrap_or(0));
    let rows = model
        .b
        .iter()
        .zip(&sheet.rows)
        .enumerate()
        .map(|(l, (drive, row))| {
            let mut input = Holes::default();
            input.set("l", l).flag("first", l == 0);
            if !sheet.graded() {
                input.set("drive", tongue.number(*drive));
                input.set("gain", sum(row, &sheet.product_back));
            }
            if let Some(lag) = delays.get(l) {
                input.set("lag", lag).set("place", lag + 1);
            }
            if let Some(factor) = sheet.transport.as_ref().and_then(|t| t.factors.get(l)) {
                input.set("factor", tongue.number(*factor));
            }
            input
        });
    holes.list("inputs", rows.collect());
}

/// Each text as a line.
pub(super) fn lines(texts: impl IntoIterator<Item = impl AsRef<str>>) -> String {
    texts
        .into_iter()
        .map(|text| format!("{}\n", text.as_ref()))
        .collect()
}

/// The states and memories of all pieces, a line each.
pub(super) fn memories(
    sheet: &Sheet<'_>,
    state: impl Fn(&str, f64) -> String,
    memory: impl Fn(&str, usize) -> String,
) -> String {
    lines(sheet.pieces().flat_map(|piece| {
        let states = piece
            .states()
            .into_iter()
            .map(|(name, start)| state(&name, start));
        let memories = piece
            .lines()
            .into_iter()
            .map(|(name, samples)| memory(&name, samples));
        states.chain(memories).collect::<Vec<_>>()
    }))
}

/// Name, parameters and units of the delay law and of the effects.
fn cards(sheet: &Sheet<'_>, tongue: &dyn Tongue) -> String {
    let mut text = String::new();
    for effect in sheet.cards() {
        text += &tongue.heading(&format!("{}: {}.", effect.name, effect.summary));
        let parameters = effect.parameters.iter();
        text += &lines(
            parameters.map(|(name, v, unit)| tongue.define(name, &tongue.constant(*v), unit)),
        );
        if effect.piece.reads_reference() {
            let name = format!("{}_REFERENCE", effect.piece.owner());
            text += &lines([tongue.define(&name, &tongue.constant(effect.reference), "")]);
        }
    }
    text
}

/// The constants that follow from parameters, and the lengths of memories.
fn derived(sheet: &Sheet<'_>, tongue: &dyn Tongue) -> String {
    let mut text = String::new();
    for piece in sheet.pieces() {
        text += &lines(
            piece
                .constants(tongue)
                .iter()
                .map(|c: &Constant| tongue.derived(c)),
        );
        let lengths = piece.lines();
        text += &lines(
            lengths
                .iter()
                .filter_map(|(line, samples)| tongue.length(line, *samples)),
        );
    }
    text
}

/// The effects at a place, a block each.
fn effects(sheet: &Sheet<'_>, tongue: &dyn Tongue, place: Place, port: Port<'_>) -> Vec<String> {
    let each = sheet.at(place);
    each.map(|effect| tongue.block(&effect.name, &statements(&effect.piece, tongue, port)))
        .collect()
}

/// The statements of a piece.
fn statements(piece: &Piece, tongue: &dyn Tongue, [signal, target]: Port<'_>) -> Vec<String> {
    let own = piece
        .reads(Signal::Own)
        .then(|| tongue.local("signal", signal));
    let (computed, value) = piece.statements(tongue);
    let taken = [target.replace("{}", &value)];
    own.into_iter().chain(computed).chain(taken).collect()
}

/// The constants of a tracking law.
fn law_constants<T: Real>(track: &Track, tongue: &dyn Tongue) -> String {
    let name = |name: &str| tongue.law_name(name);
    let counts = counts(track);
    let counts = counts
        .iter()
        .map(|(n, v)| tongue.define(&name(n), &tongue.whole(*v), ""));
    let reals = reals::<T>(track);
    let reals = reals
        .iter()
        .map(|(n, v, unit)| tongue.define(&name(n), &tongue.constant(*v), unit));
    lines(counts.chain(reals))
}

/// The constants of a tracking law that are whole numbers, by name.
fn counts(track: &Track) -> Vec<(&'static str, u32)> {
    let [cost, saved] = track.switches.unwrap_or_default();
    let [per_mille, air] = track.air.unwrap_or([0, 0]);
    let has_air = track.air.is_some();
    let drain = if has_air {
        1000_u32.saturating_sub(per_mille)
    } else {
        0
    };
    let capacity = if has_air {
        drain.max(1).saturating_mul(air.max(1))
    } else {
        0
    };
    let (on, off) = (track.hold.on.max(1), track.hold.off.max(1));
    let anticipation = track.anticipation();
    vec![
        ("LAW_HOLD_ON", on),
        ("LAW_HOLD_OFF", off),
        ("LAW_HALF_SAMPLES_ON", anticipation.on),
        ("LAW_HALF_SAMPLES_OFF", anticipation.off),
        ("LAW_SAMPLES_PER_SWITCH", cost),
        ("LAW_SWITCHES_CAPACITY", cost.saturating_mul(saved.max(2))),
        ("LAW_AIR_PER_MILLE", per_mille),
        ("LAW_AIR_DRAIN", drain),
        ("LAW_AIR_CAPACITY", capacity),
        ("LAW_AIR_FIRST", drain.saturating_mul(on)),
        ("LAW_LEAD", track.lead.into()),
        ("LAW_OPENING", track.opening.into()),
        ("LAW_CLOSING", track.closing.into()),
        ("LAW_LOOK_AHEAD", track.look_ahead.into()),
    ]
}

/// Constants of the law that are real numbers, with their units.
fn reals<T: Real>(track: &Track) -> Vec<(&'static str, f64, &'static str)> {
    let law = track.tracking::<T>();
    vec![
        ("LAW_REFERENCE", law.reference.value(), "y"),
        ("LAW_SLOPE", law.slope.value(), "y per sample; 0 for steps"),
        (
            "LAW_OBSERVER",
            law.observer.value(),
            "share of a residual that corrects the estimate",
        ),
        ("LAW_BIAS_RATE", law.bias_rate.value(), "1/sample"),
        ("LAW_INTEGRAL_RATE", law.integral_rate.value(), "1/sample"),
        ("LAW_PLAY", law.play.value(), "y"),
        (
            "LAW_SETTLED",
            law.settled.value(),
            "long-term rate of the integral relative to its initial rate",
        ),
        ("LAW_CORRECTION_LIMIT", law.correction_limit.value(), "y"),
        ("LAW_RESIDUAL_LIMIT", law.residual_limit.value(), "y"),
    ]
}
