//! The printed page: curves are lines of the PDF, not empty canvases.

use std::io::Read as _;

use flate2::read::ZlibDecoder;
use scenarios::browser::Browser;

use super::{act, picture, until};

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

/// Prints a page of `records` records, and sees that nothing of it is lost.
#[track_caller]
pub(crate) fn keeps_its_curves(b: &mut Browser, address: &str, records: usize) {
    // Printed from a dark screen: the paper is white nevertheless.
    let page = b.open(address, (1100, 1000), true).expect("a page");
    until(
        b,
        &page,
        20,
        &format!("hostFit.groups[0].charts.length === {records}"),
    );
    let pdf = b.pdf(&page).expect("a PDF");
    let kept = picture("report.pdf");
    std::fs::create_dir_all(kept.parent().expect("a folder")).expect("a folder");
    std::fs::write(&kept, &pdf).expect("a file");
    let with = segments(&pdf);
    // The same page without its curves.
    act(
        b,
        &page,
        "(() => { hostFit.groups[0].paper = () => {}; return true; })()",
    );
    let without = segments(&b.pdf(&page).expect("a PDF"));
    eprintln!("  printed: {with} line segments, {without} without the records");
    // Records with measurement, model and residual, some hundred segments each.
    assert!(with > without + records * 3 * 200, "{with} and {without}");
    // The screen is as it was.
    until(
        b,
        &page,
        5,
        "document.querySelectorAll('.paper').length === 0",
    );
    until(
        b,
        &page,
        5,
        "!document.documentElement.classList.contains('on-paper')",
    );
    b.close(&page).expect("closed");
}
