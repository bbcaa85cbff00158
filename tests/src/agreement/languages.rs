//! Runs the exported files with the tools of their languages.

use super::{Case, Row, TOLERANCE, Vectors};
use anyhow::{Context, Result, bail, ensure};
use host_fit::codegen::portable::{self, Precision};
use host_fit::model::Law;
use std::fmt::Write as _;
use std::path::Path;
use std::process::{Command, Stdio};

/// A language's tool.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Tool {
    /// GCC.
    C,
    /// GCC for a Cortex-M4F, and QEMU.
    Board,
    /// Python 3 with NumPy.
    Python,
    /// GNU Octave.
    Octave,
}

impl Tool {
    /// All of them.
    pub const ALL: [Self; 4] = [Self::C, Self::Board, Self::Python, Self::Octave];

    /// Its command, without arguments.
    #[must_use]
    pub fn command(self) -> Command {
        match self {
            Self::C => Command::new("gcc"),
            Self::Board => Command::new("arm-none-eabi-gcc"),
            Self::Python => Command::new(python()),
            Self::Octave => {
                let mut octave = Command::new("octave-cli");
                octave.args(["--quiet", "--no-init-file"]);
                octave
            }
        }
    }

    /// Whether the tool is installed.
    #[must_use]
    pub fn is_installed(self) -> bool {
        let mut command = self.command();
        if self == Self::Python {
            command.args(["-c", "import numpy"]);
        } else {
            command.arg("--version");
        }
        let mut qemu = Command::new("qemu-system-arm");
        runs(&mut command) && (self != Self::Board || runs(qemu.arg("--version")))
    }
}

fn runs(command: &mut Command) -> bool {
    let run = command.stdout(Stdio::null()).stderr(Stdio::null()).status();
    run.is_ok_and(|status| status.success())
}

/// The first Python on the path with NumPy, or the system's.
fn python() -> &'static str {
    let has = |program: &str| runs(Command::new(program).args(["-c", "import numpy"]));
    if has("python3") {
        "python3"
    } else {
        "/usr/bin/python3"
    }
}

/// Readings from rest, readings from another initial state, estimates of the law, its decisions.
type Said = [Vec<f64>; 4];

fn expected<T: model_core::Real>(case: &Case, vectors: &Vectors) -> Said {
    let (on, estimates, _) = vectors.law::<T>(&case.model);
    let on = on.into_iter().map(|on| f64::from(u8::from(on))).collect();
    [
        vectors.run::<T>(&case.model, false),
        vectors.run::<T>(&case.model, true),
        estimates,
        on,
    ]
}

/// Runs `cases` with `tool`, in files of `folder`.
///
/// # Errors
/// If the tool refuses the generated file.
pub fn run(tool: Tool, cases: &[Case], folder: &Path) -> Result<Vec<Row>> {
    let vectors: Vec<Vectors> = cases.iter().map(|case| Vectors::of(&case.model)).collect();
    for (i, vectors) in vectors.iter().enumerate() {
        write_inputs(folder, i, vectors)?;
    }
    let mut rows = Vec::new();
    let mut judge =
        |case: &Case, language, (said, instructions): (&Said, _), expected: &Said, most: f64| {
            let largest = expected[0]
                .iter()
                .chain(&expected[1])
                .fold(1e-9_f64, |m, y| m.max(y.abs()));
            let mut difference = 0.0_f64;
            for (said, expected) in said.iter().zip(expected) {
                if said.len() != expected.len() {
                    difference = f64::INFINITY;
                }
                for (said, expected) in said.iter().zip(expected) {
                    let off = (said - expected).abs() / largest;
                    difference = if off.is_nan() {
                        f64::INFINITY
                    } else {
                        difference.max(off)
                    };
                }
            }
            rows.push(Row {
                case: case.name.clone(),
                language,
                difference,
                agrees: difference <= most,
                instructions,
            });
        };
    let compiled = match tool {
        Tool::C => &[(Precision::Single, "C f32"), (Precision::Double, "C f64")][..],
        // A board computes in single precision.
        Tool::Board => &[(Precision::Single, "C board")],
        Tool::Python | Tool::Octave => &[],
    };
    for (i, case) in cases.iter().enumerate() {
        for &(precision, language) in compiled {
            let (said, instructions) = c(tool, case, i, precision, folder)
                .with_context(|| format!("{}, {language}", case.name))?;
            let expected = match precision {
                Precision::Single => expected::<f32>(case, &vectors[i]),
                Precision::Double => expected::<f64>(case, &vectors[i]),
            };
            judge(case, language, (&said, instructions), &expected, 0.0);
        }
    }
    if !compiled.is_empty() {
        return Ok(rows);
    }
    let (language, text) = match tool {
        Tool::Python => ("Python", interpreted_python(cases, folder)?),
        _ => ("Octave", interpreted_octave(cases, folder)?),
    };
    let mut said = blocks(&text).into_iter();
    for (case, vectors) in cases.iter().zip(&vectors) {
        let own: Vec<Vec<f64>> = said.by_ref().take(4).collect();
        let Ok(own) = Said::try_from(own) else {
            bail!("{language} said too little")
        };
        judge(
            case,
            language,
            (&own, None),
            &expected::<f64>(case, vectors),
            TOLERANCE,
        );
    }
    Ok(rows)
}

/// Commands with channels, and readings, as text; `NaN` is understood by all.
fn write_inputs(folder: &Path, i: usize, vectors: &Vectors) -> Result<()> {
    let mut text = String::new();
    for (u, row) in vectors.u.iter().zip(&vectors.channels) {
        let _ = write!(text, "{u:?}");
        for channel in row {
            let _ = write!(text, " {channel:?}");
        }
        text.push('\n');
    }
    std::fs::write(folder.join(format!("in{i}.txt")), text)?;
    let readings: String = vectors
        .readings
        .iter()
        .map(|y| format!("{y:?}\n"))
        .collect();
    std::fs::write(folder.join(format!("law{i}.txt")), readings)?;
    Ok(())
}

/// Lists of numbers, each after a line with `=`.
fn blocks(text: &str) -> Vec<Vec<f64>> {
    let blocks = text.split('=').skip(1);
    let numbers = |block: &str| {
        block
            .split_whitespace()
            .map(|x| x.parse().unwrap_or(f64::NAN))
            .collect()
    };
    blocks.map(numbers).collect()
}

pub(super) fn output(command: &mut Command) -> Result<String> {
    let done = command.output().context("the tool does not start")?;
    ensure!(
        done.status.success(),
        "{}{}",
        String::from_utf8_lossy(&done.stdout)
            .chars()
            .take(2000)
            .collect::<String>(),
        String::from_utf8_lossy(&done.stderr)
    );
    Ok(String::from_utf8(done.stdout)?)
}

/// C99 with the options that the page on exports states.
pub(super) const C: [&str; 9] = [
    "-std=c99",
    "-O2",
    "-ffp-contract=off",
    "-Wall",
    "-Wextra",
    "-pedantic",
    "-Werror",
    "-Wno-misleading-indentation",
    "-Wno-type-limits",
];
const CORTEX_M4F: [&str; 6] = [
    "-DBOARD",
    "-mcpu=cortex-m4",
    "-mthumb",
    "-mfloat-abi=hard",
    "-mfpu=fpv4-sp-d16",
    "--specs=rdimon.specs",
];
const BOARD_START: &str = include_str!("board.c");
const BOARD_MEMORY: &str = include_str!("board.ld");

/// The output of case `i` in C, and on a board the instructions per sample.
fn c(
    tool: Tool,
    case: &Case,
    i: usize,
    precision: Precision,
    folder: &Path,
) -> Result<(Said, Option<f64>)> {
    let vectors = Vectors::of(&case.model);
    let [u, y] = vectors.before;
    let mut played = format!(
        "#define WIDTH {}\n#define U_BEFORE (real){u:?}\n#define Y_BEFORE (real){y:?}\n",
        vectors.channels[0].len() + 1
    );
    match &case.model.law {
        None => {}
        Some(Law::Track(_)) => played += "#define TRACKS\n",
        Some(Law::Maximise(_)) => played += "#define PULSES 320\n",
    }
    let program = folder.join("main");
    for (name, text) in [
        ("case.h", played.as_str()),
        ("model.c", &portable::c(&case.model, precision)?),
        ("main.c", include_str!("main.c")),
        ("board.c", BOARD_START),
        ("board.ld", BOARD_MEMORY),
    ] {
        std::fs::write(folder.join(name), text)?;
    }
    let mut gcc = tool.command();
    gcc.args(C).arg("-o").arg(&program).arg("main.c");
    if tool == Tool::Board {
        gcc.args(CORTEX_M4F).args(["-T", "board.ld", "board.c"]);
    }
    output(gcc.arg("-lm").current_dir(folder))?;
    let (inputs, readings) = (format!("in{i}.txt"), format!("law{i}.txt"));
    let mut run = if tool == Tool::Board {
        let mut qemu = Command::new("qemu-system-arm");
        qemu.args(["-machine", "mps2-an386", "-cpu", "cortex-m4"])
            .args(["-icount", "shift=5,sleep=off", "-display", "none"])
            .args(["-monitor", "none", "-serial", "null", "-kernel", "main"])
            .arg("-semihosting-config")
            .arg(format!(
                "enable=on,target=native,arg=main,arg={inputs},arg={readings}"
            ));
        qemu
    } else {
        let mut run = Command::new(&program);
        run.arg(inputs).arg(readings);
        run
    };
    let mut said = blocks(&output(run.current_dir(folder))?);
    let instructions = said.get(4).and_then(|list| list.first()).copied();
    said.resize(4, Vec::new());
    let said = Said::try_from(said).map_err(|_| anyhow::anyhow!("four blocks"))?;
    Ok((said, instructions))
}

fn interpreted_python(cases: &[Case], folder: &Path) -> Result<String> {
    let mut script = String::from(
        "import sys, importlib\nimport numpy as np\n\
         def out(x):\n    print('=')\n    for v in x: print(repr(float(v)))\n",
    );
    for (i, case) in cases.iter().enumerate() {
        std::fs::write(
            folder.join(format!("model{i}.py")),
            portable::python(&case.model)?,
        )?;
        let [u, y] = Vectors::of(&case.model).before;
        let _ = write!(
            script,
            "m = importlib.import_module('model{i}')\nx = np.loadtxt('in{i}.txt', ndmin=2)\n\
             out(m.Model().simulate(x[:, 0], x[:, 1:]))\nout(m.Model().simulate(x[:, 0], x[:, 1:], {y:?}, {u:?}))\n"
        );
        script.push_str(
            &match &case.model.law {
                None => "out([])\nout([])\n",
                Some(Law::Track(_)) => LAW_PYTHON,
                Some(Law::Maximise(_)) => {
                    "law = m.Law()\nout([0] * 320)\nout([law.step() for _ in range(320)])\n"
                }
            }
            .replace("{i}", &i.to_string()),
        );
    }
    std::fs::write(folder.join("run_cases.py"), script)?;
    let mut python = Tool::Python.command();
    output(
        python
            .arg("run_cases.py")
            .current_dir(folder)
            .env("PYTHONDONTWRITEBYTECODE", "1"),
    )
}

const LAW_PYTHON: &str = "law, on, e = m.Law(), [], []\n\
    for r in np.loadtxt('law{i}.txt'):\n    on.append(law.step(r))\n    e.append(law.estimate)\nout(e)\nout(on)\n";

fn interpreted_octave(cases: &[Case], folder: &Path) -> Result<String> {
    let mut script =
        String::from("1;\nfunction out(x)\n  printf('=\\n'); printf('%.17g\\n', x);\nend\n");
    for (i, case) in cases.iter().enumerate() {
        let name = format!("model{i}");
        std::fs::write(
            folder.join(format!("{name}.m")),
            portable::matlab(&case.model, &name)?,
        )?;
        let [u, y] = Vectors::of(&case.model).before;
        let channels = Vectors::of(&case.model).channels[0].len();
        let first = if channels > 0 { ", x(1, 2:end)" } else { "" };
        let all = if channels > 0 { ", x(:, 2:end)" } else { "" };
        let _ = write!(
            script,
            "x = dlmread('in{i}.txt', ' ');\nout({name}(x(:, 1), []{all}));\ns = {name}('hold', {u:?}, {y:?}{first});\nout({name}(x(:, 1), s{all}));\n"
        );
        script.push_str(&match &case.model.law {
            None => "out([]); out([]);\n".to_owned(),
            Some(law) => {
                let estimate = if matches!(law, Law::Track(_)) { "law.estimate" } else { "0" };
                format!(
                    "r = str2double(strsplit(strtrim(fileread('law{i}.txt')), \"\\n\")); law = []; on = []; e = [];\n\
                     for k = 1:numel(r)\n  [on(k), law] = {name}('law', r(k), law);\n  e(k) = {estimate};\nend\nout(e); out(on);\n"
                )
            }
        });
    }
    std::fs::write(folder.join("run_cases.m"), script)?;
    let mut octave = Tool::Octave.command();
    output(octave.arg("run_cases.m").current_dir(folder))
}
