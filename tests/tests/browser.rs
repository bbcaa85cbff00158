//! Report and workbench in a real browser. They need chromium and the packages of `host-fit/web`, so they run where those
//! are: `cargo xtask browser`.

use std::io::{BufRead as _, BufReader};
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};

use scenarios::browser::{Browser, Page};
use scenarios::program;
use serde_json::Value;

fn root() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("..")
}

/// Where the pictures go: artefacts of CI, to be looked at.
fn shots(name: &str) -> PathBuf {
    let folder = program()
        .parent()
        .expect("target/release")
        .join("../browser");
    folder.join(name)
}

fn run(arguments: &[&Path]) {
    let output = Command::new(program())
        .args(arguments)
        .output()
        .expect("the program starts");
    assert!(
        output.status.success(),
        "{}",
        String::from_utf8_lossy(&output.stderr)
    );
}

/// WCAG 2.1 A and AA, as far as a machine can tell.
fn accessible(browser: &mut Browser, page: &Page) {
    let path = root().join("host-fit/web/node_modules/axe-core/axe.min.js");
    let axe = std::fs::read_to_string(path).expect("axe-core: run `cargo xtask pages`");
    browser.eval(page, &format!("{axe};1")).expect("axe");
    let found = browser
        .eval(page, "axe.run(document, {runOnly: ['wcag2a', 'wcag2aa', 'wcag21a', 'wcag21aa']}).then(r => r.violations.map(v => v.id + ': ' + v.nodes.length + ' ' + v.nodes[0].html.slice(0, 160) + ' ' + v.nodes[0].failureSummary))")
        .expect("axe runs");
    assert_eq!(found, Value::Array(Vec::new()), "{found:#}");
}

#[test]
#[ignore = "needs chromium: cargo xtask browser"]
fn a_report_is_looked_along() {
    let folder = tempfile::tempdir().expect("a folder");
    let page_file = folder.path().join("report.html");
    let model = root().join("data/paper/table-2-state-dependent.toml");
    let data = root().join("data/hidden-ramp");
    run(&[
        Path::new("compare"),
        &model,
        &data,
        Path::new("--report"),
        &page_file,
    ]);
    let address = format!("file://{}", page_file.display());
    let mut b = Browser::start().expect("chromium");
    let page = b.open(&address, (1100, 1000), false).expect("a page");
    b.wait(&page, "hostFit.groups[0].charts.length === 8", 20)
        .expect("records");
    accessible(&mut b, &page);
    b.screenshot(&page, &shots("report-light.png"))
        .expect("a picture");

    // A bar lights up its samples, and the address keeps it.
    let to_record = "document.querySelectorAll('.record')[6].scrollIntoView()";
    b.eval(&page, "document.querySelector('[data-bar=\"0:2\"]').dispatchEvent(new MouseEvent('click', {bubbles: true}))").expect("a bar");
    b.eval(
        &page,
        &format!("hostFit.groups[0].view.show(2, 4); {to_record}"),
    )
    .expect("a view");
    b.wait(
        &page,
        "location.hash.includes('g1.bar=0:2') && location.hash.includes('g1.t=2..4')",
        5,
    )
    .expect("the address");
    b.wait(
        &page,
        "document.querySelectorAll('.record')[6].querySelectorAll('canvas').length === 2",
        10,
    )
    .expect("a chart");
    // Lit samples are painted at the top of the chart, in a colour that nothing else has there.
    let painted = "(() => { const c = document.querySelectorAll('.record')[6].querySelector('canvas'); const d = c.getContext('2d').getImageData(0, 12, c.width, 1).data; let n = 0; for (let i = 0; i < d.length; i += 4) if (d[i] > 150 && d[i + 1] < 110 && d[i + 2] < 40 && d[i + 3] > 200) n++; return n; })()";
    b.wait(&page, &format!("{painted} > 3"), 10)
        .expect("lit samples");

    // Pointing reads values, in every record, and marks the bars of the sample.
    let middle = b.eval(&page, "(() => { const r = document.querySelectorAll('.record')[6].querySelector('.u-over').getBoundingClientRect(); return [r.x + r.width / 2, r.y + r.height / 2]; })()").expect("a place");
    b.mouse(
        &page,
        middle[0].as_f64().expect("x"),
        middle[1].as_f64().expect("y"),
        false,
    )
    .expect("a mouse");
    b.wait(&page, "[...document.querySelectorAll('.readout')].filter(r => /^t 3\\.0\\d* s/.test(r.textContent)).length === 8", 5).expect("values");
    b.wait(
        &page,
        "document.querySelectorAll('.bar.here').length > 2",
        5,
    )
    .expect("bars of the sample");
    b.screenshot(&page, &shots("report-lit.png"))
        .expect("a picture");

    // By keyboard: along, in, out, whole.
    b.eval(&page, "document.querySelectorAll('.record')[6].focus()")
        .expect("focus");
    for key in ["+", "PageDown", "ArrowRight"] {
        b.key(&page, key).expect("a key");
    }
    b.wait(&page, "hostFit.groups[0].view.to - hostFit.groups[0].view.from < 1.01 && hostFit.groups[0].view.from > 2.9", 5).expect("zoomed");
    b.key(&page, "Home").expect("a key");
    b.wait(&page, "hostFit.groups[0].view.to > 9.9", 5)
        .expect("whole");

    // A figure as a file is what is drawn.
    b.eval(&page, "window.saved = []; const make = URL.createObjectURL; URL.createObjectURL = b => { saved.push(b); return make.call(URL, b); }; document.querySelectorAll('.record')[6].querySelectorAll('.save button').forEach(b => b.click())").expect("saving");
    b.wait(&page, "saved.length === 2", 20).expect("two files");
    let svg = b
        .eval(&page, "saved.find(b => b.type.includes('svg')).text()")
        .expect("SVG");
    let svg = svg.as_str().expect("text").to_owned();
    let drawn = svg.matches("<path").count();
    assert!(svg.starts_with("<svg") && drawn > 8, "{drawn} paths");
    assert!(!svg.contains("undefined") && !svg.contains("NaN"));

    // Pans smoothly: the page's own frame times, all that is in sight redrawn in each.
    let frames = b.eval(&page, "(async () => { const v = hostFit.groups[0].view; const times = []; let last = performance.now(); for (let i = 0; i < 60; i++) { v.show(i * 0.05, 5 + i * 0.05); await new Promise(r => requestAnimationFrame(r)); const now = performance.now(); times.push(now - last); last = now; } return times.sort((a, b) => a - b)[30]; })()").expect("frames");
    eprintln!("median frame {:.1} ms", frames.as_f64().unwrap_or(f64::NAN));
    assert_eq!(b.faults(), Vec::<String>::new());

    let dark = b.open(&address, (1100, 1000), true).expect("a page");
    accessible(&mut b, &dark);
    b.eval(&dark, to_record).expect("scrolled");
    b.wait(
        &dark,
        "document.querySelectorAll('.record')[6].querySelectorAll('canvas').length === 2",
        10,
    )
    .expect("a chart");
    b.screenshot(&dark, &shots("report-dark.png"))
        .expect("a picture");
    let phone = b.open(&address, (390, 840), false).expect("a page");
    b.eval(&phone, to_record).expect("scrolled");
    b.wait(
        &phone,
        "document.querySelectorAll('.record')[6].querySelectorAll('canvas').length === 2",
        10,
    )
    .expect("a chart");
    let wide = b
        .eval(&phone, "document.documentElement.scrollWidth")
        .expect("a width");
    assert!(
        wide.as_f64() <= Some(390.0),
        "the page is {wide} px wide on a phone"
    );
    b.screenshot(&phone, &shots("report-phone.png"))
        .expect("a picture");
    assert_eq!(b.faults(), Vec::<String>::new());
}

/// The program, serving; ends with this value, as abruptly as a power cut.
struct Served {
    child: Child,
    address: String,
}

impl Drop for Served {
    fn drop(&mut self) {
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

fn serve(project: &Path) -> Served {
    let mut child = Command::new(program())
        .args(["workbench", "--no-open", "--json"])
        .arg(root().join("data/hidden-ramp"))
        .arg("--project")
        .arg(project)
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
    Served { child, address }
}

const IDLE: &str = "document.getElementById('work').hidden";

#[test]
#[ignore = "needs chromium: cargo xtask browser"]
fn the_workbench_finds_what_is_missing_and_loses_nothing() {
    let folder = tempfile::tempdir().expect("a folder");
    let project = folder.path().join("project");
    let served = serve(&project);
    let mut b = Browser::start().expect("chromium");
    let page = b
        .open(&served.address, (1100, 1000), false)
        .expect("a page");
    b.wait(
        &page,
        "document.querySelectorAll('.record').length === 8",
        20,
    )
    .expect("the records");
    accessible(&mut b, &page);
    b.screenshot(&page, &shots("workbench-start.png"))
        .expect("a picture");

    // Identify, and see it at work.
    let identify = |evaluations: u32| {
        format!(
            "(() => {{ const f = document.getElementById('identify'); f.delay.value = 'fixed'; f.n1.value = 2; f.n2.value = 2; f.max_lag.value = 150; f.evaluations.value = {evaluations}; f.requestSubmit(); }})()"
        )
    };
    b.eval(&page, &identify(300)).expect("identify");
    b.wait(&page, "!document.getElementById('work').hidden", 20)
        .expect("it runs");
    b.wait(
        &page,
        &format!("{IDLE} && document.querySelectorAll('.model').length === 1"),
        300,
    )
    .expect("a model");
    b.wait(&page, "document.querySelectorAll('[data-bar]').length > 20 && document.querySelectorAll('.record').length === 8", 20).expect("where it fails");

    // Cancelled: the best so far is a model, too.
    b.eval(&page, &identify(1_000_000)).expect("identify");
    b.wait(
        &page,
        "document.getElementById('work-now').textContent.includes('best')",
        60,
    )
    .expect("progress");
    b.screenshot(&page, &shots("workbench-progress.png"))
        .expect("a picture");
    b.eval(&page, "document.getElementById('cancel').click()")
        .expect("cancel");
    b.wait(
        &page,
        &format!("{IDLE} && document.querySelectorAll('.model').length === 2"),
        300,
    )
    .expect("the best so far");
    b.eval(&page, "document.querySelectorAll('.model')[0].click()")
        .expect("back to the first");
    b.wait(
        &page,
        "document.querySelector('.model.current').textContent.startsWith('1.')",
        20,
    )
    .expect("chosen");

    // Killed while it works; another start on the folder has everything.
    b.eval(&page, &identify(1_000_000)).expect("identify");
    b.wait(&page, "!document.getElementById('work').hidden", 20)
        .expect("it runs");
    drop(served);
    b.wait(&page, "!document.getElementById('offline').hidden", 30)
        .expect("the page says so");
    b.screenshot(&page, &shots("workbench-offline.png"))
        .expect("a picture");
    b.faults();
    let served = serve(&project);
    let page = b
        .open(&served.address, (1100, 1000), false)
        .expect("a page");
    b.wait(&page, "document.querySelectorAll('.model').length === 2 && document.querySelector('.model.current').textContent.startsWith('1.')", 20).expect("nothing lost");
    // A second browser sees what the first does.
    let second = b.open(&served.address, (1100, 1000), true).expect("a page");

    b.eval(&page, "document.getElementById('diagnose').click()")
        .expect("diagnose");
    b.wait(
        &page,
        &format!("{IDLE} && document.querySelectorAll('#missing tbody tr').length > 2"),
        900,
    )
    .expect("candidates");
    b.wait(
        &second,
        "document.querySelectorAll('#missing tbody tr').length > 2",
        20,
    )
    .expect("the other browser");
    b.eval(
        &page,
        "document.getElementById('missing-section').scrollIntoView()",
    )
    .expect("scrolled");
    b.screenshot(&page, &shots("workbench-candidates.png"))
        .expect("a picture");
    b.eval(
        &page,
        "document.querySelector('#missing tbody button').click()",
    )
    .expect("add");
    b.wait(
        &page,
        &format!("{IDLE} && document.querySelectorAll('.model').length === 3"),
        900,
    )
    .expect("a better model");
    b.wait(
        &second,
        "document.querySelectorAll('.model').length === 3",
        20,
    )
    .expect("the other browser");
    let times_noise = b.eval(&page, "fetch('/api/state', {headers: {'x-token': new URLSearchParams(location.search).get('token')}}).then(r => r.json()).then(s => { const m = s.models.at(-1); return m.rmse / m.noise_rmse; })").expect("numbers");
    assert!(
        times_noise.as_f64() < Some(1.3),
        "the error is {times_noise} times the noise"
    );
    b.eval(
        &page,
        "document.getElementById('match-section').scrollIntoView()",
    )
    .expect("scrolled");
    b.screenshot(&page, &shots("workbench-ladder.png"))
        .expect("a picture");
    accessible(&mut b, &page);
    accessible(&mut b, &second);
    b.screenshot(&second, &shots("workbench-dark.png"))
        .expect("a picture");

    // Undo is the parent; what was made stays in the tree.
    b.eval(&page, "[...document.querySelectorAll('#models button')].find(x => x.textContent === 'Undo').click()").expect("undo");
    b.wait(&page, "document.querySelector('.model.current').textContent.startsWith('1.') && document.querySelectorAll('.model').length === 3", 20).expect("undone");
    b.eval(&page, "document.querySelectorAll('.model')[1].click()")
        .expect("redo");
    let constants = b.eval(&page, "fetch([...document.querySelectorAll('#models a')].find(a => a.textContent.includes('identified.rs')).href).then(r => r.text())").expect("constants");
    assert!(
        constants
            .as_str()
            .is_some_and(|text| text.contains("pub const")),
        "{constants}"
    );
    assert_eq!(b.faults(), Vec::<String>::new());

    // The command line goes on with the same folder.
    drop(served);
    run(&[
        Path::new("compare"),
        &project.join("model-3.toml"),
        &root().join("data/hidden-ramp"),
    ]);
}
