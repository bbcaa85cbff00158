//! Tests of the release files as a user would use them: unpacked or installed elsewhere, without the project's
//! sources.

use super::{Made, NOTICES, PARTS, SHELLS, TEXTS};
use crate::shell::{command, exists, output, root, run};
use anyhow::{Context, Result, ensure};
use serde_json::Value;
use std::path::{Path, PathBuf};
use std::process::Command;

/// Lines of the README that install the wheel and use it: this one and the two below it.
const FIRST_LINE: &str = "    pip install ";

/// A folder that is removed when the trial ends.
struct Elsewhere(PathBuf);

impl Elsewhere {
    fn new(name: &str) -> Result<Self> {
        let path = std::env::temp_dir().join(format!("{name}-{}", std::process::id()));
        std::fs::create_dir_all(&path)?;
        Ok(Self(path))
    }
}

impl Drop for Elsewhere {
    fn drop(&mut self) {
        let _ = std::fs::remove_dir_all(&self.0);
    }
}

pub(super) fn archive(made: &Made) -> Result<()> {
    let elsewhere = Elsewhere::new("archive")?;
    let folder = &elsewhere.0;
    run(command("tar", &["--extract", "--gzip", "--file"])
        .arg(&made.archive)
        .arg("--directory")
        .arg(folder))?;
    let name = made
        .archive
        .file_name()
        .context("its name")?
        .to_string_lossy();
    let unpacked = folder.join(name.trim_end_matches(".tar.gz"));
    let program = unpacked.join("host-fit");
    let said =
        |arguments: &[&str]| output(Command::new(&program).args(arguments).current_dir(folder));
    ensure!(
        said(&["--version"])?.trim() == format!("host-fit {}", made.version),
        "its version"
    );

    // Every command must have a manual page and must be in the completion scripts.
    let help = said(&["--help"])?;
    let commands = help.lines().skip_while(|line| *line != "Commands:").skip(1);
    let commands: Vec<&str> = commands
        .take_while(|line| !line.is_empty())
        .filter_map(|line| line.strip_prefix("  ")?.split_whitespace().next())
        .filter(|name| *name != "help")
        .collect();
    ensure!(
        commands.len() > 10,
        "`host-fit --help` names {} commands",
        commands.len()
    );
    let read =
        |path: &Path| std::fs::read_to_string(path).with_context(|| path.display().to_string());
    let scripts = SHELLS.map(|(_, file)| read(&unpacked.join("completions").join(file)));
    for name in &commands {
        let page = read(&unpacked.join(format!("man/man1/host-fit-{name}.1")))?;
        ensure!(
            page.contains(".SH SYNOPSIS"),
            "the page of `{name}` has no synopsis"
        );
        for (script, (shell, _)) in scripts.iter().zip(SHELLS) {
            let script = script
                .as_ref()
                .map_err(|error| anyhow::anyhow!("{error:#}"))?;
            ensure!(script.contains(name), "{shell} does not complete `{name}`");
            ensure!(
                script.contains("plenum-droop"),
                "{shell} does not complete names of effects"
            );
        }
    }
    if exists("bash") {
        completes(&unpacked, folder)?;
    }
    for text in TEXTS {
        ensure!(unpacked.join(text).is_file(), "the archive has no {text}");
    }
    let parts: Value = serde_json::from_str(&read(&unpacked.join(PARTS))?)?;
    let parts = parts["components"].as_array().map_or(0, Vec::len);
    ensure!(parts > 50, "{PARTS} lists {parts} crates");
    // The licences include those of crates deep in the dependency tree, and of the pages' library.
    let notices = read(&unpacked.join(NOTICES))?;
    for part in ["faer ", "serde_core "] {
        ensure!(notices.contains(part), "{NOTICES} does not name {part}");
    }
    let locators = read(&unpacked.join(PARTS))?;
    for part in ["pkg:cargo/faer@", "pkg:npm/uplot@"] {
        ensure!(locators.contains(part), "{PARTS} does not list {part}");
    }
    println!(
        "archive: {} commands with pages and completions, {parts} crates listed",
        commands.len()
    );
    Ok(())
}

/// Requests completions from bash as its Tab key does.
fn completes(unpacked: &Path, folder: &Path) -> Result<()> {
    std::fs::write(folder.join("model.toml"), "")?;
    for (words, expected) in [
        (&["host-fit", "diagn"][..], "diagnose"),
        (&["host-fit", "extend", "--effect", "plen"], "plenum-droop"),
        (&["host-fit", "simulate", "mod"], "model.toml"),
        (&["host-fit", "codegen", "--lang", "py"], "python"),
    ] {
        // If a script offers nothing, `-o default` makes bash offer files.
        let (last, before) = (words.len() - 1, words.len() - 2);
        let ask = format!(
            "shopt -s progcomp; . \"$1\"; shift; COMP_WORDS=(\"$@\"); COMP_CWORD={last}\n\
             with=$(complete -p host-fit); with=${{with##*-F }}; word=${{COMP_WORDS[{last}]}}\n\
             ${{with%% *}} host-fit \"$word\" \"${{COMP_WORDS[{before}]}}\"\n\
             [ ${{#COMPREPLY[@]}} -gt 0 ] || COMPREPLY=($(compgen -f -- \"$word\"))\n\
             printf '%s\\n' \"${{COMPREPLY[@]}}\""
        );
        let mut bash = Command::new("bash");
        bash.args(["--norc", "-c", &ask, "bash"])
            .arg(unpacked.join("completions/host-fit.bash"));
        let found = output(bash.args(words).current_dir(folder))?;
        ensure!(
            found.lines().any(|line| line == expected),
            "bash completes `{}` with `{}`, not with {expected}",
            words.join(" "),
            found.trim()
        );
    }
    Ok(())
}

/// The README's recipe in a fresh virtual environment without network access.
pub(super) fn wheel(made: &Made) -> Result<()> {
    let readme = std::fs::read_to_string(root().join("README.md"))?;
    let lines = readme
        .lines()
        .skip_while(|line| !line.starts_with(FIRST_LINE))
        .take(3);
    let recipe: Vec<&str> = lines.filter_map(|line| line.strip_prefix("    ")).collect();
    let [install, export, simulate] = recipe[..] else {
        anyhow::bail!(
            "README.md does not contain the three lines that begin with `{}`",
            FIRST_LINE.trim()
        );
    };

    let elsewhere = Elsewhere::new("wheel")?;
    let folder = &elsewhere.0;
    let environment = folder.join("venv");
    let python = crate::setup::python()?;
    // NumPy of the system is used and not downloaded.
    run(command(python, &["-m", "venv", "--system-site-packages"]).arg(&environment))?;
    std::fs::create_dir_all(folder.join("out/demo"))?;
    // This model replaces the demo's model, which would take a minute to identify.
    std::fs::copy(
        root().join("data/paper/table-2-state-dependent.toml"),
        folder.join("out/demo/hidden-after.toml"),
    )?;
    std::fs::copy(
        &made.wheel,
        folder.join(made.wheel.file_name().context("its name")?),
    )?;
    let path = std::env::join_paths([environment.join("bin"), "/usr/bin".into(), "/bin".into()])?;
    let said = |line: &str| {
        let mut shell = Command::new("sh");
        shell
            .args(["-e", "-c", line])
            .current_dir(folder)
            .env("PATH", &path);
        output(
            shell
                .env("PIP_NO_INDEX", "1")
                .env("PIP_DISABLE_PIP_VERSION_CHECK", "1"),
        )
    };
    said(install)?;
    let found = said("command -v host-fit")?;
    ensure!(
        Path::new(found.trim()) == environment.join("bin/host-fit"),
        "host-fit is {found}"
    );
    let version = said("host-fit --version")?;
    ensure!(
        version.trim() == format!("host-fit {}", made.version),
        "its version is {version}"
    );
    said(export)?;
    let last = said(simulate)?;
    let last: f64 = last
        .trim()
        .parse()
        .with_context(|| format!("`{simulate}` prints {last}"))?;

    // The program's own free run over the same command.
    let mut input = "t,u\n".to_owned();
    for k in 0..2000 {
        input.push_str(&format!("{},1\n", f64::from(k) * 1e-3));
    }
    std::fs::write(folder.join("ones.csv"), input)?;
    said("host-fit simulate out/demo/hidden-after.toml ones.csv -o ones-out.csv")?;
    let run = std::fs::read_to_string(folder.join("ones-out.csv"))?;
    let expected = run
        .lines()
        .last()
        .and_then(|line| line.rsplit(',').next()?.parse::<f64>().ok());
    let expected = expected.context("the free run has no last sample")?;
    ensure!(
        (last - expected).abs() <= 1e-9 * expected.abs(),
        "the exported model ends at {last}, the program's at {expected}"
    );
    said("pip uninstall --yes host-fit")?;
    ensure!(
        !environment.join("bin/host-fit").exists(),
        "the program is still there after `pip uninstall`"
    );
    println!(
        "wheel: installed, exported, simulated: y = {last} after 2000 samples, equal to the program's"
    );
    Ok(())
}
