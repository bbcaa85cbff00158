//! The words of messages and pages: phrases that a control engineer has to read twice stay out, the field's terms stay in.

use std::path::{Path, PathBuf};

fn root() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("..")
}

/// Phrases that messages and user pages must not contain, and their replacements.
const BANNED: [(&str, &str); 42] = [
    ("held-out error", "validation error"),
    ("Held-out", "validation"),
    ("held-out record", "validation record"),
    ("kept back", "validation record"),
    ("quoted on", "independent estimate on"),
    ("quote on", "independent estimate on"),
    ("noise floor", "noise level"),
    ("times it is left", "× the noise level"),
    ("is at the floor", "is at the noise level"),
    ("the excess", "model error above the noise"),
    ("Noise alone would", "Family-wise p"),
    ("would do as much", "family-wise p"),
    ("by chance", "significant, p"),
    ("cannot tell", "not distinguishable on these data"),
    ("cannot be told", "not identifiable, not distinguishable"),
    ("tell apart", "distinguish"),
    ("tells apart", "distinguishes"),
    ("told apart", "distinguished"),
    ("stand in for", "surrogate"),
    ("stands in for", "surrogate"),
    ("take the rest", "surrogate"),
    ("takes the rest", "surrogate"),
    ("does as well", "fits equally well"),
    ("do as well", "fit equally well"),
    (
        "makes do with less",
        "fits equally well with fewer parameters",
    ),
    ("the leanest", "the fewest lags, the base model"),
    ("learned from", "estimation records"),
    ("where they pay", "if they lower the error enough"),
    (
        "as long as they pay",
        "as long as they lower the error enough",
    ),
    ("earn their place", "lower the validation error enough"),
    ("earns its place", "lowers the validation error enough"),
    ("lived through", "simulated before the first sample"),
    (
        "beside something unexplained",
        "and something is unexplained",
    ),
    ("that is held back", "that is delayed"),
    ("edges held back", "delayed edges"),
    ("without being told", "without further information"),
    ("sets out from", "starts at"),
    ("goes the wrong way", "inverse response"),
    ("for the time it takes", "limits the time"),
    ("may be used; ", "allowed; "),
    (
        "What p and intervals are worth,",
        "Reliability of p-values and intervals",
    ),
    ("which any static curve maps", "every static curve maps"),
];

/// Phrases of comments and of every page of the book that only their author understands.
const ELLIPTIC: &str = "tell apart, told apart, cannot be told, takes the rest, stands in for, does as well, \
    makes do with, earn its place, earns its place, the leanest, is told nothing, \
    noise alone would, what is left of it, as it stands here, lived through, \
    nobody had looked at";

/// Pages for users, without those generated from code.
const PAGES: &str = "README.md, docs/start.md, docs/pages.md, docs/glossary.md, docs/evidence.md, \
    docs/guide.md, docs/base-terms.md, docs/discover.md, docs/hidden-effects.md, \
    docs/calibration.md, docs/files.md, docs/install.md, docs/limits.md, docs/literature.md, \
    docs/search.md, docs/strangers.md, docs/testing.md, docs/history/diagnosis.md, \
    docs/history/discover.md";

/// Folders beside `host-fit/src` whose messages users read.
const MORE_MESSAGES: &str =
    "host-fit/web/src, workbench/src, recordings/src, rig-line/src, closed-loop/src";

/// Files whose messages users read.
fn sources(folder: &Path, found: &mut Vec<PathBuf>) {
    for entry in std::fs::read_dir(folder).expect("a folder") {
        let path = entry.expect("an entry").path();
        if path.is_dir() {
            sources(&path, found);
        } else if path
            .extension()
            .is_some_and(|e| e == "rs" || e == "html" || e == "js")
        {
            found.push(path);
        }
    }
}

/// The string literals of a Rust source, comments and unit tests left out; of commands, the doc comments as well, which
/// are their help.
fn texts(path: &Path) -> Vec<String> {
    let source = std::fs::read_to_string(path).expect("a source");
    if path.extension().is_some_and(|e| e == "html") {
        return vec![source];
    }
    if path.extension().is_some_and(|e| e == "js") {
        // Texts of a script are in three kinds of quotes, so its whole code is searched.
        let code = source.lines().map(str::trim_start);
        let code = code.filter(|line| !["//", "/*", "*"].iter().any(|c| line.starts_with(c)));
        return vec![code.collect::<Vec<_>>().join(" ")];
    }
    let code = match source.find("#[cfg(test)]\nmod tests") {
        Some(at) => &source[..at],
        None => &source,
    };
    let help = path.components().any(|c| c.as_os_str() == "commands");
    let mut all = Vec::new();
    if help {
        let comments = code.lines().map(str::trim_start);
        let comments = comments.filter_map(|line| line.strip_prefix("/// "));
        all.push(comments.collect::<Vec<_>>().join(" "));
    }
    let plain: Vec<&str> = code
        .lines()
        .filter(|line| !line.trim_start().starts_with("//"))
        .collect();
    let plain = plain.join("\n");
    let mut letters = plain.chars();
    let mut literal: Option<String> = None;
    while let Some(c) = letters.next() {
        match (&mut literal, c) {
            (Some(text), '\\') => {
                // In a continued line, the line break and the indent are not part of the text.
                match letters.next() {
                    Some('\n') => {
                        let rest = letters.clone();
                        let skipped = rest.take_while(|c| c.is_whitespace()).count();
                        (0..skipped).for_each(|_| {
                            letters.next();
                        });
                    }
                    Some('n') => text.push(' '),
                    Some(other) => text.push(other),
                    None => {}
                }
            }
            (Some(_), '"') => all.extend(literal.take()),
            (Some(text), c) => text.push(c),
            (None, '"') => literal = Some(String::new()),
            (None, '\'') => {
                // This begins a character literal or a lifetime.
                let mut ahead = letters.clone();
                if ahead.next() == Some('"') && ahead.next() == Some('\'') {
                    letters = ahead;
                }
            }
            (None, _) => {}
        }
    }
    all
}

#[test]
fn banned_phrases_are_in_no_message() {
    let mut files = Vec::new();
    sources(&root().join("host-fit/src"), &mut files);
    let commands = files.len();
    assert!(commands > 200, "{commands}");
    for folder in MORE_MESSAGES.split(", ") {
        sources(&root().join(folder), &mut files);
    }
    assert!(files.len() > commands + 40, "{}", files.len());
    let mut found = Vec::new();
    for file in &files {
        // Rules describe internal decisions; their page is for readers who change a rule.
        if file.ends_with("rules.rs") {
            continue;
        }
        for text in texts(file) {
            for (banned, instead) in BANNED {
                if text.contains(banned) {
                    let at = text.find(banned).unwrap_or(0);
                    let before = text[..at].chars().count().saturating_sub(60);
                    let start: String = text.chars().skip(before).take(120).collect();
                    found.push(format!(
                        "{}: \"{banned}\" (say \"{instead}\") in: {start}",
                        file.display()
                    ));
                }
            }
        }
    }
    assert!(found.is_empty(), "{}", found.join("\n"));
}

#[test]
fn banned_phrases_are_on_no_page_for_users() {
    let mut found = Vec::new();
    for page in PAGES.split(", ") {
        let text = std::fs::read_to_string(root().join(page)).expect(page);
        for (number, line) in text.lines().enumerate() {
            for (banned, instead) in BANNED {
                if line.contains(banned) {
                    found.push(format!(
                        "{page}:{}: \"{banned}\" (say \"{instead}\")",
                        number + 1
                    ));
                }
            }
        }
    }
    assert!(found.is_empty(), "{}", found.join("\n"));
}

/// The comments of a Rust source, line ends left out.
fn comments(path: &Path) -> String {
    let source = std::fs::read_to_string(path).expect("a source");
    let lines = source.lines().map(str::trim_start);
    let lines = lines.filter_map(|line| line.strip_prefix("//"));
    let words = lines.map(|line| line.trim_start_matches(['/', '!']).trim());
    words.collect::<Vec<_>>().join(" ")
}

#[test]
fn elliptic_phrases_are_in_no_comment_and_on_no_page() {
    let mut files = Vec::new();
    for package in [
        "model-core",
        "numerics",
        "recordings",
        "host-fit",
        "firmware-sim",
    ] {
        sources(&root().join(package).join("src"), &mut files);
    }
    files.retain(|file| file.extension().is_some_and(|e| e == "rs"));
    let mut texts: Vec<(PathBuf, String)> = Vec::new();
    texts.extend(files.into_iter().map(|file| {
        let text = comments(&file);
        (file, text)
    }));
    let mut folders = vec![root().join("docs")];
    while let Some(folder) = folders.pop() {
        for entry in std::fs::read_dir(folder).expect("a folder") {
            let path = entry.expect("an entry").path();
            if path.is_dir() {
                folders.push(path);
            } else if path.extension().is_some_and(|e| e == "md") {
                let text = std::fs::read_to_string(&path).expect("a page");
                texts.push((path, text.replace('\n', " ")));
            }
        }
    }
    assert!(texts.len() > 350, "{}", texts.len());
    let mut found = Vec::new();
    for (path, text) in &texts {
        for phrase in ELLIPTIC.split(", ") {
            if text.contains(phrase) {
                found.push(format!("{}: \"{phrase}\"", path.display()));
            }
        }
    }
    assert!(found.is_empty(), "{}", found.join("\n"));
}

#[test]
fn the_terms_of_the_field_are_said_and_explained() {
    let glossary = std::fs::read_to_string(root().join("docs/glossary.md")).expect("the page");
    let terms = "validation record, estimation record, free run, noise level, \
        model error above the noise, model order, base model, candidate, surrogate, \
        family-wise p-value, not distinguishable, identifiable, dead time, over-fitting, \
        cross-validation, bootstrap, evidence, record-to-record offset, parsimony, \
        residual autocorrelation, false discovery, e-value, Bayes factor, certificate, \
        equivalence set, base term, baseline, stand-in, restarted error, \
        unexplained variance share, × the noise level, detectable size, delay law, \
        residual cross-correlation with u, imitates, below the practical margin, screened only";
    for term in terms.split(", ") {
        assert!(
            glossary.contains(&format!("**{term}**")),
            "{term} is not in the glossary"
        );
    }
    let mut files = Vec::new();
    sources(&root().join("host-fit/src"), &mut files);
    let said: Vec<String> = files.iter().flat_map(|file| texts(file)).collect();
    let terms = "validation error, noise level, Family-wise p, surrogate, \
        Not distinguishable on these data, over-fit, identifiable, cross-validation, bootstrap";
    for term in terms.split(", ") {
        assert!(
            said.iter().any(|text| text.contains(term)),
            "no message says {term}"
        );
    }
}

/// The message on the reliability of p-values and intervals quotes the page with the counts.
#[test]
fn the_calibration_that_messages_quote_is_that_of_the_pages() {
    let page = std::fs::read_to_string(root().join("docs/calibration.md")).expect("the page");
    let evidence = std::fs::read_to_string(root().join("docs/evidence.md")).expect("the page");
    assert!(evidence.contains("1 of 40 rigs without an effect got a false name"));
    let held = page
        .lines()
        .filter(|line| line.starts_with("| 95 % intervals that contain"));
    let counts = held.map(|line| {
        let cell = line.split('|').nth(2).expect("a cell");
        let mut words = cell.split_whitespace();
        let number =
            |word: Option<&str>| word.and_then(|w| w.parse::<f64>().ok()).expect("a number");
        let held = number(words.next());
        (held, number(words.nth(1)))
    });
    let (held, all) = counts.fold((0.0, 0.0), |(a, b), (x, y)| (a + x, b + y));
    assert!((held / all - 0.9).abs() < 0.02, "{held} of {all}");
    let verdict = root().join("host-fit/src/steps/verdict.rs");
    let said = texts(&verdict).join(" ");
    assert!(said.contains("of 40 without a missing effect, one got a false name"));
    assert!(said.contains("about 90 % of the cases"));
}
