//! The user's own files and effects, and laws.

use std::path::Path;

use scenarios::browser::{Browser, Page};

use super::{Steps, accessible, act, identify, idle_with, ramp, root, run, serve, shoot, until};

const SIZE: (u32, u32) = (1100, 1000);

/// Drops a file onto the page, as from another program.
fn drop_file(b: &mut Browser, page: &Page, name: &str, text: &str) {
    let text = serde_json::to_string(text).expect("a text");
    act(
        b,
        page,
        &format!(
            "(() => {{ const data = new DataTransfer(); data.items.add(new File([{text}], '{name}')); document.getElementById('drop').dispatchEvent(new DragEvent('drop', {{dataTransfer: data, bubbles: true, cancelable: true}})); }})()"
        ),
    );
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
    let mut b = Browser::start().expect("chromium");
    let page = b.open(&served.address, SIZE, false).expect("a page");
    until(
        &mut b,
        &page,
        20,
        "document.getElementById('data').textContent.includes('import')",
    );
    accessible(&mut b, &page);
    shoot(&mut b, &page, "workbench-empty.png");
    act(&mut b, &page, "document.getElementById('bundled').click()");
    until(
        &mut b,
        &page,
        20,
        "document.querySelectorAll('.record').length === 8",
    );

    // An unreadable file is reported and not stored.
    drop_file(&mut b, &page, "notes.csv", "nothing that is a table\n");
    until(
        &mut b,
        &page,
        20,
        "document.getElementById('message').textContent.includes('notes.csv')",
    );
    assert!(!project.join("uploads/notes.csv").exists());
    assert_eq!(b.faults().len(), 1, "the refusal, as the browser logs it");

    for (name, file) in [
        ("a.csv", "random-a.csv"),
        ("b.csv", "sq4-50.csv"),
        ("c.csv", "random-b.csv"),
    ] {
        drop_file(&mut b, &page, name, &german(file));
        until(
            &mut b,
            &page,
            20,
            &format!("document.getElementById('uploads').textContent.includes('{name}')"),
        );
    }
    // A command in volts is not an on/off command; the message says so and gives the remedy.
    let choose = "(() => { const f = document.getElementById('mapping').elements; f.t.value = 'Zeit'; f.u.value = 'Ventil'; f.y.value = 'Reibung'; document.querySelector('[name=validate][value=c]').checked = true; f.t.form.requestSubmit(); })()";
    act(&mut b, &page, choose);
    until(
        &mut b,
        &page,
        20,
        "document.querySelectorAll('.record').length === 3 && document.getElementById('message').textContent.includes('“on above (of u)” 2.5') && document.querySelector('[name=u-threshold]').getAttribute('aria-invalid') === 'true'",
    );
    shoot(&mut b, &page, "workbench-import.png");
    accessible(&mut b, &page);
    act(
        &mut b,
        &page,
        "(() => { const f = document.getElementById('mapping'); f.elements['u-threshold'].value = 2.5; f.requestSubmit(); })()",
    );
    until(
        &mut b,
        &page,
        20,
        "document.getElementById('work').hidden && document.getElementById('log').textContent.includes('--u-threshold=2.5') && hostFit.groups[0].charts[0].record.onOff",
    );
    steps.done("dropped and mapped");
    act(&mut b, &page, &identify(100));
    until(&mut b, &page, 300, &idle_with(1));
    steps.done("identified");
    assert_eq!(b.faults(), Vec::<String>::new());

    // The project contains its data. The page is closed first, because it reports the loss of its server.
    b.close(&page).expect("closed");
    drop(served);
    let served = serve(&project, &[]);
    let page = b.open(&served.address, SIZE, false).expect("a page");
    until(
        &mut b,
        &page,
        20,
        "document.querySelectorAll('.record').length === 3 && document.querySelectorAll('.model').length === 1",
    );
    // Other validation records are another question: the model moves aside.
    act(
        &mut b,
        &page,
        "document.querySelector('fieldset.records [value=b]').click(); document.getElementById('choose').click()",
    );
    until(
        &mut b,
        &page,
        20,
        "document.querySelectorAll('.model').length === 0 && hostFit.groups[0].charts.map(c => c.record.use).join() === 'identify,validate,validate'",
    );
    assert!(project.join("earlier-1/model-1.toml").is_file());
    assert!(project.join("earlier-1/data/dataset.toml").is_file());
    assert!(!project.join("model-1.toml").exists());
    assert_eq!(b.faults(), Vec::<String>::new());
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
    let mut b = Browser::start().expect("chromium");
    let page = b.open(&served.address, SIZE, false).expect("a page");
    until(
        &mut b,
        &page,
        20,
        "document.querySelectorAll('.record').length === 4",
    );
    let write = |text: &str| {
        let text = serde_json::to_string(text).expect("a text");
        format!(
            "(() => {{ const a = document.getElementById('own-text'); a.value = {text}; a.dispatchEvent(new Event('input')); a.scrollIntoView(); }})()"
        )
    };
    // The error is shown during typing, with a mark below it; Keep puts the cursor there.
    act(&mut b, &page, &write(DROOP));
    until(
        &mut b,
        &page,
        5,
        "document.getElementById('own-told').textContent.includes('line 4, column 36')",
    );
    act(&mut b, &page, "document.getElementById('own-keep').click()");
    until(
        &mut b,
        &page,
        5,
        "document.getElementById('message').textContent.includes('sgged is not known here')",
    );
    let cursor = act(
        &mut b,
        &page,
        "(() => { const a = document.getElementById('own-text'); return a.value.slice(a.selectionStart, a.selectionStart + 5); })()",
    );
    assert_eq!(cursor, "sgged");
    shoot(&mut b, &page, "workbench-own-effect.png");
    accessible(&mut b, &page);
    act(&mut b, &page, &write(&DROOP.replace("sgged", "sagged")));
    until(
        &mut b,
        &page,
        5,
        "document.getElementById('own-told').textContent.includes('In order: supply-sag')",
    );
    steps.done("mended");
    act(&mut b, &page, "document.getElementById('own-add').click()");
    until(&mut b, &page, 300, &idle_with(2));
    until(
        &mut b,
        &page,
        10,
        "document.querySelector('.model.current').textContent === '2. + supply-sag' && document.getElementById('log').textContent.includes('--effect-file=')",
    );
    steps.done("added");

    // A law: an unreachable goal is refused with a message, a reachable one is tried in the loop.
    let design = |target: f64| {
        format!(
            "(() => {{ const f = document.getElementById('design'); f.elements.target.value = {target}; f.requestSubmit(); }})()"
        )
    };
    act(&mut b, &page, &design(50.0));
    until(
        &mut b,
        &page,
        60,
        "document.getElementById('work').hidden && document.querySelector('#message .verdict') !== null",
    );
    let refused = act(
        &mut b,
        &page,
        "document.getElementById('message').textContent",
    );
    eprintln!("  refused: {refused}");
    act(&mut b, &page, &design(0.6));
    until(&mut b, &page, 300, &idle_with(3));
    until(
        &mut b,
        &page,
        10,
        "document.querySelector('#law svg') !== null && document.querySelectorAll('#law tbody tr').length > 2",
    );
    act(
        &mut b,
        &page,
        "document.getElementById('loop-section').scrollIntoView()",
    );
    shoot(&mut b, &page, "workbench-law.png");
    accessible(&mut b, &page);
    steps.done("a law in the loop");
    let loop_csv = act(
        &mut b,
        &page,
        "fetch([...document.querySelectorAll('#models a')].find(a => a.textContent.includes('loop.csv')).href).then(r => r.text())",
    );
    assert!(
        loop_csv
            .as_str()
            .is_some_and(|csv| csv.starts_with("t,") && csv.lines().count() > 1000)
    );
    assert_eq!(b.faults(), Vec::<String>::new());
}
