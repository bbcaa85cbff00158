//! System calls that change files: where a command makes them, and runs that are killed at one of them.

use anyhow::{Context, Result, bail, ensure};
use std::collections::HashMap;
use std::fs;
use std::os::unix::process::ExitStatusExt;
use std::path::Path;
use std::process::{Command, Stdio};

/// Calls that change a file or folder.
const CALLS: &str = "open,openat,creat,write,pwrite64,writev,rename,renameat,renameat2,unlink,\
    unlinkat,rmdir,mkdir,mkdirat,fsync,fdatasync,ftruncate,truncate,link,linkat,symlink,symlinkat,\
    copy_file_range,sendfile,chmod,fchmod,fchmodat,fallocate";
const KILLED: i32 = 9;

/// The `number`-th of a thread's calls of this name, from 1.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct Point {
    pub(super) call: String,
    pub(super) number: usize,
}

impl Point {
    pub(super) fn is_rename(&self) -> bool {
        self.call.starts_with("rename")
    }
}

/// A command: program, arguments, and the folder in which it runs.
#[derive(Clone, Copy, Debug)]
pub(super) struct Line<'a> {
    pub(super) program: &'a Path,
    pub(super) arguments: &'a str,
    pub(super) folder: &'a Path,
}

impl Line<'_> {
    /// Runs the command undisturbed.
    pub(super) fn run(&self) -> Result<()> {
        let output = Command::new(self.program)
            .args(self.arguments.split_whitespace())
            .current_dir(self.folder)
            .stdin(Stdio::null())
            .output()?;
        ensure!(
            output.status.success(),
            "`host-fit {}` ended with {}: {}",
            self.arguments,
            output.status,
            String::from_utf8_lossy(&output.stderr)
        );
        Ok(())
    }

    fn strace(&self, options: &[&str]) -> Command {
        let mut strace = Command::new("strace");
        strace
            .args(["-f", "-qq"])
            .args(options)
            .arg("--")
            .arg(self.program)
            .args(self.arguments.split_whitespace())
            .current_dir(self.folder)
            .stdin(Stdio::null())
            .stdout(Stdio::null())
            .stderr(Stdio::piped());
        strace
    }

    /// Runs the command and lists its changes of files in the folder.
    pub(super) fn points(&self, log: &Path) -> Result<Vec<Point>> {
        let trace = format!("trace={CALLS}");
        let path = log.to_string_lossy();
        let output = self
            .strace(&["-y", "-e", &trace, "-o", &path])
            .output()
            .context("strace could not be started")?;
        if !output.status.success() {
            bail!(
                "`host-fit {}` under strace ended with {}: {}",
                self.arguments,
                output.status,
                String::from_utf8_lossy(&output.stderr)
            );
        }
        let text = String::from_utf8_lossy(&fs::read(log)?).into_owned();
        Ok(points(&text, &self.folder.to_string_lossy()))
    }

    /// Runs the command and kills it before this call; returns whether it was killed.
    pub(super) fn kill_at(&self, point: &Point) -> Result<bool> {
        let trace = format!("trace={}", point.call);
        let inject = format!("inject={}:signal=KILL:when={}", point.call, point.number);
        let output = self
            .strace(&["-e", &trace, "-e", &inject, "-o", "/dev/null"])
            .output()?;
        match output.status.signal() {
            Some(KILLED) => Ok(true),
            None if output.status.success() => Ok(false),
            _ => bail!(
                "`host-fit {}` to be killed at {} {} ended with {}: {}",
                self.arguments,
                point.call,
                point.number,
                output.status,
                String::from_utf8_lossy(&output.stderr)
            ),
        }
    }
}

/// The changes of files in `folder`, from the log of `strace -f -y`.
fn points(log: &str, folder: &str) -> Vec<Point> {
    let mut counts: HashMap<(&str, &str), usize> = HashMap::new();
    let mut found = Vec::new();
    for line in log.lines() {
        let Some((process, rest)) = line.split_once(' ') else {
            continue;
        };
        let Some((call, arguments)) = rest.trim_start().split_once('(') else {
            continue;
        };
        // Not a call: a signal, an exit, or the end of a call that another thread interrupted.
        if !call.bytes().all(|b| b.is_ascii_alphanumeric() || b == b'_') {
            continue;
        }
        let number = counts.entry((process, call)).or_default();
        *number += 1;
        let changes = match call {
            "open" | "openat" => ["O_WRONLY", "O_RDWR", "O_CREAT", "O_TRUNC"]
                .iter()
                .any(|flag| arguments.contains(flag)),
            "write" | "pwrite64" | "writev" => arguments
                .split_once('<')
                .is_some_and(|(_, file)| file.starts_with(folder)),
            _ => true,
        };
        if changes {
            found.push(Point {
                call: call.to_owned(),
                number: *number,
            });
        }
    }
    found
}

/// Checks that strace is installed and that the system permits it.
pub(super) fn check() -> Result<()> {
    if !crate::shell::exists("strace") {
        bail!("strace is missing; install it with `cargo xtask setup` or the package manager");
    }
    let tried = Command::new("strace")
        .args(["-f", "-qq", "-e", "inject=exit_group:signal=KILL:when=1"])
        .args(["-o", "/dev/null", "true"])
        .output()?;
    ensure!(
        tried.status.signal() == Some(KILLED),
        "this system does not permit strace to stop a program (ptrace): {}",
        String::from_utf8_lossy(&tried.stderr)
    );
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn points_are_the_changes_numbered_for_each_thread_and_call() {
        let log = "\
7 openat(AT_FDCWD</out>, \"/lib/libc.so\", O_RDONLY|O_CLOEXEC) = 3</lib/libc.so>
8 openat(AT_FDCWD</out>, \"/proc/x\", O_RDONLY <unfinished ...>
7 openat(AT_FDCWD</out>, \"/out/.host-fit-a\", O_RDWR|O_CREAT|O_EXCL, 0666) = 3</out/.host-fit-a>
8 <... openat resumed>) = 4
7 write(3</out/.host-fit-a>, \"x\", 1) = 1
7 write(1</dev/null>, \"x\", 1) = 1
7 write(3</out/.host-fit-a>, \"x\", 1) = 1
7 renameat(AT_FDCWD</out>, \"/out/.host-fit-a\", AT_FDCWD</out>, \"/out/a\") = 0
7 +++ exited with 0 +++
";
        let found = points(log, "/out");
        let found: Vec<(&str, usize)> = found.iter().map(|p| (&*p.call, p.number)).collect();
        assert_eq!(
            found,
            [("openat", 2), ("write", 1), ("write", 3), ("renameat", 1)]
        );
    }
}
