//! Tests of report and workbench in a real browser.

use crate::Task;
use crate::shell::{cargo, command, exists, program, root, run};
use anyhow::{Result, bail};

pub(crate) const TASK: Task = Task {
    name: "browser",
    does: "tests report and workbench in chromium; leaves pictures in target/browser; --bless stores these pictures as the reference",
    run: browser,
};

pub(crate) fn browser(arguments: &[String]) -> Result<()> {
    let bless = match arguments {
        [] => false,
        [only] if only == "--bless" => true,
        _ => bail!("browser accepts --bless and no other option"),
    };
    if !exists("chromium") {
        bail!("chromium is missing; run `cargo xtask setup`");
    }
    // The accessibility checker.
    let web = root().join("host-fit/web");
    if !web.join("node_modules/axe-core").is_dir() {
        let mut npm = command(
            "npm",
            &["ci", "--ignore-scripts", "--no-audit", "--no-fund"],
        );
        npm.current_dir(web);
        run(&mut npm)?;
    }
    // The tests run the present program.
    program()?;
    let mut tests = cargo(
        "test --release --package=scenarios --test=browser -- --ignored --nocapture \
                --test-threads=1",
    );
    if bless {
        tests.env("BLESS", "1");
    }
    run(&mut tests)
}
