//! The complete workflow on the bundled set with a hidden effect.

use std::process::Command;

use scenarios::browser::Browser;

use super::{
    Steps, accessible, act, fits, identify, identify_for_long, idle_with, ramp, readable, root,
    run, serve, shoot, until,
};

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
    let mut b = Browser::start().expect("chromium");
    steps.done("server and browser start");
    let size = (1100, 1000);
    let page = b.open(&served.address, size, false).expect("a page");
    until(
        &mut b,
        &page,
        20,
        "document.querySelectorAll('.record').length === 4",
    );
    steps.done("the set is on the page");
    accessible(&mut b, &page);
    shoot(&mut b, &page, "workbench-start.png");
    // A pane is made wider by its border.
    let wider = "(() => { const pane = document.getElementById('left'), before = pane.offsetWidth; document.querySelector('[data-pane=left]').dispatchEvent(new KeyboardEvent('keydown', {key: 'ArrowRight'})); const by = pane.offsetWidth - before; document.querySelector('[data-pane=left]').dispatchEvent(new KeyboardEvent('keydown', {key: 'ArrowLeft'})); return by; })()";
    assert_eq!(act(&mut b, &page, wider), 20);

    // Identify, and see it at work.
    act(&mut b, &page, &identify(300));
    until(&mut b, &page, 300, &idle_with(1));
    until(
        &mut b,
        &page,
        20,
        "document.querySelectorAll('[data-bar]').length > 20 && document.querySelectorAll('.record').length === 4",
    );
    steps.done("identified");

    // After a cancellation the best model so far remains. The curve of the search's progress advances.
    act(&mut b, &page, &identify_for_long());
    until(
        &mut b,
        &page,
        60,
        "document.getElementById('work-now').textContent.includes('best')",
    );
    until(
        &mut b,
        &page,
        60,
        "document.querySelector('#curve canvas') !== null",
    );
    // What it has found so far is seen over the records, and changes.
    let drawn = "hostFit.groups[0].charts.filter(c => c.best).length === 4 && document.querySelector('.switches').textContent.includes('best so far')";
    until(&mut b, &page, 60, drawn);
    act(
        &mut b,
        &page,
        "document.getElementById('records-section').scrollIntoView()",
    );
    until(
        &mut b,
        &page,
        20,
        "hostFit.groups[0].charts.some(c => c.plots[0]?.series.some(s => s.label === 'best so far'))",
    );
    shoot(&mut b, &page, "workbench-progress.png");
    assert!(
        act(
            &mut b,
            &page,
            "document.getElementById('work-name').textContent"
        )
        .as_str()
        .is_some_and(
            |name| name.starts_with("host-fit identify ") && name.contains("--evaluations=1000000")
        )
    );
    act(&mut b, &page, "document.getElementById('cancel').click()");
    until(&mut b, &page, 300, &idle_with(2));
    until(
        &mut b,
        &page,
        20,
        "!document.querySelector('.switches').textContent.includes('best so far')",
    );
    steps.done("cancelled");
    act(
        &mut b,
        &page,
        "document.querySelectorAll('.model')[0].click()",
    );
    until(&mut b, &page, 20, &format!("{CURRENT}.startsWith('1.')"));

    // Killed during a step; a new server on the folder has all results.
    act(&mut b, &page, &identify_for_long());
    until(&mut b, &page, 20, "!document.getElementById('work').hidden");
    drop(served);
    until(
        &mut b,
        &page,
        30,
        "!document.getElementById('offline').hidden",
    );
    shoot(&mut b, &page, "workbench-offline.png");
    // The page continues to send requests, as intended; their errors are not failures.
    b.close(&page).expect("closed");
    b.faults();
    let served = serve(&project, &[&data]);
    let page = b.open(&served.address, size, false).expect("a page");
    until(
        &mut b,
        &page,
        20,
        &format!("document.querySelectorAll('.model').length === 2 && {CURRENT}.startsWith('1.')"),
    );
    steps.done("killed, and gone on");
    // A second browser shows the same state as the first.
    let mut other = Browser::start().expect("chromium");
    let second = other.open(&served.address, size, true).expect("a page");

    act(&mut b, &page, "document.getElementById('diagnose').click()");
    let candidates = "document.querySelectorAll('#missing tbody tr').length > 2";
    until(
        &mut b,
        &page,
        900,
        &format!("document.getElementById('work').hidden && {candidates}"),
    );
    steps.done("diagnosed");
    until(&mut other, &second, 20, candidates);
    act(
        &mut b,
        &page,
        "document.getElementById('missing-section').scrollIntoView()",
    );
    shoot(&mut b, &page, "workbench-candidates.png");
    readable(&mut b, &page);
    let first = act(
        &mut b,
        &page,
        "document.querySelector('#missing tbody td').textContent",
    );
    assert_eq!(first, "plenum-droop");
    act(
        &mut b,
        &page,
        "document.querySelector('#missing tbody button').click()",
    );
    until(&mut b, &page, 900, &idle_with(3));
    steps.done("added");
    until(
        &mut other,
        &second,
        20,
        &format!("{CURRENT} === '3. + plenum-droop'"),
    );
    let times_noise = act(
        &mut b,
        &page,
        "fetch('/api/state', {headers: {'x-token': new URLSearchParams(location.search).get('token')}}).then(r => r.json()).then(s => { const m = s.models.at(-1); return m.rmse / m.noise_rmse; })",
    );
    eprintln!("  the validation error is {times_noise} times the noise");
    assert!(times_noise.as_f64() < Some(1.05), "{times_noise}");
    act(
        &mut b,
        &page,
        "document.getElementById('match-section').scrollIntoView()",
    );
    shoot(&mut b, &page, "workbench-ladder.png");
    accessible(&mut b, &page);
    accessible(&mut other, &second);
    shoot(&mut other, &second, "workbench-dark.png");
    assert_eq!(other.faults(), Vec::<String>::new());

    // Undo returns to the parent; later models stay in the tree, and any two models can be compared.
    act(
        &mut b,
        &page,
        "[...document.querySelectorAll('#models button')].find(x => x.textContent === 'Undo').click()",
    );
    until(
        &mut b,
        &page,
        20,
        &format!("{CURRENT}.startsWith('1.') && document.querySelectorAll('.model').length === 3"),
    );
    act(
        &mut b,
        &page,
        "document.querySelector('.tree .tree input[type=checkbox]').click()",
    );
    until(
        &mut b,
        &page,
        20,
        "[...document.querySelectorAll('.switches label')].filter(l => /^[13]\\. /.test(l.textContent)).length === 2 && location.hash.includes('beside=3')",
    );
    act(
        &mut b,
        &page,
        "document.getElementById('records-section').scrollIntoView()",
    );
    until(
        &mut b,
        &page,
        20,
        "document.querySelectorAll('.record canvas').length > 1",
    );
    shoot(&mut b, &page, "workbench-compared.png");
    // A view is its address.
    let address = act(&mut b, &page, "location.href");
    let again = b
        .open(address.as_str().expect("an address"), size, false)
        .expect("a page");
    until(
        &mut b,
        &again,
        20,
        "[...document.querySelectorAll('.switches label')].some(l => l.textContent.startsWith('3. '))",
    );
    // Another branch, from the earlier model.
    act(
        &mut b,
        &page,
        "document.querySelector('[aria-label=\"add stopping-vortex\"]').click()",
    );
    until(&mut b, &page, 900, &idle_with(4));
    until(
        &mut b,
        &page,
        20,
        "document.querySelectorAll('.tree .tree > li').length === 2",
    );
    act(
        &mut b,
        &page,
        "[...document.querySelectorAll('.model')].find(m => m.textContent.startsWith('3.')).click()",
    );
    until(&mut b, &page, 20, &format!("{CURRENT}.startsWith('3.')"));
    steps.done("undone, compared, branched");

    // Downloaded constants compile where the board's code does.
    let constants = act(
        &mut b,
        &page,
        "fetch([...document.querySelectorAll('#models a')].find(a => a.textContent.includes('identified.rs')).href).then(r => r.text())",
    );
    compiles(
        constants.as_str().expect("text"),
        &folder.path().join("constants"),
    );
    let report = act(
        &mut b,
        &page,
        "fetch([...document.querySelectorAll('#models a')].find(a => a.textContent.includes('report.html')).href).then(r => r.text())",
    );
    assert!(report.as_str().is_some_and(
        |page| page.starts_with("<!doctype html>") && page.contains("host-fit compare")
    ));
    steps.done("downloaded, compiled");

    // The diagnosis as a page: the ladder's steps appear as curves once they are switched on.
    let diagnosis = format!("file://{}", project.join("diagnosis-1.html").display());
    let report = b.open(&diagnosis, size, false).expect("a page");
    let drawn = "hostFit.groups[0].charts.filter(c => c.plots[0]?.series.some(s => s.label === 'refitted with the fewest lags')).length";
    act(
        &mut b,
        &report,
        "document.querySelectorAll('.record')[2].scrollIntoView()",
    );
    until(
        &mut b,
        &report,
        20,
        "document.querySelectorAll('.record')[2].querySelectorAll('canvas').length === 2",
    );
    assert_eq!(act(&mut b, &report, drawn), 0);
    act(
        &mut b,
        &report,
        "[...document.querySelectorAll('.switches label')].find(l => l.textContent === 'refitted with the fewest lags').querySelector('input:not(:checked)').click()",
    );
    until(
        &mut b,
        &report,
        20,
        &format!("{drawn} > 0 && location.hash.includes('g1.off=')"),
    );
    accessible(&mut b, &report);
    shoot(&mut b, &report, "report-ladder.png");
    steps.done("the ladder on the curves");

    let phone = b.open(&served.address, (390, 840), false).expect("a page");
    until(
        &mut b,
        &phone,
        20,
        "document.querySelectorAll('.record').length === 4",
    );
    fits(&mut b, &phone, 390.0);
    readable(&mut b, &phone);
    shoot(&mut b, &phone, "workbench-phone.png");
    act(
        &mut b,
        &phone,
        "document.getElementById('missing-section').scrollIntoView()",
    );
    shoot(&mut b, &phone, "workbench-phone-missing.png");
    assert_eq!(b.faults(), Vec::<String>::new());

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
