//! Fuzzing of every reader of untrusted input; run by `cargo xtask fuzz`.

use std::process::ExitCode;
use std::time::Duration;

use clap::Parser;
use host_fit::data::memory;
use scenarios::fuzz::{TARGETS, Target, corpus, fuzz};

/// Tries mutated input on each target for some time. An input that causes a failure is stored with the tests.
#[derive(Parser)]
struct Args {
    /// Total duration in minutes, shared by the targets.
    #[arg(long, default_value_t = 1.0)]
    minutes: f64,
    /// Seed of the mutations.
    #[arg(long, default_value_t = 0)]
    seed: u64,
    /// Targets [default: all].
    targets: Vec<String>,
}

fn main() -> ExitCode {
    let args = Args::parse();
    let wanted = |target: &&Target| {
        args.targets.is_empty() || args.targets.iter().any(|name| name == target.name)
    };
    let targets: Vec<&Target> = TARGETS.iter().filter(wanted).collect();
    if targets.is_empty() {
        let names: Vec<&str> = TARGETS.iter().map(|target| target.name).collect();
        eprintln!("the targets are {}", names.join(", "));
        return ExitCode::from(2);
    }
    // Memory limit for small inputs.
    memory::set_limit(200_000_000);
    std::panic::set_hook(Box::new(|_| {}));
    let time = Duration::from_secs_f64((60.0 * args.minutes / targets.len() as f64).max(0.1));
    let mut broken = 0;
    for target in targets {
        let outcome = fuzz(target, time, args.seed);
        println!(
            "{:8} {:>9} inputs, {:>4} different answers",
            target.name, outcome.executions, outcome.said
        );
        if let Some((input, how)) = outcome.broken {
            broken += 1;
            let hash = input.iter().fold(0xcbf2_9ce4_8422_2325_u64, |hash, byte| {
                (hash ^ u64::from(*byte)).wrapping_mul(0x100_0000_01b3)
            });
            let path = corpus(target).join(format!("{hash:016x}"));
            let kept = std::fs::create_dir_all(corpus(target))
                .and_then(|()| std::fs::write(&path, &input));
            println!(
                "  BROKEN: {how}\n  input: {} {}",
                path.display(),
                kept.err().map_or(String::new(), |e| e.to_string())
            );
        }
    }
    if broken > 0 {
        ExitCode::FAILURE
    } else {
        ExitCode::SUCCESS
    }
}
