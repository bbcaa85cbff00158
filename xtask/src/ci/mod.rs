//! Everything CI runs, in one command: three steps at a time; failures are collected, not fatal.

mod lanes;
mod slowest;

use crate::Task;
use crate::setup::TARGETS;
use crate::shell::{cargo, firmware_cargo, run};
use anyhow::{Context, Result, bail};

pub(crate) const TASK: Task = Task {
    name: "ci",
    does: "runs all steps of CI; continues after a failure and lists all failures at the end",
    run: ci,
};

/// A part of CI, which runs concurrently with others.
#[derive(Clone, Copy)]
struct Step {
    name: &'static str,
    /// Steps that must end before this step starts. If one of them fails, this step is not run.
    after: &'static [&'static str],
    /// A resource that no two steps use at the same time.
    room: Option<Room>,
    run: fn() -> Result<()>,
}

impl Step {
    const fn new(name: &'static str, run: fn() -> Result<()>) -> Self {
        Self {
            name,
            after: &[],
            room: None,
            run,
        }
    }

    const fn after(self, after: &'static [&'static str]) -> Self {
        Self { after, ..self }
    }

    const fn within(self, room: Room) -> Self {
        Self {
            room: Some(room),
            ..self
        }
    }
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Room {
    /// The workspace's folder of artefacts, which cargo locks while it compiles and before it runs tests.
    Host,
    /// The firmware's folder, in which programs for boards and their constants have fixed names.
    Firmware,
}

/// The step that compiles the workspace, all tests and programs.
const BUILD: &str = "build";
const SET_UP: &str = "set-up";

/// The steps, in the order in which they start if none has to wait.
const STEPS: &[Step] = &[
    Step::new(BUILD, || {
        run(&mut cargo("test --release --workspace --no-run"))
    })
    .within(Room::Host),
    Step::new("format", || {
        run(&mut cargo("fmt --all --check"))?;
        run(&mut firmware_cargo("fmt --all --check"))
    }),
    Step::new(SET_UP, || crate::setup::setup(&[])),
    // This is the README's test command, which includes documentation examples. Everything is compiled
    // before, so that the folder is locked only briefly.
    Step::new("tests", || run(&mut cargo("test --release --workspace"))).after(&[BUILD]),
    // Checks that the script in the report pages was built from the present sources.
    Step::new("pages", || crate::pages::pages(&["--check".to_owned()])).after(&[SET_UP]),
    Step::new("browser", || crate::browser::browser(&[])).after(&[BUILD, "pages"]),
    Step::new("lints", || {
        run(&mut cargo(
            "clippy --release --workspace --all-targets -- -Dwarnings",
        ))
    })
    .within(Room::Host),
    Step::new("documentation", || {
        run(cargo("doc --release --workspace --no-deps").env("RUSTDOCFLAGS", "-Dwarnings"))
    })
    .within(Room::Host),
    // These steps use the emulated board one after the other. They are the longest chain, so they start before steps
    // that can run at the same time.
    Step::new("faults", || crate::faults::faults(&[]))
        .after(&[SET_UP, BUILD])
        .within(Room::Firmware),
    // The program links only without panics. The step runs the constants and checks the budgets.
    Step::new("pil", crate::budgets::check)
        .after(&[SET_UP, BUILD])
        .within(Room::Firmware),
    // Lockstep runs at other periods, and the emulated board at one of them.
    Step::new("periods", || crate::periods::periods(&[]))
        .after(&[SET_UP, BUILD])
        .within(Room::Firmware),
    // The complete workflow on the simulated rig, without a user.
    Step::new("rig-day", || {
        crate::rig_day::rig_day(&["--brief".to_owned()])
    })
    .after(&[SET_UP, BUILD])
    .within(Room::Firmware),
    // The whole workflow: the model found by the demo is built for the board and runs there.
    Step::new("demo on board", demo_on_board)
        .after(&[SET_UP, BUILD])
        .within(Room::Firmware),
    Step::new("msrv", crate::msrv::msrv),
    Step::new("supply", crate::supply::supply),
    // Checks that every crate can be published.
    Step::new("package", || (crate::package::TASK.run)(&[]))
        .after(&[BUILD])
        .within(Room::Host),
    // Archive and wheel, for people without a compiler, are installed in another folder.
    Step::new("release", || crate::release::release(&[])).after(&[SET_UP, BUILD]),
    // Checks that a new effect and a new delay law need only one file and one line each.
    Step::new("new effect", crate::new_effect::proof)
        .after(&[BUILD])
        .within(Room::Host),
    // 10 s a target.
    Step::new("fuzz", crate::fuzz::brief).after(&[BUILD]),
    // The generated pages equal the catalogue, and every link has a target.
    Step::new("book", || crate::book::book(&["--check".to_owned()])).after(&[BUILD]),
    // The lints use the test profile; otherwise every dependency would be checked once for tests and once for
    // the rest.
    Step::new("firmware lints", || {
        run(&mut firmware_cargo(
            "clippy --release --all-targets --package=firmware --package=identified \
                --package=log-reader --config=profile.release.panic=\"unwind\" -- -Dwarnings",
        ))
    })
    .within(Room::Firmware),
    Step::new("firmware tests", || {
        run(&mut firmware_cargo("test --release"))
    })
    .within(Room::Firmware),
    Step::new("board lints", board_lints)
        .after(&[SET_UP])
        .within(Room::Firmware),
    // The loop and the model are built without board code, also for smaller and newer cores.
    Step::new("no_std", || {
        TARGETS
            .iter()
            .try_for_each(|target| crate::firmware::libraries(target))
    })
    .after(&[SET_UP])
    .within(Room::Firmware),
    // Link only without panics.
    Step::new("boards", || {
        for board in crate::firmware::BOARDS {
            crate::firmware::firmware(&["--board".to_owned(), board.to_owned()])?;
        }
        crate::firmware::build("nucleo-f446re", "nucleo-pil", &[], None).map(|_| ())
    })
    .after(&[SET_UP])
    .within(Room::Firmware),
    Step::new("nucleo", crate::nucleo::nucleo)
        .after(&[SET_UP])
        .within(Room::Firmware),
    // The exported models agree with the host.
    Step::new("agreement", || {
        (crate::agreement::TASK.run)(&["--all", "--in-turn"].map(str::to_owned))
    })
    .after(&[SET_UP, BUILD]),
    Step::new("examples", || (crate::examples::TASK.run)(&[])).after(&[SET_UP, BUILD]),
    Step::new("constants", || {
        crate::identified::identified(&["--check".to_owned()])
    })
    .after(&[BUILD]),
];

fn board_lints() -> Result<()> {
    let mut clippy = crate::setup::cross_cargo("clippy", TARGETS[0])?;
    clippy
        .args(["--package", "board", "--package", "qemu-mps2"])
        .args(["--package", "nucleo-f446re"])
        .args(["--features", "qemu-mps2/peer", "--", "-Dwarnings"])
        .current_dir(crate::shell::root().join("firmware"))
        .env("CARGO_TARGET_DIR", crate::shell::firmware_target());
    run(&mut clippy)
}

fn demo_on_board() -> Result<()> {
    let out = crate::shell::target().join("demo");
    run(crate::shell::program()?.args(["demo", "--out"]).arg(&out))?;
    let model = out.join("controlled.toml").to_string_lossy().into_owned();
    let with = |option: &str, value: &str| ["--model", &model, option, value].map(str::to_owned);
    crate::firmware::firmware(&with("--board", crate::firmware::BOARDS[0]))?;
    crate::pil::pil(&with("--steps", "5000")).map(|_| ())
}

fn ci(arguments: &[String]) -> Result<()> {
    let names: Vec<&str> = STEPS.iter().map(|step| step.name).collect();
    let find = |name: &String| {
        STEPS
            .iter()
            .find(|step| step.name == name)
            .with_context(|| {
                format!(
                    "there is no step `{name}`; the steps are: {}; without a name all steps run",
                    names.join(", ")
                )
            })
    };
    let mut chosen = arguments
        .iter()
        .map(find)
        .collect::<Result<Vec<&'static Step>>>()?;
    if let [only] = chosen[..] {
        return lanes::alone(only);
    }
    if chosen.is_empty() {
        chosen = STEPS.iter().collect();
    }
    let mut done = lanes::run(&chosen)?;
    let place = |name: &str| names.iter().position(|other| *other == name);
    done.sort_by_key(|done| place(done.name));
    for line in done.iter().flat_map(|done| slowest::lines(&done.output)) {
        println!("{line}");
    }
    println!("\nci: {} steps", done.len());
    for done in &done {
        println!("{}", done.line());
    }
    let failed = done.iter().filter(|done| done.failure.is_some()).count();
    if failed > 0 {
        bail!("{failed} of {} steps failed", done.len());
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A step that waits for a step below it would never start.
    #[test]
    fn steps_come_after_steps_above_them() {
        for (at, step) in STEPS.iter().enumerate() {
            for need in step.after {
                let above = STEPS[..at].iter().any(|other| other.name == *need);
                assert!(above, "{} after {need}", step.name);
            }
        }
    }
}
