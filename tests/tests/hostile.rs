//! Files and options that could abort the program, exhaust its time or memory, or give a wrong message: one minimal
//! input of each kind. Every command must end within its time limit, with one paragraph that names the key, the
//! file or the option.

use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Command, Output, Stdio};
use std::time::{Duration, Instant};

use scenarios::{Parts, host_fit, program};
use tempfile::TempDir;

const MODEL: &str = include_str!("../data/hostile/model.toml");

fn data(name: &str) -> String {
    let path = Path::new(env!("CARGO_MANIFEST_DIR"))
        .join("../data")
        .join(name);
    path.to_str().expect("UTF-8").to_owned()
}

struct Room(TempDir);

impl Room {
    fn new() -> Self {
        Self(tempfile::tempdir().expect("a folder"))
    }

    fn path(&self, name: &str) -> PathBuf {
        self.0.path().join(name)
    }

    /// A file; its path as an argument.
    fn file(&self, name: &str, text: &str) -> String {
        fs::write(self.path(name), text).expect("written");
        self.named(name)
    }

    fn named(&self, name: &str) -> String {
        self.path(name).to_str().expect("UTF-8").to_owned()
    }
}

/// Runs the program with a limit of half a minute.
#[track_caller]
fn run(line: &str, parts: Parts<'_>) -> Output {
    let mut child = host_fit(line, parts)
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .expect("the program starts");
    let until = Instant::now() + Duration::from_secs(60);
    while child.try_wait().expect("a child").is_none() {
        if Instant::now() > until {
            child.kill().expect("ended");
            panic!("no end: {line}");
        }
        std::thread::sleep(Duration::from_millis(5));
    }
    child.wait_with_output().expect("its output")
}

/// Exit 1 and one paragraph with every part, of visible characters.
#[track_caller]
fn refused(line: &str, parts: Parts<'_>, told: &[&str]) {
    let output = run(line, parts);
    let error = String::from_utf8(output.stderr).expect("UTF-8");
    assert_eq!(output.status.code(), Some(1), "{line}: {error}");
    let paragraph = error.strip_suffix('\n').unwrap_or(&error);
    assert!(
        paragraph.starts_with("error: ") && !paragraph.chars().any(char::is_control),
        "{error:?}"
    );
    for part in told {
        assert!(error.contains(part), "no `{part}` in: {error}");
    }
}

#[track_caller]
fn done(line: &str, parts: Parts<'_>) -> Output {
    let output = run(line, parts);
    let error = String::from_utf8_lossy(&output.stderr);
    assert_eq!(output.status.code(), Some(0), "{line}: {error}");
    output
}

/// Values of a model file that require too much memory or time, or are not finite: refused by every command that
/// reads a model.
#[test]
fn values_of_a_model_are_checked_when_it_is_loaded() {
    let room = Room::new();
    let (step, out) = (data("hidden-ramp/step.csv"), room.named("o"));
    for (from, to, key) in [
        ("window = 250", "window = 4294967295", "structure.window"),
        (
            "delay_floor = 30.0",
            "delay_floor = 1e18",
            "delay.delay_floor",
        ),
        ("[0.0, 0.84]", "[-inf, inf]", "law.reachable"),
    ] {
        let model = room.file("m.toml", &MODEL.replacen(from, to, 1));
        refused(
            "simulate {} {} -o {}",
            &[&model, &step, &out],
            &["m.toml", key],
        );
        refused("codegen {} -o {}", &[&model, &out], &["m.toml", key]);
        refused(
            "design {} -o {} --target 0.5",
            &[&model, &out],
            &["m.toml", key],
        );
    }
    assert!(!room.path("o").exists());
}

/// Long lags, horizons and hold times: an answer or a refusal within the time limit.
#[test]
fn no_design_goes_on_for_ever() {
    let room = Room::new();
    let out = room.named("d.toml");
    let lags = ["state_lags = [65535]", "product_lags = [3000]"];
    for (lag, from) in lags.iter().zip(["state_lags = [1]", "product_lags = [1]"]) {
        let model = room.file("m.toml", &MODEL.replacen(from, lag, 1));
        let output = run("design {} -o {} --target 0.02", &[&model, &out]);
        let error = String::from_utf8_lossy(&output.stderr);
        assert!(
            matches!(output.status.code(), Some(0 | 1)) && !error.contains("panicked"),
            "{error}"
        );
    }
    let model = room.file("m.toml", MODEL);
    for (option, value) in [
        ("--horizon", "1e300"),
        ("--horizon", "4294967295samples"),
        ("--min-on", "1e300"),
    ] {
        let line = "design {} -o {} --goal maximise {} {}";
        refused(line, &[&model, &out, &option, &value], &["100 s"]);
    }
}

/// The need for memory is computed before the allocation, and the limit can be changed.
#[test]
fn memory_is_counted_before_it_is_asked_for() {
    let room = Room::new();
    let rows = (0..30_000).fold("t,u,y\n".to_owned(), |text, k| {
        format!(
            "{text}{:.3},{},{}\n",
            f64::from(k) * 0.001,
            k / 500 % 2,
            f64::from(k % 977) * 1e-3
        )
    });
    let (long, out) = (room.file("long.csv", &rows), room.named("m.toml"));
    let identify = "identify {} -o {} --n1 1 --n2 1 --n3 1 --evaluations 2";
    refused(
        &format!("{identify} --max-lag 12000"),
        &[&long, &out],
        &["--max-lag", "GB", "--memory"],
    );
    refused(
        &format!("{identify} --max-lag 3000 --memory 0.2"),
        &[&long, &out],
        &["0.2 GB", "--memory"],
    );
    // Ten million cells in a file of ten lines.
    let wide = (0..20_000).fold("t,u,y".to_owned(), |text, k| format!("{text},c{k}"));
    let row = ",0.5".repeat(20_000);
    let wide = room.file(
        "wide.csv",
        &format!("{wide}\n0,0,1{row}\n1,1,1{row}\n2,0,1{row}\n"),
    );
    refused(
        "import {} -o {}",
        &[&wide, &room.named("set")],
        &["wide.csv", "16384"],
    );
    assert_eq!(run("effects --memory 0", &[]).status.code(), Some(2));
}

/// The output of one command is readable by the next.
#[test]
fn what_is_written_can_be_read() {
    let room = Room::new();
    let (set, model) = (data("hidden-ramp"), room.named("m.toml"));
    let identify = "identify {} -o {} --n1 1 --n2 1 --n3 1 --evaluations 50 --seed {}";
    for seed in ["9223372036854775808", "18446744073709551615"] {
        done(identify, &[&set, &model, &seed]);
        done("compare {} {}", &[&model, &set]);
    }
    let tiny = room.file(
        "tiny.csv",
        "t,u,y\n0,0,1e-320\n1e-320,0,1e-320\n2e-320,1,0\n",
    );
    refused(
        "import {} -o {}",
        &[&tiny, &room.named("out")],
        &["tiny.csv", "sampling period"],
    );
    let late = room.file(
        "late.csv",
        "t,u,y\n1700000000.0000001,0,1\n1700000000.0000002,0,1\n1700000000.0000003,1,0\n",
    );
    refused(
        "import {} -o {}",
        &[&late, &room.named("out")],
        &["late.csv"],
    );
}

/// Names that control a terminal are escaped in messages, documents and generated code; a path may contain any
/// bytes.
#[test]
fn names_are_shown_and_do_not_act() {
    let room = Room::new();
    let acting = "a\\u001b[2J\\u001b]0;x\\u0007b\\u202Ec\\rd";
    let model = room.file("m.toml", &MODEL.replacen("plenum-droop", acting, 1));
    refused(
        "compare {} {}",
        &[&model, &data("hidden-ramp")],
        &["a\\u{1b}[2J"],
    );
    let model = room.file(
        "m.toml",
        &MODEL.replacen(
            "tool_version = \"0.1.0\"",
            &format!("tool_version = \"{acting}\""),
            1,
        ),
    );
    let out = room.named("o.rs");
    let told = done("codegen {} -o {} --json", &[&model, &out]);
    let written = fs::read_to_string(&out).expect("written");
    for text in [String::from_utf8(told.stdout).expect("UTF-8"), written] {
        let acts = |c: char| (c.is_control() && c != '\n') || c == '\u{202e}';
        assert!(!text.contains(acts), "{text}");
    }
    #[cfg(unix)]
    {
        use std::os::unix::ffi::OsStrExt;
        let name = room.0.path().join(std::ffi::OsStr::from_bytes(b"o\xff.rs"));
        let output = Command::new(program())
            .args(["--json", "codegen", &model, "-o"])
            .arg(&name)
            .output();
        let output = output.expect("the program starts");
        assert_eq!(
            output.status.code(),
            Some(0),
            "{}",
            String::from_utf8_lossy(&output.stderr)
        );
        let document: serde_json::Value = serde_json::from_slice(&output.stdout).expect("JSON");
        assert!(
            document["output"]
                .as_str()
                .expect("a name")
                .ends_with("o\u{fffd}.rs")
                && name.exists()
        );
    }
}

/// The inputs do not exist: an error about the output shows that nothing was read before.
#[test]
fn an_output_that_cannot_be_written_is_refused_before_anything_is_read() {
    let room = Room::new();
    let (model, data) = (room.named("m.toml"), room.named("data"));
    let (kept, nowhere) = (room.named("kept.toml"), room.named("none/out"));
    let cases: [(&str, Parts<'_>, &[&str]); 5] = [
        ("identify {}", &[&data], &["-o", "--report"]),
        (
            "diagnose {} {}",
            &[&model, &data],
            &["-o", "--report", "--experiment"],
        ),
        (
            "discover {} {}",
            &[&model, &data],
            &["-o", "--report", "--trace"],
        ),
        (
            "extend {} {} --effect plenum-droop",
            &[&model, &data],
            &["-o"],
        ),
        ("design {} --target 0.5", &[&model], &["-o", "--csv"]),
    ];
    for (line, inputs, outputs) in cases {
        for option in outputs {
            let mut command = host_fit(line, inputs);
            command.args([option, &nowhere.as_str()]);
            if *option != "-o" && (line.starts_with("identify") || line.starts_with("design")) {
                command.args(["-o", &kept]);
            }
            let output = command.output().expect("it runs");
            let error = String::from_utf8_lossy(&output.stderr);
            assert!(
                error.contains("none/out cannot be written"),
                "{line} {option}: {error}"
            );
            assert_eq!(output.status.code(), Some(1), "{line} {option}");
        }
    }
}

#[test]
fn a_rig_that_single_precision_cannot_hold_is_refused() {
    let room = Room::new();
    let rig = "format_version = 1\nsample_period_s = 0.001\nresidual_envelope = 0.5\n[sensor]\nzero_counts = 800.0\n\
               per_count = 0.0005\nlower_rail_counts = 8.0\nupper_rail_counts = 4087.0\nstuck_after_samples = 500\n\
               [valve]\nshortest_on_s = 0.004\nshortest_off_s = 0.004\n";
    let (model, out) = (room.file("m.toml", MODEL), room.named("identified.rs"));
    for (from, to, key) in [
        ("envelope = 0.5", "envelope = 1e300", "residual_envelope"),
        ("per_count = 0.0005", "per_count = 1e39", "per_count"),
        ("per_count = 0.0005", "per_count = 1e-300", "per_count"),
        ("on_s = 0.004", "on_s = inf", "shortest_on_s"),
    ] {
        let rig = room.file("rig.toml", &rig.replacen(from, to, 1));
        refused(
            "codegen {} --rig {} -o {}",
            &[&model, &rig, &out],
            &["rig.toml", key],
        );
    }
    assert!(!room.path("rig.rs").exists());
    let rig = room.file("rig.toml", rig);
    done("codegen {} --rig {} -o {}", &[&model, &rig, &out]);
}

/// The unit of y must not matter: a model that is unstable at 1 is also unstable at 1e-30 and at 1e12, and a stable
/// one is stable.
#[test]
fn stability_does_not_depend_on_the_unit() {
    let room = Room::new();
    let step = fs::read_to_string(data("hidden-ramp") + "/sq4-50.csv").expect("bundled");
    let header: Vec<&str> = step.lines().next().expect("a header").split(',').collect();
    let y = header.iter().position(|name| *name == "y").expect("y");
    for scale in [1e-30, 1e12] {
        let mut text = "t,u,y\n".to_owned();
        for line in step.lines().skip(1) {
            let cells: Vec<&str> = line.split(',').collect();
            let value: f64 = cells[y].parse().expect("a number");
            text.push_str(&format!("{},{},{:e}\n", cells[0], cells[1], value * scale));
        }
        let (file, model) = (room.file("run.csv", &text), room.named("m.toml"));
        done(
            "identify {} -o {} --n1 1 --n2 1 --n3 1 --evaluations 100",
            &[&file, &model],
        );
        let command = room.file(
            "u.csv",
            &text
                .lines()
                .map(|l| {
                    let cells: Vec<&str> = l.split(',').collect();
                    format!("{},{}\n", cells[0], cells[1])
                })
                .collect::<String>(),
        );
        done(
            "simulate {} {} -o {}",
            &[&model, &command, &room.named("o.csv")],
        );
    }
}

/// Ctrl-C ends every long command soon, without partial files.
#[cfg(target_os = "linux")]
#[test]
fn ctrl_c_ends_every_command() {
    let room = Room::new();
    let (set, out, model) = (
        data("hidden-ramp"),
        room.named("out.toml"),
        room.file("m.toml", MODEL),
    );
    let commands: [(&str, Parts<'_>); 5] = [
        ("identify {} -o {}", &[&set, &out]),
        ("diagnose {} {}", &[&model, &set]),
        ("discover {} {}", &[&model, &set]),
        (
            "extend {} {} --effect valve-lag -o {}",
            &[&model, &set, &out],
        ),
        (
            "design {} --goal maximise --horizon 50 -o {}",
            &[&model, &out],
        ),
    ];
    for (command, parts) in commands {
        for after in [0.1, 1.0] {
            let said = fs::File::create(room.path("said.json")).expect("a file");
            // After a `&` of a shell the signal is ignored until the program requests it, and a signal before that
            // is lost.
            let child = Command::new("env")
                .arg("--default-signal=INT")
                .arg(program())
                .args(host_fit(command, parts).get_args())
                .arg("--json")
                .stdout(said)
                .stderr(Stdio::null())
                .spawn();
            let mut child = child.expect("the program starts");
            std::thread::sleep(Duration::from_secs_f64(after));
            let works = child.try_wait().expect("a child").is_none();
            // The process may have ended by itself.
            let _ = Command::new("kill")
                .args(["-INT", &child.id().to_string()])
                .stderr(Stdio::null())
                .status();
            let asked = Instant::now();
            while child.try_wait().expect("a child").is_none() {
                if asked.elapsed() > Duration::from_secs(40) {
                    child.kill().expect("ended");
                    panic!("{command} goes on after {after} s");
                }
                std::thread::sleep(Duration::from_millis(10));
            }
            // The result so far may be returned; a message then says so.
            if works && child.wait().expect("a child").success() {
                let said = fs::read_to_string(room.path("said.json")).expect("an answer");
                assert!(said.contains("interrupted"), "{command} after {after} s");
            }
            let names = fs::read_dir(room.0.path()).expect("a folder").flatten();
            let names: Vec<String> = names
                .map(|e| e.file_name().to_string_lossy().into_owned())
                .collect();
            assert!(
                names.iter().all(|n| !n.contains(".host-fit-")) || after < 1.0,
                "{names:?}"
            );
        }
    }
}

/// A text may be checked at every keystroke without being stored.
#[cfg(target_os = "linux")]
#[test]
fn checking_a_text_keeps_nothing() {
    use host_fit::user_effect::Definition;
    let resident = || -> u64 {
        let status = fs::read_to_string("/proc/self/status").expect("Linux");
        let line = status
            .lines()
            .find(|l| l.starts_with("VmRSS"))
            .expect("there");
        line.split_whitespace()
            .nth(1)
            .expect("a number")
            .parse()
            .expect("a number")
    };
    let filler = "x".repeat(5_000);
    let before = resident();
    for i in 0..10_000 {
        let text = format!(
            "name = \"warm\"\nplace = \"jet\"\nsummary = \"{filler}{i}\"\nexpression = \"jet * gain + {i}.0\"\n[[parameter]]\n\
             name = \"gain\"\nunit = \"-\"\nlow = 0.1\nhigh = 2.0\nstarts = [1.0]\n"
        );
        assert!(Definition::check(&text, "t").is_ok());
    }
    // If the inputs were kept, they would take 50 MB.
    let grown = resident().saturating_sub(before);
    assert!(grown < 10_000, "{grown} kB");
}
