//! Report and workbench in a real browser. The tests need chromium and the packages of `host-fit/web`, so they run
//! only with `cargo xtask browser`, which leaves pictures in `target/browser`.

mod bench;
mod files;
mod pictures;
mod print;
mod report;
mod speed;
mod tab;
mod terms;

use std::io::{BufRead, BufReader};
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::time::Instant;

use scenarios::program;
use serde_json::Value;

use tab::{Tab, Window};

fn root() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("..")
}

/// Runs the program on files and options, from the project's root: a page that prints short paths does not depend on where
/// the project lies.
#[track_caller]
fn run(arguments: &[&dyn AsRef<std::ffi::OsStr>]) {
    let output = Command::new(program())
        .current_dir(root())
        .args(arguments.iter().map(|a| a.as_ref()))
        .output()
        .expect("the program starts");
    assert!(
        output.status.success(),
        "{}",
        String::from_utf8_lossy(&output.stderr)
    );
}

/// Half of the records of the bundled ramp with a hidden effect: the same answers in a fifth of the time.
fn ramp(folder: &Path) -> PathBuf {
    let bundled = root().join("data/hidden-ramp");
    let data = folder.join("ramp");
    std::fs::create_dir_all(&data).expect("a folder");
    let mut manifest = "title = \"Half of a ramp\"\nsample_period_s = 0.001\n".to_owned();
    for (name, role) in RECORDS {
        let file = format!("{name}.csv");
        std::fs::copy(bundled.join(&file), data.join(&file)).expect("a record");
        manifest.push_str(&format!(
            "[[record]]\nname = \"{name}\"\nfile = \"{file}\"\nuse = \"{role}\"\n"
        ));
    }
    std::fs::write(data.join("dataset.toml"), manifest).expect("a manifest");
    data
}

/// The records of [`ramp`].
const RECORDS: [(&str, &str); 4] = [
    ("sq4-50", "identify"),
    ("random-a", "identify"),
    ("sq8-80", "validate"),
    ("random-b", "validate"),
];

/// Path of a picture to be inspected.
fn picture(name: &str) -> PathBuf {
    let folder = program()
        .parent()
        .expect("target/release")
        .join("../browser");
    folder.join(name)
}

/// A running workbench. When this value is dropped, the workbench ends as abruptly as in a power
/// cut.
struct Served {
    child: Child,
    address: String,
    /// Time from the start of the program to the line with its address, s.
    ready_s: f64,
}

impl Drop for Served {
    fn drop(&mut self) {
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

fn serve(project: &Path, rest: &[&dyn AsRef<std::ffi::OsStr>]) -> Served {
    let started = Instant::now();
    let mut child = Command::new(program())
        .args(["workbench", "--no-open", "--json", "--project"])
        .arg(project)
        .args(rest.iter().map(|a| a.as_ref()))
        .stdout(Stdio::piped())
        .spawn()
        .expect("the program starts");
    let mut out = BufReader::new(child.stdout.take().expect("its output"));
    let mut text = String::new();
    while !text.trim_end().ends_with('}') {
        assert!(out.read_line(&mut text).expect("a line") > 0, "{text}");
    }
    let told: Value = serde_json::from_str(&text).expect("one JSON document");
    let address = told["address"].as_str().expect("an address").to_owned();
    assert!(address.starts_with("http://127.0.0.1:"));
    Served {
        child,
        address,
        ready_s: started.elapsed().as_secs_f64(),
    }
}

/// Largest time of a page's thread per frame on any machine, ms: at 30 frames a second a frame lasts 33.
const SLOWEST_FRAME: f64 = 80.0;

/// Size of a window, px.
const SIZE: (u32, u32) = (1100, 1000);

/// A short identification.
fn identify(evaluations: u32) -> String {
    identify_lags(2, 150, evaluations)
}

/// An identification that takes longer than the test.
fn identify_for_long() -> String {
    identify_lags(10, 500, 1_000_000)
}

fn identify_lags(lags: u32, longest: u32, evaluations: u32) -> String {
    format!(
        "(() => {{ const f = document.getElementById('identify').elements; f.delay.value = 'state-dependent'; f.n1.value = {lags}; f.n2.value = {lags}; f['max-lag'].value = {longest}; f.evaluations.value = {evaluations}; f.n1.form.requestSubmit(); }})()"
    )
}

/// Prints the duration of a step.
struct Steps(Instant);

impl Steps {
    fn new(test: &str) -> Self {
        eprintln!("{test}");
        Self(Instant::now())
    }

    fn done(&mut self, what: &str) {
        eprintln!("  {:6.1} s  {what}", self.0.elapsed().as_secs_f64());
        self.0 = Instant::now();
    }
}
