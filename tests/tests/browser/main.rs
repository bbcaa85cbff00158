//! Report and workbench in a real browser. The tests need chromium and the packages of `host-fit/web`, so they run
//! only with `cargo xtask browser`, which leaves pictures in `target/browser`.

mod bench;
mod files;
mod pictures;
mod print;
mod report;
mod speed;
mod terms;

use std::io::{BufRead, BufReader};
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::time::Instant;

use scenarios::browser::{Browser, Page};
use scenarios::program;
use serde_json::Value;

use pictures::shoot;

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

/// Half of the records of the bundled ramp with a hidden effect, which says as much in a fifth of the time.
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

/// Evaluates an expression on a page.
#[track_caller]
fn act(b: &mut Browser, page: &Page, expression: &str) -> Value {
    b.eval(page, expression).expect("an expression of the test")
}

/// Waits until an expression is true; the time limit is generous for an idle machine.
#[track_caller]
fn until(b: &mut Browser, page: &Page, seconds: u64, expression: &str) {
    const BUSY: u64 = 3;
    if let Err(error) = b.wait(page, expression, BUSY * seconds) {
        let said = b.eval(
            page,
            "document.getElementById('message')?.textContent ?? ''",
        );
        let _ = b.screenshot(page, &picture("failed.png"));
        panic!("{error}; the page says {said:?}");
    }
}

/// Path of a picture to be inspected.
fn picture(name: &str) -> PathBuf {
    let folder = program()
        .parent()
        .expect("target/release")
        .join("../browser");
    folder.join(name)
}

/// WCAG 2.1 A and AA, as far as a program can check them.
#[track_caller]
fn accessible(b: &mut Browser, page: &Page) {
    let path = root().join("host-fit/web/node_modules/axe-core/axe.min.js");
    let axe = std::fs::read_to_string(path).expect("axe-core: run `cargo xtask pages`");
    act(b, page, &format!("{axe};1"));
    let found = act(
        b,
        page,
        "axe.run(document, {runOnly: ['wcag2a', 'wcag2aa', 'wcag21a', 'wcag21aa']}).then(r => r.violations.map(v => v.id + ': ' + v.nodes.length + ' ' + v.nodes[0].html.slice(0, 160) + ' ' + v.nodes[0].failureSummary))",
    );
    assert_eq!(found, Value::Array(Vec::new()), "{found:#}");
}

/// No page is wider than a phone.
#[track_caller]
fn fits(b: &mut Browser, page: &Page, width: f64) {
    let wide = act(b, page, "document.documentElement.scrollWidth");
    assert!(wide.as_f64() <= Some(width), "{wide} px wide on {width} px");
}

/// Words in pictures are at least 11 px high as they are seen, and nothing of them is cut off at the picture's edge.
#[track_caller]
fn readable(b: &mut Browser, page: &Page) {
    let wrong = act(
        b,
        page,
        "[...document.querySelectorAll('figure svg')].filter(s => s.clientWidth > 0).flatMap(s => { const box = s.getBoundingClientRect(), scale = box.width / s.viewBox.baseVal.width; return [...s.querySelectorAll('text')].flatMap(t => { const r = t.getBoundingClientRect(), px = scale * Number(t.getAttribute('font-size')); return px < 11 ? [`${px.toFixed(1)} px: ${t.textContent}`] : r.left < box.left - 1 || r.right > box.right + 1 || t.textContent.endsWith('…') ? [`cut: ${t.textContent}`] : []; }); })",
    );
    assert_eq!(wrong, Value::Array(Vec::new()), "{wrong:#}");
}

/// The workbench, serving; ends with this value, as abruptly as a power cut.
struct Served {
    child: Child,
    address: String,
    /// From the start to the address, s.
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

/// No task runs, and there are this many models.
fn idle_with(models: usize) -> String {
    format!(
        "document.getElementById('work').hidden && document.querySelectorAll('.model').length === {models}"
    )
}

/// Pans the records of a page, with everything in sight redrawn in each frame. Returns the milliseconds of the
/// page's own thread per frame, and the duration of a frame by this machine's clock under its present load.
fn panned(b: &mut Browser, page: &Page) -> f64 {
    const FRAMES: u32 = 120;
    let before = b.worked(page).expect("its time");
    let frame = act(
        b,
        page,
        &format!(
            "(async () => {{ const v = hostFit.groups[0].view; const times = []; let last = performance.now(); for (let i = 0; i < {FRAMES}; i++) {{ v.show(i * 0.03, 5 + i * 0.03); await new Promise(r => requestAnimationFrame(r)); const now = performance.now(); times.push(now - last); last = now; }} return times.sort((a, b) => a - b)[{FRAMES} / 2]; }})()"
        ),
    );
    let worked = b.worked(page).expect("its time") - before;
    let (own, clock) = (
        1000.0 * worked / f64::from(FRAMES),
        frame.as_f64().expect("ms"),
    );
    eprintln!("  panned: {own:.1} ms of the page's thread in a frame; {clock:.1} ms by the clock");
    own
}

/// Largest time of a page's thread per frame on any machine, ms: at 30 frames a second a frame lasts 33.
const SLOWEST_FRAME: f64 = 80.0;

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
