//! Instructions of one step of Table II's model, compared with C by hand and with the exported C, in one QEMU run.

use crate::Task;
use crate::firmware::{BOARD_TARGET, qemu};
use crate::setup::cross_cargo;
use crate::shell::{cargo, command, firmware_target, output, root, run};
use anyhow::{Context, Result, bail};
use std::hash::{DefaultHasher, Hasher as _};
use std::io::Read;
use std::process::Stdio;

pub(crate) const TASK: Task = Task {
    name: "bench-step",
    does: "counts the instructions of a model step in model-core, in hand-written C (gcc -O3, newlib) and in exported C, under QEMU",
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
    let exported = folder.join("exported.c");
    run(cargo("run --release --quiet --package host-fit -- codegen")
        .arg(root().join("firmware/identified/models/full.toml"))
        .args(["--lang", "c", "-o"])
        .arg(&exported))?;
    version.write(&std::fs::read(&exported)?);
    let linked = folder.join(format!("peer-{:016x}.o", version.finish()));
    let mut objects = Vec::new();
    for (source, options) in [
        (&source, &["-O3"][..]),
        // These are the options that the page on exports recommends.
        (&exported, &["-std=c99", "-O2", "-ffp-contract=off"]),
    ] {
        let object = source.with_extension("o");
        let object = folder.join(object.file_name().context("a file")?);
        run(command("arm-none-eabi-gcc", &CPU)
            .args(options)
            .args(["-ffunction-sections", "-fdata-sections", "-c"])
            .arg(source)
            .arg("-o")
            .arg(&object))?;
        objects.push(object);
    }
    let library = |name: &str| {
        output(command("arm-none-eabi-gcc", &CPU).arg(format!("-print-file-name={name}")))
    };
    // Links only the parts of newlib that the step needs.
    run(command("arm-none-eabi-ld", &["-r", "-o"])
        .arg(&linked)
        .args(&objects)
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
    let mut bytes = [0; 36];
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
    let [
        steps,
        own,
        peer,
        exported,
        own_most,
        peer_most,
        exported_most,
        apart,
        differ,
    ] = words[..]
    else {
        bail!("the program sent unexpected data");
    };
    let instructions = |ticks: f64| ticks * 1.25 / steps;
    for (what, ticks, most) in [
        ("model-core", own, own_most),
        ("C by hand", peer, peer_most),
        ("C exported", exported, exported_most),
    ] {
        println!(
            "{what:<10} {:>7.1} instructions per step (allowed: {:.0}); model-core needs {:.3} times as many",
            instructions(ticks),
            most * 1.25,
            own / ticks
        );
    }
    println!(
        "largest difference of y from the hand-written C: {:.1e}",
        apart * 1e-9
    );
    if differ > 0.0 {
        bail!("the exported C differs from model-core in {differ} of {steps} steps");
    }
    println!("the exported C agrees bit for bit");
    Ok(())
}
