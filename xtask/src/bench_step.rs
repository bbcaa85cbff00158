//! Instructions of one step of Table II's model compared with a C implementation, in one QEMU run.

use crate::Task;
use crate::firmware::{BOARD_TARGET, qemu};
use crate::setup::cross_cargo;
use crate::shell::{command, firmware_target, output, root, run};
use anyhow::{Context, Result, bail};
use std::hash::{DefaultHasher, Hasher as _};
use std::io::Read;
use std::process::Stdio;

pub(crate) const TASK: Task = Task {
    name: "bench-step",
    does: "instructions of a model step, ours against C (gcc -O3, newlib), under QEMU",
    run: bench_step,
};

const CPU: [&str; 4] = [
    "-mcpu=cortex-m4",
    "-mthumb",
    "-mfloat-abi=hard",
    "-mfpu=fpv4-sp-d16",
];

fn bench_step(_arguments: &[String]) -> Result<()> {
    let folder = firmware_target().join("peer");
    std::fs::create_dir_all(&folder)?;
    let source = root().join("firmware/peer/step.c");
    // Cargo does not track linked objects: a new version gets a new name.
    let mut version = DefaultHasher::new();
    version.write(&std::fs::read(&source)?);
    let (object, linked) = (
        folder.join("step.o"),
        folder.join(format!("peer-{:016x}.o", version.finish())),
    );
    run(command("arm-none-eabi-gcc", &CPU)
        .args(["-O3", "-ffunction-sections", "-fdata-sections", "-c"])
        .arg(&source)
        .arg("-o")
        .arg(&object))?;
    let library = |name: &str| {
        output(command("arm-none-eabi-gcc", &CPU).arg(format!("-print-file-name={name}")))
    };
    // Links only the parts of newlib that the step needs.
    run(command("arm-none-eabi-ld", &["-r", "-o"])
        .arg(&linked)
        .arg(&object)
        .args([library("libm.a")?.trim(), library("libc.a")?.trim()]))?;
    let mut build = cross_cargo("build", BOARD_TARGET)?;
    build
        .args(["--package", "qemu-mps2", "--bin", "bench-step"])
        .args(["--features", "peer"])
        .current_dir(root().join("firmware"))
        .env("CARGO_TARGET_DIR", firmware_target())
        .env(
            "RUSTFLAGS",
            format!("-Clink-arg=-Tlink.x -Clink-arg={}", linked.display()),
        );
    run(&mut build)?;
    let elf = firmware_target()
        .join(BOARD_TARGET)
        .join("release/bench-step");
    let mut process = qemu(&elf)
        .stdin(Stdio::piped())
        .stdout(Stdio::piped())
        .spawn()
        .context("could not start qemu-system-arm; run `cargo xtask setup`")?;
    let mut bytes = [0; 24];
    let received = process
        .stdout
        .take()
        .context("QEMU has no output")
        .and_then(|mut from| Ok(from.read_exact(&mut bytes)?));
    let _ = process.kill();
    let _ = process.wait();
    received?;
    let words: Vec<f64> = bytes
        .chunks_exact(4)
        .filter_map(|word| Some(f64::from(u32::from_le_bytes(word.try_into().ok()?))))
        .collect();
    let [steps, own, peer, own_most, peer_most, apart] = words[..] else {
        bail!("the program sent something else");
    };
    let instructions = |ticks: f64| ticks * 1.25 / steps;
    println!(
        "ours: {:.1}, at most {:.0}\nC: {:.1}, at most {:.0}\nratio: {:.3}\nlargest difference of y: {:.1e}",
        instructions(own),
        own_most * 1.25,
        instructions(peer),
        peer_most * 1.25,
        own / peer,
        apart * 1e-9
    );
    Ok(())
}
