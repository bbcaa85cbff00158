//! The living report, opened from disk.

use super::print::keeps_its_curves;
use super::{SIZE, SLOWEST_FRAME, Window, run};

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
    let b = Window::start();
    let page = b.open(&address, SIZE);
    page.until(20, "hostFit.groups[0].charts.length === 8");
    page.accessible();
    page.shoot("report-light.png");

    // A bar marks its samples, and the address stores it.
    let drawn_record =
        "document.querySelectorAll('.record')[6].querySelectorAll('canvas').length === 2";
    let to_record = "document.querySelectorAll('.record')[6].scrollIntoView()";
    page.act("document.querySelector('[data-bar=\"0:2\"]').dispatchEvent(new MouseEvent('click', {bubbles: true}))");
    page.act(&format!("hostFit.groups[0].view.show(2, 4); {to_record}"));
    page.until(
        5,
        "location.hash.includes('g1.bar=0:2') && location.hash.includes('g1.t=2..4')",
    );
    page.until(10, drawn_record);
    // Marked samples are painted at the top of the chart, in a colour that nothing else there has.
    let painted = "(() => { const c = document.querySelectorAll('.record')[6].querySelector('canvas'); const d = c.getContext('2d').getImageData(0, 12, c.width, 1).data; let n = 0; for (let i = 0; i < d.length; i += 4) if (d[i] > 150 && d[i + 1] < 110 && d[i + 2] < 40 && d[i + 3] > 200) n++; return n; })()";
    page.until(10, &format!("{painted} > 3"));

    // Pointing shows values in every record and marks the bars of the sample.
    let middle = page.act("(() => { const r = document.querySelectorAll('.record')[6].querySelector('.u-over').getBoundingClientRect(); return [r.x + r.width / 2, r.y + r.height / 2]; })()");
    page.mouse(
        middle[0].as_f64().expect("x"),
        middle[1].as_f64().expect("y"),
    );
    page.until(5, "[...document.querySelectorAll('.readout')].filter(r => /^t 3\\.0\\d* s/.test(r.textContent)).length === 8");
    page.until(5, "document.querySelectorAll('.bar.here').length > 2");
    page.shoot("report-lit.png");

    // The keyboard moves the view, zooms in and out, and shows the whole record.
    page.act("document.querySelectorAll('.record')[6].focus()");
    for key in ["+", "PageDown", "ArrowRight"] {
        page.key(key);
    }
    page.until(5, "hostFit.groups[0].view.to - hostFit.groups[0].view.from < 1.01 && hostFit.groups[0].view.from > 2.9");
    page.key("Home");
    page.until(5, "hostFit.groups[0].view.to > 9.9");

    // A saved figure equals the displayed one.
    page.act("window.saved = []; const make = URL.createObjectURL; URL.createObjectURL = b => { saved.push(b); return make.call(URL, b); }; document.querySelectorAll('.record')[6].querySelectorAll('.save button').forEach(b => b.click())");
    page.until(20, "saved.length === 2");
    let svg = page.act("saved.find(b => b.type.includes('svg')).text()");
    let svg = svg.as_str().expect("text").to_owned();
    let drawn = svg.matches("<path").count();
    assert!(svg.starts_with("<svg") && drawn > 8, "{drawn} paths");
    assert!(!svg.contains("undefined") && !svg.contains("NaN"));

    assert!(page.panned() < SLOWEST_FRAME);
    b.has_no_faults();

    let dark = b.open_dark(&address, SIZE);
    dark.accessible();
    dark.act(to_record);
    dark.until(10, drawn_record);
    dark.shoot("report-dark.png");
    let phone = b.open(&address, (390, 840));
    phone.act(to_record);
    phone.until(10, drawn_record);
    phone.fits(390.0);
    phone.shoot("report-phone.png");
    phone.readable();
    page.readable();
    keeps_its_curves(&b, &address, 8);
    b.has_no_faults();
}
