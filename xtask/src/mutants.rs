//! Mutation tests: changes of single expressions in the law, the effects and the loop, each of which a test must notice.

use crate::Task;
use crate::shell::{cargo, command, run, target};
use anyhow::{Context, Result, bail};
use std::fs;

pub(crate) const TASK: Task = Task {
    name: "mutants",
    does: "runs the tests of model-core and firmware on mutants of the law, the effects and the loop; mutants that are \
         equivalent are listed with reasons in .cargo/mutants.toml; --sample N/M: only this part of them",
    run: mutants,
};

/// Common options. Doc-tests take longer than all other tests and are left out.
const OPTIONS: [&str; 5] = [
    "--in-place",
    "--timeout=60",
    "--cargo-test-arg=--lib",
    "--colors=never",
    "--no-shuffle",
];

fn mutants(arguments: &[String]) -> Result<()> {
    let sample = match arguments {
        [] => None,
        [name, sample] if name == "--sample" => Some(format!("--shard={sample}")),
        _ => bail!("the only option is --sample N/M, such as 0/8"),
    };
    let installed = cargo("mutants --version").output();
    if !installed.is_ok_and(|output| output.status.success()) {
        bail!("cargo-mutants is missing; install it with `cargo install --locked cargo-mutants`");
    }
    // The mutants are made in a copy of the files that git knows, as they are committed or staged.
    let folder = target().join("mutants");
    let copy = folder.join("copy");
    fs::create_dir_all(&copy)?;
    let prefix = format!("--prefix={}/", copy.display());
    run(&mut command(
        "git",
        &["checkout-index", "--all", "--force", &prefix],
    ))?;
    let with = |line: &str, workspace: &str, name: &str| {
        let mut mutants = cargo(line);
        mutants.args(OPTIONS).args(&sample);
        mutants.arg("--output").arg(folder.join(name));
        mutants.current_dir(copy.join(workspace));
        mutants.env_remove("CARGO_TARGET_DIR");
        run(&mut mutants).with_context(|| {
            format!("mutants of {name}; those that no test noticed are in target/mutants/{name}")
        })
    };
    let core = "mutants --profile=release --package=model-core --file=model-core/src/control/**/*.rs \
                --file=model-core/src/effects/**/*.rs";
    let ends = [
        with(core, "", "model-core"),
        with("mutants --package=firmware", "firmware", "firmware"),
    ];
    ends.into_iter().collect()
}
