//! Kills of the program at every change of a file: each output must then be absent, the complete old file or the
//! complete new one, and the same command must succeed when it is run again.

mod input;
mod trace;
mod tree;

use crate::Task;
use crate::random::Random;
use crate::shell::{program, target};
use anyhow::{Context, Result, bail, ensure};
use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};
use trace::{Line, Point};
use tree::{Entry, LINKED, Tree};

pub(crate) const TASK: Task = Task {
    name: "kills",
    does: "kills every command that writes files before each change of a file, and checks its outputs; --kills N \
         (default 10000), --seed S (1), --minutes M: stop after M minutes",
    run: kills,
};

/// Commands with their outputs in the present folder.
const COMMANDS: &[(&str, &str)] = &[
    ("import", "import ../input/raw -o set --force"),
    (
        "average",
        "average ../input/repeats.csv --period 1 --out set",
    ),
    ("delay", "delay ../input/set --out delays"),
    (
        "identify",
        "identify ../input/set -o model.toml --report page.html --n1 1 --n2 1 --n3 1 --max-lag 12 \
         --evaluations 100",
    ),
    (
        "compare",
        "compare ../input/model.toml ../input/set --report page.html --pictures pictures",
    ),
    (
        "diagnose",
        "diagnose ../input/model.toml ../input/set -o better.toml --report page.html --most-effects 1",
    ),
    (
        "discover",
        "discover ../input/model.toml ../input/set -o new.toml --report page.html --trace trace.csv --terms 1",
    ),
    (
        "extend",
        "extend ../input/model.toml ../input/droop --effect plenum-droop -o better.toml --report page.html",
    ),
    (
        "simulate",
        "simulate ../input/model.toml ../input/set/a.csv -o run.csv",
    ),
    (
        "design",
        "design ../input/model.toml --target 0.3 -o law.toml --report page.html --set design.trial=2000 \
         --set design.trial-from=500 --set design.margin-rays=4 --set design.margin-bisections=2",
    ),
    (
        "codegen rust",
        "codegen ../input/model.toml --rig ../input/rig.toml -o flow.rs",
    ),
    (
        "codegen c",
        "codegen ../input/model.toml --lang c -o flow.c",
    ),
    (
        "codegen python",
        "codegen ../input/model.toml --lang python -o flow.py",
    ),
    ("man-pages", "man-pages -o man"),
];

/// Time for the kills of a command in one state in a round; at least [`FEWEST`] are made.
const SHARE: Duration = Duration::from_secs(2);
const FEWEST: usize = 3;
/// A command that takes longer is tried in one state in every [`RARE`]-th round, and not in all states in each.
const FAST: Duration = Duration::from_millis(150);
const RARE: usize = 12;

/// Outputs before the command.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Before {
    Absent,
    Old,
    /// Files are symbolic links to the old ones; folders also contain a file of the user.
    Linked,
    /// Folders also contain a folder of the user.
    Crowded,
}

const STATES: [Before; 4] = [Before::Absent, Before::Old, Before::Linked, Before::Crowded];

#[derive(Clone, Copy, Debug, Default)]
struct Counts {
    kills: usize,
    /// Outputs after the kills, by state.
    absent: usize,
    old: usize,
    new: usize,
    /// Kills that left a temporary file or folder.
    temporary: usize,
    /// Runs that ended before the call at which they were to be killed.
    ended: usize,
}

struct Options {
    kills: usize,
    seed: u64,
    time: Duration,
}

fn options(arguments: &[String]) -> Result<Options> {
    let mut options = Options {
        kills: 10_000,
        seed: 1,
        time: Duration::MAX,
    };
    for pair in arguments.chunks(2) {
        let [name, value] = pair else {
            bail!("{} needs a value", pair[0]);
        };
        let number: u64 = value
            .parse()
            .with_context(|| format!("{name} {value}: not a whole number"))?;
        match name.as_str() {
            "--kills" => options.kills = usize::try_from(number)?,
            "--seed" => options.seed = number,
            "--minutes" => options.time = Duration::from_secs(60 * number),
            _ => bail!("there is no option {name}; there are --kills, --seed and --minutes"),
        }
    }
    Ok(options)
}

fn kills(arguments: &[String]) -> Result<()> {
    let options = options(arguments)?;
    trace::check()?;
    let program = PathBuf::from(program()?.get_program());
    let folder = target().join("kills");
    let started = Instant::now();
    let mut random = Random::new(options.seed);
    let mut counts: BTreeMap<&str, Counts> = BTreeMap::new();
    let done = |counts: &BTreeMap<&str, Counts>| counts.values().map(|c| c.kills).sum::<usize>();
    // In a short run each command gets its share.
    let most = (options.kills / COMMANDS.len()).max(FEWEST);
    let mut slow: BTreeSet<&str> = BTreeSet::new();
    'rounds: for round in 0.. {
        let input = folder.join("input");
        if folder.exists() {
            fs::remove_dir_all(&folder)?;
        }
        fs::create_dir_all(&input)?;
        input::write(&input, &program, &mut random)?;
        let inputs = Tree::read(&input)?;
        for (name, arguments) in COMMANDS {
            if slow.contains(name) && round % RARE != 0 {
                continue;
            }
            let run = folder.join("run");
            let line = Line {
                program: &program,
                arguments,
                folder: &run,
            };
            let drawn = random.below(STATES.len());
            for state in STATES.iter().cycle().skip(drawn).take(STATES.len()) {
                let trial = Trial::new(line, *state, &folder)
                    .with_context(|| format!("{name}, outputs {state:?} before"))?;
                let left = options.kills - done(&counts);
                let counts_of = counts.entry(name).or_default();
                trial.kills(counts_of, left.min(most), &mut random)?;
                if trial.took > FAST {
                    slow.insert(name);
                    break;
                }
            }
            ensure!(
                Tree::read(&input)? == inputs,
                "`host-fit {arguments}` changed its input"
            );
            if done(&counts) >= options.kills || started.elapsed() >= options.time {
                break 'rounds;
            }
        }
        ensure!(done(&counts) > 0, "no run was killed");
        eprintln!(
            "{} kills in {:.0} s",
            done(&counts),
            started.elapsed().as_secs_f64()
        );
    }
    print(&counts);
    let ended: usize = counts.values().map(|c| c.ended).sum();
    println!(
        "\n{} kills, seed {}, {:.0} s: no output lost, half written or mixed; {ended} other runs ended before their kill",
        done(&counts),
        options.seed,
        started.elapsed().as_secs_f64()
    );
    Ok(())
}

fn print(counts: &BTreeMap<&str, Counts>) {
    println!("| command | kills | old | new | absent | left temporary files |");
    println!("|---|---|---|---|---|---|");
    for (name, c) in counts {
        println!(
            "| {name} | {} | {} | {} | {} | {} |",
            c.kills, c.old, c.new, c.absent, c.temporary
        );
    }
}

/// A command with the outputs before and after it, and the calls at which it can be killed.
struct Trial<'a> {
    line: Line<'a>,
    state: Before,
    before: Tree,
    after: Tree,
    outputs: Vec<PathBuf>,
    points: Vec<Point>,
    /// Duration of the undisturbed run under strace.
    took: Duration,
}

impl<'a> Trial<'a> {
    fn new(line: Line<'a>, state: Before, folder: &Path) -> Result<Self> {
        Tree::default().write(line.folder)?;
        line.run()?;
        let first = Tree::read(line.folder)?;
        let outputs = first.outputs();
        let before = before(&first, state);
        before.write(line.folder)?;
        let started = Instant::now();
        let points = line.points(&folder.join("calls.log"))?;
        let took = started.elapsed();
        let after = Tree::read(line.folder)?;
        ensure!(after.temporary == 0, "temporary files without a kill");
        ensure!(!points.is_empty(), "no change of a file was seen");
        Ok(Self {
            line,
            state,
            before,
            after,
            outputs,
            points,
            took,
        })
    }

    /// The points to try: all, or renames, the first, the last and a sample of the others.
    fn chosen(&self, most: usize, random: &mut Random) -> Vec<&Point> {
        let last = self.points.len() - 1;
        let mut order: Vec<(bool, u64, usize)> = (0..=last)
            .map(|at| {
                let first = self.points[at].is_rename() || at == 0 || at == last;
                (!first, random.next(), at)
            })
            .collect();
        order.sort_unstable();
        order.truncate(most);
        order.iter().map(|(.., at)| &self.points[*at]).collect()
    }

    fn kills(&self, counts: &mut Counts, most: usize, random: &mut Random) -> Result<()> {
        let each = 2.0 * self.took.as_secs_f64();
        let in_time = (SHARE.as_secs_f64() / each) as usize;
        let most = most.min(in_time.max(FEWEST));
        for point in self.chosen(most, random) {
            self.before.write(self.line.folder)?;
            // Threads may make their calls in another order, so a point may not be reached.
            if !self.line.kill_at(point)? {
                counts.ended += 1;
                continue;
            }
            self.check(counts).with_context(|| {
                format!(
                    "`host-fit {}`, outputs {:?} before, killed before {} {}; the files after it are in {}",
                    self.line.arguments,
                    self.state,
                    point.call,
                    point.number,
                    self.line.folder.display()
                )
            })?;
        }
        Ok(())
    }

    /// Checks the outputs after a kill, and runs the command again.
    fn check(&self, counts: &mut Counts) -> Result<()> {
        let left = Tree::read(self.line.folder)?;
        counts.kills += 1;
        counts.temporary += usize::from(left.temporary > 0);
        for output in &self.outputs {
            let (now, old, new) = (
                left.output(output),
                self.before.output(output),
                self.after.output(output),
            );
            if now == new {
                counts.new += 1;
            } else if now == old {
                match self.state {
                    Before::Absent => counts.absent += 1,
                    _ => counts.old += 1,
                }
            } else {
                bail!("{} is neither old nor new", output.display());
            }
        }
        self.line.run().context("the next run fails")?;
        let mut again = Tree::read(self.line.folder)?;
        again.temporary = 0;
        ensure!(again == self.after, "the next run gives other files");
        Ok(())
    }
}

/// The outputs before the command: those of `first`, each with another content.
fn before(first: &Tree, state: Before) -> Tree {
    let mut tree = Tree::default();
    if state == Before::Absent {
        return tree;
    }
    let mut add = |path: PathBuf, entry: Entry| tree.entries.insert(path, entry);
    for (path, entry) in &first.entries {
        let entry = match entry {
            Entry::File(bytes) => Entry::File([b"# old\n", bytes.as_slice()].concat()),
            other => other.clone(),
        };
        let top = path.components().count() == 1;
        if entry == Entry::Folder && top {
            add(path.join("of-before.csv"), Entry::File(b"t,u,y\n".to_vec()));
            if state != Before::Old {
                add(path.join("notes.txt"), Entry::File(b"mine".to_vec()));
            }
            if state == Before::Crowded {
                add(path.join("more"), Entry::Folder);
                add(path.join("more/notes.txt"), Entry::File(b"mine".to_vec()));
            }
        }
        if state == Before::Linked && top && entry != Entry::Folder {
            let linked = Path::new(LINKED).join(path);
            add(PathBuf::from(LINKED), Entry::Folder);
            add(linked.clone(), entry);
            add(path.clone(), Entry::Link(linked));
        } else {
            add(path.clone(), entry);
        }
    }
    tree
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_outputs_before_differ_from_those_after() {
        let mut first = Tree::default();
        for (path, entry) in [
            ("set", Entry::Folder),
            ("set/dataset.toml", Entry::File(vec![1])),
            ("m.toml", Entry::File(vec![1])),
        ] {
            first.entries.insert(path.into(), entry);
        }
        for state in STATES {
            let old = before(&first, state);
            assert_eq!(old.entries.is_empty(), state == Before::Absent);
            for output in first.outputs() {
                assert_ne!(old.output(&output), first.output(&output), "{state:?}");
            }
        }
        let linked = before(&first, Before::Linked);
        assert_eq!(linked.output(Path::new("m.toml")).len(), 2);
    }
}
