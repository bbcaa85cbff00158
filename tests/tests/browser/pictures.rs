//! Screenshots of pages, compared with inspected ones as thumbnails of 64 × 64 greys, because fonts differ between
//! machines.
//!
//! `cargo xtask browser --bless` rewrites the thumbnails and the pictures of the book; inspect the pictures in
//! `target/browser` first.

use base64::Engine as _;
use base64::engine::general_purpose::STANDARD;
use serde_json::Value;

use super::{Tab, picture, root};

/// Largest mean difference of the greys, of 255: another font makes 1 to 3, a page in wrong colours about 200, a
/// missing section 15.
const DIFFERENCE: f64 = 8.0;

/// Pictures that the book shows, with their place.
const IN_THE_BOOK: [(&str, &str); 2] = [
    ("report-ladder.png", "docs/start-report.png"),
    ("workbench-compared.png", "docs/workbench.png"),
];

/// The browser reduces a picture, so no PNG decoder is needed here. `small` returns 64 × 64 greys row by row.
const SMALL: &str = "async (address) => { const i = new Image(); i.src = address; await i.decode(); const c = new OffscreenCanvas(i.width, i.height), x = c.getContext('2d'); x.drawImage(i, 0, 0); const d = x.getImageData(0, 0, i.width, i.height).data, n = 64, sum = new Array(n * n).fill(0), count = new Array(n * n).fill(0); for (let r = 0; r < i.height; r++) for (let k = 0; k < i.width; k++) { const cell = Math.floor(r * n / i.height) * n + Math.floor(k * n / i.width), p = 4 * (r * i.width + k); sum[cell] += 0.299 * d[p] + 0.587 * d[p + 1] + 0.114 * d[p + 2]; count[cell] += 1; } return sum.map((s, k) => Math.round(s / count[k])); }";

/// Script that encodes 64 × 64 grey values as a PNG in base64.
const PNG: &str = "async (greys) => { const c = new OffscreenCanvas(64, 64), x = c.getContext('2d'), d = x.createImageData(64, 64); greys.forEach((g, k) => d.data.set([g, g, g, 255], 4 * k)); x.putImageData(d, 0, 0); const b = new Uint8Array(await (await c.convertToBlob()).arrayBuffer()); return btoa(String.fromCharCode(...b)); }";

impl Tab<'_> {
    /// Takes a picture, an artefact of CI, and compares it with the inspected one.
    #[track_caller]
    pub(crate) fn shoot(&self, name: &str) {
        let path = picture(name);
        self.screenshot(&path);
        // A separate page, because the tested page forbids foreign pictures and must not be changed.
        let desk = self.empty((64, 64));
        let taken = greys(&desk, &std::fs::read(&path).expect("the picture"));
        let known = root().join("tests/tests/browser/pictures").join(name);
        if std::env::var_os("BLESS").is_some() {
            let text = desk.act(&format!("({PNG})({})", serde_json::json!(taken)));
            let png = STANDARD.decode(text.as_str().expect("base64"));
            std::fs::create_dir_all(known.parent().expect("a folder")).expect("a folder");
            std::fs::write(&known, png.expect("base64")).expect("a file");
            for (_, page) in IN_THE_BOOK.iter().filter(|(own, _)| *own == name) {
                std::fs::copy(&path, root().join(page)).expect("a picture of the book");
            }
        } else {
            let known = std::fs::read(&known).unwrap_or_else(|_| {
                panic!("{name} has no thumbnail: look at it, then `cargo xtask browser --bless`")
            });
            let known = greys(&desk, &known);
            let sum: f64 = taken.iter().zip(&known).map(|(a, k)| (a - k).abs()).sum();
            let mean = sum / taken.len() as f64;
            eprintln!("           {name}: {mean:.1} of 255 from the one that was looked at");
            assert!(
                mean < DIFFERENCE,
                "{} is {mean:.1} of 255 from the picture that was looked at; if it is right, `cargo xtask browser --bless`",
                path.display()
            );
        }
        desk.close();
    }
}

/// The grey values of a PNG picture that is reduced to 64 × 64 pixels.
fn greys(desk: &Tab<'_>, png: &[u8]) -> Vec<f64> {
    let address = format!("data:image/png;base64,{}", STANDARD.encode(png));
    let told = desk.act(&format!("({SMALL})('{address}')"));
    let greys = told.as_array().into_iter().flatten();
    let greys: Vec<f64> = greys.filter_map(Value::as_f64).collect();
    assert_eq!(greys.len(), 64 * 64, "greys of a picture");
    greys
}
