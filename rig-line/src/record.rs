//! Plays a command repeatedly and keeps the complete repeats.
//!
//! A repeat with a lost sample (on the board or on the line) or a broken link is played again. Repeats are
//! never assembled from pieces: each is played without interruption, from rest.

use std::time::{Duration, Instant};

use serde::Serialize;
use wire::reply::{Info, Phase};
use wire::samples::Sample;

use crate::command::Command;
use crate::error::LineError;
use crate::host::{Event, Host, Streamed, word};

/// Longest silence during playing.
const SILENCE: Duration = Duration::from_millis(1000);
/// Time to wait for a lost board.
const GONE: Duration = Duration::from_secs(30);
/// Longest time without a new sample.
const NO_PROGRESS: Duration = Duration::from_secs(10);
/// Longest command, samples: 2.8 h at 1 kHz, about 100 MB in memory.
pub(crate) const MOST_SAMPLES: u64 = 10_000_000;
/// Attempts without a complete repeat after which recording fails.
const FRUITLESS: u32 = 10;

/// Progress of a recording.
#[derive(Clone, Copy, Debug)]
pub struct Progress {
    /// Complete repeats so far.
    pub whole: u32,
    /// Sample of the present repeat.
    pub sample: u32,
    /// Samples lost so far.
    pub lost: u64,
    /// The newest sample.
    pub newest: Sample,
}

/// Repeats that were played without interruption.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct Part {
    /// The board's sample count at the first repeat of the part.
    pub board_sample: u64,
    /// Complete repeats before the part.
    pub first_repeat: u32,
    /// Complete repeats in the part.
    pub whole: u32,
    /// Why the part ended.
    pub ended: String,
}

/// Lost samples.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
pub struct Gap {
    /// Index of the part.
    pub part: usize,
    /// First lost sample, from the part's start.
    pub first: u32,
    /// Number of lost samples.
    pub samples: u32,
    /// Number of lost samples that the board dropped for lack of memory; the others were lost on the line.
    pub left_out: u32,
}

/// Result of a recording.
#[derive(Clone, Debug, PartialEq)]
pub struct Recording {
    /// The board.
    pub board: Info,
    /// Complete repeats, all of them kept.
    pub whole: u32,
    /// Uninterrupted parts.
    pub parts: Vec<Part>,
    /// Lost samples.
    pub gaps: Vec<Gap>,
    /// Received samples, including those of incomplete repeats.
    pub samples: u64,
    /// Damaged frames.
    pub damaged_frames: u64,
    /// The reason for the end before all repeats were complete.
    pub cut_short: Option<String>,
}

impl Recording {
    /// Lost samples.
    #[must_use]
    pub fn lost(&self) -> u64 {
        self.gaps.iter().map(|gap| u64::from(gap.samples)).sum()
    }
}

/// How a turn ended.
enum End {
    /// All was played.
    Played,
    /// The board closed the valve; its phase states the reason.
    Shut(Phase),
    /// The line or the board failed.
    Broken(String),
}

/// Reopens the line after it broke.
pub type Connect<'a> = dyn FnMut() -> Result<Host, LineError> + 'a;
/// Receives a complete repeat: its number and samples.
pub type Keep<'a> = dyn FnMut(u32, &[Sample]) -> std::io::Result<()> + 'a;

/// Plays `command` on `host` until `repeats` complete repeats were received, and passes each to `keep`.
///
/// The recording ends early, with the reason, after a fault, with another board, or on a line without complete
/// repeats. Complete repeats are kept.
///
/// # Errors
/// [`LineError`] if nothing can be played at all.
pub fn record(
    host: &mut Host,
    connect: &mut Connect<'_>,
    command: &Command,
    repeats: u32,
    keep: &mut Keep<'_>,
    watch: &mut dyn FnMut(&Progress),
) -> Result<Recording, LineError> {
    let board = host.hello()?;
    fits(command, &board)?;
    let mut session = Session {
        command,
        repeats,
        keep,
        watch,
        recording: Recording {
            board,
            whole: 0,
            parts: Vec::new(),
            gaps: Vec::new(),
            samples: 0,
            damaged_frames: 0,
            cut_short: None,
        },
    };
    let mut fruitless = 0;
    while session.recording.whole < repeats && session.recording.cut_short.is_none() {
        let before = session.recording.whole;
        let end = match session.turn(host) {
            Ok(end) => end,
            // Playing may become possible later, so the attempt is repeated.
            Err(LineError::Gone(why)) => End::Broken(why),
            Err(LineError::Silent(_)) => End::Broken("the board fell silent".into()),
            Err(other @ LineError::Keep(_)) => return Err(other),
            Err(other) if session.recording.whole == 0 => return Err(other),
            Err(other) => {
                session.recording.cut_short = Some(other.to_string());
                break;
            }
        };
        fruitless = if session.recording.whole > before {
            0
        } else {
            fruitless + 1
        };
        session.recording.damaged_frames += std::mem::take(&mut host.damaged);
        let ended = match &end {
            End::Played => "played".to_owned(),
            End::Shut(phase) => format!("the board was {}", word(*phase)),
            End::Broken(why) => why.clone(),
        };
        if let Some(part) = session.recording.parts.last_mut() {
            part.whole = session.recording.whole - part.first_repeat;
            part.ended = ended;
        }
        let cut = match end {
            End::Shut(phase @ Phase::Faulted(_)) => {
                Some(format!("the board closed the valve: {}", word(phase)))
            }
            End::Shut(_) => Some("the valve was closed by hand or by another host".to_owned()),
            End::Broken(_) => session.again(connect, host).err(),
            End::Played => None,
        };
        let cut = cut.or_else(|| {
            (fruitless >= FRUITLESS).then(|| {
                format!("no complete repeat in {FRUITLESS} attempts; check the connection, or play shorter commands")
            })
        });
        if session.recording.whole < repeats {
            session.recording.cut_short = cut;
        }
    }
    // The valve does not stay open: a board that does not receive this closes it by itself.
    let _ = host.disarm();
    Ok(session.recording)
}

/// Whether the board can play the command at all.
fn fits(command: &Command, board: &Info) -> Result<(), LineError> {
    let refused = |reason| LineError::Command {
        command: command.name.clone(),
        reason,
    };
    let period = f64::from(board.period_us) * 1e-6;
    if (command.sample_period_s / period - 1.0).abs() > 1e-6 {
        return Err(refused(format!(
            "it has a row every {} s, but the board samples every {period} s; write it for the board's period",
            command.sample_period_s
        )));
    }
    if board.period_us < 400 {
        return Err(refused(format!(
            "the board samples every {period} s, but the serial line can transmit every sample only at periods of at \
                 least 0.0004 s"
        )));
    }
    if command.samples() > MOST_SAMPLES {
        return Err(refused(format!(
            "with its rest it has {} samples, but at most {MOST_SAMPLES} are possible; play it in shorter pieces",
            command.samples()
        )));
    }
    if command.runs.len() > usize::from(board.most_runs) {
        return Err(refused(format!(
            "it has {} intervals of constant command, but the board stores {}; play it in shorter pieces",
            command.runs.len(),
            board.most_runs
        )));
    }
    Ok(())
}

struct Session<'a, 'b> {
    command: &'a Command,
    repeats: u32,
    keep: &'a mut Keep<'b>,
    watch: &'a mut dyn FnMut(&Progress),
    recording: Recording,
}

impl Session<'_, '_> {
    /// Plays the remaining repeats without interruption.
    fn turn(&mut self, host: &mut Host) -> Result<End, LineError> {
        let period = self.command.samples();
        // Samples of a stream are numbered with 32 bits.
        let most = (u64::from(u32::MAX) / period.max(1)).max(1);
        let left = self.repeats - self.recording.whole;
        let repeats = u32::try_from(most).map_or(left, |most| left.min(most));
        let total = period * u64::from(repeats);
        // After a broken link the board waits for an acknowledgement.
        if matches!(host.hello()?.phase, Phase::Faulted(n) if word(Phase::Faulted(n)) == "link") {
            host.disarm()?;
        }
        host.load(&self.command.runs)?;
        let start = host.play(&self.command.runs, repeats)?;
        self.recording.parts.push(Part {
            board_sample: start,
            first_repeat: self.recording.whole,
            whole: 0,
            ended: String::new(),
        });
        let mut taken = Taken {
            period: period as usize,
            next: 0,
            left_out: 0,
            repeat: Vec::new(),
        };
        let mut unanswered = 0;
        let mut progressed = (0, Instant::now());
        loop {
            match host.next(SILENCE)? {
                Event::Samples(streamed) => {
                    unanswered = 0;
                    self.take(&mut taken, &streamed)?;
                    if taken.next != progressed.0 {
                        progressed = (taken.next, Instant::now());
                    } else if progressed.1.elapsed() > NO_PROGRESS {
                        return Ok(End::Broken("the board repeats the same samples".into()));
                    }
                    if u64::from(taken.next) > total {
                        return Ok(End::Broken(
                            "the board continues to play after the end of the command".into(),
                        ));
                    }
                    if streamed.phase != Phase::Playing
                        && !(streamed.last && streamed.samples.is_empty())
                    {
                        return Ok(End::Shut(streamed.phase));
                    }
                    if streamed.last {
                        return Ok(if u64::from(taken.next) >= total {
                            End::Played
                        } else {
                            End::Shut(streamed.phase)
                        });
                    }
                }
                Event::Silence => {
                    let info = host.hello()?;
                    if info.samples < start
                        || (info.session != host.session() && info.phase == Phase::Disarmed)
                    {
                        return Ok(End::Broken("the board was restarted".into()));
                    }
                    match info.phase {
                        Phase::Playing if unanswered < 3 => unanswered += 1,
                        Phase::Playing => {
                            return Ok(End::Broken("no samples arrive".into()));
                        }
                        // The last frames were lost.
                        Phase::Disarmed if info.samples - start >= total => {
                            self.gap(&mut taken, total as u32, None);
                            return Ok(End::Played);
                        }
                        phase if word(phase) == "link" => {
                            return Ok(End::Broken(
                                "the board received no messages from its host".into(),
                            ));
                        }
                        phase => return Ok(End::Shut(phase)),
                    }
                }
            }
        }
    }

    fn take(&mut self, taken: &mut Taken, streamed: &Streamed) -> Result<(), LineError> {
        let first = streamed.samples.first().map_or(streamed.next, |(n, _)| *n);
        if first < taken.next {
            // These samples were received before, or belong to another turn.
            return Ok(());
        }
        self.gap(taken, first, Some(streamed.left_out));
        for (number, sample) in &streamed.samples {
            let at = *number as usize % taken.period.max(1);
            if at == 0 {
                taken.repeat.clear();
            }
            // Only a repeat that was received from its first sample is extended.
            if taken.repeat.len() == at {
                taken.repeat.push(*sample);
            }
            taken.next = number.wrapping_add(1);
            self.recording.samples += 1;
            if taken.repeat.len() == taken.period && self.recording.whole < self.repeats {
                (self.keep)(self.recording.whole, &taken.repeat).map_err(LineError::Keep)?;
                self.recording.whole += 1;
                taken.repeat.clear();
            }
        }
        if let Some((number, sample)) = streamed.samples.last() {
            let progress = Progress {
                whole: self.recording.whole,
                sample: *number % (taken.period.max(1) as u32),
                lost: self.recording.lost(),
                newest: *sample,
            };
            (self.watch)(&progress);
        }
        Ok(())
    }

    /// Records the samples missing before sample `first`.
    fn gap(&mut self, taken: &mut Taken, first: u32, left_out: Option<u32>) {
        if first > taken.next {
            let samples = first - taken.next;
            let left_out = left_out.map_or(0, |all| all.wrapping_sub(taken.left_out));
            self.recording.gaps.push(Gap {
                part: self.recording.parts.len() - 1,
                first: taken.next,
                samples,
                left_out: left_out.min(samples),
            });
            taken.next = first;
            // An incomplete repeat is not continued with samples of another.
            taken.repeat.clear();
        }
        taken.left_out = left_out.unwrap_or(taken.left_out);
    }

    /// Reconnects to the board after the link broke, or returns the reason for the failure.
    fn again(&self, connect: &mut Connect<'_>, host: &mut Host) -> Result<(), String> {
        let until = Instant::now() + GONE;
        loop {
            let gone = match host.hello() {
                Ok(info) => {
                    let who = |i: &Info| (i.version, i.period_us, i.model, i.rig);
                    if who(&info) != who(&self.recording.board) {
                        return Err(LineError::AnotherBoard.to_string());
                    }
                    return match info.phase {
                        Phase::Faulted(_) if word(info.phase) != "link" => {
                            Err(format!("the board closed the valve: {}", word(info.phase)))
                        }
                        _ => Ok(()),
                    };
                }
                Err(LineError::Gone(_)) => true,
                Err(LineError::Silent(_)) => false,
                Err(other) => return Err(other.to_string()),
            };
            if Instant::now() > until {
                return Err(format!(
                    "the board did not reconnect within {} s",
                    GONE.as_secs()
                ));
            }
            if gone {
                match connect() {
                    Ok(new) => *host = new,
                    Err(_) => std::thread::sleep(Duration::from_millis(500)),
                }
            }
        }
    }
}

/// The samples received in one turn.
struct Taken {
    /// Samples of a repeat.
    period: usize,
    /// Number of the next sample.
    next: u32,
    /// Samples left out by the board so far.
    left_out: u32,
    /// The present repeat, as far as it was received completely.
    repeat: Vec<Sample>,
}
