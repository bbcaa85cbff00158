//! Ctrl-C: the first press requests the best result so far from a command, the second press ends
//! the command.

use std::sync::Once;
use std::sync::atomic::{AtomicBool, Ordering};

static ASKED: AtomicBool = AtomicBool::new(false);
static WATCHING: Once = Once::new();

/// Whether the user has pressed Ctrl-C; the handler is installed by the first call.
pub(crate) fn watch() -> &'static AtomicBool {
    WATCHING.call_once(|| {
        // Without a handler Ctrl-C ends the program, which is acceptable.
        let _ = ctrlc::set_handler(|| {
            if ASKED.swap(true, Ordering::Relaxed) {
                std::process::exit(130);
            }
        });
    });
    &ASKED
}
