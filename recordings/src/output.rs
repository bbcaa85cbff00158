//! Atomic output: files are written completely or not at all.

use std::fs::{self, File};
use std::io::{self, BufWriter, Write};
use std::path::{Component, Path, PathBuf};

use crate::set::MANIFEST;

/// Why an output could not be written.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum OutputError {
    /// The operating system refused (no such folder, no permission, disk full …).
    #[error("{path} cannot be written ({cause}); no partial file was left; check that its folder exists, is \
         writable and has space", path = .path.display())]
    Io {
        /// The requested file or folder.
        path: PathBuf,
        /// Message of the operating system.
        cause: io::Error,
    },
    /// The path names a folder, the root, or nothing.
    #[error("{path} does not name a file; give a file name", path = .path.display())]
    NoFileName {
        /// The requested path.
        path: PathBuf,
    },
    /// A name inside a [`Staging`] folder that leads out of it.
    #[error("{path} leads out of the output folder; use a plain relative name", path = .path.display())]
    Outside {
        /// The requested name.
        path: PathBuf,
    },
}

/// Writes a file through `write`; the file appears under `path` only if everything succeeded.
///
/// An existing file is replaced (through a symbolic link, its target). A path that exists and is not a regular file
/// (`/dev/stdout`, a pipe) is written directly, because it cannot be renamed.
///
/// # Errors
/// [`OutputError`] if the temporary file cannot be made, `write` fails, or the rename is refused; the previous
/// content of `path` then stays.
pub fn write_atomic<F>(path: &Path, write: F) -> Result<(), OutputError>
where
    F: FnOnce(&mut dyn Write) -> io::Result<()>,
{
    let mut write = Some(write);
    write_once(path, &mut |to| {
        write.take().map_or(Ok(()), |write| write(to))
    })
}

/// [`write_atomic`], compiled once; calls `write` once.
fn write_once(
    path: &Path,
    write: &mut dyn FnMut(&mut dyn Write) -> io::Result<()>,
) -> Result<(), OutputError> {
    let failed = failed(path);
    let target = target(path)?;
    if target.exists() && !target.is_file() {
        let mut device = BufWriter::new(File::options().write(true).open(&target).map_err(failed)?);
        return write(&mut device)
            .and_then(|()| device.flush())
            .map_err(failed);
    }
    let mut temporary = temporary(&target).map_err(failed)?;
    {
        let mut buffered = BufWriter::with_capacity(1 << 16, temporary.as_file_mut());
        write(&mut buffered)
            .and_then(|()| buffered.flush())
            .map_err(failed)?;
    }
    temporary.as_file().sync_all().map_err(failed)?;
    temporary.persist(&target).map_err(|e| failed(e.error))?;
    Ok(())
}

/// Refuses an output that [`write_atomic`] could not write now; the existing file stays unchanged. For commands
/// that take long before they write.
///
/// # Errors
/// [`OutputError`] as of [`write_atomic`].
pub fn check_writable(path: &Path) -> Result<(), OutputError> {
    let target = target(path)?;
    if target.exists() && !target.is_file() {
        let device = File::options().write(true).open(&target);
        return device.map(drop).map_err(failed(path));
    }
    // Without a name, where the system supports that: nothing is left if the program is killed here.
    let unnamed = tempfile::tempfile_in(parent_of(&target));
    unnamed
        .map(drop)
        .map_err(|cause| failed(path)(without_temporary_name(cause)))
}

fn failed(path: &Path) -> impl Fn(io::Error) -> OutputError + Copy {
    |cause| OutputError::Io {
        path: path.to_path_buf(),
        cause,
    }
}

/// The file that is written for the requested `path`.
fn target(path: &Path) -> Result<PathBuf, OutputError> {
    let target = match fs::canonicalize(path) {
        Ok(existing) => existing,
        Err(e) if e.kind() == io::ErrorKind::NotFound => path.to_path_buf(),
        Err(e) => return Err(failed(path)(e)),
    };
    if target.is_dir() || target.file_name().is_none() {
        return Err(OutputError::NoFileName {
            path: path.to_path_buf(),
        });
    }
    Ok(target)
}

/// An empty file next to `target`, which is deleted when the returned value is dropped.
fn temporary(target: &Path) -> io::Result<tempfile::NamedTempFile> {
    permitted(tempfile::Builder::new().prefix(".host-fit-"), 0o666)
        .tempfile_in(parent_of(target))
        .map_err(without_temporary_name)
}

/// Several output files that belong together: they are written into a temporary folder next to the target and moved
/// in together.
///
/// Dropped without [`Staging::commit`], it removes everything it wrote.
#[derive(Debug)]
pub struct Staging {
    target: PathBuf,
    folder: tempfile::TempDir,
    names: Vec<PathBuf>,
}

impl Staging {
    /// Starts the files of the folder `target`, which need not exist yet (its parent must).
    ///
    /// # Errors
    /// [`OutputError`] if `target` is a file, or no folder can be made next to it.
    pub fn new(target: &Path) -> Result<Self, OutputError> {
        let failed = failed(target);
        let real = match fs::canonicalize(target) {
            Ok(existing) if existing.is_dir() => existing,
            Ok(_) => return Err(failed(io::Error::from(io::ErrorKind::NotADirectory))),
            Err(e) if e.kind() == io::ErrorKind::NotFound => target.to_path_buf(),
            Err(e) => return Err(failed(e)),
        };
        let folder = permitted(tempfile::Builder::new().prefix(".host-fit-"), 0o777)
            .tempdir_in(parent_of(&real))
            .map_err(|e| failed(without_temporary_name(e)))?;
        Ok(Self {
            target: real,
            folder,
            names: Vec::new(),
        })
    }

    /// Writes one file, `name` relative to the target folder (sub-folders are created).
    ///
    /// # Errors
    /// [`OutputError`] if the name leads out of the folder or the file cannot be written.
    pub fn write<F>(&mut self, name: &str, write: F) -> Result<(), OutputError>
    where
        F: FnOnce(&mut dyn Write) -> io::Result<()>,
    {
        let relative = Path::new(name);
        let plain = relative
            .components()
            .all(|c| matches!(c, Component::Normal(_)));
        if !plain || relative.file_name().is_none() {
            return Err(OutputError::Outside {
                path: relative.to_path_buf(),
            });
        }
        let staged = self.folder.path().join(relative);
        let named = |e: OutputError| match e {
            OutputError::Io { cause, .. } => OutputError::Io {
                path: self.target.join(relative),
                cause,
            },
            other => other,
        };
        fs::create_dir_all(parent_of(&staged)).map_err(|cause| {
            named(OutputError::Io {
                path: staged.clone(),
                cause,
            })
        })?;
        write_atomic(&staged, write).map_err(named)?;
        if !self.names.iter().any(|n| n == relative) {
            self.names.push(relative.to_path_buf());
        }
        Ok(())
    }

    /// Moves everything into the target folder; files of the same names are replaced, others stay.
    ///
    /// A new target appears complete in one rename. An existing target is exchanged in one rename, if the system
    /// supports that and everything else in the target can be linked. Otherwise the files are moved one by one. If the
    /// last one is `dataset.toml`, which lists the others, it is removed first: old and new files are never mixed in a
    /// loadable set.
    ///
    /// # Errors
    /// [`OutputError`] when a rename is refused.
    pub fn commit(self) -> Result<(), OutputError> {
        let failed = |path: &Path, cause: io::Error| OutputError::Io {
            path: path.to_path_buf(),
            cause,
        };
        if !self.target.exists() {
            fs::rename(self.folder.path(), &self.target).map_err(|e| failed(&self.target, e))?;
            // The folder has its final name now, so nothing remains to be removed.
            let _ = self.folder.keep();
            return Ok(());
        }
        let destinations: Vec<PathBuf> = self.names.iter().map(|n| self.target.join(n)).collect();
        if let Some(folder) = destinations.iter().find(|d| d.is_dir()) {
            return Err(failed(folder, io::Error::from(io::ErrorKind::IsADirectory)));
        }
        if swap::with(self.folder.path(), &self.target).is_ok() {
            return Ok(());
        }
        if let (Some(last), 2..) = (destinations.last(), destinations.len())
            && last.ends_with(MANIFEST)
        {
            match fs::remove_file(last) {
                Err(e) if e.kind() != io::ErrorKind::NotFound => return Err(failed(last, e)),
                _ => {}
            }
        }
        for (name, destination) in self.names.iter().zip(&destinations) {
            fs::create_dir_all(parent_of(destination)).map_err(|e| failed(destination, e))?;
            fs::rename(self.folder.path().join(name), destination)
                .map_err(|e| failed(destination, e))?;
        }
        Ok(())
    }
}

/// Atomic exchange of two folders.
mod swap {
    use std::fs;
    use std::io;
    use std::path::Path;

    /// Largest number of other files and folders in a target that is exchanged.
    const MOST: usize = 10_000;

    /// Exchanges the folders `new` and `old`, and keeps the files of `old` that `new` did not have, also those in
    /// folders. Afterwards `new` contains the replaced files.
    pub(super) fn with(new: &Path, old: &Path) -> io::Result<()> {
        // A process inside the folder would remain in the removed one.
        let here = std::env::current_dir()?;
        if here.starts_with(old) {
            return Err(unfit());
        }
        let mut left = MOST;
        link_others(old, new, &mut left)?;
        exchange(new, old)?;
        keep_added(new, old);
        Ok(())
    }

    fn unfit() -> io::Error {
        io::Error::from(io::ErrorKind::Unsupported)
    }

    /// Links everything in `old` that `new` does not have into `new`; `left` counts down.
    fn link_others(old: &Path, new: &Path, left: &mut usize) -> io::Result<()> {
        let permissions = fs::metadata(old)?.permissions();
        // The files of such a folder could not be removed afterwards.
        if permissions.readonly() {
            return Err(unfit());
        }
        for entry in fs::read_dir(old)? {
            let entry = entry?;
            *left = left.checked_sub(1).ok_or_else(unfit)?;
            let kept = new.join(entry.file_name());
            let exists = kept.symlink_metadata().is_ok();
            if entry.file_type()?.is_dir() {
                if !exists {
                    fs::create_dir(&kept)?;
                }
                link_others(&entry.path(), &kept, left)?;
            } else if !exists {
                // A symbolic link is linked, not the file to which it leads.
                fs::hard_link(entry.path(), kept)?;
            }
        }
        fs::set_permissions(new, permissions)
    }

    /// Moves files that another program added meanwhile from the replaced folder into the new one.
    fn keep_added(replaced: &Path, place: &Path) {
        for entry in fs::read_dir(replaced).into_iter().flatten().flatten() {
            let place = place.join(entry.file_name());
            if place.symlink_metadata().is_err() {
                let _ = fs::rename(entry.path(), place);
            } else if entry.file_type().is_ok_and(|kind| kind.is_dir()) {
                keep_added(&entry.path(), &place);
            }
        }
    }

    #[cfg(any(target_os = "linux", target_vendor = "apple"))]
    fn exchange(a: &Path, b: &Path) -> io::Result<()> {
        use rustix::fs::{CWD, RenameFlags, renameat_with};
        Ok(renameat_with(CWD, a, CWD, b, RenameFlags::EXCHANGE)?)
    }

    #[cfg(not(any(target_os = "linux", target_vendor = "apple")))]
    fn exchange(_: &Path, _: &Path) -> io::Result<()> {
        Err(io::ErrorKind::Unsupported.into())
    }
}

/// The operating system's message without the temporary name, which the user does not know.
fn without_temporary_name(error: io::Error) -> io::Error {
    match (error.get_ref(), error.kind()) {
        (None, _) => error,
        (Some(_), kind @ io::ErrorKind::NotFound) => io::Error::new(kind, "no such folder"),
        (Some(_), kind) => io::Error::from(kind),
    }
}

fn parent_of(path: &Path) -> &Path {
    match path.parent() {
        Some(parent) if !parent.as_os_str().is_empty() => parent,
        _ => Path::new("."),
    }
}

/// Temporary files and folders are private by default; output gets the permissions of `mode` under the user's
/// umask.
fn permitted<'a, 'b>(
    builder: &'a mut tempfile::Builder<'b, 'b>,
    #[cfg_attr(not(unix), expect(unused_variables))] mode: u32,
) -> &'a mut tempfile::Builder<'b, 'b> {
    #[cfg(unix)]
    {
        use std::os::unix::fs::PermissionsExt;
        builder.permissions(fs::Permissions::from_mode(mode));
    }
    builder
}

#[cfg(test)]
mod tests {
    use super::*;

    fn entries(folder: &Path) -> Vec<String> {
        let mut names: Vec<String> = fs::read_dir(folder)
            .unwrap()
            .map(|e| e.unwrap().file_name().into_string().unwrap())
            .collect();
        names.sort();
        names
    }

    #[test]
    fn what_cannot_be_written_is_refused_before_the_work() {
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join("model.toml");
        check_writable(&file).unwrap();
        assert!(entries(folder.path()).is_empty());
        fs::write(&file, "kept").unwrap();
        check_writable(&file).unwrap();
        assert_eq!(fs::read_to_string(&file).unwrap(), "kept");
        let nowhere = folder.path().join("no/model.toml");
        let said = check_writable(&nowhere).unwrap_err().to_string();
        assert!(said.contains("no/model.toml cannot be written"), "{said}");
        let error = check_writable(folder.path()).unwrap_err();
        assert!(matches!(error, OutputError::NoFileName { .. }), "{error}");
    }

    fn full_disk(w: &mut dyn Write) -> io::Result<()> {
        w.write_all(&[b'x'; 100_000])?;
        Err(io::Error::from(io::ErrorKind::StorageFull))
    }

    #[test]
    fn a_failing_writer_leaves_the_old_file_and_nothing_else() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("model.toml");
        assert!(write_atomic(&path, full_disk).is_err());
        assert!(entries(folder.path()).is_empty());
        write_atomic(&path, |w| w.write_all(b"old")).unwrap();
        let message = write_atomic(&path, full_disk).unwrap_err().to_string();
        assert!(message.contains("model.toml"), "{message}");
        assert_eq!(fs::read(&path).unwrap(), b"old");
        assert_eq!(entries(folder.path()), ["model.toml"]);
        assert!(write_atomic(folder.path(), |w| w.write_all(b"x")).is_err());
        let missing = folder.path().join("no/such/x");
        let message = write_atomic(&missing, |w| w.write_all(b"x"))
            .unwrap_err()
            .to_string();
        assert!(!message.contains(".host-fit-"), "{message}");
    }

    #[cfg(target_os = "linux")]
    #[test]
    fn a_device_is_written_to_and_not_replaced() {
        use std::os::unix::fs::FileTypeExt;
        let error = write_atomic(Path::new("/dev/full"), |w| w.write_all(b"x")).unwrap_err();
        assert!(
            matches!(error, OutputError::Io { ref cause, .. } if cause.kind() == io::ErrorKind::StorageFull),
            "{error}"
        );
        write_atomic(Path::new("/dev/null"), |w| w.write_all(b"x")).unwrap();
        let kind = fs::metadata("/dev/null").unwrap().file_type();
        assert!(kind.is_char_device());
    }

    #[cfg(unix)]
    #[test]
    fn a_link_keeps_pointing_and_the_file_is_readable_by_others() {
        use std::os::unix::fs::PermissionsExt;
        let folder = tempfile::tempdir().unwrap();
        let (real, link) = (folder.path().join("real"), folder.path().join("link"));
        write_atomic(&real, |w| w.write_all(b"1")).unwrap();
        std::os::unix::fs::symlink(&real, &link).unwrap();
        write_atomic(&link, |w| w.write_all(b"2")).unwrap();
        assert_eq!(fs::read(&real).unwrap(), b"2");
        assert!(fs::symlink_metadata(&link).unwrap().is_symlink());
        let plain = folder.path().join("plain");
        fs::write(&plain, b"").unwrap();
        let mode = |p: &Path| fs::metadata(p).unwrap().permissions().mode();
        assert_eq!(mode(&real), mode(&plain));
    }

    #[test]
    fn staged_files_appear_together_or_not_at_all() {
        let folder = tempfile::tempdir().unwrap();
        let target = folder.path().join("out");
        {
            let mut staging = Staging::new(&target).unwrap();
            staging.write("a.csv", |w| w.write_all(b"a")).unwrap();
            assert!(staging.write("b.csv", full_disk).is_err());
        }
        assert!(entries(folder.path()).is_empty());
        for content in [b"1", b"2"] {
            let mut staging = Staging::new(&target).unwrap();
            staging.write("a.csv", |w| w.write_all(content)).unwrap();
            staging
                .write("sub/b.csv", |w| w.write_all(content))
                .unwrap();
            assert!(staging.write("../c.csv", |w| w.write_all(content)).is_err());
            staging.commit().unwrap();
            assert_eq!(entries(folder.path()), ["out"]);
            assert_eq!(entries(&target), ["a.csv", "sub"]);
            assert_eq!(fs::read(target.join("sub/b.csv")).unwrap(), content);
        }
        assert!(Staging::new(&target.join("a.csv")).is_err());
    }

    /// A concurrent reader sees either all old or all new files.
    #[test]
    fn a_folder_is_replaced_at_one_stroke_and_keeps_what_is_not_replaced() {
        use std::sync::atomic::{AtomicBool, Ordering};
        let folder = tempfile::tempdir().unwrap();
        let target = folder.path().join("set");
        let write = |content: &str| {
            let mut staging = Staging::new(&target).unwrap();
            for name in ["a.csv", "b.csv", "dataset.toml"] {
                staging
                    .write(name, |w| w.write_all(content.as_bytes()))
                    .unwrap();
            }
            staging.commit().unwrap();
        };
        write("0");
        fs::write(target.join("notes.txt"), "mine").unwrap();
        let done = AtomicBool::new(false);
        std::thread::scope(|scope| {
            let looks = scope.spawn(|| {
                let (mut mixed, mut seen) = (0, 0);
                while !done.load(Ordering::Relaxed) {
                    // A folder that is in use stays unchanged.
                    let names = ["dataset.toml", "a.csv", "b.csv", "dataset.toml"];
                    let read = names.map(|n| fs::read(target.join(n)).unwrap_or_default());
                    // A read counts only if the folders were not exchanged during it.
                    if read[0] == read[3] && !read[0].is_empty() {
                        seen += 1;
                        mixed += u32::from(read[1] != read[0] || read[2] != read[0]);
                    }
                }
                (mixed, seen)
            });
            for round in 1..200 {
                write(&round.to_string());
            }
            done.store(true, Ordering::Relaxed);
            let (mixed, seen) = looks.join().unwrap();
            assert!(mixed == 0 && seen > 0, "{mixed} of {seen}");
        });
        assert_eq!(
            entries(&target),
            ["a.csv", "b.csv", "dataset.toml", "notes.txt"]
        );
        assert_eq!(fs::read(target.join("notes.txt")).unwrap(), b"mine");
        assert_eq!(entries(folder.path()), ["set"]);
    }

    /// What else is in the target stays the same, whether the system can exchange the folders or not.
    #[cfg(unix)]
    #[test]
    fn folders_and_links_in_the_target_are_kept() {
        use std::os::unix::fs::{MetadataExt, PermissionsExt, symlink};
        let folder = tempfile::tempdir().unwrap();
        let target = folder.path().join("set");
        let write = |content: &str| {
            let mut staging = Staging::new(&target).unwrap();
            for name in ["a.csv", "sub/b.csv", "dataset.toml"] {
                staging
                    .write(name, |w| w.write_all(content.as_bytes()))
                    .unwrap();
            }
            staging.commit().unwrap();
            fs::metadata(&target).unwrap().ino()
        };
        let first = write("0");
        fs::create_dir_all(target.join("more/yet")).unwrap();
        fs::write(target.join("more/yet/notes.txt"), "mine").unwrap();
        fs::write(target.join("sub/notes.txt"), "mine").unwrap();
        symlink("more", target.join("link")).unwrap();
        symlink("nowhere", target.join("more/broken")).unwrap();
        let check = |content: &str| {
            for name in ["a.csv", "sub/b.csv", "dataset.toml"] {
                assert_eq!(fs::read(target.join(name)).unwrap(), content.as_bytes());
            }
            for name in ["more/yet/notes.txt", "link/yet/notes.txt", "sub/notes.txt"] {
                assert_eq!(fs::read(target.join(name)).unwrap(), b"mine", "{name}");
            }
            let link = |name: &str| fs::read_link(target.join(name)).unwrap();
            assert_eq!(link("more/broken"), Path::new("nowhere"));
            assert_eq!(link("link"), Path::new("more"));
            assert_eq!(entries(folder.path()), ["set"]);
            assert_eq!(entries(&target).len(), 5);
        };
        let second = write("1");
        check("1");
        assert_eq!(
            first == second,
            cfg!(not(any(target_os = "linux", target_vendor = "apple")))
        );
        // A folder that cannot be written prevents the exchange: the files are moved one by one.
        let mode =
            |bits| fs::set_permissions(target.join("more"), fs::Permissions::from_mode(bits));
        mode(0o555).unwrap();
        assert_eq!(write("2"), second);
        check("2");
        mode(0o755).unwrap();
    }
}
