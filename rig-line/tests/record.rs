//! Recordings over good and bad lines, with the firmware's own code at the other end.

mod board;

use board::{board, gone, host};
use rig_line::record::{Recording, record};
use rig_line::{Bad, Command, Host, LineError};
use std::sync::atomic::Ordering;
use wire::samples::Sample;

fn command(samples: usize) -> Command {
    let levels = (0..samples).map(|k| (30..samples / 2).contains(&k) && k % 100 < 60);
    Command::new("squares", 0.001, levels).with_rest(200)
}

fn play(
    host: &mut Host,
    command: &Command,
    repeats: u32,
) -> (Result<Recording, LineError>, Vec<Vec<Sample>>) {
    let mut kept = Vec::new();
    let result = record(
        host,
        &mut gone,
        command,
        repeats,
        &mut |repeat, samples| {
            assert_eq!(repeat as usize, kept.len());
            kept.push(samples.to_vec());
            Ok(())
        },
        &mut |_| {},
    );
    (result, kept)
}

/// Checks that repeats are complete: the valve moved as commanded, and the samples follow each
/// other without a gap (the channel counts them).
fn whole(command: &Command, kept: &[Vec<Sample>]) {
    for repeat in kept {
        assert!(command.levels().eq(repeat.iter().map(|s| s.open)));
        let numbers = repeat.windows(2);
        for pair in numbers {
            assert_eq!((pair[0].channel + 1) % 4096, pair[1].channel);
        }
    }
}

#[test]
fn a_good_line_loses_nothing() {
    let (hands, line) = board();
    let mut host = host(&line, &hands, None, 5);
    let command = command(1000);
    let (recording, kept) = play(&mut host, &command, 20);
    let recording = recording.expect("a recording");
    assert_eq!(
        (recording.whole, recording.lost()),
        (20, 0),
        "{recording:?}"
    );
    assert_eq!((recording.parts.len(), recording.damaged_frames), (1, 0));
    whole(&command, &kept);
    assert!(!hands.is_open.load(Ordering::Relaxed));
}

/// A million samples over a line that damages a byte in five thousand: each sample is received or known to be
/// missing, and every stored repeat is complete.
#[test]
fn a_bad_line_loses_nothing_unnoticed() {
    let (hands, line) = board();
    let bad = Bad {
        millionths: 200,
        seed: 1,
    };
    let mut host = host(&line, &hands, Some(bad), 5);
    let command = command(1000);
    let (mut samples, mut lost, mut frames, mut parts, mut repeats) = (0, 0, 0, 0, 0);
    while samples + lost < 1_000_000 {
        let (recording, kept) = play(&mut host, &command, 100);
        let recording = recording.expect("a recording");
        whole(&command, &kept);
        assert_eq!(recording.cut_short, None);
        // Every played sample is received or known to be missing.
        let played = recording.samples + recording.lost();
        // The end of the command is missing only if an attempt was aborted.
        let broken = recording.parts.iter().filter(|p| p.ended != "played");
        let broken = broken.count();
        assert!(broken <= 1 && (broken > 0 || played % command.samples() == 0));
        samples += recording.samples;
        lost += recording.lost();
        frames += recording.damaged_frames;
        parts += recording.parts.len();
        repeats += kept.len();
    }
    assert!(frames > 500 && lost > 10_000, "{frames} {lost}");
    println!(
        "{samples} samples came, {lost} were lost and noticed, {frames} damaged frames, \
         {repeats} whole repeats in {parts} goes"
    );
}

#[test]
fn a_board_that_is_restarted_goes_on_with_whole_repeats() {
    let (hands, line) = board();
    let mut host = host(&line, &hands, None, 5);
    let command = command(2000);
    let mut kept = Vec::new();
    let recording = record(
        &mut host,
        &mut gone,
        &command,
        6,
        &mut |repeat, samples| {
            if repeat == 2 {
                hands.reset.store(true, Ordering::Relaxed);
            }
            kept.push(samples.to_vec());
            Ok(())
        },
        &mut |_| {},
    )
    .expect("a recording");
    assert_eq!((recording.whole, recording.parts.len()), (6, 2));
    assert!(recording.parts[0].ended.contains("restarted"));
    whole(&command, &kept);
}

#[test]
fn a_fault_ends_it_and_keeps_what_was_whole() {
    let (hands, line) = board();
    let mut host = host(&line, &hands, None, 5);
    let command = command(1000);
    let mut kept = 0;
    let recording = record(
        &mut host,
        &mut gone,
        &command,
        6,
        &mut |repeat, _| {
            kept += 1;
            if repeat == 1 {
                hands.reading.store(4095, Ordering::Relaxed);
            }
            Ok(())
        },
        &mut |_| {},
    )
    .expect("a recording");
    let why = recording.cut_short.expect("a reason");
    assert!(why.contains("at-rail"), "{why}");
    assert_eq!((recording.whole, kept), (2, 2));
    assert!(!hands.is_open.load(Ordering::Relaxed));
}

#[test]
fn a_host_that_dies_leaves_no_valve_open() {
    let (hands, line) = board();
    let mut first = host(&line, &hands, None, 5);
    let runs = [10, 1_000_000, 10];
    first.load(&runs).expect("loaded");
    first.play(&runs, 1).expect("played");
    let _ = first.next(std::time::Duration::from_millis(50));
    // The host neither reads nor writes; the board continues.
    drop(first);
    let until = std::time::Instant::now() + std::time::Duration::from_secs(20);
    loop {
        std::thread::sleep(std::time::Duration::from_millis(20));
        let (samples, open) = (
            hands.samples.load(Ordering::Relaxed),
            hands.is_open.load(Ordering::Relaxed),
        );
        if samples > 800 && !open {
            break;
        }
        assert!(std::time::Instant::now() < until, "{samples} {open}");
    }
    let open = hands.open.load(Ordering::Relaxed);
    // The valve closes half a second after the last message from the host.
    assert!((300..1000).contains(&open), "{open}");
}

#[test]
fn two_hosts_do_not_mix() {
    let (hands, line) = board();
    let mut first = host(&line, &hands, None, 5);
    let runs = [10, 20_000, 10];
    first.load(&runs).expect("loaded");
    first.play(&runs, 1).expect("played");
    // A second host sends on the same line, but cannot play.
    let frame = wire::request::Request {
        number: 1,
        session: 6,
        ask: wire::request::Ask::Arm,
    };
    std::io::Write::write_all(&mut &line, frame.frame().bytes()).expect("sent");
    let mut next = 0;
    while next < 5_000 {
        let event = first
            .next(std::time::Duration::from_secs(2))
            .expect("a line");
        let rig_line::Event::Samples(streamed) = event else {
            panic!("silence after {next}");
        };
        assert_eq!(streamed.samples.first().map(|s| s.0), Some(next));
        next = streamed.next;
    }
    first.disarm().expect("disarmed");
    // Another answer, another sample.
    first.hello().expect("an answer");
    assert!(!hands.is_open.load(Ordering::Relaxed));
}

#[test]
fn what_no_board_can_play_is_refused_with_the_reason() {
    let (hands, line) = board();
    let mut host = host(&line, &hands, None, 5);
    let refused = |host: &mut Host, command: &Command| {
        let (result, _) = play(host, command, 2);
        result.expect_err("refused").to_string()
    };
    let other = Command::new("slow", 0.002, [false, true, true]);
    assert!(refused(&mut host, &other).contains("0.002"));
    let short = Command::new("short", 0.001, [false, true, false]).with_rest(200);
    assert!(refused(&mut host, &short).contains("hold time"));
    let long = Command::new("long", 0.001, (0..90_000).map(|k| k / 30 % 2 == 1));
    assert!(refused(&mut host, &long).contains("3000 intervals"));
    // The law runs on a flow that does not respond.
    host.arm().expect("armed");
    let message = refused(&mut host, &command(1000));
    assert!(
        message.contains("armed") || message.contains("residual"),
        "{message}"
    );
}

/// The calibration finds the properties of the simulated rig.
#[test]
fn a_rig_is_calibrated() {
    let (hands, line) = board();
    let mut host = host(&line, &hands, None, 5);
    let plan = rig_line::calibrate::Plan::default();
    let rig = rig_line::calibrate::calibrate(&mut host, &plan, None, &mut |_, _| {});
    let rig = rig.expect("a rig");
    rig.check().expect("a good one");
    assert!((rig.sensor.zero_counts - 900.0).abs() < 1.5, "{rig:?}");
    assert!((rig.friction(2700.0) - 1.0).abs() < 0.002, "{rig:?}");
    // The valve needs more than six samples to move, so seven samples are the shortest time with a response.
    assert_eq!(rig.hold_samples(), [7, 7], "{rig:?}");
    let [off, on] = rig.sensor.noise_counts.expect("noise");
    let expected = (41.0_f64 * 41.0 - 1.0).sqrt() / 12.0_f64.sqrt();
    assert!((off - expected).abs() < 1.0 && (on - expected).abs() < 1.0);
    assert!(!hands.is_open.load(Ordering::Relaxed));
}

#[test]
fn a_rig_without_air_or_at_a_rail_is_not_calibrated() {
    for (reading, word) in [(0, "steady blowing"), (4095, "closed the valve")] {
        let (hands, line) = board();
        hands.no_air.store(true, Ordering::Relaxed);
        hands.reading.store(reading, Ordering::Relaxed);
        let mut host = host(&line, &hands, None, 5);
        let plan = rig_line::calibrate::Plan::default();
        let result = rig_line::calibrate::calibrate(&mut host, &plan, None, &mut |_, _| {});
        let message = result.expect_err("refused").to_string();
        assert!(message.contains(word), "{message}");
    }
}

/// The zero of the sensor moves while the law runs. The log must begin at rest, and the check of the model must
/// raise the alarm.
#[test]
fn a_loop_is_watched_logged_and_judged() {
    use rig_line::alarm::{Test, Verdict};
    let (hands, line) = board();
    hands.as_modelled.store(true, Ordering::Relaxed);
    let mut host = host(&line, &hands, None, 5);
    let plan = rig_line::watch::Plan {
        arm: true,
        rest_s: 1.0,
        duration_s: 60.0,
        log_s: 10.0,
        test: Test {
            block_s: 1.0,
            learn: 20,
            false_alarms_per_year: 0.01,
        },
    };
    let folder = tempfile::tempdir().expect("a folder");
    let log = folder.path().join("service");
    let mut seen = Vec::new();
    let watched = rig_line::watch::watch(
        &mut host,
        &plan,
        &Default::default(),
        Some(&log),
        &mut |now| {
            if now.t > 40.0 {
                // The shift is a fifth of the shift that latches a fault.
                hands.shift.store(200, Ordering::Relaxed);
            } else {
                seen.push(now.verdict);
            }
            rig_line::watch::Turn::GoOn
        },
    );
    let watched = watched.expect("watched");
    assert!(watched.ended.is_none(), "{watched:?}");
    assert!(
        matches!(seen.last(), Some(Verdict::True { .. })),
        "{watched:?}"
    );
    let Some(Verdict::Stopped { at_s, .. }) = watched.verdict else {
        panic!("{watched:?}");
    };
    // The time of the verdict counts from the start of the law, one second after the start. The shift is set when
    // this thread receives the 40th second; the emulated board may be ahead of it.
    assert!((39.0..50.0).contains(&at_s), "{at_s}");
    assert_eq!((watched.lost_samples, watched.logged), (0, 10_000));
    assert!(watched.rms_error.is_some_and(|e| e < 0.2), "{watched:?}");
    let set = recordings::DataSet::load(&log).expect("a data set");
    let record = &set.records[0];
    assert!(record.u[..1000].iter().all(|u| *u == 0.0) && record.u.contains(&1.0));
    assert!(!hands.is_open.load(Ordering::Relaxed));
}

/// The running law is changed over a line that loses and changes bytes: each change is made once, a value outside its
/// bounds is not sent, and the disarmed law has its designed target again.
#[test]
fn the_running_law_is_changed_over_a_bad_line() {
    use rig_line::Change;
    use rig_line::watch::Turn;
    let (hands, line) = board();
    hands.as_modelled.store(true, Ordering::Relaxed);
    let bad = Bad {
        millionths: 300,
        seed: 11,
    };
    let mut host = host(&line, &hands, Some(bad), 5);
    let designed = host.settings().expect("settings");
    let [low, high] = designed.reachable.map(f64::from);
    let other = f64::from(designed.target) - 0.2 * (high - low);
    assert!(low < other, "{designed:?}");
    let plan = rig_line::watch::Plan {
        arm: true,
        rest_s: 0.5,
        duration_s: 20.0,
        log_s: 1.0,
        test: Default::default(),
    };
    let mut changes = [
        (4.0, Change::Target(high + 0.01)),
        (5.0, Change::Target(f64::NAN)),
        (6.0, Change::Air(1.5)),
        (7.0, Change::Target(other)),
        (16.0, Change::Pause),
        (18.0, Change::Resume),
        (19.0, Change::Air(0.9)),
    ]
    .into_iter()
    .peekable();
    let (mut sum, mut count, mut paused) = (0.0, 0.0, false);
    let mut held = None;
    let watched = rig_line::watch::watch(&mut host, &plan, &Default::default(), None, &mut |now| {
        if (10.0..16.0).contains(&now.t) {
            held = now.reference;
            (sum, count) = (sum + now.y, count + 1.0);
        }
        if (17.0..18.0).contains(&now.t) {
            paused |= now.phase == wire::reply::Phase::Paused;
            assert!(!now.open, "paused");
        }
        match changes.next_if(|(t, _)| now.t >= *t) {
            Some((_, change)) => Turn::Change(change),
            None => Turn::GoOn,
        }
    });
    let watched = watched.expect("watched");
    assert!(watched.ended.is_none(), "{watched:?}");
    let refused: Vec<bool> = watched
        .changes
        .iter()
        .map(|c| c.refused.is_some())
        .collect();
    assert_eq!(
        refused,
        [true, true, true, false, false, false, false],
        "{:?}",
        watched.changes
    );
    assert!(paused);
    assert!(
        held.is_some_and(|held| (held - other).abs() < 1e-6),
        "{held:?}"
    );
    assert!(
        (sum / count - other).abs() < 0.1,
        "{} for {other}",
        sum / count
    );
    assert!(
        watched
            .least_margin
            .is_some_and(|m| (0.0..1.0).contains(&m))
    );
    let after = host.settings().expect("settings");
    assert_eq!(after, designed);
    // Without a running law nothing changes.
    assert!(host.change(Change::Target(other)).is_err());
    assert!(host.change(Change::Pause).is_err());
}
