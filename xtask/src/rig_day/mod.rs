//! The complete workflow on a simulated rig with a hidden effect, behind the board under QEMU: the program reaches it
//! over the serial line only. Every step is a command that a user would type; `docs/rig-day.md` shows their output.

mod picture;

use crate::Task;
use crate::firmware::Chosen;
use crate::shell::{program, root, target};
use anyhow::{Context, Result, bail, ensure};
use std::fmt::Write as _;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::time::Instant;

pub(crate) const TASK: Task = Task {
    name: "rig-day",
    does: "runs the whole workflow on a simulated rig with the board under QEMU: --short, --brief (as CI), --page writes docs/rig-day.md",
    run: rig_day,
};

/// The hidden effect of the simulated rig, and the seed of the rig.
const HIDDEN: &str = "echo-path";
const RIG: &str = "7";
/// Amount of recording and watching. Commands are those of the bundled set.
struct Form {
    /// Estimation records.
    identify: &'static [&'static str],
    /// Validation records; the page shows the first.
    validate: &'static [&'static str],
    /// Length of each command, s; the valve is closed at its end.
    period: &'static str,
    repeats: &'static str,
    /// Additional options of the calibration.
    calibration: &'static str,
    /// Additional options of the law's design.
    design: &'static str,
    /// Duration of `watch`, and of its learning phase, s.
    watched: [&'static str; 2],
    /// Largest allowed ratio of the second law's rms error to the first's.
    law: f64,
}

const LONG: Form = Form {
    identify: &["step", "sq4-50", "random-a", "sq8-50", "sq4-80"],
    validate: &["sq2-30", "random-b", "sq8-80"],
    period: "10",
    repeats: "8",
    calibration: "",
    design: "",
    watched: ["90", "30"],
    law: 1.0,
};
/// The amounts for the page docs/rig-day.md.
const SHORT: Form = Form {
    identify: &["step", "sq4-50", "random-a"],
    validate: &["sq2-30", "random-b"],
    repeats: "3",
    watched: ["25", "10"],
    ..LONG
};
/// For CI: the least data with which the effect is named.
const BRIEF: Form = Form {
    identify: &["step", "random-a"],
    validate: &["random-b"],
    period: "5",
    repeats: "5",
    calibration: "--steady 1.5 --pulses 8",
    // Trials of half the length, and a coarse robustness margin.
    design: "--set design.trial=6000 --set design.trial-from=2000 --set design.margin-rays=4 \
        --set design.margin-bisections=2",
    watched: ["20", "8"],
    // Most of the error is the ripple of the shortest pulses, which a watch of this length measures to 3 %.
    law: 1.06,
};
/// Rest at the end of a shortened command, ms; no bundled command has an edge shortly before it.
const CUT_MS: usize = 450;

/// Target of the law, y.
const TARGET: &str = "0.5";
/// Largest allowed validation error, as a multiple of the noise level.
const FLOOR: f64 = 1.15;

/// Working folder, program and page.
struct Day {
    folder: PathBuf,
    program: PathBuf,
    page: String,
    started: Instant,
    times: Vec<(String, f64)>,
}

pub(crate) fn rig_day(arguments: &[String]) -> Result<()> {
    let (mut form, mut page) = (&LONG, false);
    for argument in arguments {
        match argument.as_str() {
            "--short" => form = &SHORT,
            "--brief" => form = &BRIEF,
            "--page" => page = true,
            other => bail!("unknown option {other}; the options are --short, --brief and --page"),
        }
    }
    let Form {
        identify,
        validate,
        period,
        repeats,
        calibration,
        design,
        watched: [seconds, learn],
        law,
    } = form;
    let program = program()?.get_program().into();
    let folder = target().join("rig-day");
    if folder.exists() {
        std::fs::remove_dir_all(&folder)?;
    }
    std::fs::create_dir_all(folder.join("commands"))?;
    let mut day = Day {
        folder,
        program,
        page: String::new(),
        started: Instant::now(),
        times: Vec::new(),
    };
    for name in identify.iter().chain(*validate) {
        let file = format!("{name}.csv");
        let text = std::fs::read_to_string(root().join("data/hidden-ramp").join(&file))?;
        let samples = 1000 * period.parse::<usize>()?;
        std::fs::write(day.folder.join("commands").join(&file), cut(&text, samples))?;
    }

    day.say("## 1. Calibrate the rig\n\nThe bundled firmware contains neither a model nor the properties of the rig. `--calibrate` measures sensor scale, noise\nand shortest pulses.");
    day.firmware("first", None, false)?;
    let calibrate = format!("--calibrate -o rig.toml {calibration}");
    day.fit("calibrate", &port("record", "first", &calibrate))?;

    day.say("## 2. Record and average\n\nThe board plays each command from rest and streams every sample. `rig.toml` converts counts to y. The scatter between\nrepeats becomes `y_sd`, the noise level of every later comparison.");
    let names = || identify.iter().chain(*validate);
    let rest = format!("--rig rig.toml --repeats {repeats} -o raw");
    let mut line = port("record", "first", &rest);
    line.extend(names().map(|n| format!("--command=commands/{n}.csv")));
    day.fit("record", &line)?;
    let played = played_period(&day.folder.join(format!("raw/{}.toml", identify[0])))?;
    let mut line = words(&format!("average --period {played} --out set"));
    line.extend(names().map(|n| format!("raw/{n}.csv")));
    line.extend(validate.iter().map(|n| format!("--validate={n}")));
    day.fit("average", &line)?;

    day.say("## 3. Identify and diagnose");
    day.fit("identify", &words("identify set -o model.toml"))?;
    day.fit("compare", &words("compare model.toml set"))?;
    let line = words("diagnose model.toml set -o better.toml --experiment experiment.csv");
    day.fit("diagnose", &line)?;
    if day.folder.join("experiment.csv").exists() {
        day.say("Several effects are not distinguishable on these records. The command that distinguishes these effects is played,\nand the diagnosis is repeated.");
        let rest = format!("--rig rig.toml --repeats {repeats} -o raw-2 --command experiment.csv");
        day.fit("record experiment", &port("record", "first", &rest))?;
        let period = played_period(&day.folder.join("raw-2/experiment.toml"))?;
        let line = format!("average raw-2/experiment.csv --period {period} --out set-2");
        day.fit("average experiment", &words(&line))?;
        std::fs::copy(
            day.folder.join("set-2/experiment.csv"),
            day.folder.join("set/experiment.csv"),
        )?;
        let list = day.folder.join("set/dataset.toml");
        let text = std::fs::read_to_string(&list)?
            + "\n[[record]]\nname = \"experiment\"\nfile = \"experiment.csv\"\nuse = \"identify\"\n";
        std::fs::write(&list, text)?;
        let line = words("diagnose model.toml set -o better.toml");
        day.fit("diagnose again", &line)?;
    }
    let better = day.fit("compare", &words("compare better.toml set --json"))?;
    let effects = effects(&day.folder.join("better.toml"))?;
    for model in ["model", "better"] {
        let record = validate[0];
        let line = format!("simulate {model}.toml set/{record}.csv -o {model}-run.csv");
        day.quietly(&words(&line))?;
    }

    day.say("## 4. Design a law with each model\n\nBoth models get a law for the same target. Each law is tried in simulation on its model and on every plant that the\nrecords do not exclude; losing attachment there rejects the law. Stress trials only warn. The firmware is built from model\nand rig file, and a rig file that contradicts the model is refused.");
    let mut rms = Vec::new();
    for (name, model) in [("before", "model.toml"), ("after", "better.toml")] {
        let controlled = format!("{name}.toml");
        let line = format!(
            "design {model} set -o {controlled} --target {TARGET} --min-on 0.02 --min-off 0.02 --rig rig.toml {design}"
        );
        day.fit(&format!("design {name}"), &words(&line))?;
        day.firmware(name, Some(&controlled), true)?;
        let rest =
            format!("--arm --seconds {seconds} --learn {learn} --rig rig.toml -o service-{name}");
        let said = day.fit(&format!("watch {name}"), &port("watch", name, &rest))?;
        rms.push((number(&said, "rms error ")?, number(&said, "air ")?));
    }

    day.say("## 5. Check the model in operation\n\nThe log of the closed loop is a data set: `compare` validates the model on it.");
    let line = words("compare better.toml service-after");
    day.fit("compare in service", &line)?;

    let (held_out, noise) = held_out(&better)?;
    let ((before, air_before), (after, air_after)) = (rms[0], rms[1]);
    let mut table = String::from("| step, on two cores | duration, s |\n|---|---|\n");
    for (name, seconds) in &day.times {
        let _ = writeln!(table, "| {name} | {seconds:.1} |");
    }
    let _ = write!(
        table,
        "| all | {:.1} |",
        day.started.elapsed().as_secs_f64()
    );
    let summary = format!(
        "hidden effect: {HIDDEN}; named: {}\nvalidation error {held_out:.4} = {:.2} × the noise level ({noise:.4})\n\
         rms error of the law: {before:.4} with the first model, {after:.4} with the second; air {air_before:.3} and {air_after:.3}",
        effects.join(", "),
        held_out / noise
    );
    println!("{summary}");
    day.say(&format!("## Result\n\n```\n{summary}\n```\n\n{table}"));
    ensure!(
        effects.iter().any(|e| e == HIDDEN),
        "the effect was not named: {}",
        effects.join(", ")
    );
    ensure!(
        held_out <= FLOOR * noise,
        "the validation error is {:.2} × the noise level",
        held_out / noise
    );
    ensure!(
        after < law * before,
        "the law did not become better: rms {before} before, {after} after"
    );
    if page {
        std::fs::write(
            root().join("docs/rig-day.svg"),
            picture::draw(&day.folder, validate[0])?,
        )?;
        std::fs::write(
            root().join("docs/rig-day.md"),
            format!("{HEAD}{}", day.page),
        )?;
    }
    Ok(())
}

const HEAD: &str = "# A day at the rig\n\n\
The complete workflow on one rig: calibrate, record, identify, diagnose, design a law, run it, check the model.\n\
The rig is simulated and hides an echo of the jet. The board runs under QEMU; the program reaches it over the serial line only.\n\
With a real board, flash the program (`firmware/README.md`) and use `--port /dev/ttyACM0` in place of `--port qemu …`.\n\n\
`cargo xtask rig-day --short --page` wrote this page; long outputs are shortened.\n\n\
![A validation record with both models; the reading under both laws](rig-day.svg)\n\n";

/// The first `samples` of a recording, with the valve shut at the end.
fn cut(text: &str, samples: usize) -> String {
    let mut lines = text.lines();
    let mut cut = lines.next().unwrap_or_default().to_owned() + "\n";
    let whole = text.lines().count() - 1;
    for (k, line) in lines.take(samples).enumerate() {
        match line.splitn(3, ',').collect::<Vec<_>>()[..] {
            [t, _, rest] if samples < whole && k >= samples - CUT_MS => {
                let _ = writeln!(cut, "{t},0,{rest}");
            }
            _ => {
                let _ = writeln!(cut, "{line}");
            }
        }
    }
    cut
}

fn words(line: &str) -> Vec<String> {
    line.split_whitespace().map(str::to_owned).collect()
}

/// A command at the simulated rig, with the program that the board runs.
fn port(command: &str, elf: &str, rest: &str) -> Vec<String> {
    words(&format!(
        "{command} --port qemu --firmware {elf} --rig-seed {RIG} --rig-effect {HIDDEN} {rest}"
    ))
}

impl Day {
    fn say(&mut self, text: &str) {
        let _ = writeln!(self.page, "{text}\n");
    }

    /// Runs a command without showing it.
    fn quietly(&self, line: &[String]) -> Result<()> {
        let done = Command::new(&self.program)
            .args(line)
            .current_dir(&self.folder)
            .stdout(Stdio::null())
            .status()?;
        ensure!(done.success(), "`host-fit {}` failed", line.join(" "));
        Ok(())
    }

    /// Runs a command of the program and adds its output to the page.
    fn fit(&mut self, step: &str, line: &[String]) -> Result<String> {
        let shown = format!("host-fit {}", line.join(" "));
        eprintln!("$ {shown}");
        let started = Instant::now();
        let output = Command::new(&self.program)
            .args(line)
            .current_dir(&self.folder)
            .stdin(Stdio::null())
            .stderr(Stdio::inherit())
            .output()
            .context("host-fit could not be started")?;
        let said = String::from_utf8_lossy(&output.stdout).into_owned();
        ensure!(
            output.status.success(),
            "`{shown}` ended with {}\n{said}",
            output.status
        );
        self.times
            .push((step.to_owned(), started.elapsed().as_secs_f64()));
        if line.iter().all(|word| word != "--json") {
            print!("{said}");
            let _ = writeln!(
                self.page,
                "```\n$ {shown}\n{}\n```\n",
                shortened(said.trim_end())
            );
        }
        Ok(said)
    }

    /// Builds the firmware and copies it to `name` in the working folder.
    fn firmware(&mut self, name: &str, model: Option<&str>, rig: bool) -> Result<()> {
        let path = |file: &str| self.folder.join(file);
        let chosen = Chosen {
            board: Some("qemu-rig"),
            model: model.map(path),
            rig: rig.then(|| path("rig.toml")),
        };
        let started = Instant::now();
        let elf = chosen.build("qemu-rig")?;
        std::fs::copy(&elf, path(name))?;
        self.times
            .push((format!("firmware {name}"), started.elapsed().as_secs_f64()));
        let model = model.map_or_else(String::new, |m| format!(" --model {m}"));
        let rig = if rig { " --rig rig.toml" } else { "" };
        let _ = writeln!(
            self.page,
            "```\n$ cargo xtask firmware --board qemu-rig{model}{rig}\n```\n"
        );
        Ok(())
    }
}

/// Long output for the page: its first and last lines, with the number of lines left out.
fn shortened(said: &str) -> String {
    const FIRST: usize = 12;
    const LAST: usize = 3;
    let lines: Vec<&str> = said.lines().map(str::trim_end).collect();
    if lines.len() <= FIRST + LAST + 1 {
        return lines.join("\n");
    }
    let left_out = lines.len() - FIRST - LAST;
    let (first, last) = (&lines[..FIRST], &lines[lines.len() - LAST..]);
    format!(
        "{}\n… {left_out} more lines\n{}",
        first.join("\n"),
        last.join("\n")
    )
}

/// Names of a model's effects.
fn effects(model: &Path) -> Result<Vec<String>> {
    let text = std::fs::read_to_string(model).with_context(|| model.display().to_string())?;
    let table: toml::Table = text.parse()?;
    let effects = table
        .get("effect")
        .and_then(toml::Value::as_array)
        .into_iter()
        .flatten();
    Ok(effects
        .filter_map(|e| Some(e.get("name")?.as_str()?.to_owned()))
        .collect())
}

/// Validation error and noise level.
fn held_out(compared: &str) -> Result<(f64, f64)> {
    let document: serde_json::Value = serde_json::from_str(compared)?;
    let of = |key: &str| {
        document["validate"][key]
            .as_f64()
            .with_context(|| format!("no `{key}`"))
    };
    Ok((of("rmse")?, of("noise_rmse")?))
}

/// The period of a recording from its header, rest between repeats included.
fn played_period(header: &Path) -> Result<String> {
    let text = std::fs::read_to_string(header)?;
    let said = text.lines().find_map(|line| line.split("--period ").nth(1));
    let number = said.and_then(|said| said.split_whitespace().next());
    let number = number.with_context(|| format!("{}: no period", header.display()))?;
    Ok(number.trim_end_matches(['"', '`']).to_owned())
}

/// The number behind `name` in a text.
fn number(text: &str, name: &str) -> Result<f64> {
    let rest = text
        .split_once(name)
        .with_context(|| format!("no `{name}` in: {text}"))?
        .1;
    let digits: String = rest
        .chars()
        .take_while(|c| c.is_ascii_digit() || *c == '.')
        .collect();
    digits
        .parse()
        .with_context(|| format!("no number behind `{name}`"))
}
