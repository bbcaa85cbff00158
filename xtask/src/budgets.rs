//! Compares what the processor-in-the-loop run measured with
//! `firmware/budgets.toml`.

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
    instructions_per_step: BTreeMap<String, f64>,
}

/// Runs the processor in the loop and checks what it took.
pub(crate) fn check() -> Result<()> {
    let path = root().join("firmware/budgets.toml");
    let text = std::fs::read_to_string(&path)
        .with_context(|| format!("could not read {}", path.display()))?;
    let budgets: Budgets = toml::from_str(&text).context("firmware/budgets.toml")?;
    let exceeded = exceeded(&budgets, &pil(&[])?);
    if !exceeded.is_empty() {
        bail!("over budget: {}", exceeded.join("; "));
    }
    Ok(())
}

fn exceeded(budgets: &Budgets, outcome: &Outcome) -> Vec<String> {
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
        (
            "stack_bytes",
            f64::from(outcome.stack),
            Some(budgets.stack_bytes),
        ),
    ];
    for case in &outcome.cases {
        let limit = budgets.instructions_per_step.get(case.case).copied();
        rows.push((case.case, case.mean, limit));
    }
    rows.into_iter()
        .filter_map(|(name, found, limit)| match limit {
            Some(limit) if found <= limit * (1.0 + budgets.tolerance) => None,
            Some(limit) => Some(format!("{name} {found:.0} of {limit:.0}")),
            None => Some(format!("{name} has no budget")),
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::firmware::Size;
    use crate::pil::Measured;

    #[test]
    fn what_exceeds_its_budget_is_named() {
        let budgets = Budgets {
            tolerance: 0.1,
            flash_bytes: 100.0,
            ram_bytes: 100.0,
            stack_bytes: 100.0,
            instructions_per_step: BTreeMap::from([("full model".to_owned(), 10.0)]),
        };
        let case = |case, mean| Measured { case, mean };
        let outcome = Outcome {
            cases: vec![case("full model", 10.9), case("law", 1.0)],
            stack: 110,
            size: Size { flash: 111, ram: 5 },
        };
        assert_eq!(
            exceeded(&budgets, &outcome),
            ["flash_bytes 111 of 100", "law has no budget"]
        );
    }
}
