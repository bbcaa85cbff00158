//! The complete workflow on the bundled set with a hidden effect.

use std::process::Command;

use super::{SIZE, Steps, Window, identify, identify_for_long, ramp, root, run, serve};

const CURRENT: &str = "document.querySelector('.model.current')?.textContent";

#[test]
#[ignore = "needs chromium: cargo xtask browser"]
fn the_workbench_finds_what_is_missing_and_loses_nothing() {
    let folder = tempfile::tempdir().expect("a folder");
    let project = folder.path().join("project");
    let data = ramp(folder.path());
    let mut steps = Steps::new("the whole way");
    let served = serve(&project, &[&data]);
    eprintln!("  {:6.1} s  from start to address", served.ready_s);
    let b = Window::start();
    steps.done("server and browser start");
    let page = b.open(&served.address, SIZE);
    page.has(20, ".record", 4);
    steps.done("the set is on the page");
    page.accessible();
    page.shoot("workbench-start.png");
    // The border of a pane can be moved to make the pane wider.
    let wider = "(() => { const pane = document.getElementById('left'), before = pane.offsetWidth; document.querySelector('[data-pane=left]').dispatchEvent(new KeyboardEvent('keydown', {key: 'ArrowRight'})); const by = pane.offsetWidth - before; document.querySelector('[data-pane=left]').dispatchEvent(new KeyboardEvent('keydown', {key: 'ArrowLeft'})); return by; })()";
    assert_eq!(page.act(wider), 20);

    // Identify, and watch the search.
    page.act(&identify(300));
    page.idles_with(300, 1);
    page.until(20, "document.querySelectorAll('[data-bar]').length > 20 && document.querySelectorAll('.record').length === 4");
    steps.done("identified");

    // After a cancellation the best model so far remains. The curve of the search's progress advances.
    page.act(&identify_for_long());
    page.says(60, "#work-now", "best");
    page.until(60, "document.querySelector('#curve canvas') !== null");
    // The best model so far is drawn over the records, and changes during the search.
    let drawn = "hostFit.groups[0].charts.filter(c => c.best).length === 4 && document.querySelector('.switches').textContent.includes('best so far')";
    page.until(60, drawn);
    page.scroll_to("#records-section");
    page.until(20, "hostFit.groups[0].charts.some(c => c.plots[0]?.series.some(s => s.label === 'best so far'))");
    page.shoot("workbench-progress.png");
    let name = page.text("#work-name");
    assert!(name.starts_with("host-fit identify ") && name.contains("--evaluations=1000000"));
    page.click("#cancel");
    page.idles_with(300, 2);
    page.until(
        20,
        "!document.querySelector('.switches').textContent.includes('best so far')",
    );
    steps.done("cancelled");
    page.act("document.querySelectorAll('.model')[0].click()");
    page.until(20, &format!("{CURRENT}.startsWith('1.')"));

    // The server is killed during a step; a new server on the folder has all results.
    page.act(&identify_for_long());
    page.until(20, "!document.getElementById('work').hidden");
    drop(served);
    page.until(30, "!document.getElementById('offline').hidden");
    page.shoot("workbench-offline.png");
    // The page continues to send requests, as intended; their errors are not failures.
    page.close();
    b.faults();
    let served = serve(&project, &[&data]);
    let page = b.open(&served.address, SIZE);
    page.until(
        20,
        &format!("document.querySelectorAll('.model').length === 2 && {CURRENT}.startsWith('1.')"),
    );
    steps.done("killed, and gone on");
    // A second browser shows the same state as the first.
    let other = Window::start();
    let second = other.open_dark(&served.address, SIZE);

    page.click("#diagnose");
    // The step is shown at once, and no second one can begin.
    page.until(
        3,
        "!document.getElementById('work').hidden && ['diagnose', 'discover', 'own-keep'].every(id => document.getElementById(id).disabled)",
    );
    let candidates = "document.querySelectorAll('#missing tbody tr').length > 2";
    page.until(
        900,
        &format!("document.getElementById('work').hidden && {candidates}"),
    );
    steps.done("diagnosed");
    second.until(20, candidates);
    page.scroll_to("#missing-section");
    page.shoot("workbench-candidates.png");
    page.readable();
    let first = page.text("#missing tbody td");
    assert_eq!(first, "plenum-droop");
    page.click("#missing tbody button");
    page.idles_with(900, 3);
    steps.done("added");
    second.until(20, &format!("{CURRENT} === '3. + plenum-droop'"));
    // Charts name the models as the tree does, in the colours of the tree: the third is green.
    page.until(20, "['1. identified', '3. + plenum-droop'].every(name => document.querySelector('#stretch figure')?.textContent.includes(name)) && document.querySelector('#stretch svg [stroke=\"#009E73\"]') !== null && document.querySelector('#checks svg [stroke=\"#009E73\"]') !== null");
    let times_noise = page.times_noise();
    assert!(times_noise < 1.05, "{times_noise}");
    page.scroll_to("#match-section");
    page.shoot("workbench-ladder.png");
    page.accessible();
    second.accessible();
    second.shoot("workbench-dark.png");
    other.has_no_faults();

    // Undo returns to the parent; later models stay in the tree, and any two models can be compared.
    page.click_text("#models button", "Undo");
    page.until(
        20,
        &format!("{CURRENT}.startsWith('1.') && document.querySelectorAll('.model').length === 3"),
    );
    page.click(".tree .tree input[type=checkbox]");
    page.until(20, "[...document.querySelectorAll('.switches label')].filter(l => /^[13]\\. /.test(l.textContent)).length === 2 && location.hash.includes('beside=3')");
    page.scroll_to("#records-section");
    page.until(20, "document.querySelectorAll('.record canvas').length > 1");
    // The book shows this picture; a temporary folder is nobody's project.
    page.act("document.querySelector('#project').textContent = 'project folder half.workbench'");
    page.shoot("workbench-compared.png");
    // The address of the page contains the view.
    let address = page.act("location.href");
    let again = b.open(address.as_str().expect("an address"), SIZE);
    again.until(20, "[...document.querySelectorAll('.switches label')].some(l => l.textContent.startsWith('3. '))");
    // Another branch starts from the earlier model.
    page.click("[aria-label=\"add stopping-vortex\"]");
    page.idles_with(900, 4);
    page.has(20, ".tree .tree > li", 2);
    page.act("[...document.querySelectorAll('.model')].find(m => m.textContent.startsWith('3.')).click()");
    page.until(20, &format!("{CURRENT}.startsWith('3.')"));
    steps.done("undone, compared, branched");

    // Downloaded constants compile without the standard library, as on the board.
    let constants = page.download("#models a", "identified.rs");
    compiles(&constants, &folder.path().join("constants"));
    let report = page.download("#models a", "report.html");
    assert!(report.starts_with("<!doctype html>") && report.contains("host-fit compare"));
    steps.done("downloaded, compiled");

    // The diagnosis as a page: the ladder's steps appear as curves once they are switched on.
    let diagnosis = format!("file://{}", project.join("diagnosis-1.html").display());
    let report = b.open(&diagnosis, SIZE);
    let drawn = "hostFit.groups[0].charts.filter(c => c.plots[0]?.series.some(s => s.label === 'refitted with the fewest lags')).length";
    report.act("document.querySelectorAll('.record')[2].scrollIntoView()");
    report.until(
        20,
        "document.querySelectorAll('.record')[2].querySelectorAll('canvas').length === 2",
    );
    assert_eq!(report.act(drawn), 0);
    report.act("[...document.querySelectorAll('.switches label')].find(l => l.textContent === 'refitted with the fewest lags').querySelector('input:not(:checked)').click()");
    report.until(
        20,
        &format!("{drawn} > 0 && location.hash.includes('g1.off=')"),
    );
    report.accessible();
    report.shoot("report-ladder.png");
    steps.done("the ladder on the curves");

    let phone = b.open(&served.address, (390, 840));
    phone.has(20, ".record", 4);
    phone.fits(390.0);
    phone.readable();
    phone.shoot("workbench-phone.png");
    phone.scroll_to("#missing-section");
    phone.shoot("workbench-phone-missing.png");
    b.has_no_faults();

    // The command line continues in the same folder.
    drop(served);
    run(&[&"compare", &project.join("model-3.toml"), &data]);
}

/// A crate with these constants, without the standard library, that depends on `model-core` alone.
fn compiles(constants: &str, folder: &std::path::Path) {
    std::fs::create_dir_all(folder.join("src")).expect("a folder");
    std::fs::write(folder.join("src/identified.rs"), constants).expect("a file");
    std::fs::write(
        folder.join("src/lib.rs"),
        "#![no_std]\npub mod identified;\n",
    )
    .expect("a file");
    let core = std::fs::canonicalize(root().join("model-core")).expect("model-core");
    let manifest = format!(
        "[package]\nname = \"constants\"\nversion = \"0.1.0\"\nedition = \"2024\"\n[dependencies]\nmodel-core = {{ path = {core:?} }}\n[workspace]\n"
    );
    std::fs::write(folder.join("Cargo.toml"), manifest).expect("a file");
    std::fs::copy(root().join("Cargo.lock"), folder.join("Cargo.lock")).expect("the lock file");
    let output = Command::new(env!("CARGO"))
        .args(["check", "--quiet", "--offline"])
        .env("CARGO_TARGET_DIR", super::picture("../constants"))
        .current_dir(folder)
        .output()
        .expect("cargo");
    assert!(
        output.status.success(),
        "{}",
        String::from_utf8_lossy(&output.stderr)
    );
}
