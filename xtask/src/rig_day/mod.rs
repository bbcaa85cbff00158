//! A day at the rig, unattended: a simulated rig with a hidden effect behind the
//! board under QEMU, and nothing but the serial line between it and the program.
//! Every step is a command that a user would type; the page in `docs` is made of
//! what they print.

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
    does: "the whole circle at a simulated rig behind the board under QEMU: --short, --brief (as CI), --page writes docs/rig-day.md",
    run: rig_day,
};

/// What the rig hides, and which rig it is.
const HIDDEN: &str = "echo-path";
const RIG: &str = "7";
/// How much is recorded and watched. Commands are those of the bundled set.
struct Form {
    /// To identify on.
    identify: &'static [&'static str],
    /// Held out; the page shows the first.
    validate: &'static [&'static str],
    /// Seconds of the commands that are played, the last of them shut.
    period: &'static str,
    repeats: &'static str,
    /// More words for the calibration.
    calibration: &'static [&'static str],
    /// Of the law at work, and of it until the model is judged.
    watched: [&'static str; 2],
    /// The second law's rms error over that of the first, at most.
    law: f64,
}

const LONG: Form = Form {
    identify: &["step", "sq4-50", "random-a", "sq8-50", "sq4-80"],
    validate: &["sq2-30", "random-b", "sq8-80"],
    period: "10",
    repeats: "8",
    calibration: &[],
    watched: ["90", "30"],
    law: 1.0,
};
/// The page's.
const SHORT: Form = Form {
    identify: &["step", "sq4-50", "random-a"],
    validate: &["sq2-30", "random-b"],
    repeats: "3",
    watched: ["25", "10"],
    ..LONG
};
/// As little as names the effect: CI's.
const BRIEF: Form = Form {
    identify: &["step", "random-a"],
    validate: &["random-b"],
    period: "5",
    repeats: "5",
    calibration: &["--steady", "1.5", "--pulses", "8"],
    watched: ["20", "8"],
    // The ripple of the shortest pulses is most of the error; so short a watch tells it to 3 %.
    law: 1.06,
};
/// Where a command that is cut is shut for the rest: no bundled one has an edge shortly before.
const CUT_MS: usize = 450;

/// What the law is to hold.
const TARGET: &str = "0.5";
/// Of the noise floor that the held-out error may be at most.
const FLOOR: f64 = 1.15;

/// The day's folder, program and page.
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
            other => bail!("unknown option {other}; there are --short, --brief and --page"),
        }
    }
    let Form {
        identify,
        validate,
        period,
        repeats,
        calibration,
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

    day.say("## 1. What is this rig?\n\nThe board comes with the bundled firmware: it knows neither the rig nor a model of it. The rig is measured first.");
    day.firmware("first", None, false)?;
    day.fit(
        "calibrate",
        &port(
            "record",
            "first",
            &[&["--calibrate", "-o", "rig.toml"], *calibration].concat(),
        ),
    )?;

    day.say("## 2. Recordings\n\nCommands are played, each from rest; the board streams every sample. The rig file says what its counts mean.");
    let commands: Vec<String> = identify
        .iter()
        .chain(*validate)
        .map(|n| format!("--command=commands/{n}.csv"))
        .collect();
    let mut line = port(
        "record",
        "first",
        &["--rig", "rig.toml", "--repeats", repeats, "-o", "raw"],
    );
    line.extend(commands);
    day.fit("record", &line)?;
    let played = played_period(&day.folder.join(format!("raw/{}.toml", identify[0])))?;
    let mut line = words(&["average", "--period", &played, "--out", "set"]);
    line.extend(
        identify
            .iter()
            .chain(*validate)
            .map(|n| format!("raw/{n}.csv")),
    );
    line.extend(validate.iter().map(|n| format!("--validate={n}")));
    day.fit("average", &line)?;

    day.say("## 3. A model, and what it lacks");
    day.fit("identify", &words(&["identify", "set", "-o", "model.toml"]))?;
    day.fit("compare", &words(&["compare", "model.toml", "set"]))?;
    day.fit(
        "diagnose",
        &words(&[
            "diagnose",
            "model.toml",
            "set",
            "-o",
            "better.toml",
            "--experiment",
            "experiment.csv",
        ]),
    )?;
    if day.folder.join("experiment.csv").exists() {
        day.say("The records leave something open, and the diagnosis says which command would tell. It is played, and the diagnosis repeated.");
        day.fit(
            "record experiment",
            &port(
                "record",
                "first",
                &[
                    "--rig",
                    "rig.toml",
                    "--repeats",
                    repeats,
                    "-o",
                    "raw-2",
                    "--command",
                    "experiment.csv",
                ],
            ),
        )?;
        let period = played_period(&day.folder.join("raw-2/experiment.toml"))?;
        day.fit(
            "average experiment",
            &words(&[
                "average",
                "raw-2/experiment.csv",
                "--period",
                &period,
                "--out",
                "set-2",
            ]),
        )?;
        std::fs::copy(
            day.folder.join("set-2/experiment.csv"),
            day.folder.join("set/experiment.csv"),
        )?;
        let list = day.folder.join("set/dataset.toml");
        let text = std::fs::read_to_string(&list)?
            + "\n[[record]]\nname = \"experiment\"\nfile = \"experiment.csv\"\nuse = \"identify\"\n";
        std::fs::write(&list, text)?;
        day.fit(
            "diagnose again",
            &words(&["diagnose", "model.toml", "set", "-o", "better.toml"]),
        )?;
    }
    let better = day.fit(
        "compare",
        &words(&["compare", "better.toml", "set", "--json"]),
    )?;
    let effects = effects(&day.folder.join("better.toml"))?;
    for model in ["model", "better"] {
        let (model, run) = (format!("{model}.toml"), format!("{model}-run.csv"));
        let record = format!("set/{}.csv", validate[0]);
        day.quietly(&words(&["simulate", &model, &record, "-o", &run]))?;
    }

    day.say("## 4. The law before and after the effect was known\n\nThe same goal for both models. Each law is tried on its model and on every flow that the records leave possible; these decide. Effects at their worst, which the records exclude, are tried as well and warn. The firmware is built with model and rig, and refuses a rig that contradicts the model.");
    let mut rms = Vec::new();
    for (name, model) in [("before", "model.toml"), ("after", "better.toml")] {
        let controlled = format!("{name}.toml");
        day.fit(
            &format!("design {name}"),
            &words(&[
                "design",
                model,
                "set",
                "-o",
                &controlled,
                "--target",
                TARGET,
                "--min-on",
                "0.02",
                "--min-off",
                "0.02",
                "--rig",
                "rig.toml",
            ]),
        )?;
        day.firmware(name, Some(&controlled), true)?;
        let log = format!("service-{name}");
        let said = day.fit(
            &format!("watch {name}"),
            &port(
                "watch",
                name,
                &[
                    "--arm",
                    "--seconds",
                    seconds,
                    "--learn",
                    learn,
                    "--rig",
                    "rig.toml",
                    "-o",
                    &log,
                ],
            ),
        )?;
        rms.push((number(&said, "rms error ")?, number(&said, "air ")?));
    }

    day.say("## 5. The model in service\n\nThe log of the loop is a data set: the model that the law uses is judged on its own operation.");
    day.fit(
        "compare in service",
        &words(&["compare", "better.toml", "service-after"]),
    )?;

    let (held_out, noise) = held_out(&better)?;
    let ((before, air_before), (after, air_after)) = (rms[0], rms[1]);
    let mut table = String::from("| step | s |\n|---|---|\n");
    for (name, seconds) in &day.times {
        let _ = writeln!(table, "| {name} | {seconds:.1} |");
    }
    let _ = write!(
        table,
        "| all | {:.1} |",
        day.started.elapsed().as_secs_f64()
    );
    let summary = format!(
        "hidden: {HIDDEN}; named: {}\nheld-out error {held_out:.4}, noise floor {noise:.4} ({:.2} times)\n\
         the law: rms error {before:.4} before, {after:.4} after; air {air_before:.3} and {air_after:.3}",
        effects.join(", "),
        held_out / noise
    );
    println!("{summary}");
    day.say(&format!("## What came of it\n\n```\n{summary}\n```\n\nTimes on the machine that made this page, in seconds:\n\n{table}"));
    ensure!(
        effects.iter().any(|e| e == HIDDEN),
        "the effect was not named: {}",
        effects.join(", ")
    );
    ensure!(
        held_out <= FLOOR * noise,
        "the held-out error is {:.2} times the noise floor",
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
`cargo xtask rig-day --short --page` made this page: a simulated rig that hides an effect, behind the board under QEMU, and nothing but the\n\
serial line between it and the program. With a board at a port it is `--port /dev/ttyACM0` instead of `--port qemu …`, and the\n\
program is flashed (`firmware/README.md`). What is printed below is what the commands printed.\n\n\
![A held-out record and both models; the reading under both laws](rig-day.svg)\n\n";

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

fn words(line: &[&str]) -> Vec<String> {
    line.iter().map(|word| (*word).to_owned()).collect()
}

/// A command at the simulated rig, with the program that the board runs.
fn port(command: &str, elf: &str, rest: &[&str]) -> Vec<String> {
    let mut line = words(&[command, "--port", "qemu", "--firmware", elf]);
    line.extend(words(&["--rig-seed", RIG, "--rig-effect", HIDDEN]));
    line.extend(words(rest));
    line
}

impl Day {
    fn say(&mut self, text: &str) {
        let _ = writeln!(self.page, "{text}\n");
    }

    /// A command of which nobody needs to read.
    fn quietly(&self, line: &[String]) -> Result<()> {
        let done = Command::new(&self.program)
            .args(line)
            .current_dir(&self.folder)
            .stdout(Stdio::null())
            .status()?;
        ensure!(done.success(), "`host-fit {}` failed", line.join(" "));
        Ok(())
    }

    /// A command of the program; what it prints goes to the page.
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
            let _ = writeln!(self.page, "```\n$ {shown}\n{}\n```\n", said.trim_end());
        }
        Ok(said)
    }

    /// The board's program under the name `name` in the day's folder.
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

/// Error and noise floor of the held-out records.
fn held_out(compared: &str) -> Result<(f64, f64)> {
    let document: serde_json::Value = serde_json::from_str(compared)?;
    let of = |key: &str| {
        document["validate"][key]
            .as_f64()
            .with_context(|| format!("no `{key}`"))
    };
    Ok((of("rmse")?, of("noise_rmse")?))
}

/// The period of a recording, with the rest that the board keeps between repeats, as its header says it.
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
