//! Release files for people without a compiler: an archive with the program, its completions, manual pages,
//! licences and list of parts, and a Python wheel with the same contents. Each is tested after it was made. The
//! network is used only for crates that `cargo fetch` has not downloaded yet.

mod notices;
mod sbom;
mod tried;

use crate::Task;
use crate::shell::{command, output, program, root, run, target};
use anyhow::{Context, Result, ensure};
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};

pub(crate) const TASK: Task = Task {
    name: "release",
    does: "makes target/release-files: archive, wheel, parts list, checksums; installs and tests them",
    run: release,
};

/// The project's files that the archive contains in addition to the program.
const TEXTS: [&str; 5] = [
    "README.md",
    "CHANGELOG.md",
    "CITATION.cff",
    "LICENSE-MIT",
    "LICENSE-APACHE",
];

/// Shells, and the file name of each script.
const SHELLS: [(&str, &str); 3] = [
    ("bash", "host-fit.bash"),
    ("zsh", "_host-fit"),
    ("fish", "host-fit.fish"),
];

const PARTS: &str = "host-fit.cdx.json";
const NOTICES: &str = "THIRD-PARTY.txt";

/// The files of a release.
struct Made {
    version: String,
    archive: PathBuf,
    wheel: PathBuf,
}

pub(crate) fn release(arguments: &[String]) -> Result<()> {
    ensure!(arguments.is_empty(), "there are no options");
    let made = make()?;
    tried::archive(&made)?;
    tried::wheel(&made)?;
    for file in [&made.archive, &made.wheel] {
        let size = std::fs::metadata(file)?.len();
        println!("{} {:.1} MB", file.display(), size as f64 * 1e-6);
    }
    Ok(())
}

fn make() -> Result<Made> {
    let built = program()?.get_program().to_owned();
    let said = output(Command::new(&built).arg("--version"))?;
    let version = said
        .trim()
        .strip_prefix("host-fit ")
        .context("its version")?
        .to_owned();
    let triple = triple()?;

    let folder = target().join("release-files");
    if folder.exists() {
        std::fs::remove_dir_all(&folder)?;
    }
    let name = format!("host-fit-{version}-{triple}");
    let unpacked = folder.join(&name);
    std::fs::create_dir_all(unpacked.join("completions"))?;
    std::fs::create_dir_all(unpacked.join("man"))?;
    // The archive contains the program without its symbols.
    run(command("strip", &["-o"])
        .arg(unpacked.join("host-fit"))
        .arg(&built))?;
    let own = || Command::new(unpacked.join("host-fit"));
    for (shell, file) in SHELLS {
        let script = output(own().args(["completions", shell]))?;
        std::fs::write(unpacked.join("completions").join(file), script)?;
    }
    output(
        own()
            .args(["man-pages", "-o"])
            .arg(unpacked.join("man/man1")),
    )?;
    for text in TEXTS {
        std::fs::copy(root().join(text), unpacked.join(text)).context(text)?;
    }
    let tree = sbom::Parts::new(&triple)?;
    std::fs::write(unpacked.join(NOTICES), notices::text(&tree)?)?;
    let parts = tree.document()?;
    std::fs::write(unpacked.join(PARTS), &parts)?;
    std::fs::write(folder.join(format!("{name}.cdx.json")), &parts)?;

    let archive = folder.join(format!("{name}.tar.gz"));
    pack(&folder, &name, &archive)?;
    let python = crate::setup::python()?;
    let script = root().join("xtask/src/release/wheel.py");
    let mut write = command(python, &[]);
    write.arg(script).arg(&unpacked).arg(&version).arg(&folder);
    let wheel = folder.join(output(&mut write)?.trim());
    checksums(&folder, python)?;
    Ok(Made {
        version,
        archive,
        wheel,
    })
}

fn triple() -> Result<String> {
    let about = output(&mut command("rustc", &["-vV"]))?;
    let triple = about.lines().find_map(|line| line.strip_prefix("host: "));
    Ok(triple.context("`rustc -vV` names no host")?.to_owned())
}

/// Packs a folder without times and owners, so that equal files give equal bytes.
fn pack(folder: &Path, name: &str, archive: &Path) -> Result<()> {
    let mut tar = command(
        "tar",
        &["--create", "--sort=name", "--mtime=1980-01-01 00:00:00Z"],
    );
    tar.args([
        "--owner=0",
        "--group=0",
        "--numeric-owner",
        "--mode=go=rX,u+rw",
    ]);
    let mut tar = tar
        .arg("--directory")
        .arg(folder)
        .arg(name)
        .stdout(Stdio::piped())
        .spawn()?;
    let from = tar.stdout.take().context("tar's output")?;
    let to = std::fs::File::create(archive)?;
    let packed = command("gzip", &["--no-name", "--stdout"])
        .stdin(from)
        .stdout(to)
        .status()?;
    ensure!(
        tar.wait()?.success() && packed.success(),
        "tar or gzip failed"
    );
    Ok(())
}

/// `SHA256SUMS`, as `sha256sum --check` takes it.
fn checksums(folder: &Path, python: &str) -> Result<()> {
    let mut names: Vec<String> = Vec::new();
    for entry in std::fs::read_dir(folder)? {
        let entry = entry?;
        if entry.file_type()?.is_file() {
            names.push(entry.file_name().to_string_lossy().into_owned());
        }
    }
    names.sort();
    let script = "import hashlib, sys\nfor name in sys.argv[1:]:\n    \
                  print(hashlib.sha256(open(name, 'rb').read()).hexdigest() + '  ' + name)";
    let mut sum = command(python, &["-c", script]);
    let sums = output(sum.args(&names).current_dir(folder))?;
    std::fs::write(folder.join("SHA256SUMS"), sums)?;
    Ok(())
}
