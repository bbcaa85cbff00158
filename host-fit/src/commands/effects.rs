//! `host-fit effects`: the catalogue of physical effects.

use anyhow::Context;
use host_fit::extend::nearest_name;
use host_fit::steps::{base_terms, catalogue};

use super::Console;
use super::effect_names::EffectName;
use super::words::{Words, effect_table};

/// Base terms that are lags of the recursion and have no card in the catalogue.
const FLOW_TERMS: &str = "flow-lag         flow   a second lag in series: T2·q̇ = u − q; q replaces u in the \
                          recursion\nflow-memory      flow   a later lag of y: a·y(t − T) is added to the \
                          recursion";

/// List the catalogue of effects, and the terms of base models.
///
/// Example: host-fit effects plenum-droop
#[derive(Debug, clap::Args)]
pub(crate) struct Args {
    /// Only this effect, with its equation and parameters.
    #[arg(value_name = "NAME", value_parser = EffectName, hide_possible_values = true)]
    name: Option<String>,
}

/// Runs the command.
pub(crate) fn run(args: &Args, console: Console) -> anyhow::Result<()> {
    let effects = catalogue();
    let Some(name) = &args.name else {
        console.say(&effect_table(&effects))?;
        console.say(
            "\nTerms of base models: `identify` adds a term if it lowers the validation error enough. `diagnose` \
             never reports these terms as missing.",
        )?;
        console.say(&effect_table(&base_terms()))?;
        console.say(FLOW_TERMS)?;
        return console.document(&effects);
    };
    let effects = [effects, base_terms()].concat();
    let known: Vec<&str> = effects.iter().map(|effect| effect.name).collect();
    let named = effects.iter().find(|effect| effect.name == name);
    let effect = named.with_context(|| nearest_name(name, &known))?;
    console.say(&effect.words())?;
    console.document(effect)
}
