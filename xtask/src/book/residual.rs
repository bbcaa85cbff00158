//! The residual that each effect leaves: a picture for its page, from two simulated models.

use crate::shell::target;
use anyhow::{Context, Result, ensure};
use std::ffi::OsStr;
use std::fmt::Write as _;
use std::fs;
use std::path::Path;
use std::process::Command;

/// Length of the simulated record, samples of 1 ms, and the pulses of its command.
const SAMPLES: usize = 2200;
const PULSES: [(usize, usize); 3] = [(150, 350), (600, 680), (900, 1500)];
/// Samples per point of a line.
const STEP: usize = 8;
const WIDTH: f64 = 640.0;
const LEFT: f64 = 44.0;
const PANEL: f64 = 96.0;
const WITH: &str = "#D55E00";
const WITHOUT: &str = "#0072B2";
const GREY: &str = "#57606A";

/// An effect with typical parameters, as lines of a model file.
struct Case {
    effect: &'static str,
    parameters: &'static str,
    base: Base,
}

/// The model and the command of a case.
#[derive(Clone, Copy, PartialEq)]
enum Base {
    /// Gain 1, time constant 50 ms, delay 40 ms, on/off pulses.
    Usual,
    /// As `Usual`, with a level of −0.3 at rest.
    BelowZero,
    /// Pulses of several strengths.
    Graded,
    /// A free stream that varies by 8 %.
    Wind,
    /// A delay law instead of an effect.
    Delay,
}

#[rustfmt::skip]
const CASES: [Case; 21] = [
    Case { effect: "valve-lag", parameters: "opening_time = 0.03, closing_time = 0.06", base: Base::Usual },
    Case { effect: "plenum-droop", parameters: "recovery_time = 0.8, depletion_rate = 0.6", base: Base::Usual },
    Case { effect: "free-stream-variation", parameters: "gain = 1.5", base: Base::Wind },
    Case { effect: "input-nonlinearity", parameters: "quadratic = -0.6, cubic = 0.0", base: Base::Graded },
    Case { effect: "echo-path", parameters: "gain = 0.15, echo_delay = 0.25", base: Base::Usual },
    Case { effect: "starting-vortex", parameters: "gain = 0.8, decay_time = 0.06", base: Base::Usual },
    Case { effect: "stopping-vortex", parameters: "gain = 0.8, decay_time = 0.06", base: Base::Usual },
    Case { effect: "state-dependent-delay", parameters: "delay_floor = 25.0, delay_rise = 30.0, delay_rate = 3.0", base: Base::Delay },
    Case { effect: "edge-dependent-delay", parameters: "rise_delay = 0.055, fall_delay = 0.025", base: Base::Delay },
    Case { effect: "attachment-hysteresis", parameters: "upper_threshold = 0.6, lower_threshold = 0.4, gain = 0.2", base: Base::Usual },
    Case { effect: "amplitude-saturation", parameters: "cubic = 0.4", base: Base::Usual },
    Case { effect: "bouc-wen-hysteresis", parameters: "stiffness = 1.0, beta = 2.0, gamma = 1.0, alpha = 0.3", base: Base::Usual },
    Case { effect: "dry-friction", parameters: "level = 0.002", base: Base::Usual },
    Case { effect: "quadratic-drag", parameters: "coefficient = 60.0", base: Base::Usual },
    Case { effect: "vortex-shedding", parameters: "frequency = 12.0, damping_ratio = 0.08, gain = 0.2", base: Base::Usual },
    Case { effect: "rectifying-sensor", parameters: "", base: Base::BelowZero },
    Case { effect: "hot-film-nonlinearity", parameters: "king_ratio = 2.0, king_offset = 0.05", base: Base::Usual },
    Case { effect: "hot-film-lag", parameters: "time_constant = 0.04", base: Base::Usual },
    Case { effect: "thermal-drift", parameters: "amplitude = 0.15, time_constant = 0.8", base: Base::Usual },
    Case { effect: "electrical-pickup", parameters: "gain = 0.1, delay = 0.0", base: Base::Usual },
    Case { effect: "sensor-saturation", parameters: "lower_limit = -0.5, upper_limit = 0.7", base: Base::Usual },
];

/// The picture of an effect and the parameters with which `program` simulated it; `None` for an effect without a case.
pub(super) fn drawn(program: &OsStr, effect: &str) -> Result<Option<(String, &'static str)>> {
    let Some(case) = CASES.iter().find(|case| case.effect == effect) else {
        return Ok(None);
    };
    let folder = target().join("residuals").join(effect);
    fs::create_dir_all(&folder)?;
    let command = command(case.base);
    fs::write(folder.join("command.csv"), table(&command, case.base))?;
    let with = simulated(program, &folder, "with", &model(case, true))?;
    let without = simulated(program, &folder, "without", &model(case, false))?;
    let svg = picture(effect, &command, &with, &without);
    Ok(Some((svg, case.parameters)))
}

/// The command at sample `k`.
fn command(base: Base) -> Vec<f64> {
    let level = |pulse: usize| match base {
        Base::Graded => [0.5, 1.0, 0.8][pulse],
        _ => 1.0,
    };
    let at = |k: usize| {
        let pulse = PULSES
            .iter()
            .position(|(from, to)| (*from..*to).contains(&k));
        pulse.map_or(0.0, level)
    };
    (0..SAMPLES).map(at).collect()
}

fn table(command: &[f64], base: Base) -> String {
    let wind = base == Base::Wind;
    let mut text = String::from(if wind { "t,u,u_inf\n" } else { "t,u\n" });
    for (k, u) in command.iter().enumerate() {
        let _ = write!(text, "{}.{:03},{u}", k / 1000, k % 1000);
        if wind {
            // The free stream is a triangle wave with a period of 1 s, because the last digit of a
            // library's sine could differ between machines.
            let phase = (k % 1000) as f64 / 1000.0;
            let triangle = 4.0 * (phase - 0.5).abs() - 1.0;
            let _ = write!(text, ",{}", 10.0 * (1.0 + 0.08 * triangle));
        }
        text.push('\n');
    }
    text
}

/// The model file of a case, with its effect or without.
fn model(case: &Case, with: bool) -> String {
    let (constant, b) = match case.base {
        Base::BelowZero => (-0.006, 0.026),
        _ => (0.0, 0.02),
    };
    let mut text = format!(
        "format_version = 1\nsample_period_s = 0.001\nlag_convention = \"one-step\"\n[structure]\naveraged = false\n\
         window = 250\nstate_lags = [1]\nproduct_lags = [1]\n[coefficients]\nconstant = {constant:?}\na = [0.98]\n\
         b = [{b:?}]\nc = [[0.0]]\n[delay]\n"
    );
    let lines = case.parameters.replace(", ", "\n");
    if with && case.base == Base::Delay {
        let law = case.effect.trim_end_matches("-delay");
        let _ = writeln!(text, "law = \"{law}\"\n{lines}");
        return text;
    }
    text.push_str("law = \"fixed\"\ndelays = [40]\n");
    if with {
        let _ = writeln!(text, "[[effect]]\nname = \"{}\"", case.effect);
        if case.base == Base::Wind {
            text.push_str("channel = \"u_inf\"\nreference = 10.0\n");
        }
        let _ = writeln!(text, "[effect.parameters]\n{lines}");
    }
    text
}

/// y of the model's free run.
fn simulated(program: &OsStr, folder: &Path, name: &str, model: &str) -> Result<Vec<f64>> {
    let file = folder.join(format!("{name}.toml"));
    fs::write(&file, model)?;
    let run = folder.join(format!("{name}.csv"));
    let output = Command::new(program)
        .args(["simulate".as_ref(), file.as_os_str()])
        .arg(folder.join("command.csv"))
        .args(["-o".as_ref(), run.as_os_str()])
        .output()?;
    ensure!(
        output.status.success(),
        "{}: {}",
        file.display(),
        String::from_utf8_lossy(&output.stderr)
    );
    let text = fs::read_to_string(&run).with_context(|| run.display().to_string())?;
    let y = text.lines().skip(1).map(|line| line.split(',').nth(2));
    y.map(|cell| Ok(cell.context("a column y")?.parse()?))
        .collect()
}

/// Both runs above, their difference below.
fn picture(effect: &str, command: &[f64], with: &[f64], without: &[f64]) -> String {
    let residual: Vec<f64> = with.iter().zip(without).map(|(a, b)| a - b).collect();
    let mut svg = format!(
        "<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"{WIDTH}\" height=\"270\" viewBox=\"0 0 {WIDTH} 270\" \
         role=\"img\" font-family=\"Helvetica, Arial, sans-serif\" font-size=\"11\">\n<title>{effect}: response with and \
         without the effect, and residual</title>\n<rect width=\"100%\" height=\"100%\" fill=\"#FFFFFF\"/>\n"
    );
    let runs = [(with, WITH), (without, WITHOUT)];
    panel(&mut svg, 22.0, "y", command, &runs);
    panel(&mut svg, 148.0, "residual", command, &[(&residual, GREY)]);
    let _ = writeln!(
        svg,
        "<text x=\"{LEFT}\" y=\"13\"><tspan fill=\"{WITH}\">with {effect}</tspan><tspan dx=\"14\" fill=\"{WITHOUT}\">without \
         it</tspan><tspan dx=\"14\" fill=\"{GREY}\">grey areas: command on</tspan></text>"
    );
    for second in 0..=2 {
        let x = place(second * 1000);
        let _ = writeln!(
            svg,
            "<text x=\"{x:.0}\" y=\"260\" text-anchor=\"middle\" fill=\"{GREY}\">{second} s</text>"
        );
    }
    svg.push_str("</svg>\n");
    svg
}

/// Horizontal position of sample `k`, px.
fn place(k: usize) -> f64 {
    LEFT + (WIDTH - LEFT - 8.0) * k as f64 / SAMPLES as f64
}

/// Lines on a common scale that includes 0.
fn panel(svg: &mut String, top: f64, name: &str, command: &[f64], lines: &[(&[f64], &str)]) {
    let values = || lines.iter().flat_map(|(line, _)| line.iter().copied());
    let low = values().fold(0.0, f64::min);
    let high = values().fold(0.0, f64::max);
    let span = (high - low).max(1e-9);
    let height = |y: f64| top + PANEL * (high - y) / span;
    for (from, to) in PULSES {
        let (x, end) = (place(from), place(to));
        let shade = 0.05 + 0.08 * command[from];
        let _ = writeln!(
            svg,
            "<rect x=\"{x:.1}\" y=\"{top}\" width=\"{:.1}\" height=\"{PANEL}\" fill=\"{GREY}\" fill-opacity=\"{shade:.2}\"/>",
            end - x
        );
    }
    let zero = height(0.0);
    let _ = writeln!(
        svg,
        "<line x1=\"{LEFT}\" x2=\"{}\" y1=\"{zero:.1}\" y2=\"{zero:.1}\" stroke=\"#D0D7DE\"/>\n\
         <text x=\"{}\" y=\"{}\" text-anchor=\"end\" fill=\"{GREY}\">{name}</text>",
        WIDTH - 8.0,
        WIDTH - 8.0,
        top - 4.0
    );
    for level in [low, 0.0, high] {
        if level != 0.0 && (height(level) - zero).abs() < 12.0 {
            continue;
        }
        let _ = writeln!(
            svg,
            "<text x=\"{}\" y=\"{:.1}\" text-anchor=\"end\" fill=\"{GREY}\">{}</text>",
            LEFT - 5.0,
            height(level) + 4.0,
            label(level)
        );
    }
    for (line, colour) in lines {
        let _ = write!(
            svg,
            "<polyline fill=\"none\" stroke=\"{colour}\" stroke-width=\"1.4\" points=\""
        );
        for (k, y) in line.iter().enumerate().step_by(STEP) {
            let _ = write!(svg, "{:.1},{:.1} ", place(k), height(*y));
        }
        svg.push_str("\"/>\n");
    }
}

/// A level with two decimals and a true minus sign.
fn label(level: f64) -> String {
    let text = format!("{level:.2}");
    match text.as_str() {
        "0.00" | "-0.00" => "0".to_owned(),
        _ => text.replace('-', "−"),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_picture_is_small_and_says_what_it_shows() {
        let command = command(Base::Usual);
        let with: Vec<f64> = command.iter().map(|u| 0.9 * u).collect();
        let svg = picture("plenum-droop", &command, &with, &command);
        assert!(svg.len() < 15_000, "{}", svg.len());
        assert!(svg.contains("plenum-droop: response with and without the effect"));
        assert!(svg.contains("−0.10"));
    }

    #[test]
    fn a_model_file_has_the_effect_or_the_law_only_where_it_is_asked_for() {
        let of = |effect: &str| CASES.iter().find(|case| case.effect == effect).unwrap();
        assert!(model(of("echo-path"), true).contains("name = \"echo-path\""));
        assert!(!model(of("echo-path"), false).contains("[[effect]]"));
        assert!(model(of("edge-dependent-delay"), true).contains("law = \"edge-dependent\""));
        assert!(model(of("edge-dependent-delay"), false).contains("law = \"fixed\""));
    }
}
