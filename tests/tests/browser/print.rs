//! The printed page: curves are lines of the PDF, not empty canvases.

use std::io::Read as _;

use flate2::read::ZlibDecoder;
use scenarios::browser::Browser;

use super::{act, picture, root, run, until};

/// Line segments that the pages of a PDF draw: operators `l` in its unpacked content streams.
fn segments(pdf: &[u8]) -> usize {
    let find = |from: usize, word: &[u8]| {
        let rest = pdf.get(from..)?;
        let at = rest.windows(word.len()).position(|w| w == word)?;
        Some(from + at)
    };
    let (mut from, mut count) = (0, 0);
    while let Some(start) = find(from, b"stream") {
        let start = start + b"stream".len();
        let Some(end) = find(start, b"endstream") else {
            break;
        };
        let packed = &pdf[start..end];
        let packed = packed.strip_prefix(b"\r").unwrap_or(packed);
        let packed = packed.strip_prefix(b"\n").unwrap_or(packed);
        let mut text = Vec::new();
        // Fonts and pictures may decompress as well; they contain no such lines.
        let _ = ZlibDecoder::new(packed).read_to_end(&mut text);
        let lines = text.split(|b| *b == b'\n');
        count += lines.filter(|line| line.ends_with(b" l")).count();
        from = end + b"endstream".len();
    }
    count
}

#[test]
#[ignore = "needs chromium: cargo xtask browser"]
fn a_printed_report_keeps_its_curves() {
    let folder = tempfile::tempdir().expect("a folder");
    let page_file = folder.path().join("report.html");
    let model = root().join("data/paper/table-2-state-dependent.toml");
    let data = root().join("data/hidden-ramp");
    run(&[&"compare", &model, &data, &"--report", &page_file]);
    let address = format!("file://{}", page_file.display());
    let mut b = Browser::start().expect("chromium");
    // Printed from a dark screen: the paper is white nevertheless.
    let page = b.open(&address, (1100, 1000), true).expect("a page");
    until(&mut b, &page, 20, "hostFit.groups[0].charts.length === 8");
    let pdf = b.pdf(&page).expect("a PDF");
    let kept = picture("report.pdf");
    std::fs::create_dir_all(kept.parent().expect("a folder")).expect("a folder");
    std::fs::write(&kept, &pdf).expect("a file");
    let with = segments(&pdf);
    // The same page without its curves.
    act(
        &mut b,
        &page,
        "(() => { hostFit.groups[0].paper = () => {}; return true; })()",
    );
    let without = segments(&b.pdf(&page).expect("a PDF"));
    eprintln!("  printed: {with} line segments, {without} without the records");
    // Eight records with measurement, model and residual, some hundred segments each.
    assert!(with > without + 8 * 3 * 200, "{with} and {without}");
    // The screen is as it was.
    until(
        &mut b,
        &page,
        5,
        "document.querySelectorAll('.paper').length === 0",
    );
    until(
        &mut b,
        &page,
        5,
        "!document.documentElement.classList.contains('on-paper')",
    );
    assert_eq!(b.faults(), Vec::<String>::new());
}
