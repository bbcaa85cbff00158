//! Compares the figures of the processor-in-the-loop run with `firmware/budgets.toml`.

use crate::firmware::{BOARDS, Size, build, size};
use crate::pil::{Outcome, pil};
use crate::shell::root;
use anyhow::{Context, Result, bail};
use serde::Deserialize;
use std::collections::BTreeMap;

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Budgets {
    tolerance: f64,
    flash_bytes: f64,
    ram_bytes: f64,
    stack_bytes: f64,
    board_flash_bytes: f64,
    instructions_per_step: BTreeMap<String, f64>,
    /// Largest count in a single sample, for some cases.
    most_instructions: BTreeMap<String, f64>,
}

/// Budget of all cases with this prefix without a budget of their own.
const EFFECT: &str = "effect_";

/// Runs the processor in the loop and checks its figures.
pub(crate) fn check() -> Result<()> {
    let path = root().join("firmware/budgets.toml");
    let text = std::fs::read_to_string(&path)
        .with_context(|| format!("could not read {}", path.display()))?;
    let budgets: Budgets = toml::from_str(&text).context("firmware/budgets.toml")?;
    // Must run before other constants replace the bundled ones.
    let board = size(&build(BOARDS[0], BOARDS[0], &[], None)?)?;
    let outcome = pil(&[])?;
    let exceeded = exceeded(&budgets, &outcome, board);
    if !exceeded.is_empty() {
        bail!("over budget: {}", exceeded.join("; "));
    }
    Ok(())
}

fn exceeded(budgets: &Budgets, outcome: &Outcome, board: Size) -> Vec<String> {
    let mut rows = vec![
        (
            "flash_bytes",
            outcome.size.flash as f64,
            Some(budgets.flash_bytes),
        ),
        (
            "ram_bytes",
            outcome.size.ram as f64,
            Some(budgets.ram_bytes),
        ),
        ("stack_bytes", outcome.stack, Some(budgets.stack_bytes)),
        (
            "board_flash_bytes",
            board.flash as f64,
            Some(budgets.board_flash_bytes),
        ),
    ];
    for (case, mean) in &outcome.cases {
        let limits = &budgets.instructions_per_step;
        let of_all = || {
            case.starts_with(EFFECT)
                .then(|| limits.get(EFFECT))
                .flatten()
        };
        let limit = limits.get(case).or_else(of_all).copied();
        rows.push((case, *mean, limit));
    }
    let rows = rows
        .into_iter()
        .filter_map(|(name, found, limit)| match limit {
            Some(limit) if found <= limit * (1.0 + budgets.tolerance) => None,
            Some(limit) => Some(format!("{name} {found:.0} of {limit:.0}")),
            None => Some(format!("{name} has no budget")),
        });
    // The worst sample has no tolerance, because a step must fit into its sample.
    let worst = budgets
        .most_instructions
        .iter()
        .filter_map(|(case, limit)| {
            let found = outcome.most.get(case).copied().unwrap_or(f64::INFINITY);
            (found > *limit).then(|| {
                format!("{case}: {found:.0} instructions in the worst sample, allowed {limit:.0}")
            })
        });
    rows.chain(worst).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_exceeds_its_budget_is_named() {
        let budgets = Budgets {
            tolerance: 0.1,
            flash_bytes: 100.0,
            ram_bytes: 100.0,
            stack_bytes: 100.0,
            board_flash_bytes: 100.0,
            instructions_per_step: [("base", 10.0), (EFFECT, 20.0), ("effect_own", 30.0)]
                .map(|(name, limit)| (name.to_owned(), limit))
                .into(),
            most_instructions: [("base", 20.0), ("law", 40.0)]
                .map(|(name, limit)| (name.to_owned(), limit))
                .into(),
        };
        let means = [
            ("base", 10.9),
            ("effect_new", 23.0),
            ("effect_own", 30.0),
            ("law", 1.0),
        ];
        let outcome = Outcome {
            cases: means.map(|(name, mean)| (name.to_owned(), mean)).into(),
            most: [("base", 20.0), ("law", 41.0)]
                .map(|(name, most)| (name.to_owned(), most))
                .into(),
            stack: 110.0,
            size: Size { flash: 111, ram: 5 },
        };
        assert_eq!(
            exceeded(&budgets, &outcome, Size { flash: 112, ram: 5 }),
            [
                "flash_bytes 111 of 100",
                "board_flash_bytes 112 of 100",
                "effect_new 23 of 20",
                "law has no budget",
                "law: 41 instructions in the worst sample, allowed 40"
            ]
        );
    }
}
