//! Speed of pages: the page's own times, on the longest records.

use std::fmt::Write as _;
use std::path::Path;
use std::time::Instant;

use super::{SIZE, SLOWEST_FRAME, Window, root, serve};

/// A record of a flow that lags behind the valve, with repeatable noise.
fn record(samples: usize, period: f64) -> String {
    let mut csv = "t,u,y\n".to_owned();
    let (mut y, mut noise) = (0.0, 1_u32);
    for k in 0..samples {
        let u = f64::from(u8::from(k / 250 % 3 == 1));
        y += 0.01 * (u - y);
        noise = noise.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        let scatter = 0.02 * (f64::from(noise) / f64::from(u32::MAX) - 0.5);
        let _ = writeln!(csv, "{:.3},{u},{:.5}", k as f64 * period, y + scatter);
    }
    csv
}

fn set(folder: &Path, records: usize, samples: usize) {
    std::fs::create_dir_all(folder).expect("a folder");
    let mut manifest = "sample_period_s = 0.001\n".to_owned();
    for r in 0..records {
        let role = if r == 0 { "identify" } else { "validate" };
        let _ = writeln!(
            manifest,
            "[[record]]\nname = \"r{r}\"\nfile = \"r{r}.csv\"\nuse = \"{role}\""
        );
        std::fs::write(folder.join(format!("r{r}.csv")), record(samples, 0.001)).expect("a record");
    }
    std::fs::write(folder.join("dataset.toml"), manifest).expect("a manifest");
}

#[test]
#[ignore = "needs chromium: cargo xtask browser"]
fn long_records_open_and_pan_smoothly() {
    eprintln!("speed");
    let folder = tempfile::tempdir().expect("a folder");
    let b = Window::start();

    // Ten minutes at 1 kHz in the workbench.
    let long = folder.path().join("long");
    set(&long, 1, 600_000);
    let served = serve(&folder.path().join("project"), &[&long]);
    let started = Instant::now();
    let page = b.open(&served.address, SIZE);
    page.until(60, "document.querySelectorAll('.record canvas').length > 0");
    let opened = started.elapsed().as_secs_f64();
    eprintln!(
        "  600 000 samples: server ready after {:.2} s, drawn {opened:.2} s after the page was asked for",
        served.ready_s
    );

    // Eight records of 10 000 samples with three models.
    let eight = folder.path().join("eight");
    set(&eight, 8, 10_000);
    let project = folder.path().join("models");
    for (n, model) in ["table-2-state-dependent", "table-2-fixed", "table-4-fixed"]
        .into_iter()
        .enumerate()
    {
        let model = root().join(format!("data/paper/{model}.toml"));
        let served = serve(&project, &[&eight, &"--model", &model]);
        drop(served);
        assert_eq!(
            std::fs::read_dir(&project)
                .expect("the project")
                .filter(|f| f
                    .as_ref()
                    .is_ok_and(|f| f.file_name().to_string_lossy().starts_with("model-")))
                .count(),
            n + 1
        );
    }
    let served = serve(&project, &[&eight]);
    let page = b.open(&format!("{}#beside=1,2", served.address), SIZE);
    page.until(60, "hostFit.groups[0].payload.runs.length === 3");
    page.act("document.querySelectorAll('.record')[3].scrollIntoView()");
    page.until(
        20,
        "document.querySelectorAll('.record canvas').length >= 4",
    );
    eprintln!("  8 × 10 000 × 3");
    assert!(page.panned() < SLOWEST_FRAME);

    // On an idle machine the page opens within 2 s.
    assert!(opened < 10.0, "600 000 samples took {opened} s");
    b.has_no_faults();
}
