//! Our search, NOMAD and a genetic search on the same delay problem, in one run.

use crate::Task;
use crate::shell::{cargo, command, output, root, run};
use anyhow::{Context, Result, bail};
use std::collections::BTreeMap;

pub(crate) const TASK: Task = Task {
    name: "bench-search",
    does: "ours, NOMAD and differential evolution on one paper-like set [SET_SEED] [SEARCH_SEEDS] [--ours]",
    run: bench,
};

/// One optimisation.
struct Run {
    evaluations: f64,
    value: f64,
    cpu_seconds: f64,
}

fn bench(arguments: &[String]) -> Result<()> {
    let (options, numbers): (Vec<&String>, Vec<&String>) =
        arguments.iter().partition(|a| a.starts_with("--"));
    if options.iter().any(|o| *o != "--ours") || numbers.len() > 2 {
        bail!("usage: cargo xtask bench-search [SET_SEED] [SEARCH_SEEDS] [--ours]");
    }
    let set = numbers.first().map_or("1", |s| s.as_str());
    let seeds = numbers.get(1).map_or("3", |s| s.as_str());
    let folder = root().join("target").join("bench-search");
    std::fs::create_dir_all(&folder)
        .with_context(|| format!("cannot create {}", folder.display()))?;
    let file = folder.join(format!("set-{set}.csv"));
    let file = file.to_string_lossy();
    let example = [
        "run",
        "--release",
        "-q",
        "-p",
        "host-fit",
        "--example",
        "search_table",
        "--",
    ];
    let ours: Vec<&str> = example
        .into_iter()
        .chain([file.as_ref(), set, seeds])
        .collect();
    let mut lines = output(&mut cargo(&ours))?;
    if options.is_empty() {
        let python = folder.join("venv").join("bin").join("python");
        if !python.exists() {
            run(&mut command(
                "python3",
                &["-m", "venv", &folder.join("venv").to_string_lossy()],
            ))?;
        }
        let python = python.to_string_lossy().into_owned();
        let requirements = "xtask/peers/requirements.txt";
        run(&mut command(
            &python,
            &["-m", "pip", "install", "-q", "-r", requirements],
        ))?;
        lines += &output(&mut command(
            &python,
            &["xtask/peers/search_peers.py", &file, seeds],
        ))?;
    }
    print!("{}", table(&lines)?);
    Ok(())
}

/// The paper's kind of table from `method,problem,seed,evaluations,value,cpu` lines.
fn table(lines: &str) -> Result<String> {
    let mut problems: BTreeMap<&str, BTreeMap<&str, Vec<Run>>> = BTreeMap::new();
    for line in lines.lines() {
        let fields: Vec<&str> = line.split(',').collect();
        let [method, problem, _, evaluations, value, cpu] = fields.as_slice() else {
            // NOMAD prints lines of its own.
            continue;
        };
        let one = Run {
            evaluations: evaluations.parse()?,
            value: value.parse()?,
            cpu_seconds: cpu.parse()?,
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
            "  {:<24}{:>5}{:>13}{:>11}{:>11}{:>9}{:>9}{:>9}\n",
            "method", "runs", "evaluations", "lowest", "highest", "above %", "CPU s", "most s"
        );
        for (method, runs) in methods {
            let mean = |f: fn(&Run) -> f64| runs.iter().map(f).sum::<f64>() / runs.len() as f64;
            let most = |f: fn(&Run) -> f64| runs.iter().map(f).fold(f64::NEG_INFINITY, f64::max);
            let lowest = runs.iter().map(|r| r.value).fold(f64::INFINITY, f64::min);
            let highest = most(|r| r.value);
            text += &format!(
                "  {method:<24}{:>5}{:>13.0}{lowest:>11.5}{highest:>11.5}{:>9.3}{:>9.2}{:>9.2}\n",
                runs.len(),
                mean(|r| r.evaluations),
                100.0 * (highest / best - 1.0),
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
        let lines = "ours,p,0,10,1.0,0.5\nours,p,1,30,1.1,1.5\nnoise\npeer,p,0,99,1.25,9.0\n";
        let table = table(lines).expect("lines are well-formed");
        assert!(table.contains("p: best of all 1.00000"));
        let ours = table
            .lines()
            .find(|l| l.contains("ours"))
            .expect("a line for ours");
        let words: Vec<&str> = ours.split_whitespace().collect();
        assert_eq!(
            words,
            [
                "ours", "2", "20", "1.00000", "1.10000", "10.000", "1.00", "1.50"
            ]
        );
    }
}
