//! Creates the two files of a new effect or delay law, initially without influence, and adds them to both
//! catalogues.

mod proof;

pub(crate) use proof::proof;

use crate::Task;
use crate::shell::{command, root, run};
use anyhow::{Context, Result, bail};
use std::fs;
use std::path::Path;

pub(crate) const TASK: Task = Task {
    name: "new-effect",
    does: "NAME --place jet|delay|flow|sensor: makes the files of a new effect for model and plant",
    run: new_effect,
};

const MODEL: &str = "model-core/src/effects";
const PLANT: &str = "firmware-sim/src/plant/effects";

/// Text that differs between the places; empty for delay laws, which have complete templates.
struct Holes {
    place: &'static str,
    /// In the model: place of the card, run of the test bench, hook.
    model: [(&'static str, &'static str); 6],
    /// In the plant: module, kind of part, its trait and hooks.
    plant: [(&'static str, &'static str); 6],
}

const PLACES: [Holes; 3] = [
    Holes {
        place: "jet",
        model: [
            ("Place", "Jet"),
            ("flow", ""),
            ("bench", "jets"),
            ("equation", "j = v·(1 + g)"),
            (
                "hook",
                "    #[inline]
    fn jet(&self, _state: &mut (), jet: T, _at: &Instant<'_, T>) -> T {
        jet + self.gain * jet
    }",
            ),
            ("model_test", "assert_eq!(jets(&effect, |_| 0.5)[0], 0.75);"),
        ],
        plant: [
            ("Room", "Nozzle"),
            ("Kind", "Jet"),
            ("Part", "JetPart"),
            ("piece", "Piece"),
            (
                "part",
                "    fn jump(&mut self, _t: f64, _from: f64, to: f64) -> f64 {
        to + self.gain * to
    }

    fn advance(&mut self, _t: f64, piece: &Piece) -> f64 {
        piece.to + self.gain * piece.to
    }",
            ),
            (
                "plant_test",
                "assert_eq!(effect.jump(0.0, 0.0, 0.5), 0.75);",
            ),
        ],
    },
    Holes {
        place: "flow",
        model: [
            ("Place", "Flow"),
            ("flow", "Flow, "),
            ("bench", "flow"),
            ("equation", "−g·s is added to the drive"),
            (
                "hook",
                "    #[inline]
    fn drives(&self) -> bool {
        true
    }
    #[inline]
    fn drive(&self, _state: &mut (), flow: &Flow<T>, _at: &Instant<'_, T>) -> T {
        -(self.gain * flow.relaxation) * flow.now
    }",
            ),
            (
                "model_test",
                "assert!((flow(&effect, |_| 0.9)[1999] - 0.6).abs() < 1e-9);",
            ),
        ],
        plant: [
            ("Room", "Flow"),
            ("Kind", "Flow"),
            ("Part", "FlowPart"),
            ("piece", ""),
            (
                "part",
                "    fn drive(&self, s: f64, _z: f64) -> f64 {
        -self.gain * s
    }",
            ),
            (
                "plant_test",
                "effect.gain *= 2.0;
        assert_eq!(effect.drive(0.5, 0.0), -0.5);",
            ),
        ],
    },
    Holes {
        place: "sensor",
        model: [
            ("Place", "Sensor"),
            ("flow", ""),
            ("bench", "readings"),
            ("equation", "y = s·(1 + g)"),
            (
                "hook",
                "    #[inline]
    fn sense(&self, _state: &mut (), signal: T, _at: &Instant<'_, T>) -> T {
        signal + self.gain * signal
    }",
            ),
            (
                "model_test",
                "assert_eq!(readings(&effect, |_| 0.5, |_| 0.0)[0], 0.75);",
            ),
        ],
        plant: [
            ("Room", "Sense"),
            ("Kind", "Sensor"),
            ("Part", "SensorPart"),
            ("piece", ""),
            (
                "part",
                "    fn jump(&mut self, to: f64) -> f64 {
        to + self.gain * to
    }",
            ),
            ("plant_test", "assert_eq!(effect.jump(0.5), 0.75);"),
        ],
    },
];

fn new_effect(arguments: &[String]) -> Result<()> {
    let words: Vec<&str> = arguments.iter().map(String::as_str).collect();
    let (&[name, "--place", place] | &["--place", place, name]) = words.as_slice() else {
        bail!("usage: `cargo xtask new-effect NAME --place jet|delay|flow|sensor`");
    };
    let written = write(&root(), name, place)?;
    for file in &written {
        println!("{file}");
    }
    println!("Both files have no influence yet; docs/adding-an-effect.md says what to add.");
    Ok(())
}

/// Writes both files below `root` and adds them to the catalogues; returns their paths.
pub(crate) fn write(root: &Path, name: &str, place: &str) -> Result<[String; 2]> {
    let word = |word: &str| {
        word.starts_with(|c: char| c.is_ascii_lowercase())
            && word
                .chars()
                .all(|c| c.is_ascii_lowercase() || c.is_ascii_digit())
    };
    if !name.split('-').all(word) {
        bail!(
            "`{name}` is not a valid effect name: use small letters and digits, words joined by `-`"
        );
    }
    let delay = place == "delay";
    let holes = PLACES.iter().find(|holes| holes.place == place);
    let holes = match holes {
        Some(holes) => [&holes.model[..], &holes.plant[..]].concat(),
        None if delay => Vec::new(),
        None => bail!("`{place}` is not a place: an effect acts on jet, delay, flow or sensor"),
    };
    let file = name.replace('-', "_");
    let fill = |template: &str| {
        let mut text = template.to_owned();
        for (hole, filling) in &holes {
            text = text.replace(&format!("@{hole}@"), filling);
        }
        let words = name.replace('-', " ");
        let article = if words.starts_with(['a', 'e', 'i', 'o', 'u']) {
            "an"
        } else {
            "a"
        };
        for (hole, filling) in [
            ("name", name),
            ("file", &file),
            ("Type", &type_name(name)),
            ("a", article),
            ("Words", &capital(&words)),
            ("words", &words),
        ] {
            text = text.replace(&format!("@{hole}@"), filling);
        }
        text
    };
    let [model, plant] = if delay {
        [
            include_str!("model_delay.txt"),
            include_str!("plant_delay.txt"),
        ]
    } else {
        [
            include_str!("model_effect.txt"),
            include_str!("plant_effect.txt"),
        ]
    };
    let model_line = if delay {
        format!("{file}::{}", type_name(name))
    } else {
        format!("{file}::{0}: {0}<T>", type_name(name))
    };
    let list = if delay { "delay_laws" } else { "catalogue" };
    let mut written = [const { String::new() }; 2];
    for (slot, (folder, text, module, list, line)) in written.iter_mut().zip([
        (MODEL, fill(model), "pub mod", list, model_line),
        (
            PLANT,
            fill(plant),
            "mod",
            "catalogue",
            format!("{file}::{}", type_name(name)),
        ),
    ]) {
        let path = root.join(folder).join(&file).with_extension("rs");
        if path.exists() {
            bail!("{} is there already", path.display());
        }
        let catalogue = root.join(folder).join("mod.rs");
        let old = fs::read_to_string(&catalogue)
            .with_context(|| format!("could not read {}", catalogue.display()))?;
        let entered =
            entered(&old, &format!("{module} {file};"), list, &line).with_context(|| {
                format!(
                    "{} has no list to which the effect could be added",
                    catalogue.display()
                )
            })?;
        fs::write(&path, text).with_context(|| format!("could not write {}", path.display()))?;
        fs::write(&catalogue, entered)?;
        let path = path.display().to_string();
        run(&mut command("rustfmt", &["--edition", "2024", &path]))?;
        *slot = path;
    }
    Ok(written)
}

/// The catalogue with `module` among the modules, in order, and `line` at the end of the list.
fn entered(text: &str, module: &str, list: &str, line: &str) -> Option<String> {
    let keyword = &module[..=module.rfind(' ')?];
    let is_module = |line: &&str| line.starts_with(keyword) && line.ends_with(';');
    let mut lines: Vec<&str> = text.lines().collect();
    let last = lines.iter().rposition(is_module)?;
    let place = lines
        .iter()
        .position(|line| is_module(line) && *line > module);
    lines.insert(place.unwrap_or(last + 1), module);
    let begin = format!("{list}! {{");
    let begin = lines.iter().position(|line| *line == begin)?;
    let end = begin + lines[begin..].iter().position(|line| line.trim() == "}")?;
    let line = format!("    {line},");
    lines.insert(end, &line);
    Some(lines.join("\n") + "\n")
}

/// `valve-lag` is `ValveLag`.
fn type_name(name: &str) -> String {
    name.split('-').map(capital).collect()
}

fn capital(word: &str) -> String {
    let mut letters = word.chars();
    let first = letters.next().map(|c| c.to_ascii_uppercase());
    first.into_iter().chain(letters).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_line_finds_its_place_in_a_catalogue() {
        let text = "pub mod b;\n#[cfg(test)]\nmod c;\npub mod d;\n\nmacro_rules! catalogue {\n}\n\ncatalogue! {\n    b::B,\n}\n";
        let found = entered(text, "pub mod c2;", "catalogue", "c2::C2").expect("a place");
        assert!(
            found.contains("mod c;\npub mod c2;\npub mod d;\n"),
            "{found}"
        );
        assert!(
            found.ends_with("catalogue! {\n    b::B,\n    c2::C2,\n}\n"),
            "{found}"
        );
        let last = entered(text, "pub mod e;", "catalogue", "e::E").expect("a place");
        assert!(last.contains("pub mod d;\npub mod e;\n"), "{last}");
        assert_eq!(type_name("valve-lag"), "ValveLag");
    }

    #[test]
    fn no_hole_is_left_open() {
        for holes in &PLACES {
            let known: Vec<&str> = [&holes.model[..], &holes.plant[..]]
                .concat()
                .iter()
                .map(|(hole, _)| *hole)
                .chain(["name", "file", "Type", "a", "Words", "words"])
                .collect();
            for template in [
                include_str!("model_effect.txt"),
                include_str!("plant_effect.txt"),
            ] {
                for hole in template.split('@').skip(1).step_by(2) {
                    assert!(known.contains(&hole), "{}: @{hole}@", holes.place);
                }
            }
        }
    }

    #[test]
    fn impossible_names_and_places_are_refused() {
        let nowhere = Path::new("nowhere");
        for (name, place) in [
            ("Valve", "jet"),
            ("valve_lag", "jet"),
            ("-", "jet"),
            ("a", "tail"),
        ] {
            assert!(write(nowhere, name, place).is_err(), "{name} {place}");
        }
    }
}
