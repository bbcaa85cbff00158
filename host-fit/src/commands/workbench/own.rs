//! The user's own effects: files in the project folder, with a check of their text.

use std::path::{Path, PathBuf};

use host_fit::output::write_atomic;
use host_fit::user_effect::Definition;
use serde_json::{Value, json};
use workbench::{Refusal, beneath};

/// The effect files of a project.
pub(super) struct OwnEffects(PathBuf);

/// Folder of the effect files in the project.
const EFFECTS: &str = "effects";

impl OwnEffects {
    pub(super) fn of(project: &Path) -> Self {
        Self(project.join(EFFECTS))
    }

    /// The files, sorted by name.
    pub(super) fn files(&self) -> Vec<PathBuf> {
        let names = super::names_in(&self.0, ".toml");
        names.iter().map(|name| self.0.join(name)).collect()
    }

    /// The file of the effect called `name`.
    pub(super) fn file(&self, name: &str) -> PathBuf {
        self.0.join(format!("{name}.toml"))
    }

    /// The effects with their texts.
    pub(super) fn state(&self) -> Value {
        let read = |path: PathBuf| {
            let text = std::fs::read_to_string(&path).ok()?;
            Some(json!({"name": path.file_stem()?.to_string_lossy(), "text": text}))
        };
        self.files().into_iter().filter_map(read).collect()
    }

    /// The effect's name, or the error in the text with its position.
    pub(super) fn check(text: &str) -> Value {
        match Definition::check(text, "the effect") {
            Ok(source) => json!({"name": source.name, "summary": source.summary}),
            Err(error) => {
                let at = error.place_in(text);
                json!({"error": error.to_string(), "line": at.map(|at| at.0), "column": at.map(|at| at.1)})
            }
        }
    }

    /// Stores a text as the file of its effect.
    pub(super) fn keep(&self, text: &str) -> Result<Value, Refusal> {
        let name = Definition::check(text, "the effect")?.name;
        let project = self.0.parent().unwrap_or(&self.0);
        let path = beneath(project, &Path::new(EFFECTS).join(format!("{name}.toml")))?;
        std::fs::create_dir_all(&self.0)?;
        write_atomic(&path, |out| out.write_all(text.as_bytes()))?;
        Ok(json!({"name": name}))
    }

    /// Deletes the file of an effect. Models that contain the effect keep it.
    pub(super) fn forget(&self, name: &str) -> Result<Value, Refusal> {
        let known = super::names_in(&self.0, ".toml");
        if !known.contains(&format!("{name}.toml")) {
            return Err(Refusal(format!(
                "there is no effect of your own called `{name}`"
            )));
        }
        std::fs::remove_file(self.file(name))?;
        Ok(json!({}))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const TEXT: &str = "name = \"warm\"\nplace = \"jet\"\nsummary = \"one line\"\nexpression = \"jet * gain\"\n\n[[parameter]]\nname = \"gain\"\nunit = \"-\"\nlow = 0.1\nhigh = 2.0\nstarts = [1.0]\n";

    #[test]
    fn a_mistake_has_its_place_in_the_text() {
        assert_eq!(OwnEffects::check(TEXT)["name"], "warm");
        let wrong = TEXT.replace("jet * gain", "jet * gian");
        let told = OwnEffects::check(&wrong);
        assert!(told["error"].as_str().unwrap().contains("`gian`"));
        assert_eq!((&told["line"], &told["column"]), (&json!(4), &json!(21)));
        assert_eq!(OwnEffects::check("name = ")["line"], 1);
    }

    #[test]
    fn effects_are_kept_under_their_names() {
        let folder = tempfile::tempdir().unwrap();
        let own = OwnEffects::of(folder.path());
        assert_eq!(own.keep(TEXT).unwrap()["name"], "warm");
        assert!(own.keep("name = \"../x\"").is_err());
        assert_eq!(own.state()[0]["name"], "warm");
        assert!(own.forget("../../etc/passwd").is_err());
        own.forget("warm").unwrap();
        assert!(own.files().is_empty());
    }
}
