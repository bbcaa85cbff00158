//! Builds the book with mdBook from the pages of `docs` and those of the catalogue.
//!
//! Pages of effects are written from the cards (`host-fit effects --json`) and checked in, so that links to them hold
//! without a build.

use std::fmt::Write as _;
use std::fs;
use std::path::Path;

use anyhow::{Context, Result, bail};
use serde::Deserialize;

mod residual;

use crate::Task;
use crate::shell::{command, exists, program, root, run, target};

pub(crate) const TASK: Task = Task {
    name: "book",
    does: "writes the pages of effects from the catalogue, checks every link and the length of pages, and builds the book with mdbook; --check compares the pages only",
    run: book,
};

/// Longest page, lines.
const LONGEST: usize = 250;

#[derive(Deserialize)]
struct Effect {
    name: String,
    place: String,
    summary: String,
    equation: String,
    channel: Option<String>,
    source: String,
    shows: Option<String>,
    check: Option<String>,
    confused_with: Option<String>,
    parameters: Vec<Parameter>,
}

#[derive(Deserialize)]
struct Parameter {
    name: String,
    unit: String,
    low: f64,
    high: f64,
}

pub(crate) fn book(arguments: &[String]) -> Result<()> {
    let check = match arguments {
        [] => false,
        [only] if only == "--check" => true,
        _ => bail!("book accepts --check and no other option"),
    };
    let docs = root().join("docs");
    for (path, text) in pages()? {
        let file = docs.join(&path);
        let there = fs::read_to_string(&file).unwrap_or_default();
        if there == text {
            continue;
        }
        if check {
            bail!("docs/{path} differs from the catalogue; run `cargo xtask book`");
        }
        if let Some(folder) = file.parent() {
            fs::create_dir_all(folder)?;
        }
        fs::write(&file, text)?;
        println!("written: docs/{path}");
    }
    contents(&docs)?;
    if check {
        return Ok(());
    }
    if !exists("mdbook") {
        println!("the pages are checked; to build the book, `cargo install mdbook --locked`");
        return Ok(());
    }
    let into = target().join("book");
    let mut mdbook = command("mdbook", &["build", "--dest-dir"]);
    mdbook.arg(&into).current_dir(root());
    run(&mut mdbook)?;
    println!("written: {}", into.join("index.html").display());
    Ok(())
}

/// Checks that every page is listed, every listed page exists, every link leads to a page, and no page is too
/// long.
fn contents(docs: &Path) -> Result<()> {
    let summary = fs::read_to_string(docs.join("SUMMARY.md")).context("docs/SUMMARY.md")?;
    let listed: Vec<String> = targets(&summary).collect();
    let mut files = Vec::new();
    markdown(docs, docs, &mut files)?;
    for page in files.iter().filter(|page| *page != "SUMMARY.md") {
        if !listed.contains(page) {
            bail!("docs/{page} is not in docs/SUMMARY.md");
        }
        let text = fs::read_to_string(docs.join(page))?;
        let lines = text.lines().count();
        if lines > LONGEST {
            bail!("docs/{page} has {lines} lines; split pages longer than {LONGEST}");
        }
        let folder = Path::new(page).parent().unwrap_or(Path::new(""));
        for link in targets(&text) {
            if !docs.join(folder).join(&link).exists() {
                bail!("docs/{page} links to {link}, which does not exist");
            }
        }
    }
    for page in &listed {
        if !files.contains(page) {
            bail!("docs/SUMMARY.md lists {page}, which does not exist");
        }
    }
    println!("{} pages; every link has a target", listed.len());
    Ok(())
}

/// Files that a page links to, without headings and without addresses elsewhere.
fn targets(text: &str) -> impl Iterator<Item = String> + '_ {
    let links = text.split("](").skip(1);
    let links = links.filter_map(|rest| rest.split(')').next());
    let files = links.map(|link| link.split('#').next().unwrap_or_default());
    files
        .filter(|file| !file.is_empty() && !file.contains("://"))
        .map(str::to_owned)
}

fn markdown(folder: &Path, docs: &Path, found: &mut Vec<String>) -> Result<()> {
    for entry in fs::read_dir(folder)? {
        let path = entry?.path();
        if path.is_dir() {
            markdown(&path, docs, found)?;
        } else if path.extension().is_some_and(|e| e == "md") {
            let path = path.strip_prefix(docs)?.to_string_lossy().into_owned();
            found.push(path.replace('\\', "/"));
        }
    }
    Ok(())
}

/// The generated pages: the catalogue, a page for each effect, the terms of base models.
fn pages() -> Result<Vec<(String, String)>> {
    let json = |arguments: &[&str]| -> Result<Vec<u8>> {
        let output = program()?
            .arg("effects")
            .args(arguments)
            .arg("--json")
            .output()?;
        if !output.status.success() {
            bail!("{}", String::from_utf8_lossy(&output.stderr));
        }
        Ok(output.stdout)
    };
    let effects: Vec<Effect> = serde_json::from_slice(&json(&[])?)?;
    let base = [
        "dispersed-delay",
        "lagging-drive",
        "slow-wake",
        "level-rate",
        "reading-curve",
        "direct-part",
        "sensor-resonance",
        "zero-offset",
        "constant-delay",
        "saturating-delay",
    ];
    let base = base.iter().map(|name| {
        let effect: Effect = serde_json::from_slice(&json(&[name])?)?;
        Ok(effect)
    });
    let base: Vec<Effect> = base.collect::<Result<_>>()?;
    let mut all = vec![
        ("effects.md".to_owned(), catalogue(&effects)),
        ("base-terms.md".to_owned(), base_terms(&base)),
    ];
    let program = program()?;
    for effect in &effects {
        let name = &effect.name;
        let picture = residual::drawn(program.get_program(), name)?;
        let parameters = picture.as_ref().map(|(_, parameters)| *parameters);
        all.push((format!("effects/{name}.md"), page(effect, parameters)));
        all.extend(picture.map(|(svg, _)| (format!("effects/{name}.svg"), svg)));
    }
    Ok(all)
}

const MADE: &str =
    "<!-- Written by `cargo xtask book` from the catalogue; edit the cards, not this page. -->\n";

fn catalogue(effects: &[Effect]) -> String {
    let mut text = format!(
        "# The catalogue of effects\n\n{MADE}\nAn effect is one physical mechanism that a model can lack. \
         `host-fit diagnose` tries all of them, `host-fit extend --effect NAME`\nadds one. The second column \
         is what the records show; the name is its interpretation in a flow.\n\n| effect | records show | \
         place |\n|---|---|---|\n"
    );
    for effect in effects {
        let shows = effect.shows.as_deref().unwrap_or(&effect.summary);
        let _ = writeln!(
            text,
            "| [{0}](effects/{0}.md) | {shows} | {1} |",
            effect.name, effect.place
        );
    }
    text.push_str(
        "\nTerms that `identify` adds by itself and that are never reported as missing: [base terms](base-terms.md). For an effect that\n\
         is not in the catalogue, [write your own](user-effects.md) or let [`discover`](discover.md) find it. To add an effect to the catalogue: [adding an effect](adding-an-effect.md).\n",
    );
    text
}

/// The page of an effect; `simulated` are the parameters of its picture, if it has one.
fn page(effect: &Effect, simulated: Option<&str>) -> String {
    let mut text = format!("# {}\n\n{MADE}\n", effect.name);
    let rows = [
        ("the records show", effect.shows.as_deref()),
        ("in a flow", Some(effect.summary.as_str())),
        ("acts at", Some(effect.place.as_str())),
        ("is confused with", effect.confused_with.as_deref()),
        ("bench check", effect.check.as_deref()),
        ("needs the channel", effect.channel.as_deref()),
        ("source", Some(effect.source.as_str())),
    ];
    text.push_str("| | |\n|---|---|\n");
    for (label, value) in rows {
        if let Some(value) = value {
            let _ = writeln!(text, "| {label} | {} |", value.replace('|', "\\|"));
        }
    }
    let _ = write!(text, "\n## Equation\n\n{}\n", quoted(&effect.equation));
    text.push_str(&parameters(effect));
    if let Some(simulated) = simulated {
        let with = match simulated {
            "" => String::new(),
            parameters => format!(" with {parameters}"),
        };
        let _ = write!(
            text,
            "\n## Residual\n\n![Response with and without {0}, and their difference]({0}.svg)\n\nSimulated{with}. Above: y \
             with the effect, and y of the same model without it. Below: the difference, which is\nthe residual of the model \
             without the effect. A refit of the other parameters makes this residual smaller.\n",
            effect.name
        );
    }
    let _ = write!(
        text,
        "\n## Use\n\n    host-fit extend model.toml DATASET --effect {} -o better.toml\n",
        effect.name
    );
    text
}

fn base_terms(terms: &[Effect]) -> String {
    let mut text = format!(
        "# Terms of base models\n\n{MADE}\n`identify` adds one of these terms if it lowers the validation \
             error; `diagnose` never reports them as missing. `host-fit effects NAME` prints a single term.\n"
    );
    for term in terms {
        let _ = write!(
            text,
            "\n## {}\n\n{} ({}).\n\n{}\n",
            term.name,
            capitalised(&term.summary),
            term.place,
            quoted(&term.equation)
        );
        text.push_str(&parameters(term).replace("\n## ", "\n### "));
        let _ = writeln!(text, "\nSource: {}.", term.source);
    }
    text.push_str(
        "\n## flow-lag\n\nA second lag in series with the first (flow).\n\n    T2·q̇ = u(t − h) − q; q \
         replaces u(t − h) in the recursion\n\n## flow-memory\n\nA later lag of y in the recursion: the flow \
         depends on its own past (flow).\n\n    a·y(t − T) is added, and c·y(t − T)·u(t − h) while the command \
         is on\n",
    );
    text
}

fn capitalised(text: &str) -> String {
    let mut letters = text.chars();
    let first = letters.next().map(|c| c.to_uppercase().to_string());
    first.unwrap_or_default() + letters.as_str()
}

fn quoted(equation: &str) -> String {
    format!("    {equation}")
}

fn parameters(effect: &Effect) -> String {
    if effect.parameters.is_empty() {
        return String::new();
    }
    let mut text =
        "\n## Parameters\n\n| parameter | unit | searched from | to |\n|---|---|---|---|\n"
            .to_owned();
    for parameter in &effect.parameters {
        let unit = match parameter.unit.as_str() {
            "-" => "",
            unit => unit,
        };
        let _ = writeln!(
            text,
            "| `{}` | {unit} | {} | {} |",
            parameter.name,
            parameter.low.to_string().replace('-', "−"),
            parameter.high.to_string().replace('-', "−")
        );
    }
    text
}
