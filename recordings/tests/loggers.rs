//! Files written by loggers (`data/strangers`, generated) give the expected record. Missing information and
//! unreadable cells are named in messages.

use std::fs;
use std::path::{Path, PathBuf};

use recordings::import::{Import, Imported, Mapping, files_of, import};
use recordings::{DataSet, Record, Use};

fn stranger(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR"))
        .join("tests/data/strangers")
        .join(name)
}

#[track_caller]
fn read(files: &[PathBuf], request: &Import) -> Imported {
    let files: Vec<&Path> = files.iter().map(PathBuf::as_path).collect();
    import(&files, request).unwrap_or_else(|e| panic!("{e}"))
}

/// An import with changes of the mapping.
fn with(change: impl FnOnce(&mut Mapping)) -> Import {
    let mut request = Import::default();
    change(&mut request.mapping);
    request
}

fn some(name: &str) -> Option<String> {
    Some(name.to_owned())
}

/// A file with this text, imported.
fn text(name: &str, content: &str, request: &Import) -> Result<Imported, String> {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join(name);
    fs::write(&path, content).unwrap();
    import(&[&path], request).map_err(|e| e.to_string())
}

#[track_caller]
fn parsed(content: &str) -> Imported {
    text("run.csv", content, &Import::default()).unwrap_or_else(|e| panic!("{content}\n{e}"))
}

#[track_caller]
fn refused(content: &str, parts: &[&str]) {
    let error = text("run.csv", content, &Import::default()).expect_err(content);
    for part in parts {
        assert!(error.contains(part), "no `{part}` in: {error}");
    }
    assert!(!error.contains('\n'), "one paragraph: {error}");
}

/// The 400 rows of all logs except that of the serial monitor.
fn reference() -> (Vec<f64>, Vec<f64>) {
    let text = fs::read_to_string(stranger("logs/epochms.csv")).unwrap();
    let rows = text.lines().skip(1).map(|line| {
        let cells: Vec<f64> = line.split(',').map(|c| c.parse().unwrap()).collect();
        (cells[1], cells[2])
    });
    rows.unzip()
}

#[test]
fn every_logger_gives_the_same_record() {
    let (u, y) = reference();
    assert_eq!(u.len(), 400);
    for (file, offset) in [
        ("clock.csv", 0.0),
        ("datetime.csv", 0.0),
        ("epochms.csv", 0.0),
        ("iso.csv", 0.0),
        ("isoz.csv", 0.0),
        ("onoff.csv", 0.0),
        ("percent.csv", 0.0),
        ("thousands.csv", 1000.0),
        ("truefalse.csv", 0.0),
        ("uchange.csv", 0.0),
    ] {
        let found = read(&[stranger("logs").join(file)], &Import::default());
        let record = &found.set.records[0];
        assert_eq!((record.sample_period_s, record.t0), (1.0, 0.0), "{file}");
        assert_eq!(found.files[0].sample_period_s, 1.0, "{file}");
        assert_eq!(record.u, u, "{file}");
        let as_logged = y
            .iter()
            .zip(&record.y)
            .all(|(y, found)| (found - y - offset).abs() < 1e-9);
        assert!(record.len() == 400 && as_logged, "{file}");
    }
}

#[test]
fn what_was_understood_is_said() {
    for (file, parts) in [
        ("clock.csv", &["midnight 1 time", "23:55:01"][..]),
        ("datetime.csv", &["`Heater`: ON is 1, OFF is 0"]),
        (
            "epochms.csv",
            &["Unix time in ms", "first row (1726617301000)"],
        ),
        ("iso.csv", &["first row (2024-09-17T23:55:01)"]),
        ("percent.csv", &["u is in %", "--u-scale 1"]),
        ("thousands.csv", &["1,021.04 is read as 1021.04"]),
        ("truefalse.csv", &["True is 1, False is 0"]),
        (
            "uchange.csv",
            &["repeats the previous value (396 of 400 cells)"],
        ),
    ] {
        let found = read(&[stranger("logs").join(file)], &Import::default());
        let remarks = found.files[0].remarks.join("\n");
        for part in parts {
            assert!(remarks.contains(part), "{file}: no `{part}` in\n{remarks}");
        }
    }
}

#[test]
fn serial_monitors_are_read() {
    let found = read(&[stranger("logs/serial.txt")], &Import::default());
    let record = &found.set.records[0];
    assert_eq!(record.len(), 119);
    assert!((record.sample_period_s - 0.289_9).abs() < 1e-5);
    assert_eq!((record.u[1], record.y[1]), (64.0, 25.341));
    assert!(record.channels.contains_key("tan"));
    let mapping = &found.files[0].mapping;
    assert_eq!(
        (mapping.u.as_deref(), mapping.y.as_deref()),
        (Some("out"), Some("pv"))
    );

    // The text has the monitor's own clock before each line, a start-up message, and a line that
    // was cut off.
    let lines: String = (0..40)
        .map(|k| {
            format!(
                "23:59:59.{:03} -> u:{} y:{}.5\n",
                500 + 10 * k,
                k / 10 % 2,
                k
            )
        })
        .collect();
    let found = parsed(&format!(
        "23:59:59.499 -> ready\n{lines}23:59:59.990 -> u:1 y"
    ));
    let record = &found.set.records[0];
    assert_eq!((record.len(), record.sample_period_s), (40, 0.01));
    assert_eq!(record.y[39], 39.5);
    let remarks = found.files[0].remarks.join("\n");
    assert!(
        remarks.contains("line 42 is not a row and is left out: `u:1 y`"),
        "{remarks}"
    );

    let plain = parsed("t=0.1 u=1 y=21.3\nt=0.2 u=1 y=21.4\nt=0.3 u=0 y=21.6\n");
    assert_eq!(plain.set.records[0].u, [1.0, 1.0, 0.0]);
    let arrows = parsed("10:00:00.1 -> 1,21.3\n10:00:00.2 -> 0,21.4\n10:00:00.3 -> 1,21.6\n");
    assert_eq!(arrows.set.records[0].y, [21.3, 21.4, 21.6]);
    assert_eq!(arrows.set.sample_period_s, 0.1);
}

#[test]
fn times_of_every_kind_give_the_same_period() {
    for times in [
        ["1726617301", "1726617302", "1726617303"],
        ["1726617301.250", "1726617302.250", "1726617303.250"],
        ["1726617301000", "1726617302000", "1726617303000"],
        ["1726617301000000", "1726617302000000", "1726617303000000"],
        [
            "1726617301000000000",
            "1726617302000000000",
            "1726617303000000000",
        ],
        [
            "2024-12-31 23:59:58",
            "2024-12-31 23:59:59",
            "2025-01-01 00:00:00",
        ],
        [
            "31.12.2024 23:59:58",
            "31.12.2024 23:59:59",
            "01.01.2025 00:00:00",
        ],
        ["11:59:58 AM", "11:59:59 AM", "12:00:00 PM"],
        ["0 days 00:00:01", "0 days 00:00:02", "0 days 00:00:03"],
    ] {
        let rows: String = times
            .iter()
            .zip(0..)
            .map(|(t, k)| format!("{t},{},{k}\n", k % 2))
            .collect();
        let found = parsed(&format!("timestamp,heater,temperature\n{rows}"));
        let record = &found.set.records[0];
        assert!(
            (record.sample_period_s - 1.0).abs() < 1e-9,
            "{times:?}: {}",
            record.sample_period_s
        );
        assert_eq!(record.t0, 0.0, "{times:?}");
    }
    let blanks =
        parsed("Date Time Heater Temp\n2024-09-17 23:59:59 0 21.0\n2024-09-18 00:00:00 1 21.1\n");
    assert_eq!(blanks.set.records[0].u, [0.0, 1.0]);
    assert_eq!(blanks.files[0].mapping.t.as_deref(), Some("Date Time"));
    let millis = parsed("millis,pwm,temp\n5000,0,21\n5100,1,21\n5200,1,22\n");
    assert_eq!(
        (millis.set.sample_period_s, millis.set.records[0].t0),
        (0.1, 5.0)
    );
}

/// Stamps of whole seconds: of a clock that is slightly slow, and of a clock that is read several times a second.
#[test]
fn rounded_stamps_miss_no_sample() {
    let found = read(&[stranger("rounded-clock/log.csv")], &Import::default());
    assert_eq!(found.set.records[0].len(), 599);
    assert!((found.set.sample_period_s - 599.0 / 598.0).abs() < 1e-4);
    let remarks = found.files[0].remarks.join("\n");
    assert!(
        remarks.contains("599 s / 598 = 1.0017 s; no sample is missing"),
        "{remarks}"
    );
    for period in [1.0, 1.0017] {
        let found = read(
            &[stranger("rounded-clock/log.csv")],
            &with(|m| m.period_s = Some(period)),
        );
        assert_eq!(found.set.sample_period_s, period);
        assert!(found.set.records[0].channels.is_empty());
    }
    // The file is a data set by itself, and equal to the imported one.
    let alone = DataSet::load(&stranger("rounded-clock/log.csv")).unwrap();
    assert_eq!(alone.records[0].len(), 599);
    let folder = tempfile::tempdir().unwrap();
    found.save(&folder.path().join("set")).unwrap();
    assert_eq!(
        DataSet::load(&folder.path().join("set")).unwrap().hash,
        found.set.hash
    );

    let fast: String = (0..100)
        .map(|k| format!("10:00:{:02},{},{k}\n", k / 4, k / 10 % 2))
        .collect();
    let found = parsed(&format!("time,u,y\n{fast}"));
    assert!((found.set.sample_period_s - 0.25).abs() < 0.01);
}

#[test]
fn clocks_that_agree_within_a_sample_make_one_set() {
    let days = [
        stranger("two-clocks/monday.csv"),
        stranger("two-clocks/tuesday.csv"),
    ];
    let found = read(&days, &Import::default());
    let period = found.set.sample_period_s;
    assert!((period - 0.990_444).abs() < 1e-5, "{period}");
    assert!(
        found.remarks[0].contains("less than a sample"),
        "{:?}",
        found.remarks
    );
    assert!(found.files[0].sample_period_s != found.files[1].sample_period_s);
    let folder = tempfile::tempdir().unwrap();
    found.save(&folder.path().join("set")).unwrap();
    let set = DataSet::load(&folder.path().join("set")).unwrap();
    assert_eq!(set.hash, found.set.hash);
    let stated = read(&days, &with(|m| m.period_s = Some(0.9904)));
    assert_eq!(stated.set.sample_period_s, 0.9904);

    // A period that was estimated is not called stated.
    let folder = tempfile::tempdir().unwrap();
    let (slow, fast) = (
        folder.path().join("slow.csv"),
        folder.path().join("fast.csv"),
    );
    fs::write(&slow, "t,u,y\n0,0,1\n2,1,1\n4,0,1\n").unwrap();
    fs::write(&fast, "t,u,y\n0,0,1\n1,1,1\n2,0,1\n").unwrap();
    let error = import(&[&slow, &fast], &Import::default())
        .unwrap_err()
        .to_string();
    assert!(
        error.contains("is 1 s, that of record `slow` is 2 s") && error.contains("resample"),
        "{error}"
    );
    let error = import(&[&fast], &with(|m| m.period_s = Some(2.0)))
        .unwrap_err()
        .to_string();
    assert!(error.contains("1 s apart, but --period is 2 s"), "{error}");
    let found = import(
        &[&fast],
        &with(|m| {
            m.period_s = Some(2.0);
            m.ignore_time = true;
        }),
    )
    .unwrap();
    assert_eq!(found.set.sample_period_s, 2.0);
    assert!(found.set.records[0].channels.is_empty());
}

#[test]
fn what_is_not_read_is_named_by_its_cell() {
    refused(
        "t,u,y\n0,0,21\n1,HEAT,21\n2,0,22\n",
        &["line 3, column `u`", "`HEAT`", "on/off"],
    );
    refused(
        "t,u,y\n0,HEAT,21\n1,IDLE,21\n",
        &["line 2, column `u`", "`HEAT`"],
    );
    refused(
        "time,u,y\nyesterday,0,21\ntoday,1,22\n",
        &["line 2, column `time`", "`yesterday`"],
    );
    refused(
        "t,u,y\n0,0,21\n1,1,\n2,0,22\n",
        &["line 3, column `y`", "empty", "--fill-gaps SECONDS"],
    );
    refused(
        "t,u,y\n0,,21\n1,1,21\n2,0,22\n",
        &["line 2, column `u`", "first value"],
    );
    refused("t,u,y\n0,0,21\n1,1,21\n2,1,2,1\n", &["line 4", "4 values"]);
    refused("u,y\n1,HOT\n", &["line 2", "`HOT`", "no rows of numbers"]);
    refused(
        "t,u,y\n0,0,1\n1,1,1\n2,0,1\n3,0,1\n7,0,1\n8,0,1\n",
        &["column `t`", "missing", "--fill-gaps", "--ignore-time"],
    );
    let found = parsed("t,u,y,mode\n0,0,21,AUTO\n1,1,21,AUTO\n2,0,22,MAN\n");
    let remarks = found.files[0].remarks.join("\n");
    assert!(
        remarks.contains("`mode` is left out: its cell in line 2 reads `AUTO`"),
        "{remarks}"
    );
}

/// A file of 40 rows every 0.1 s, with these rows instead (empty: lost).
fn with_rows(instead: &[(usize, &str)]) -> String {
    let row = |k: usize| match instead.iter().find(|(row, _)| *row == k) {
        Some((_, text)) => (*text).to_owned(),
        None => format!("{:.3},{},{},5\n", 0.1 * k as f64, k / 5 % 2, 2 * k),
    };
    (0..40)
        .map(row)
        .fold("t,u,y,fan\n".to_owned(), |all, row| all + &row)
}

#[test]
fn short_gaps_are_filled_and_long_ones_named() {
    let filled = |fill_gaps_s: f64, instead: &[(usize, &str)]| {
        let request = with(|m| {
            m.fill_gaps_s = Some(fill_gaps_s);
            m.channels = Some(vec!["fan".to_owned()]);
        });
        text("run.csv", &with_rows(instead), &request)
    };
    let whole = filled(0.3, &[]).unwrap();
    assert!(whole.files[0].remarks.is_empty());
    // The file has two lost rows, a value that is missing beside them, and marks for missing values
    // in u and in a channel.
    let lost = [(3, "0.3,NaN,6,5\n"), (6, ""), (7, ""), (12, "1.2,0,,n/a\n")];
    let found = filled(0.3, &lost).unwrap();
    let (record, all) = (&found.set.records[0], &whole.set.records[0]);
    assert_eq!((record.u.clone(), record.len()), (all.u.clone(), 40));
    let is_linear = record
        .y
        .iter()
        .zip(&all.y)
        .all(|(a, b)| (a - b).abs() < 1e-9);
    assert!(
        is_linear && record.channels == all.channels,
        "{:?}",
        record.y
    );
    assert_eq!(
        found.files[0].remarks,
        [
            "2 missing row(s) are inserted (before line 8): u keeps its last value, the others are interpolated",
            "`y`: 1 of 38 values are interpolated (line 12)",
            "`u`: 1 of 38 values are repeated (line 5)",
            "`fan`: 1 of 38 values are interpolated (line 12)",
        ]
    );
    // Later errors name the line of the file, also behind inserted rows.
    let late = filled(0.3, &[(6, ""), (15, "1.5,1,1e300,5\n")]).unwrap_err();
    assert!(late.contains("line 16, column `y`"), "{late}");

    for (most_s, instead, parts) in [
        (
            0.25,
            &lost[..],
            [
                "line 8, column `t`",
                "lasts 0.3 s, longer than --fill-gaps 0.25",
            ],
        ),
        // The gap of y continues across the lost rows.
        (
            0.35,
            &[(5, "0.5,1,,5\n"), lost[1], lost[2]],
            ["line 7, column `y`", "give --fill-gaps 0.4"],
        ),
        (
            1.0,
            &[(0, "0.0,0,,5\n")],
            ["line 2, column `y`", "at the start"],
        ),
        (
            1.0,
            &[(38, "3.8,1,3,\n"), (39, "3.9,1,3,\n")],
            ["line 40, column `fan`", "at the end"],
        ),
        (
            1.0,
            &[lost[1], lost[2], (11, ""), (15, "")],
            ["line 14, column `t`", "4 rows are missing"],
        ),
        (
            1.0,
            &[(6, ""), (7, "0.740,1,3,5\n")],
            ["line 8, column `t`", "the time step is 0.24 s"],
        ),
        (
            1.0,
            &[(6, ",1,3,5\n")],
            ["line 8, column `t`", "empty; fill it in, or split"],
        ),
    ] {
        let error = filled(most_s, instead).unwrap_err();
        for part in parts {
            assert!(error.contains(part), "no `{part}` in: {error}");
        }
    }
}

#[test]
fn a_column_with_two_levels_may_be_the_command() {
    let rows = "t,U_ac,F_z\n0,0,4.1\n0.1,8.5,4.2\n0.2,8.5,4.4\n0.3,0,4.3\n";
    refused(
        rows,
        &[
            "`U_ac`, whose values lie near 0 and 8.5",
            "--u \"U_ac\" --u-threshold 4.25",
        ],
    );
    // A monitored voltage scatters.
    let monitored = "t,AI0,F_z\n0,-0.1,4.1\n0.1,23.9,4.2\n0.2,24.2,4.4\n0.3,0,4.3\n";
    refused(monitored, &["--u \"AI0\" --u-threshold 12"]);
    refused(
        "t,a,b\n0,0,0\n0.1,2,3\n0.2,2,3\n",
        &["name it with --u NAME", "`a` (0 to 2)"],
    );
}

#[test]
fn a_constant_column_is_not_the_output() {
    let rows = "t,valve,setpoint,F_z\n0,0,5,4.1\n0.1,1,5,4.2\n0.2,1,5,4.4\n";
    let told = text("log.csv", rows, &with(|_| {})).unwrap();
    assert_eq!(told.set.records[0].y, [4.1, 4.2, 4.4]);
    let rows = "t,valve,setpoint,q,F_z\n0,0,5,1,4.1\n0.1,1,5,2,4.2\n0.2,1,5,1,4.4\n";
    refused(rows, &["name it with --y NAME", "`setpoint` (always 5)"]);
}

#[test]
fn a_sample_may_be_the_mean_of_several_rows() {
    let rows = "t,valve,y,q\n0,0,1,10\n0.1,0,3,20\n0.2,0,5,30\n0.3,1,7,10\n0.4,1,9,20\n0.5,1,11,30\n0.6,1,13,0\n";
    let mean = |rows_of: usize| text("log.csv", rows, &with(|m| m.mean_of = Some(rows_of)));
    let set = mean(3).unwrap().set;
    let [record] = set.records.as_slice() else {
        panic!("one record");
    };
    assert_eq!(
        (record.y.as_slice(), record.u.as_slice()),
        (&[3.0, 9.0][..], &[0.0, 1.0][..])
    );
    assert_eq!(record.channels["q"], [20.0, 20.0]);
    assert!((set.sample_period_s - 0.3).abs() < 1e-12 && (record.t0 - 0.1).abs() < 1e-12);
    // The command of a sample is that of most of its rows.
    assert_eq!(mean(2).unwrap().set.records[0].u, [0.0, 1.0, 1.0]);
    for (rows_of, says) in [
        (1, "2 or more"),
        (4, "at least twice as many rows"),
        (usize::MAX / 2 + 1, "at least twice as many rows"),
    ] {
        let error = mean(rows_of).unwrap_err().to_string();
        assert!(error.contains(says), "{error}");
    }
}

/// Two runs of three rows, and a pause of the logger within the second.
#[test]
fn a_file_with_several_runs_becomes_several_records() {
    let rows = "run,t,valve,y\n1,0,0,0.5\n1,0.1,1,0.6\n1,0.2,1,0.7\n\
                2,0,0,0.1\n2,0.1,1,0.2\n2,0.9,0,0.3\n2,1.0,0,0.4\n";
    refused(rows, &["line 5", "--split-by"]);
    let by = |name: &str, change: &dyn Fn(&mut Import)| {
        let mut request = with(|m| m.split_by = some(name));
        change(&mut request);
        text("log.csv", rows, &request)
    };
    let told = by("t", &|_| {}).unwrap();
    let names: Vec<&str> = told.set.records.iter().map(|r| r.name.as_str()).collect();
    assert_eq!(names, ["log-1", "log-2", "log-3"]);
    let [_, second, third] = told.set.records.as_slice() else {
        panic!("{names:?}");
    };
    assert_eq!(
        (second.y.as_slice(), second.t0),
        ([0.1, 0.2].as_slice(), 0.0)
    );
    assert_eq!((third.y.as_slice(), third.t0), ([0.3, 0.4].as_slice(), 0.9));
    assert!(second.channels.contains_key("run"));
    // The pause stays a fault of the second run, and is named by its line.
    let error = by("run", &|_| {}).unwrap_err();
    assert!(
        error.contains("line 7") && error.contains("--split-by"),
        "{error}"
    );
    let told = by("run", &|request| {
        (request.mapping.ignore_time, request.mapping.period_s) = (true, Some(0.1));
        request.validate = vec!["log-2".to_owned()];
    });
    let told = told.unwrap();
    let [first, second] = told.set.records.as_slice() else {
        panic!("{:?}", told.files);
    };
    assert_eq!((first.role, second.role), (Use::Identify, Use::Validate));
    assert_eq!((first.len(), second.len()), (3, 4));
    assert!(
        first.channels.is_empty(),
        "the number of the run is no channel"
    );
    assert!(by("nothing", &|_| {}).unwrap_err().contains("`run`"));
}

/// The date of a run is that of its own first row.
#[test]
fn runs_with_clock_times_count_from_their_own_first_row() {
    let rows = "Time,valve,y\n10:00:00,0,1.5\n10:00:01,1,1.6\n10:00:02,1,1.7\n\
                10:30:00,0,2.5\n10:30:01,0,2.6\n10:30:02,1,2.7\n";
    let told = text("log.csv", rows, &with(|m| m.split_by = some("Time"))).unwrap();
    let starts: Vec<f64> = told.set.records.iter().map(|r| r.t0).collect();
    assert_eq!(starts, [0.0, 0.0]);
    let remark = |file: usize| told.files[file].remarks.join(" ");
    assert!(remark(0).contains("(10:00:00)"), "{}", remark(0));
    assert!(remark(1).contains("(line 5)"), "{}", remark(1));
}

#[test]
fn a_command_may_be_graded_held_or_in_percent() {
    let graded = parsed("t,u [%],y\n0,0,21\n1,45,21\n2,45,22\n");
    assert_eq!(graded.set.records[0].u, [0.0, 0.45, 0.45]);
    let kept = text(
        "run.csv",
        "t,u,y\n0,0 %,21\n1,45 %,21\n2,45 %,22\n",
        &Import {
            u_before: Some(0.0),
            ..with(|m| m.u_scale = Some(1.0))
        },
    );
    let kept = kept.unwrap();
    assert_eq!(kept.set.records[0].u, [0.0, 45.0, 45.0]);
    assert_eq!(kept.set.records[0].u_before, Some(0.0));
    // The command is the last column and is written on change only.
    let last = parsed("t,y,u\n0,21,open\n1,21,\n2,22,closed\n3,22,\n");
    assert_eq!(last.set.records[0].u, [1.0, 1.0, 0.0, 0.0]);
    let german = parsed("Uhrzeit;Ventil;Sensor\n10:00:00;auf;1.021,5\n10:00:01;zu;998,25\n");
    assert_eq!(german.set.records[0].y, [1021.5, 998.25]);
}

#[test]
fn a_folder_stands_for_its_files() {
    let folder = tempfile::tempdir().unwrap();
    for (name, content) in [
        ("b.csv", "t,u,y\n0,0,1\n1,1,2\n"),
        ("a.csv", "t,u,y\n0,1,1\n1,0,2\n"),
        ("notes.txt", "nothing"),
        ("README.csv", "nothing"),
    ] {
        fs::write(folder.path().join(name), content).unwrap();
    }
    let files = files_of(&[folder.path()]).unwrap();
    let names: Vec<_> = files.iter().map(|f| f.file_name().unwrap()).collect();
    assert_eq!(names, ["a.csv", "b.csv"]);
    let hint = DataSet::load(folder.path()).unwrap_err().to_string();
    assert!(
        hint.contains("no dataset.toml") && hint.contains("host-fit import"),
        "{hint}"
    );

    let found = read(&files, &Import::default());
    let refuse = |target: &Path, force| {
        found
            .refuse_to_replace(target, force)
            .unwrap_err()
            .to_string()
    };
    assert!(refuse(folder.path(), true).contains("a.csv: is an input"));
    let set = folder.path().join("set");
    found.refuse_to_replace(&set, false).unwrap();
    found.save(&set).unwrap();
    assert!(refuse(&set, false).contains("--force"));
    found.refuse_to_replace(&set, true).unwrap();
    let error = files_of(&[&set]).unwrap_err().to_string();
    assert!(error.contains("a data set already"), "{error}");
    let other = folder.path().join("other");
    fs::create_dir(&other).unwrap();
    assert!(
        files_of(&[&other])
            .unwrap_err()
            .to_string()
            .contains("name the files")
    );
    fs::write(other.join("b.csv"), "").unwrap();
    assert!(refuse(&other, false).contains("b.csv: exists already"));
}

#[test]
fn the_held_out_end_has_the_whole_record_before_it() {
    let rows: String = (0..100)
        .map(|k| format!("{k},{},{k}\n", k / 10 % 2))
        .collect();
    let content = format!("t,u,y\n{rows}");
    let all = parsed(&content);
    assert!(
        all.remarks[0].contains("There is no validation record")
            && all.remarks[0].contains("--hold-out-from 70"),
        "{:?}",
        all.remarks
    );
    let request = Import {
        hold_out_from_s: Some(70.0),
        ..Import::default()
    };
    let found = text("run.csv", &content, &request).unwrap();
    assert!(found.remarks.is_empty(), "{:?}", found.remarks);
    let shapes = |records: &[Record]| -> Vec<(usize, usize)> {
        records.iter().map(|r| (r.len(), r.lead)).collect()
    };
    assert_eq!(shapes(&found.set.records), [(70, 0), (100, 70)]);
    assert_eq!(found.set.records[1].u, all.set.records[0].u);
    let folder = tempfile::tempdir().unwrap();
    found.save(&folder.path().join("set")).unwrap();
    let again = DataSet::load(&folder.path().join("set")).unwrap();
    assert_eq!(again.records, found.set.records);
    let late = Import {
        hold_out_from_s: Some(99.5),
        ..Import::default()
    };
    let error = text("run.csv", &content, &late).unwrap_err();
    assert!(error.contains("goes from 0 to 99 s"), "{error}");
}

#[test]
fn other_commands_name_the_import() {
    let made = |name: &str| {
        Path::new(env!("CARGO_MANIFEST_DIR"))
            .join("tests/import")
            .join(name)
    };
    for file in [
        made("v7.mat"),
        made("v5.mat"),
        made("plain.npz"),
        made("matrix.npy"),
        stranger("logs/epochms.csv"),
        stranger("logs/onoff.csv"),
        stranger("logs/iso.csv"),
        stranger("logs/clock.csv"),
        stranger("logs/uchange.csv"),
    ] {
        let error = DataSet::load(&file).unwrap_err().to_string();
        assert!(error.contains("host-fit import"), "{error}");
    }
}
