//! The user's own files and effects, and laws.

use std::path::Path;

use super::{SIZE, Steps, Tab, Window, identify, ramp, root, run, serve};

/// Drops a file onto the page, as from another program.
fn drop_file(page: &Tab<'_>, name: &str, text: &str) {
    let text = serde_json::to_string(text).expect("a text");
    page.act(&format!(
            "(() => {{ const data = new DataTransfer(); data.items.add(new File([{text}], '{name}')); document.getElementById('drop').dispatchEvent(new DragEvent('drop', {{dataTransfer: data, bubbles: true, cancelable: true}})); }})()"
        ));
}

/// A record as written by an office program in Germany: semicolons, decimal commas, a voltage for the valve, units.
fn german(file: &str) -> String {
    let text =
        std::fs::read_to_string(root().join("data/hidden-ramp").join(file)).expect("a record");
    let mut out = "Zeit [ms];Ventil [V];Reibung [-]\n".to_owned();
    let header: Vec<&str> = text.lines().next().expect("a header").split(',').collect();
    let column = |name: &str| header.iter().position(|h| *h == name).expect("a column");
    for line in text.lines().skip(1) {
        let cells: Vec<&str> = line.split(',').collect();
        let number = |name: &str| cells[column(name)].parse::<f64>().expect("a number");
        let line = format!(
            "{:.3};{:.2};{:.5}\n",
            1000.0 * number("t"),
            5.0 * number("u"),
            number("y")
        );
        out.push_str(&line.replace('.', ","));
    }
    out
}

#[test]
#[ignore = "needs chromium: cargo xtask browser"]
fn recordings_are_dropped_mapped_and_identified() {
    let folder = tempfile::tempdir().expect("a folder");
    let project = folder.path().join("project");
    let mut steps = Steps::new("files");
    let served = serve(&project, &[]);
    let b = Window::start();
    let page = b.open(&served.address, SIZE);
    page.says(20, "#data", "import");
    page.accessible();
    page.shoot("workbench-empty.png");
    page.click("#bundled");
    page.has(20, ".record", 8);

    // An unreadable file is reported and not stored.
    drop_file(&page, "notes.csv", "nothing that is a table\n");
    page.says(20, "#message", "notes.csv");
    assert!(!project.join("uploads/notes.csv").exists());
    assert_eq!(b.faults().len(), 1, "the refusal, as the browser logs it");

    for (name, file) in [
        ("a.csv", "random-a.csv"),
        ("b.csv", "sq4-50.csv"),
        ("c.csv", "random-b.csv"),
    ] {
        drop_file(&page, name, &german(file));
        page.until(
            20,
            &format!("document.getElementById('uploads').textContent.includes('{name}')"),
        );
    }
    // A command in volts is not an on/off command; the message says so and gives the remedy.
    let choose = "(() => { const f = document.getElementById('mapping').elements; f.t.value = 'Zeit'; f.u.value = 'Ventil'; f.y.value = 'Reibung'; document.querySelector('[name=validate][value=c]').checked = true; f.t.form.requestSubmit(); })()";
    page.act(choose);
    page.until(20, "document.querySelectorAll('.record').length === 3 && document.getElementById('message').textContent.includes('“u is on above” 2.5') && document.querySelector('[name=u-threshold]').getAttribute('aria-invalid') === 'true'");
    page.shoot("workbench-import.png");
    page.accessible();
    page.act("(() => { const f = document.getElementById('mapping'); f.elements['u-threshold'].value = 2.5; f.requestSubmit(); })()");
    page.until(20, "document.getElementById('work').hidden && document.getElementById('log').textContent.includes('--u-threshold=2.5') && hostFit.groups[0].charts[0].record.onOff");
    steps.done("dropped and mapped");
    page.act(&identify(100));
    page.idles_with(300, 1);
    steps.done("identified");
    b.has_no_faults();

    // The project contains its data. The page is closed first, because it reports the loss of its server.
    page.close();
    drop(served);
    let served = serve(&project, &[]);
    let page = b.open(&served.address, SIZE);
    page.until(20, "document.querySelectorAll('.record').length === 3 && document.querySelectorAll('.model').length === 1");
    // Other validation records start a new tree; the model moves into another folder.
    page.act("document.querySelector('fieldset.records [value=b]').click(); document.getElementById('choose').click()");
    page.until(20, "document.querySelectorAll('.model').length === 0 && hostFit.groups[0].charts.map(c => c.record.use).join() === 'identify,validate,validate'");
    assert!(project.join("earlier-1/model-1.toml").is_file());
    assert!(project.join("earlier-1/data/dataset.toml").is_file());
    assert!(!project.join("model-1.toml").exists());
    b.has_no_faults();
}

/// A model of the records, quickly.
fn model(folder: &Path, data: &Path) -> std::path::PathBuf {
    let model = folder.join("model.toml");
    run(&[
        &"identify",
        &data,
        &"-o",
        &model,
        &"--delay=state-dependent",
        &"--n1=2",
        &"--n2=2",
        &"--max-lag=150",
        &"--evaluations=300",
    ]);
    model
}

const DROOP: &str = r#"name = "supply-sag"
place = "jet"
summary = "The supply sags while it blows, and recovers."
expression = "jet * (1.0 - depth * sgged)"

[[state]]
name = "sagged"
update = "sagged + period / recovery * (u - sagged)"

[[parameter]]
name = "depth"
unit = "-"
low = 0.0
high = 0.9
starts = [0.2, 0.5]

[[parameter]]
name = "recovery"
unit = "s"
low = 0.05
high = 5.0
starts = [0.3, 1.0]
"#;

#[test]
#[ignore = "needs chromium: cargo xtask browser"]
fn an_own_effect_is_mended_under_the_cursor_and_a_law_designed() {
    let folder = tempfile::tempdir().expect("a folder");
    let data = ramp(folder.path());
    let model = model(folder.path(), &data);
    let mut steps = Steps::new("own effect and law");
    let served = serve(&folder.path().join("project"), &[&data, &"--model", &model]);
    let b = Window::start();
    let page = b.open(&served.address, SIZE);
    page.has(20, ".record", 4);
    let write = |text: &str| {
        let text = serde_json::to_string(text).expect("a text");
        format!(
            "(() => {{ const a = document.getElementById('own-text'); a.value = {text}; a.dispatchEvent(new Event('input')); a.scrollIntoView(); }})()"
        )
    };
    // The error is shown during typing, with a mark below it; the button Keep puts the cursor at
    // the error.
    page.act(&write(DROOP));
    page.says(5, "#own-told", "line 4, column 36");
    page.click("#own-keep");
    page.says(5, "#message", "sgged is not defined here");
    let cursor = page.act("(() => { const a = document.getElementById('own-text'); return a.value.slice(a.selectionStart, a.selectionStart + 5); })()");
    assert_eq!(cursor, "sgged");
    page.shoot("workbench-own-effect.png");
    page.accessible();
    page.act(&write(&DROOP.replace("sgged", "sagged")));
    page.says(5, "#own-told", "In order: supply-sag");
    steps.done("mended");
    page.click("#own-add");
    page.idles_with(300, 2);
    page.until(10, "document.querySelector('.model.current').textContent === '2. + supply-sag' && document.getElementById('log').textContent.includes('--effect-file=')");
    steps.done("added");

    // An unreachable goal of a law is refused with a message; a reachable goal is tried in the
    // loop.
    let design = |target: f64| {
        format!(
            "(() => {{ const f = document.getElementById('design'); f.elements.target.value = {target}; f.requestSubmit(); }})()"
        )
    };
    page.act(&design(50.0));
    page.until(60, "document.getElementById('work').hidden && document.querySelector('#message .verdict') !== null");
    let refused = page.text("#message");
    eprintln!("  refused: {refused}");
    page.act(&design(0.6));
    page.idles_with(300, 3);
    page.until(10, "document.querySelector('#law svg') !== null && document.querySelectorAll('#law tbody tr').length > 2");
    page.scroll_to("#loop-section");
    page.shoot("workbench-law.png");
    page.accessible();
    steps.done("a law in the loop");
    let loop_csv = page.download("#models a", "loop.csv");
    assert!(loop_csv.starts_with("t,") && loop_csv.lines().count() > 1000);
    b.has_no_faults();
}
