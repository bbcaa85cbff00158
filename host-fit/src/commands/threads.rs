//! Checks whether the machine provides threads, before libraries are used that abort without them.

use std::sync::OnceLock;
use std::sync::mpsc::channel;
use std::thread::{self, Builder};

static GIVEN: OnceLock<bool> = OnceLock::new();

/// Whether as many threads as processors, plus a few for the serial line and the page, can be created.
pub(crate) fn are_given() -> bool {
    *GIVEN.get_or_init(|| {
        const BESIDE: usize = 4;
        let wanted = thread::available_parallelism().map_or(1, usize::from) + BESIDE;
        let mut held = Vec::with_capacity(wanted);
        let all = (0..wanted).all(|_| {
            let (end, waits) = channel::<()>();
            match Builder::new().spawn(move || waits.recv()) {
                Ok(thread) => {
                    held.push((end, thread));
                    true
                }
                Err(_) => false,
            }
        });
        for (end, thread) in held {
            drop(end);
            let _ = thread.join();
        }
        all
    })
}

/// Runs everything on the calling thread if there are no others; the results are the same.
pub(crate) fn or_one() {
    if !are_given() {
        let one = rayon::ThreadPoolBuilder::new().num_threads(1);
        // This fails only if a thread pool exists already, and this is the first one.
        let _ = one.use_current_thread().build_global();
    }
}

/// Rejects commands that need threads.
///
/// # Errors
/// The remedy.
pub(crate) fn needed(what: &str) -> anyhow::Result<()> {
    match are_given() {
        true => Ok(()),
        false => anyhow::bail!(
            "{what} needs threads, but the system provides none; raise the limit of processes (`ulimit -u`) or \
                 end other programs"
        ),
    }
}
