//! `host-fit effects`: the catalogue of physical effects.

use anyhow::Context;
use host_fit::extend::nearest_name;
use host_fit::steps::catalogue;

use super::Console;
use super::words::{Words, effect_table};

/// List the physical effects that can be missing, and added.
#[derive(Debug, clap::Args)]
pub(crate) struct Args {
    /// Only this effect, with its equation and parameters.
    #[arg(value_name = "NAME")]
    name: Option<String>,
}

/// Runs the command.
pub(crate) fn run(args: &Args, console: Console) -> anyhow::Result<()> {
    let effects = catalogue();
    let Some(name) = &args.name else {
        console.say(&effect_table(&effects))?;
        return console.document(&effects);
    };
    let known: Vec<&str> = effects.iter().map(|effect| effect.name).collect();
    let named = effects.iter().find(|effect| effect.name == name);
    let effect = named.with_context(|| nearest_name(name, &known))?;
    console.say(&effect.words())?;
    console.document(effect)
}
