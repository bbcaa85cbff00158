//! The living report, opened from disk.

use scenarios::browser::Browser;

use super::print::keeps_its_curves;
use super::{SLOWEST_FRAME, accessible, act, fits, panned, readable, run, shoot, until};

#[test]
#[ignore = "needs chromium: cargo xtask browser"]
fn a_report_is_looked_along() {
    let folder = tempfile::tempdir().expect("a folder");
    let page_file = folder.path().join("report.html");
    let (model, data) = (
        "data/paper/table-2-state-dependent.toml",
        "data/hidden-ramp",
    );
    run(&[&"compare", &model, &data, &"--report", &page_file]);
    let size = std::fs::metadata(&page_file).expect("the report").len();
    eprintln!("  a report of 8 records weighs {:.2} MB", size as f64 / 1e6);
    assert!(size < 5_000_000);
    let address = format!("file://{}", page_file.display());
    let mut b = Browser::start().expect("chromium");
    let page = b.open(&address, (1100, 1000), false).expect("a page");
    until(&mut b, &page, 20, "hostFit.groups[0].charts.length === 8");
    accessible(&mut b, &page);
    shoot(&mut b, &page, "report-light.png");

    // A bar marks its samples, and the address stores it.
    let to_record = "document.querySelectorAll('.record')[6].scrollIntoView()";
    act(
        &mut b,
        &page,
        "document.querySelector('[data-bar=\"0:2\"]').dispatchEvent(new MouseEvent('click', {bubbles: true}))",
    );
    act(
        &mut b,
        &page,
        &format!("hostFit.groups[0].view.show(2, 4); {to_record}"),
    );
    until(
        &mut b,
        &page,
        5,
        "location.hash.includes('g1.bar=0:2') && location.hash.includes('g1.t=2..4')",
    );
    until(
        &mut b,
        &page,
        10,
        "document.querySelectorAll('.record')[6].querySelectorAll('canvas').length === 2",
    );
    // Marked samples are painted at the top of the chart, in a colour that nothing else there has.
    let painted = "(() => { const c = document.querySelectorAll('.record')[6].querySelector('canvas'); const d = c.getContext('2d').getImageData(0, 12, c.width, 1).data; let n = 0; for (let i = 0; i < d.length; i += 4) if (d[i] > 150 && d[i + 1] < 110 && d[i + 2] < 40 && d[i + 3] > 200) n++; return n; })()";
    until(&mut b, &page, 10, &format!("{painted} > 3"));

    // Pointing shows values in every record and marks the bars of the sample.
    let middle = act(
        &mut b,
        &page,
        "(() => { const r = document.querySelectorAll('.record')[6].querySelector('.u-over').getBoundingClientRect(); return [r.x + r.width / 2, r.y + r.height / 2]; })()",
    );
    b.mouse(
        &page,
        middle[0].as_f64().expect("x"),
        middle[1].as_f64().expect("y"),
        false,
    )
    .expect("a mouse");
    until(
        &mut b,
        &page,
        5,
        "[...document.querySelectorAll('.readout')].filter(r => /^t 3\\.0\\d* s/.test(r.textContent)).length === 8",
    );
    until(
        &mut b,
        &page,
        5,
        "document.querySelectorAll('.bar.here').length > 2",
    );
    shoot(&mut b, &page, "report-lit.png");

    // By keyboard: along, in, out, whole.
    act(
        &mut b,
        &page,
        "document.querySelectorAll('.record')[6].focus()",
    );
    for key in ["+", "PageDown", "ArrowRight"] {
        b.key(&page, key).expect("a key");
    }
    until(
        &mut b,
        &page,
        5,
        "hostFit.groups[0].view.to - hostFit.groups[0].view.from < 1.01 && hostFit.groups[0].view.from > 2.9",
    );
    b.key(&page, "Home").expect("a key");
    until(&mut b, &page, 5, "hostFit.groups[0].view.to > 9.9");

    // A saved figure equals the displayed one.
    act(
        &mut b,
        &page,
        "window.saved = []; const make = URL.createObjectURL; URL.createObjectURL = b => { saved.push(b); return make.call(URL, b); }; document.querySelectorAll('.record')[6].querySelectorAll('.save button').forEach(b => b.click())",
    );
    until(&mut b, &page, 20, "saved.length === 2");
    let svg = act(
        &mut b,
        &page,
        "saved.find(b => b.type.includes('svg')).text()",
    );
    let svg = svg.as_str().expect("text").to_owned();
    let drawn = svg.matches("<path").count();
    assert!(svg.starts_with("<svg") && drawn > 8, "{drawn} paths");
    assert!(!svg.contains("undefined") && !svg.contains("NaN"));

    assert!(panned(&mut b, &page) < SLOWEST_FRAME);
    assert_eq!(b.faults(), Vec::<String>::new());

    let dark = b.open(&address, (1100, 1000), true).expect("a page");
    accessible(&mut b, &dark);
    act(&mut b, &dark, to_record);
    until(
        &mut b,
        &dark,
        10,
        "document.querySelectorAll('.record')[6].querySelectorAll('canvas').length === 2",
    );
    shoot(&mut b, &dark, "report-dark.png");
    let phone = b.open(&address, (390, 840), false).expect("a page");
    act(&mut b, &phone, to_record);
    until(
        &mut b,
        &phone,
        10,
        "document.querySelectorAll('.record')[6].querySelectorAll('canvas').length === 2",
    );
    fits(&mut b, &phone, 390.0);
    shoot(&mut b, &phone, "report-phone.png");
    readable(&mut b, &phone);
    readable(&mut b, &page);
    keeps_its_curves(&mut b, &address, 8);
    assert_eq!(b.faults(), Vec::<String>::new());
}
