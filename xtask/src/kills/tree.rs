//! The contents of a folder: every file with its bytes.

use anyhow::{Context, Result};
use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};

/// Beginning of the names of temporary files and folders.
const TEMPORARY: &str = ".host-fit-";
/// Folder of the files to which symbolic links lead.
pub(super) const LINKED: &str = "linked";

#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) enum Entry {
    File(Vec<u8>),
    Folder,
    Link(PathBuf),
}

/// Files and folders by relative path, without temporary ones.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub(super) struct Tree {
    pub(super) entries: BTreeMap<PathBuf, Entry>,
    /// Number of temporary files and folders.
    pub(super) temporary: usize,
}

impl Tree {
    pub(super) fn read(folder: &Path) -> Result<Self> {
        let mut tree = Self::default();
        tree.add(folder, Path::new(""))?;
        Ok(tree)
    }

    fn add(&mut self, root: &Path, within: &Path) -> Result<()> {
        let folder = root.join(within);
        for entry in fs::read_dir(&folder).with_context(|| folder.display().to_string())? {
            let entry = entry?;
            if entry.file_name().to_string_lossy().starts_with(TEMPORARY) {
                self.temporary += 1;
                continue;
            }
            let path = within.join(entry.file_name());
            let kind = entry.file_type()?;
            let content = if kind.is_symlink() {
                Entry::Link(fs::read_link(entry.path())?)
            } else if kind.is_dir() {
                self.add(root, &path)?;
                Entry::Folder
            } else {
                Entry::File(fs::read(entry.path())?)
            };
            self.entries.insert(path, content);
        }
        Ok(())
    }

    /// Replaces everything in `folder` by this tree.
    pub(super) fn write(&self, folder: &Path) -> Result<()> {
        if folder.exists() {
            fs::remove_dir_all(folder)?;
        }
        fs::create_dir_all(folder)?;
        // A folder precedes its files.
        for (path, entry) in &self.entries {
            let path = folder.join(path);
            match entry {
                Entry::File(bytes) => fs::write(path, bytes)?,
                Entry::Folder => fs::create_dir(path)?,
                Entry::Link(to) => link(to, &path)?,
            }
        }
        Ok(())
    }

    /// The entries of an output: a file, also at the end of a link, or a folder with its files.
    pub(super) fn output(&self, name: &Path) -> BTreeMap<&Path, &Entry> {
        let linked = Path::new(LINKED).join(name);
        let of = |path: &Path| path.starts_with(name) || path == linked;
        let entries = self.entries.iter().filter(|(path, _)| of(path));
        entries
            .map(|(path, entry)| (path.as_path(), entry))
            .collect()
    }

    /// Files and folders at the top, without the folder of linked files.
    pub(super) fn outputs(&self) -> Vec<PathBuf> {
        let top = |path: &&PathBuf| path.components().count() == 1 && !path.ends_with(LINKED);
        self.entries.keys().filter(top).cloned().collect()
    }
}

#[cfg(unix)]
fn link(to: &Path, path: &Path) -> Result<()> {
    Ok(std::os::unix::fs::symlink(to, path)?)
}

#[cfg(not(unix))]
fn link(_: &Path, path: &Path) -> Result<()> {
    anyhow::bail!("{}: no symbolic links on this system", path.display())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_tree_is_written_as_it_was_read() {
        let folder = tempfile::tempdir().unwrap();
        let (a, b) = (folder.path().join("a"), folder.path().join("b"));
        fs::create_dir_all(a.join("set/more")).unwrap();
        fs::create_dir_all(a.join(LINKED)).unwrap();
        fs::write(a.join("set/x.csv"), "1").unwrap();
        fs::write(a.join(LINKED).join("m.toml"), "2").unwrap();
        link(&Path::new(LINKED).join("m.toml"), &a.join("m.toml")).unwrap();
        fs::write(a.join(".host-fit-abc"), "half").unwrap();
        let mut tree = Tree::read(&a).unwrap();
        assert_eq!(tree.temporary, 1);
        tree.write(&b).unwrap();
        tree.temporary = 0;
        assert_eq!(Tree::read(&b).unwrap(), tree);
        assert_eq!(tree.outputs(), ["m.toml", "set"].map(PathBuf::from));
        assert_eq!(tree.output(Path::new("m.toml")).len(), 2);
        assert_eq!(tree.output(Path::new("set")).len(), 3);
    }
}
