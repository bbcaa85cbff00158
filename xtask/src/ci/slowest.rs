//! The longest test programs in the output of `cargo test`.

/// Programs that are listed.
const LISTED: usize = 10;

/// A table of the test programs that took longest, and of the tests that reported missing data; empty if no test
/// program ran.
pub(super) fn lines(output: &str) -> Vec<String> {
    let mut programs = Vec::new();
    let mut running = None;
    for line in output.lines().map(str::trim) {
        if let Some(named) = line
            .strip_prefix("Running ")
            .or(line.strip_prefix("Doc-tests "))
        {
            running = Some(program(named));
        }
        let seconds = line
            .strip_prefix("test result:")
            .and_then(|rest| rest.rsplit_once("finished in ")?.1.strip_suffix('s'))
            .and_then(|seconds| seconds.parse::<f64>().ok());
        if let (Some(seconds), Some(name)) = (seconds, running.take_if(|_| seconds.is_some())) {
            programs.push((seconds, name));
        }
    }
    programs.sort_by(|a, b| b.0.total_cmp(&a.0));
    let rows = programs.iter().take(LISTED);
    let rows = rows.map(|(seconds, name)| format!("  {seconds:7.1} s  {name}"));
    let title = (!programs.is_empty()).then(|| "\nlongest test programs".to_owned());
    // The tests run one at a time, with the name on the same line.
    let skipped = output
        .lines()
        .filter_map(|line| Some(&line[line.find("skipped: ")?..]));
    title
        .into_iter()
        .chain(rows)
        .chain(skipped.map(str::to_owned))
        .collect()
}

/// The program's name without its hash, followed by its source.
fn program(named: &str) -> String {
    let Some((source, path)) = named.split_once(" (") else {
        return format!("documentation of {named}");
    };
    let file = path
        .trim_end_matches(')')
        .rsplit('/')
        .next()
        .unwrap_or(path);
    let name = file.rsplit_once('-').map_or(file, |(name, _)| name);
    format!("{name} ({source})")
}

#[cfg(test)]
mod tests {
    use super::*;

    const OUTPUT: &str = "    Finished `release` profile\n     \
        Running unittests src/lib.rs (target/release/deps/host_fit-0123456789abcdef)\n\n\
        running 2 tests\n\
        test a ... ok\n\
        skipped: real/silverbox is not there\n\
        test result: ok. 2 passed; 0 failed; 0 ignored; 0 measured; 0 filtered out; finished in 3.25s\n\n     \
        Running tests/slow.rs (target/release/deps/slow-0123456789abcdef)\n\
        test result: FAILED. 0 passed; 1 failed; 0 ignored; 0 measured; 0 filtered out; finished in 61.00s\n   \
        Doc-tests host_fit\n\
        test result: ok. 1 passed; 0 failed; 0 ignored; 0 measured; 0 filtered out; finished in 0.10s\n";

    #[test]
    fn programs_are_listed_by_their_time() {
        assert_eq!(
            lines(OUTPUT),
            [
                "\nlongest test programs",
                "     61.0 s  slow (tests/slow.rs)",
                "      3.2 s  host_fit (unittests src/lib.rs)",
                "      0.1 s  documentation of host_fit",
                "skipped: real/silverbox is not there",
            ]
        );
        assert_eq!(lines("nothing of tests\n"), Vec::<String>::new());
    }
}
