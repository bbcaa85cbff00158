//! Runs the hidden-effects campaign and prints its table.
//!
//! `hidden-effects [--draws N] [--nulls N] [--pairs N] [--seed N] [--only TEXT]`

use scenarios::campaign;
use std::process::ExitCode;

const USAGE: &str =
    "usage: hidden-effects [--draws N] [--nulls N] [--pairs N] [--seed N] [--only TEXT]";

fn main() -> ExitCode {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let known = ["--draws", "--nulls", "--pairs", "--seed", "--only"];
    let names = arguments.iter().step_by(2);
    if !arguments.len().is_multiple_of(2)
        || !names.clone().all(|name| known.contains(&name.as_str()))
    {
        eprintln!("{USAGE}");
        return ExitCode::from(2);
    }
    let value = |name: &str| {
        let at = arguments.iter().position(|argument| argument == name)?;
        arguments.get(at + 1).cloned()
    };
    let number = |name: &str, default: u64| {
        value(name).map_or(Ok(default), |text| text.parse::<u64>().map_err(|_| text))
    };
    let numbers = [
        ("--draws", 5),
        ("--nulls", 20),
        ("--pairs", 8),
        ("--seed", 1),
    ]
    .map(|(name, default)| number(name, default));
    let [Ok(draws), Ok(nulls), Ok(pairs), Ok(seed)] = numbers else {
        eprintln!("hidden-effects: --draws, --nulls, --pairs and --seed take whole numbers");
        return ExitCode::from(2);
    };
    let only = value("--only").unwrap_or_default();
    let cases = campaign::cases(draws, nulls, pairs, seed);
    let mut outcomes = Vec::new();
    for case in cases
        .iter()
        .filter(|case| case.hidden.label().contains(&only))
    {
        match campaign::run(case) {
            Ok(outcome) => {
                let parameters: Vec<String> = outcome
                    .parameters
                    .iter()
                    .map(|(name, truth, found)| format!("{name} {truth:.4} -> {found:.4}"))
                    .collect();
                eprintln!(
                    "{} {} #{}: {} | {:.2} -> {:.2} x noise, {:.0} s | {} | {}",
                    if outcome.is_found() { "ok  " } else { "MISS" },
                    case.hidden.label(),
                    case.seed,
                    campaign::said(&outcome),
                    outcome.base_over_noise,
                    outcome.over_noise,
                    outcome.seconds,
                    outcome.group.join(" "),
                    parameters.join(", ")
                );
                outcomes.push(outcome);
            }
            Err(error) => eprintln!("FAIL {} #{}: {error}", case.hidden.label(), case.seed),
        }
    }
    print!("{}", campaign::table(&outcomes));
    ExitCode::SUCCESS
}
