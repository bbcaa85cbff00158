//! The project folder: models as files, the tree of their origins, and the log of commands.
//!
//! `tree.json` is written completely after every step, by a rename; a server that is killed leaves the last
//! complete state. The models are the files that the command line reads and writes. A lock refuses a second
//! workbench on the same folder.

use std::fs::{self, File};
use std::io::{self, Write};
use std::path::{Path, PathBuf};

use recordings::output::{OutputError, write_atomic};
use serde::{Deserialize, Serialize};

/// One model of the tree.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Node {
    /// Number of the model, from 1.
    pub id: u32,
    /// The model from which this model was made; `None` for a model that was identified or added by the user.
    pub parent: Option<u32>,
    /// The step in a few words: `identified`, `+ plenum-droop`.
    pub step: String,
    /// The step as a command line.
    pub command: String,
    /// The model's file, within the folder.
    pub file: String,
    /// Root mean square error on the validation records, y; `None` if the free run diverges.
    pub rmse: Option<f64>,
    /// The noise level on the validation records, y.
    pub noise_rmse: Option<f64>,
    /// FIT on the validation records, %.
    pub fit_percent: Option<f64>,
}

#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
struct Tree {
    format_version: u32,
    /// Hash of the data set from which the models were made.
    data: String,
    current: Option<u32>,
    nodes: Vec<Node>,
}

const FORMAT: u32 = 1;
const TREE: &str = "tree.json";
const LOG: &str = "log.txt";

/// Why a project folder cannot be used.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum ProjectError {
    /// The operating system refused.
    #[error("{path}: {cause}; check that the folder is writable and has space", path = .path.display())]
    Io {
        /// The file or folder.
        path: PathBuf,
        /// Message of the operating system.
        cause: io::Error,
    },
    /// Not written.
    #[error(transparent)]
    Output(#[from] OutputError),
    /// A link, which may lead out of the folder.
    #[error("{path} is a link, which is not allowed in a project: put the file itself in its place", path = .0.display())]
    Link(PathBuf),
    /// Another workbench has the project open.
    #[error("{path} is open in another workbench; use that one, or close it", path = .0.display())]
    Locked(PathBuf),
    /// `tree.json` is not a valid tree.
    #[error("{path} is not a list of models of this version ({cause}); choose another folder with --project", path = .path.display())]
    Tree {
        /// The file.
        path: PathBuf,
        /// The problem.
        cause: String,
    },
    /// Models of other data.
    #[error("{path} contains models of another data set; choose another folder with --project", path = .0.display())]
    OtherData(PathBuf),
    /// A model that is not in the tree.
    #[error("there is no model {0}")]
    NoNode(u32),
}

/// The path of `relative` within `folder`, if none of its parts is a link: nothing outside is read or written.
///
/// # Errors
/// [`ProjectError::Link`] naming the link.
pub fn beneath(folder: &Path, relative: &Path) -> Result<PathBuf, ProjectError> {
    let mut path = folder.to_path_buf();
    for part in relative.components() {
        path.push(part);
        if fs::symlink_metadata(&path).is_ok_and(|found| found.is_symlink()) {
            return Err(ProjectError::Link(path));
        }
    }
    Ok(path)
}

/// Whether a file is a model or a result of a step on one: `model-1.toml`, `model-1-loop.svg`, `diagnosis-1.html`.
fn is_result(name: &str) -> bool {
    let (stem, _) = name.rsplit_once('.').unwrap_or((name, ""));
    let number = stem.split('-').nth(1).unwrap_or_default();
    stem.starts_with(char::is_alphabetic)
        && !number.is_empty()
        && number.bytes().all(|b| b.is_ascii_digit())
}

/// A project folder that is open.
#[derive(Debug)]
pub struct Project {
    folder: PathBuf,
    tree: Tree,
    /// Held as long as the project is open; the system releases it when the process ends in any way.
    _lock: File,
}

impl Project {
    /// Opens the folder for the data set with this hash, or for its own data set; creates it if it does not exist.
    ///
    /// # Errors
    /// [`ProjectError`] naming the file, and the remedy.
    pub fn open(folder: &Path, data: Option<&str>) -> Result<Self, ProjectError> {
        let io = |path: &Path| {
            let path = path.to_path_buf();
            move |cause| ProjectError::Io { path, cause }
        };
        fs::create_dir_all(folder).map_err(io(folder))?;
        let path = beneath(folder, Path::new("lock"))?;
        let lock = File::options()
            .create(true)
            .truncate(false)
            .write(true)
            .open(&path)
            .map_err(io(&path))?;
        match lock.try_lock() {
            Ok(()) => {}
            Err(fs::TryLockError::WouldBlock) => {
                return Err(ProjectError::Locked(folder.to_path_buf()));
            }
            Err(fs::TryLockError::Error(cause)) => return Err(io(&path)(cause)),
        }
        let path = beneath(folder, Path::new(TREE))?;
        let wrong = |cause: String| ProjectError::Tree {
            path: path.clone(),
            cause,
        };
        let tree = match fs::read(&path) {
            Ok(bytes) => {
                let tree: Tree =
                    serde_json::from_slice(&bytes).map_err(|e| wrong(e.to_string()))?;
                check(&tree).map_err(wrong)?;
                tree
            }
            Err(e) if e.kind() == io::ErrorKind::NotFound => Tree {
                format_version: FORMAT,
                ..Tree::default()
            },
            Err(cause) => return Err(io(&path)(cause)),
        };
        let mut project = Self {
            folder: folder.to_path_buf(),
            tree,
            _lock: lock,
        };
        if let Some(data) = data {
            project.set_data(data)?;
        }
        Ok(project)
    }

    /// Sets the data set of the models.
    ///
    /// # Errors
    /// [`ProjectError::OtherData`] if there are models of another one.
    pub fn set_data(&mut self, data: &str) -> Result<(), ProjectError> {
        if !self.tree.nodes.is_empty() && self.tree.data != data {
            return Err(ProjectError::OtherData(self.folder.clone()));
        }
        data.clone_into(&mut self.tree.data);
        Ok(())
    }

    /// Sets the data set of the next models. Models of the previous one are moved with their results into a folder
    /// `earlier-1`, `earlier-2` …, which is a project of its own and is returned.
    ///
    /// # Errors
    /// [`ProjectError`] when a file cannot be copied; the project is then as before.
    pub fn start_anew(&mut self, data: &str) -> Result<Option<PathBuf>, ProjectError> {
        if self.tree.nodes.is_empty() || self.tree.data == data {
            self.set_data(data)?;
            return Ok(None);
        }
        let earlier = (1..).map(|n| self.folder.join(format!("earlier-{n}")));
        let Some(earlier) = earlier.into_iter().find(|folder| !folder.exists()) else {
            return Err(ProjectError::OtherData(self.folder.clone()));
        };
        let io = |path: &Path| {
            let path = path.to_path_buf();
            move |cause| ProjectError::Io { path, cause }
        };
        fs::create_dir_all(&earlier).map_err(io(&earlier))?;
        let entries = fs::read_dir(&self.folder).map_err(io(&self.folder))?;
        let files = entries
            .flatten()
            .filter(|e| e.file_type().is_ok_and(|kind| kind.is_file()));
        let results = files.map(|entry| entry.file_name());
        let results: Vec<_> = results
            .filter(|name| is_result(&name.to_string_lossy()))
            .collect();
        for name in results.iter().map(AsRef::as_ref).chain([Path::new(TREE)]) {
            let from = beneath(&self.folder, name)?;
            fs::copy(&from, earlier.join(name)).map_err(io(&from))?;
        }
        self.keep(Tree {
            format_version: FORMAT,
            data: data.to_owned(),
            ..Tree::default()
        })?;
        for name in &results {
            let path = self.folder.join(name);
            fs::remove_file(&path).map_err(io(&path))?;
        }
        Ok(Some(earlier))
    }

    /// The folder.
    #[must_use]
    pub fn folder(&self) -> &Path {
        &self.folder
    }

    /// Every model, in the order of creation.
    #[must_use]
    pub fn nodes(&self) -> &[Node] {
        &self.tree.nodes
    }

    /// The model that is worked on.
    #[must_use]
    pub fn current(&self) -> Option<u32> {
        self.tree.current
    }

    /// A model by its number.
    ///
    /// # Errors
    /// [`ProjectError::NoNode`].
    pub fn node(&self, id: u32) -> Result<&Node, ProjectError> {
        let mut nodes = self.tree.nodes.iter();
        nodes.find(|n| n.id == id).ok_or(ProjectError::NoNode(id))
    }

    /// Path of a model's file.
    ///
    /// # Errors
    /// [`ProjectError::Link`].
    pub fn path(&self, node: &Node) -> Result<PathBuf, ProjectError> {
        beneath(&self.folder, Path::new(&node.file))
    }

    /// The file name of the next model.
    #[must_use]
    pub fn next_file(&self) -> String {
        format!("model-{}.toml", self.next_id())
    }

    fn next_id(&self) -> u32 {
        let highest = self.tree.nodes.iter().map(|n| n.id).max();
        highest.unwrap_or(0).saturating_add(1)
    }

    /// Adds a model whose file is in the folder already, makes it the current one and logs its command. Its number
    /// is assigned here.
    ///
    /// # Errors
    /// [`ProjectError`] if the folder cannot be written; the tree is then unchanged.
    pub fn add(&mut self, node: Node) -> Result<u32, ProjectError> {
        let id = self.next_id();
        self.note(&node.command)?;
        let mut tree = self.tree.clone();
        tree.current = Some(id);
        tree.nodes.push(Node { id, ..node });
        self.keep(tree)?;
        Ok(id)
    }

    /// Makes another model the current one; undo, redo and branches use this.
    ///
    /// # Errors
    /// [`ProjectError`] if there is no such model or the folder cannot be written.
    pub fn select(&mut self, id: u32) -> Result<(), ProjectError> {
        self.node(id)?;
        let tree = Tree {
            current: Some(id),
            ..self.tree.clone()
        };
        self.keep(tree)
    }

    /// The commands so far, oldest first; the last hundred.
    #[must_use]
    pub fn log(&self) -> Vec<String> {
        let path = beneath(&self.folder, Path::new(LOG));
        let text = path.ok().and_then(|path| fs::read_to_string(path).ok());
        let text = text.unwrap_or_default();
        let lines: Vec<&str> = text.lines().collect();
        let from = lines.len().saturating_sub(100);
        let last = lines.iter().skip(from);
        last.map(|line| (*line).to_owned()).collect()
    }

    /// Notes a command in the log.
    ///
    /// # Errors
    /// [`ProjectError`] if the log cannot be written.
    pub fn note(&self, command: &str) -> Result<(), ProjectError> {
        let path = beneath(&self.folder, Path::new(LOG))?;
        let line = format!("{}\n", command.replace(['\n', '\r'], " "));
        File::options()
            .create(true)
            .append(true)
            .open(&path)
            .and_then(|mut file| file.write_all(line.as_bytes()))
            .map_err(|cause| ProjectError::Io { path, cause })
    }

    fn keep(&mut self, tree: Tree) -> Result<(), ProjectError> {
        let text = serde_json::to_vec_pretty(&tree).unwrap_or_default();
        write_atomic(&beneath(&self.folder, Path::new(TREE))?, |out| {
            out.write_all(&text)
        })?;
        self.tree = tree;
        Ok(())
    }
}

/// Checks a tree that may have been edited by hand: numbers are unique, parents precede their children, files are
/// inside the folder.
fn check(tree: &Tree) -> Result<(), String> {
    if tree.format_version != FORMAT {
        return Err(format!("format_version {}", tree.format_version));
    }
    for (i, node) in tree.nodes.iter().enumerate() {
        let earlier = || tree.nodes.iter().take(i);
        if earlier().any(|n| n.id == node.id) {
            return Err(format!("model {} twice", node.id));
        }
        if node.parent.is_some_and(|p| earlier().all(|n| n.id != p)) {
            return Err(format!(
                "model {} is listed before the model from which it was made",
                node.id
            ));
        }
        let mut parts = Path::new(&node.file).components();
        let plain = matches!(parts.next(), Some(std::path::Component::Normal(_)));
        if !plain || parts.next().is_some() {
            return Err(format!(
                "the file of model {} is not in the folder",
                node.id
            ));
        }
    }
    match tree.current {
        Some(id) if tree.nodes.iter().all(|n| n.id != id) => Err(format!("no model {id}")),
        _ => Ok(()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[cfg(unix)]
    #[test]
    fn links_are_not_followed() {
        use std::os::unix::fs::symlink;
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("p");
        let victim = folder.path().join("victim");
        fs::write(&victim, "PRECIOUS").unwrap();
        let mut project = Project::open(&path, Some("abc")).unwrap();
        for name in [LOG, TREE, "model-1.toml"] {
            let _ = fs::remove_file(path.join(name));
            symlink(&victim, path.join(name)).unwrap();
        }
        assert!(matches!(project.note("x"), Err(ProjectError::Link(_))));
        assert!(matches!(
            project.add(node(None, "m.toml")),
            Err(ProjectError::Link(_))
        ));
        assert!(matches!(
            project.path(&node(None, "model-1.toml")),
            Err(ProjectError::Link(_))
        ));
        assert!(project.log().is_empty());
        symlink(folder.path(), path.join("data")).unwrap();
        assert!(beneath(&path, Path::new("data/victim")).is_err());
        assert!(beneath(&path, Path::new("new/victim")).is_ok());
        drop(project);
        let error = Project::open(&path, None).unwrap_err().to_string();
        assert!(error.contains("tree.json is a link"), "{error}");
        assert_eq!(fs::read_to_string(victim).unwrap(), "PRECIOUS");
    }

    fn node(parent: Option<u32>, file: &str) -> Node {
        Node {
            id: 0,
            parent,
            step: "identified".to_owned(),
            command: "host-fit identify".to_owned(),
            file: file.to_owned(),
            rmse: Some(0.1),
            noise_rmse: None,
            fit_percent: None,
        }
    }

    #[test]
    fn a_folder_opened_again_is_as_it_was_left() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("p");
        {
            let mut project = Project::open(&path, Some("abc")).unwrap();
            let first = project.add(node(None, &project.next_file())).unwrap();
            project
                .add(node(Some(first), &project.next_file()))
                .unwrap();
            project.select(first).unwrap();
            assert!(project.select(9).is_err());
            assert!(matches!(
                Project::open(&path, Some("abc")),
                Err(ProjectError::Locked(_))
            ));
        }
        let project = Project::open(&path, Some("abc")).unwrap();
        assert_eq!(project.nodes().len(), 2);
        assert_eq!(project.current(), Some(1));
        assert_eq!(project.next_file(), "model-3.toml");
        assert_eq!(project.log().len(), 2);
        drop(project);
        assert!(matches!(
            Project::open(&path, Some("other")),
            Err(ProjectError::OtherData(_))
        ));
    }

    #[test]
    fn a_tree_that_leads_out_of_the_folder_is_refused() {
        let folder = tempfile::tempdir().unwrap();
        for (file, parent) in [
            ("../x.toml", "null"),
            ("/etc/passwd", "null"),
            ("a/b", "null"),
            ("a", "7"),
        ] {
            let text = format!(
                r#"{{"format_version":1,"data":"d","current":null,"nodes":[{{"id":1,"parent":{parent},"step":"","command":"","file":"{file}","rmse":null,"noise_rmse":null,"fit_percent":null}}]}}"#
            );
            fs::write(folder.path().join(TREE), text).unwrap();
            let error = Project::open(folder.path(), Some("d")).unwrap_err();
            assert!(
                matches!(error, ProjectError::Tree { .. }),
                "{file}: {error}"
            );
        }
        fs::write(folder.path().join(TREE), "{").unwrap();
        assert!(Project::open(folder.path(), Some("d")).is_err());
    }
}
