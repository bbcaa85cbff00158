//! The rules of all modules.

use std::fmt::Write as _;

use crate::rules::{Change, ChangeError, Rulebook};
use crate::{
    curves, data, delay, design, diagnose, discover, excitation, experiment, fit, identify, model,
    power, preparation, residual, search, simulate, terms,
};

macro_rules! books {
    ($($room:ident),+) => {
        /// The rules in force of all modules, in the order of the workflow.
        #[must_use]
        pub fn rulebooks() -> Vec<Rulebook> {
            vec![$($room::RULES.book()),+]
        }

        /// All rules with their built-in values.
        fn built_in() -> Vec<Rulebook> {
            vec![$($room::Rules::BUILT_IN.book()),+]
        }
    };
}

books!(
    data,
    preparation,
    excitation,
    delay,
    identify,
    search,
    model,
    simulate,
    fit,
    residual,
    terms,
    curves,
    diagnose,
    discover,
    power,
    experiment,
    design
);

/// The change of a rule that `NAME=VALUE` specifies.
///
/// # Errors
/// [`ChangeError`].
pub fn rule_change(text: &str) -> Result<Change, ChangeError> {
    Change::read(text, &built_in())
}

/// The page `docs/rules.md` and those of the folder `docs/rules`, one per module: names within `docs`, and texts.
#[must_use]
pub fn rules_pages() -> Vec<(String, String)> {
    let mut head = "# Rules: every threshold, what it decides and where it comes from\n\n\
         Written by `BLESS=1 cargo test --release -p host-fit --test rules_page` from the code; `host-fit rules` prints the same.\n\
         `--set NAME=VALUE` on any command gives a rule another value for that run (NAME is `group.rule`, or the rule alone).\n\n\
         A value is a convention, or it was tuned on the named data, or it is a judgement without measurements.\n\n\
         | group | rules | subject |\n|---|---|---|\n"
        .to_owned();
    let mut pages = Vec::new();
    for book in rulebooks() {
        let Rulebook { room, about, rules } = book;
        let _ = writeln!(
            head,
            "| [{room}](rules/{room}.md) | {} | {about} |",
            rules.len()
        );
        let mut page = format!(
            "# Rules of {room}\n\n{about} All groups: [rules](../rules.md).\n\n\
             | rule | value | decides | comes from |\n|---|---|---|---|\n"
        );
        for rule in &rules {
            let value = match rule.unit {
                "" => rule.value.to_string(),
                unit => format!("{} {unit}", rule.value),
            };
            let cells = [&rule.name, &value, &rule.meaning, rule.calibrated];
            let cells = cells.map(|cell| cell.replace('|', "\\|"));
            let _ = writeln!(page, "| {} |", cells.join(" | "));
        }
        pages.push((format!("rules/{room}.md"), page));
    }
    pages.insert(0, ("rules.md".to_owned(), head));
    pages
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::rules::Value;
    use std::collections::BTreeSet;

    #[test]
    fn every_rule_says_what_it_decides_and_where_its_value_comes_from() {
        for book in rulebooks() {
            let mut names = BTreeSet::new();
            assert!(book.about.ends_with('.'), "{}", book.room);
            for rule in &book.rules {
                let twice = !names.insert(&rule.name);
                assert!(!twice, "{} twice in {}", rule.name, book.room);
                assert!(
                    [".", "…"].iter().any(|e| rule.meaning.ends_with(e)),
                    "{rule:?}"
                );
                assert!(!rule.calibrated.is_empty(), "{rule:?}");
                // Names of times end in their unit, which code needs and the table does not.
                let time = rule.unit == "s" || rule.unit.starts_with("s ");
                assert_eq!(rule.name.ends_with("-s"), time, "{rule:?}");
            }
        }
    }

    #[test]
    fn the_words_of_a_rule_are_its_documentation() {
        let book = residual::RULES.book();
        let least = book.rules.iter().find(|r| r.name == "least-excess");
        let least = least.expect("the rule");
        assert_eq!(least.value, Value::Number(residual::RULES.least_excess));
        assert_eq!(
            least.meaning,
            "The error is above the noise only if the unexplained variance is at least this share of the noise variance, the uncertainty of `y_sd`."
        );
    }
}
