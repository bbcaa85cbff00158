//! Steps of CI, three at a time. Each is a separate process, whose output is collected and printed when it has
//! ended.

use super::{BUILD, Step};
use crate::shell::target;
use anyhow::{Context, Result};
use std::fs::File;
use std::path::Path;
use std::process::{Command, Stdio};
use std::sync::{Condvar, Mutex, MutexGuard, PoisonError};
use std::time::Instant;

/// Steps at a time: CI has two cores, and one of three steps usually waits for a browser, an emulator or a disk.
const LANES: usize = 3;
/// Beginning of the last lines of a step's output ([`alone`]).
const FAILED: &str = "step failed: ";
const CPU: &str = "step used CPU seconds: ";

/// A step that has ended.
#[derive(Clone, Debug, Default)]
pub(super) struct Done {
    pub(super) name: &'static str,
    /// Elapsed time, s.
    pub(super) wall: f64,
    /// Processor time of all processes of the step, s; unknown if the system does not provide it.
    pub(super) cpu: Option<f64>,
    /// The reason, for a step that failed.
    pub(super) failure: Option<String>,
    /// Everything that the step printed.
    pub(super) output: String,
}

#[derive(Default)]
struct Progress {
    started: Vec<&'static str>,
    done: Vec<Done>,
}

/// Runs the steps: always the first one that need not wait. Returns them in the order in which they ended.
pub(super) fn run(steps: &[&'static Step]) -> Result<Vec<Done>> {
    let folder = target().join("ci");
    std::fs::create_dir_all(&folder)?;
    // A step may rebuild this program.
    let program = folder.join("xtask");
    // The copy of a stopped run may still be running, so it is removed before the new copy.
    let _ = std::fs::remove_file(&program);
    std::fs::copy(std::env::current_exe()?, &program).context("could not copy this program")?;
    let (progress, changed) = (Mutex::new(Progress::default()), Condvar::new());
    std::thread::scope(|scope| {
        for _ in 0..LANES {
            scope.spawn(|| {
                while let Some((step, broken)) = next(steps, &progress, &changed) {
                    let started = Instant::now();
                    println!("-- {} starts", step.name);
                    let mut done = match broken {
                        Some(need) => Done {
                            failure: Some(format!("not run: `{need}` failed")),
                            ..Done::default()
                        },
                        None => process(step, &program, &folder).unwrap_or_else(|error| Done {
                            failure: Some(format!("{error:#}")),
                            ..Done::default()
                        }),
                    };
                    (done.name, done.wall) = (step.name, started.elapsed().as_secs_f64());
                    let mut now = lock(&progress);
                    println!("\n== {}\n{}{}", step.name, done.output, done.line());
                    now.done.push(done);
                    changed.notify_all();
                }
            });
        }
    });
    let progress = progress.into_inner();
    Ok(progress.unwrap_or_else(PoisonError::into_inner).done)
}

fn lock(progress: &Mutex<Progress>) -> MutexGuard<'_, Progress> {
    progress.lock().unwrap_or_else(PoisonError::into_inner)
}

/// The next step that can start; or a step that cannot run, with the failed step that it needs.
fn next(
    steps: &[&'static Step],
    progress: &Mutex<Progress>,
    changed: &Condvar,
) -> Option<(&'static Step, Option<&'static str>)> {
    let mut now = lock(progress);
    while now.started.len() < steps.len() {
        if let Some(step) = steps.iter().find(|step| now.is_ready(step, steps)) {
            now.started.push(step.name);
            let failed = |need: &&&str| {
                let is_it = |done: &Done| done.name == **need && done.failure.is_some();
                now.done.iter().any(is_it)
            };
            return Some((step, step.after.iter().find(failed).copied()));
        }
        now = changed.wait(now).unwrap_or_else(PoisonError::into_inner);
    }
    None
}

impl Progress {
    /// Whether the step has not started, its resource is free, and all steps that it must follow have ended or were not
    /// requested.
    fn is_ready(&self, step: &Step, chosen: &[&Step]) -> bool {
        let has_ended = |name: &str| self.done.iter().any(|done| done.name == name);
        let has_started = |name: &str| self.started.contains(&name);
        let is_there = |name: &&str| has_ended(name) || chosen.iter().all(|s| s.name != *name);
        let blocks = |other: &&Step| {
            step.room.is_some()
                && other.room == step.room
                && has_started(other.name)
                && !has_ended(other.name)
        };
        !has_started(step.name) && step.after.iter().all(is_there) && !chosen.iter().any(blocks)
    }
}

/// Runs a step in a separate process.
fn process(step: &Step, program: &Path, folder: &Path) -> Result<Done> {
    let path = folder.join(step.name.replace(' ', "-") + ".log");
    let log = File::create(&path).with_context(|| path.display().to_string())?;
    let mut command = Command::new(program);
    command.args(["ci", step.name]).stdin(Stdio::null());
    if step.after.contains(&BUILD) {
        command.env(crate::shell::BUILT, "1");
    }
    let status = command.stderr(log.try_clone()?).stdout(log).status()?;
    let output = String::from_utf8_lossy(&std::fs::read(&path)?).into_owned();
    let said = |begins: &str| {
        let line = output
            .lines()
            .rev()
            .find_map(|line| line.strip_prefix(begins));
        line.map(str::to_owned)
    };
    let failure = (!status.success()).then(|| said(FAILED).unwrap_or_else(|| status.to_string()));
    Ok(Done {
        cpu: said(CPU).and_then(|seconds| seconds.parse().ok()),
        failure,
        output,
        ..Done::default()
    })
}

/// Runs a step in this process: `ci` with one name. Its last output line is read by [`process`].
pub(super) fn alone(step: &Step) -> Result<()> {
    let result = (step.run)();
    if let Err(error) = &result {
        println!("{FAILED}{}", format!("{error:#}").replace('\n', " "));
    }
    if let Some(seconds) = cpu_seconds() {
        println!("{CPU}{seconds:.1}");
    }
    result
}

/// Processor time of this process and of those that it waited for, s. Linux provides it in ticks of 10 ms.
fn cpu_seconds() -> Option<f64> {
    let stat = std::fs::read_to_string("/proc/self/stat").ok()?;
    // After the name, which may contain blanks: the state is the first field, and the four times are the 12th to
    // 15th.
    let (_, fields) = stat.rsplit_once(')')?;
    let times = fields.split_whitespace().skip(11).take(4);
    let ticks: u64 = times
        .map(|ticks| ticks.parse::<u64>().ok())
        .sum::<Option<u64>>()?;
    Some(ticks as f64 / 100.0)
}

impl Done {
    /// Line of the step in the summary.
    pub(super) fn line(&self) -> String {
        let verdict = if self.failure.is_some() {
            "FAILED"
        } else {
            "ok"
        };
        let cpu = self
            .cpu
            .map_or(String::new(), |cpu| format!("{cpu:7.1} s of CPU"));
        let why = self.failure.as_deref().unwrap_or_default();
        let line = format!(
            "  {verdict:<7} {:<16} {:7.1} s {cpu}  {why}",
            self.name, self.wall
        );
        line.trim_end().to_owned()
    }
}

#[cfg(test)]
mod tests {
    use super::super::Room;
    use super::*;

    const fn step(name: &'static str, after: &'static [&'static str], room: Option<Room>) -> Step {
        let run = || Ok(());
        Step {
            name,
            after,
            room,
            run,
        }
    }

    static STEPS: [Step; 4] = [
        step("late", &["early"], None),
        step("early", &["not asked for"], Some(Room::Host)),
        step("in the same room", &[], Some(Room::Host)),
        step("free", &[], Some(Room::Firmware)),
    ];

    #[test]
    fn a_step_waits_for_those_before_it_and_for_its_room() {
        let steps: Vec<&'static Step> = STEPS.iter().collect();
        let (progress, changed) = (Mutex::new(Progress::default()), Condvar::new());
        let start = || {
            let (step, broken) = next(&steps, &progress, &changed)?;
            Some((step.name, broken))
        };
        let end = |name: &'static str, failure: Option<&str>| {
            lock(&progress).done.push(Done {
                name,
                failure: failure.map(str::to_owned),
                ..Done::default()
            });
        };
        assert_eq!(start(), Some(("early", None)));
        assert_eq!(start(), Some(("free", None)));
        end("early", Some("broken"));
        assert_eq!(start(), Some(("late", Some("early"))));
        assert_eq!(start(), Some(("in the same room", None)));
        assert_eq!(start(), None);
    }

    #[test]
    fn time_of_the_processor_is_counted() {
        if Path::new("/proc/self/stat").exists() {
            let before = cpu_seconds().expect("ticks");
            let started = Instant::now();
            while cpu_seconds().expect("ticks") < before + 0.05 {
                assert!(started.elapsed().as_secs() < 60, "it stands still");
            }
        }
    }
}
