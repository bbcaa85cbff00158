//! `host-fit`: from recordings of an on/off actuator and a sensor to a model with delayed inputs.
//!
//! Exit code 0: done. 1: an error in the data, the model or the numbers; one paragraph on standard error states it with
//! the remedy. 2: wrong usage.

mod commands;
mod plants;
mod rig_port;

use std::io::Write;
use std::process::ExitCode;

use clap::{CommandFactory, Parser};
use commands::{Console, threads};
use host_fit::data::{memory, visible};
use host_fit::rules::{Change, change_for_this_run};
use host_fit::steps::rule_change;

#[derive(Debug, Parser)]
#[command(version, about, max_term_width = 100)]
struct Cli {
    /// Print one JSON document on standard output and nothing else.
    #[arg(long, global = true)]
    json: bool,
    /// Memory limit for data whose size a file or an option determines, in GB.
    #[arg(long, global = true, value_name = "GB", default_value = "2", value_parser = gigabytes)]
    memory: u64,
    /// Give a rule another value for this run (repeatable); `host-fit rules` lists them.
    #[arg(long, global = true, value_name = "NAME=VALUE", value_parser = rule_change)]
    set: Vec<Change>,
    #[command(subcommand)]
    command: Command,
}

#[derive(Debug, clap::Subcommand)]
enum Command {
    Demo(commands::demo::Args),
    Average(commands::average::Args),
    Import(Box<commands::import::Args>),
    Delay(commands::delay::Args),
    Design(commands::design::Args),
    Identify(Box<commands::identify::Args>),
    Compare(commands::compare::Args),
    Diagnose(commands::diagnose::Args),
    Discover(commands::discover::Args),
    Extend(commands::extend::Args),
    Simulate(commands::simulate::Args),
    Effects(commands::effects::Args),
    Rules(commands::rules::Args),
    Record(Box<commands::record::Args>),
    Watch(commands::watch::Args),
    Codegen(commands::codegen::Args),
    Workbench(commands::workbench::Args),
    Completions(commands::completions::Args),
    ManPages(commands::man_pages::Args),
}

/// Bytes in this many GB.
fn gigabytes(text: &str) -> Result<u64, String> {
    match text.parse::<f64>() {
        Ok(gb) if (0.1..=1000.0).contains(&gb) => Ok((gb * 1e9) as u64),
        _ => Err("a number of GB from 0.1 to 1000 is needed".into()),
    }
}

fn main() -> ExitCode {
    let cli = Cli::parse();
    memory::set_limit(cli.memory);
    for change in &cli.set {
        let _ = writeln!(std::io::stderr(), "{change}");
    }
    change_for_this_run(cli.set);
    threads::or_one();
    let console = Console { json: cli.json };
    let result = match &cli.command {
        Command::Demo(args) => commands::demo::run(args, console),
        Command::Average(args) => commands::average::run(args, console),
        Command::Import(args) => commands::import::run(args, console),
        Command::Delay(args) => commands::delay::run(args, console),
        Command::Design(args) => commands::design::run(args, console),
        Command::Identify(args) => commands::identify::run(args, console),
        Command::Compare(args) => commands::compare::run(args, console),
        Command::Diagnose(args) => commands::diagnose::run(args, console),
        Command::Discover(args) => commands::discover::run(args, console),
        Command::Extend(args) => commands::extend::run(args, console),
        Command::Simulate(args) => commands::simulate::run(args, console),
        Command::Effects(args) => commands::effects::run(args, console),
        Command::Rules(args) => commands::rules::run(args, console),
        Command::Record(args) => commands::record::run(args, console),
        Command::Watch(args) => commands::watch::run(args, console),
        Command::Codegen(args) => commands::codegen::run(args, console),
        Command::Workbench(args) => commands::workbench::run(args, console),
        Command::Completions(args) => commands::completions::run(args, Cli::command(), console),
        Command::ManPages(args) => commands::man_pages::run(args, Cli::command(), console),
    };
    match result {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            let _ = writeln!(
                std::io::stderr(),
                "error: {}",
                visible(&commands::paragraph(&error))
            );
            ExitCode::FAILURE
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_effect_s_name_may_be_one_that_the_shell_does_not_know() {
        let line = [
            "host-fit", "extend", "--effect", "my-own", "m.toml", "set", "-o", "n.toml",
        ];
        let cli = Cli::try_parse_from(line).expect("a command line");
        let Command::Extend(args) = cli.command else {
            panic!("another command");
        };
        assert_eq!(args.effects(), ["my-own"]);
        // A list of twenty names would hide the purpose of the option.
        let help = Cli::command()
            .find_subcommand_mut("extend")
            .expect("the command")
            .render_long_help()
            .to_string();
        assert!(!help.contains("valve-lag"), "{help}");
    }

    /// The help of every command contains an example, which is a valid command line.
    #[test]
    fn every_command_shows_an_example() {
        let mut program = Cli::command();
        for command in program.get_subcommands_mut() {
            let help = command.render_long_help().to_string();
            let name = command.get_name();
            let example = help
                .lines()
                .find_map(|line| line.strip_prefix("Example: "))
                .unwrap_or_else(|| panic!("`{name} --help` shows no example"));
            let words = example.split_whitespace().take_while(|word| *word != ">");
            let line: Vec<&str> = words.collect();
            assert_eq!(line[1], name, "{example}");
            if let Err(error) = Cli::try_parse_from(&line) {
                panic!("{example}: {error}");
            }
        }
    }
}
