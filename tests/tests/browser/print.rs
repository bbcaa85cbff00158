//! The printed page: curves are lines of the PDF, not empty canvases.

use std::io::Read as _;

use super::{SIZE, Window, picture};
use flate2::read::ZlibDecoder;

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

/// Prints a page of `records` records, and checks that nothing is lost.
#[track_caller]
pub(crate) fn keeps_its_curves(b: &Window, address: &str, records: usize) {
    // The page is printed from a dark screen, but the paper is white.
    let page = b.open_dark(address, SIZE);
    page.until(
        20,
        &format!("hostFit.groups[0].charts.length === {records}"),
    );
    let pdf = page.pdf();
    let kept = picture("report.pdf");
    std::fs::create_dir_all(kept.parent().expect("a folder")).expect("a folder");
    std::fs::write(&kept, &pdf).expect("a file");
    let with = segments(&pdf);
    // The same page without its curves.
    page.act("(() => { hostFit.groups[0].paper = () => {}; return true; })()");
    let without = segments(&page.pdf());
    eprintln!("  printed: {with} line segments, {without} without the records");
    // Each record has measurement, model and residual, with some hundred segments each.
    assert!(with > without + records * 3 * 200, "{with} and {without}");
    // Printing does not change the screen.
    page.has(5, ".paper", 0);
    page.until(
        5,
        "!document.documentElement.classList.contains('on-paper')",
    );
    page.close();
}
