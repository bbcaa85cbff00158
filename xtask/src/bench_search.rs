//! Comparison of the delay search with NOMAD and a genetic algorithm on the same problem.

use crate::Task;
use crate::shell::{cargo, command, output, run, target};
use anyhow::{Context, Result, bail};
use std::collections::BTreeMap;

pub(crate) const TASK: Task = Task {
    name: "bench-search",
    does: "compares the delay search with NOMAD and differential evolution on paper-like sets [--sets 1,2,…] \
           [--seeds N] [--evaluations N] [--seconds N] [--ours]",
    run: bench,
};

const USAGE: &str = "usage: cargo xtask bench-search [--sets 1,2,…] [--seeds N] [--evaluations N] [--seconds N] [--ours]
  --sets         seeds of the paper-like sets to search (default 1)
  --seeds        runs of each method, with the seeds 0 … N−1 (default 3)
  --evaluations  largest number of evaluations of another optimiser (default 50000)
  --seconds      largest processor time of a run of another optimiser, in seconds (default 60)
  --ours         without the other optimisers";

/// One optimisation.
struct Run {
    evaluations: f64,
    value: f64,
    cpu_seconds: f64,
    by_itself: bool,
}

/// Options of the command line.
struct Request {
    sets: Vec<u64>,
    seeds: u64,
    evaluations: u64,
    seconds: u64,
    ours: bool,
}

impl Request {
    fn parse(arguments: &[String]) -> Result<Self> {
        let mut request = Self {
            sets: vec![1],
            seeds: 3,
            evaluations: 50_000,
            seconds: 60,
            ours: false,
        };
        let mut rest = arguments.iter();
        while let Some(option) = rest.next() {
            if option == "--ours" {
                request.ours = true;
                continue;
            }
            let value = rest.next().context(USAGE)?;
            match option.as_str() {
                "--sets" => {
                    let seeds = value.split(',').map(str::parse);
                    request.sets = seeds.collect::<Result<_, _>>().context(USAGE)?;
                }
                "--seeds" => request.seeds = value.parse().context(USAGE)?,
                "--evaluations" => request.evaluations = value.parse().context(USAGE)?,
                "--seconds" => request.seconds = value.parse().context(USAGE)?,
                _ => bail!("{USAGE}"),
            }
        }
        Ok(request)
    }
}

fn bench(arguments: &[String]) -> Result<()> {
    let request = Request::parse(arguments)?;
    run(&mut cargo("build --release -q -p host-fit -p firmware-sim"))?;
    let programs = target().join("release");
    let folder = target().join("bench-search");
    let python = folder.join("venv").join("bin").join("python");
    let path = |path: &std::path::Path| path.to_string_lossy().into_owned();
    if !python.exists() {
        let venv = path(&folder.join("venv"));
        run(&mut command("python3", &["-m", "venv", &venv]))?;
    }
    let requirements = [
        "-m",
        "pip",
        "install",
        "-q",
        "-r",
        "xtask/peers/requirements.txt",
    ];
    run(&mut command(&path(&python), &requirements))?;
    let mut lines = String::new();
    for set in &request.sets {
        let data = path(&folder.join(format!("set-{set}")));
        let seed = set.to_string();
        let simulator = path(&programs.join("firmware-sim"));
        run(&mut command(
            &simulator,
            &["paper-set", "--seed", &seed, "--out", &data],
        ))?;
        let mut search = command(&path(&python), &["xtask/peers/search_peers.py"]);
        search
            .args(["--dataset", &data])
            .args(["--host-fit", &path(&programs.join("host-fit"))])
            .args(["--seeds", &request.seeds.to_string()])
            .args(["--evaluations", &request.evaluations.to_string()])
            .args(["--seconds", &request.seconds.to_string()])
            .args(request.ours.then_some("--ours"))
            // Each run has one thread, so that processor time is comparable.
            .env("OMP_NUM_THREADS", "1");
        for line in output(&mut search)?.lines() {
            let (method, rest) = line.split_once(',').context("a line without fields")?;
            lines += &format!("{method},set {set} {rest}\n");
        }
    }
    print!("{}", table(&lines)?);
    Ok(())
}

/// The table from `method,problem,seed,evaluations,value,cpu,end` lines.
fn table(lines: &str) -> Result<String> {
    let mut problems: BTreeMap<&str, BTreeMap<&str, Vec<Run>>> = BTreeMap::new();
    for line in lines.lines() {
        let fields: Vec<&str> = line.split(',').collect();
        let [method, problem, _, evaluations, value, cpu, end] = fields.as_slice() else {
            bail!("not a line of the table: {line}");
        };
        let one = Run {
            evaluations: evaluations.parse()?,
            value: value.parse()?,
            cpu_seconds: cpu.parse()?,
            by_itself: *end == "itself",
        };
        problems
            .entry(problem)
            .or_default()
            .entry(method)
            .or_default()
            .push(one);
    }
    let mut text = String::new();
    for (problem, methods) in &problems {
        let all = || methods.values().flatten().map(|r| r.value);
        let best = all().fold(f64::INFINITY, f64::min);
        text += &format!("\n{problem}: best of all {best:.5}\n");
        text += &format!(
            "  {:<24}{:>5}{:>13}{:>11}{:>11}{:>11}{:>9}{:>9}{:>9}\n",
            "method",
            "runs",
            "evaluations",
            "lowest",
            "highest",
            "spread %",
            "CPU s",
            "most s",
            "stopped"
        );
        for (method, runs) in methods {
            let mean = |f: fn(&Run) -> f64| runs.iter().map(f).sum::<f64>() / runs.len() as f64;
            let most = |f: fn(&Run) -> f64| runs.iter().map(f).fold(f64::NEG_INFINITY, f64::max);
            let lowest = runs.iter().map(|r| r.value).fold(f64::INFINITY, f64::min);
            let highest = most(|r| r.value);
            // These are the runs that reached the limit or failed.
            let stopped = runs.iter().filter(|r| !r.by_itself).count();
            text += &format!(
                "  {method:<24}{:>5}{:>13.0}{lowest:>11.5}{highest:>11.5}{:>11.3}{:>9.2}{:>9.2}{stopped:>9}\n",
                runs.len(),
                mean(|r| r.evaluations),
                100.0 * (highest / lowest - 1.0),
                mean(|r| r.cpu_seconds),
                most(|r| r.cpu_seconds),
            );
        }
    }
    Ok(text)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn runs_are_grouped_and_judged_against_the_best() {
        let lines =
            "ours,p,0,10,1.0,0.5,itself\nours,p,1,30,1.1,1.5,itself\npeer,p,0,99,1.25,9.0,time\n";
        let table = table(lines).expect("lines are well-formed");
        assert!(table.contains("p: best of all 1.00000"));
        let words = |method: &str| -> Vec<String> {
            let line = table.lines().find(|l| l.contains(method));
            let words = line.expect("a line for each").split_whitespace();
            words.map(str::to_owned).collect()
        };
        assert_eq!(
            words("ours"),
            [
                "ours", "2", "20", "1.00000", "1.10000", "10.000", "1.00", "1.50", "0"
            ]
        );
        assert_eq!(words("peer").last().map(String::as_str), Some("1"));
        assert!(super::table("NOMAD says something").is_err());
    }

    #[test]
    fn the_request_has_defaults_and_refuses_what_it_does_not_know() {
        let parse = |line: &str| {
            let arguments: Vec<String> = line.split_whitespace().map(str::to_owned).collect();
            Request::parse(&arguments)
        };
        let request = parse("--sets 2,3 --ours").expect("both are known");
        assert_eq!(
            (request.sets, request.seeds, request.ours),
            (vec![2, 3], 3, true)
        );
        for wrong in ["--sets", "--sets a", "--fast 3", "7"] {
            assert!(parse(wrong).is_err(), "{wrong}");
        }
    }
}
