//! Helpers for the tests of all pictures.

/// Asserts that `svg` is one well-formed picture of the wide layout, smaller than 300 kB, that loads nothing from
/// the network and has only finite coordinates.
pub(super) fn check(svg: &str) {
    let document = roxmltree::Document::parse(svg).expect("well-formed XML");
    let root = document.root_element();
    assert_eq!(root.tag_name().name(), "svg");
    assert_eq!(root.attribute("width"), Some("660"));
    let height: f64 = root.attribute("height").unwrap().parse().unwrap();
    assert!((20.0..4000.0).contains(&height), "height {height}");
    assert!(svg.len() < 300_000, "{} bytes", svg.len());
    for node in document.descendants() {
        assert!(!matches!(
            node.tag_name().name(),
            "script" | "image" | "foreignObject"
        ));
        for attribute in node.attributes() {
            assert!(!attribute.name().contains("href"));
            assert!(!attribute.value().contains("NaN") && !attribute.value().contains("inf"));
        }
    }
}

/// All words of a picture, one per line.
pub(super) fn words(svg: &str) -> String {
    let document = roxmltree::Document::parse(svg).expect("well-formed XML");
    document
        .descendants()
        .filter(|n| n.has_tag_name("text"))
        .filter_map(|n| n.text())
        .map(str::trim)
        .collect::<Vec<_>>()
        .join("\n")
}

/// A 4 Hz square wave and a first-order response to it, 1 kHz.
pub(super) fn square_response(samples: usize) -> (Vec<f64>, Vec<f64>) {
    let mut state = 0.0;
    (0..samples)
        .map(|k| {
            let u = f64::from(u8::from(k % 250 < 125));
            state += 0.02 * (u - state);
            (u, state)
        })
        .unzip()
}

/// Unusual series: empty, one sample, constants, gaps, infinities, extreme values.
pub(super) fn absurd_series() -> Vec<Vec<f64>> {
    vec![
        vec![],
        vec![0.3],
        vec![f64::NAN; 50],
        vec![0.0; 3000],
        vec![1.0; 3000],
        vec![
            f64::MAX,
            f64::MIN,
            1e-300,
            f64::INFINITY,
            f64::NEG_INFINITY,
            f64::NAN,
        ],
        (0..5000).map(|k| f64::from(k).exp2()).collect(),
        (0..5000).map(|k| 1e9 + 1e-9 * f64::from(k)).collect(),
        (0..5000)
            .map(|k| {
                if k % 3 == 0 {
                    f64::NAN
                } else {
                    f64::from(k % 2)
                }
            })
            .collect(),
    ]
}
