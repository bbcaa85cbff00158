//! A term outside the catalogue, and one that the records do not distinguish from another: found on the page, up to
//! the end.

use std::fmt::Write as _;
use std::path::Path;

use super::{SIZE, Steps, Window, serve};

const PERIOD_S: f64 = 0.002;

/// Numbers that repeat.
struct Chance(u32);

impl Chance {
    /// From 0 to 1.
    fn even(&mut self) -> f64 {
        self.0 = self.0.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        f64::from(self.0) / f64::from(u32::MAX)
    }

    /// Standard normal, nearly.
    fn normal(&mut self) -> f64 {
        (0..12).map(|_| self.even()).sum::<f64>() - 6.0
    }
}

/// A record: its name, its use, and the duration until the next switch, samples.
type Asked = (&'static str, &'static str, fn(&mut Chance) -> usize);

/// A first-order flow behind a valve. Its jet is the function `jet` of the arriving command and of the number of
/// its pulse; it is read with a noise of 0.01.
fn set(folder: &Path, samples: usize, records: &[Asked], jet: fn(&mut f64, f64, u32) -> f64) {
    const ARRIVES: usize = 20;
    const NOISE: f64 = 0.01;
    std::fs::create_dir_all(folder).expect("a folder");
    let mut manifest = format!("sample_period_s = {PERIOD_S}\n");
    for (number, (name, role, lasts)) in (1..).zip(records) {
        let mut chance = Chance(number);
        let mut csv = "t,u,y,y_sd\n".to_owned();
        let (mut y, mut u, mut left, mut pulses, mut state) = (0.0, 0.0, 0, 0, 0.0);
        let mut sent = vec![(0.0, 0); ARRIVES];
        for k in 0..samples {
            if left == 0 {
                u = 1.0 - u;
                pulses += u32::from(u == 1.0);
                left = lasts(&mut chance);
            }
            left -= 1;
            let (arrived, pulse) = std::mem::replace(&mut sent[k % ARRIVES], (u, pulses));
            let t = k as f64 * PERIOD_S;
            let read = y + NOISE * chance.normal();
            let _ = writeln!(csv, "{t:.3},{u},{read:.5},{NOISE}");
            y += 0.03 * (jet(&mut state, arrived, pulse) - y);
        }
        std::fs::write(folder.join(format!("{name}.csv")), csv).expect("a record");
        let _ = writeln!(
            manifest,
            "[[record]]\nname = \"{name}\"\nfile = \"{name}.csv\"\nuse = \"{role}\""
        );
    }
    std::fs::write(folder.join("dataset.toml"), manifest).expect("a manifest");
}

/// A random number of samples until the next switch, 40 to 400.
fn telegraph(chance: &mut Chance) -> usize {
    40 + (360.0 * chance.even()) as usize
}

/// Script that requests a small model with a short search.
const LEAN: &str = "(() => { const f = document.getElementById('identify').elements; f.delay.value = 'fixed'; f.n1.value = 1; f.n2.value = 1; f['max-lag'].value = 60; f.evaluations.value = 300; f.n1.form.requestSubmit(); })()";

#[test]
#[ignore = "needs chromium: cargo xtask browser"]
fn a_term_that_no_catalogue_has_is_found_and_taken_as_a_formula() {
    let folder = tempfile::tempdir().expect("a folder");
    let data = folder.path().join("tiring");
    let records: &[Asked] = &[
        ("square", "identify", |_| 150),
        ("a", "identify", telegraph),
        ("b", "identify", telegraph),
        ("slow", "validate", |_| 400),
        ("c", "validate", telegraph),
    ];
    // Jets that lose half of their strength over about six pulses: a sensor with decreasing sensitivity would give
    // the same readings.
    set(&data, 3000, records, |_, u, pulse| {
        u * (1.0 - 0.5 * (1.0 - (-(f64::from(pulse) - 1.0) / 6.0).exp()))
    });
    let mut steps = Steps::new("a term");
    let project = folder.path().join("project");
    let served = serve(&project, &[&data]);
    let b = Window::start();
    let page = b.open(&served.address, SIZE);
    page.has(20, ".record", 5);
    page.act(LEAN);
    page.idles_with(60, 1);
    steps.done("identified");
    page.click("#discover");
    page.idles_with(300, 2);
    page.until(
        20,
        "document.querySelectorAll('.model')[1].textContent.includes('-by-pulse-number')",
    );
    steps.done("discovered");
    // The finding appears in the section of the search: the page stays with its model and links to the new one.
    page.until(20, "document.querySelector('.model.current').textContent.startsWith('1.') && document.getElementById('go-on').textContent === 'Go to model 2'");
    page.until(20, "document.querySelector('#discovery svg') !== null && document.querySelector('#discovery h3').textContent.includes('pulse number')");
    page.scroll_to("#discovery-section");
    page.shoot("workbench-term.png");
    page.accessible();
    let formula = page.text("#discovery code");
    assert!(formula.contains("exp("), "{formula}");
    // The formula goes into the editor as an effect file, and from there into the model.
    page.click_text("#discovery button", "Open its effect file");
    page.until(20, "document.getElementById('own-told').textContent.includes('-by-pulse-number') && document.getElementById('own-text').value.includes('exp(')");
    page.click("#own-add");
    page.idles_with(60, 3);
    let times_noise = page.times_noise();
    assert!(times_noise < 1.15, "{times_noise}");
    steps.done("as a formula in the model");
    b.has_no_faults();
}

#[test]
#[ignore = "needs chromium: cargo xtask browser"]
fn the_experiment_that_tells_is_drawn_and_saved() {
    let folder = tempfile::tempdir().expect("a folder");
    let data = folder.path().join("saturation");
    // A pull that grows with the cube of y is not distinguishable from a pull that grows with its duration if
    // all square waves are slow.
    let records: &[Asked] = &[
        ("a", "identify", |_| 250),
        ("b", "identify", |_| 150),
        ("c", "validate", |_| 250),
    ];
    set(&data, 3000, records, |y, u, _| {
        let pull = 0.02 / 0.03 * y.powi(3);
        *y += 0.03 * (u - pull - *y);
        u - pull
    });
    let mut steps = Steps::new("what the records cannot tell");
    let project = folder.path().join("project");
    let served = serve(&project, &[&data]);
    let b = Window::start();
    let page = b.open(&served.address, SIZE);
    page.has(20, ".record", 3);
    page.act(LEAN);
    page.idles_with(60, 1);
    steps.done("identified");
    page.click("#diagnose");
    page.until(300, "document.getElementById('work').hidden && document.querySelector('#missing h3')?.textContent.startsWith('Experiment that distinguishes')");
    steps.done("diagnosed");
    page.scroll_to("#missing h3");
    page.shoot("workbench-experiment.png");
    page.accessible();
    let csv = page.download("#missing a", "experiment.csv");
    let mut rows = csv.lines().map(|line| line.split(',').collect::<Vec<_>>());
    assert_eq!(rows.next(), Some(vec!["t", "u"]));
    let switches: Vec<&str> = rows.map(|row| row[1]).collect();
    let edges = switches.windows(2).filter(|w| w[0] != w[1]).count();
    assert!(switches.len() > 500 && edges > 5, "{edges} edges");
    b.has_no_faults();
}
