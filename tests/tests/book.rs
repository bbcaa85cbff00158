//! The first pages contain the output of the program: their commands are run, and the results must be on them word
//! for word.

use std::path::{Path, PathBuf};
use std::process::Command;

use scenarios::program;

fn root() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("..")
}

/// The commands of a page that begin with `host-fit WORD`, indented by four.
fn command(page: &str, word: &str) -> Vec<String> {
    let start = format!("    host-fit {word} ");
    let line = page.lines().find(|line| line.starts_with(&start));
    let line = line.unwrap_or_else(|| panic!("no command {word}"));
    let words = line.split_whitespace().skip(1);
    words.map(str::to_owned).collect()
}

#[test]
fn the_first_ten_minutes_print_what_the_page_says() {
    let page = std::fs::read_to_string(root().join("docs/start.md")).expect("the page");
    let folder = tempfile::tempdir().expect("a folder");
    let data = folder.path().join("data/hidden-ramp");
    std::fs::create_dir_all(&data).expect("a folder");
    for entry in std::fs::read_dir(root().join("data/hidden-ramp")).expect("the data") {
        let path = entry.expect("an entry").path();
        std::fs::copy(&path, data.join(path.file_name().expect("a name"))).expect("a copy");
    }
    for word in ["identify", "diagnose"] {
        let output = Command::new(program())
            .args(command(&page, word))
            .current_dir(folder.path())
            .output()
            .expect("the program starts");
        let text = String::from_utf8(output.stdout).expect("UTF-8");
        assert!(output.status.success(), "{text}");
        // Compares the answer up to its next command.
        for line in text.lines() {
            assert!(page.contains(line), "`{line}` is not on the page");
            if line.starts_with("  Next:") {
                break;
            }
        }
    }
}
