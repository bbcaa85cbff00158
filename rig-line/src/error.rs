//! What can go wrong between host and board, each with what to do.

use std::path::PathBuf;

use recordings::DataError;
use recordings::output::OutputError;

/// Why a board does not do what it was asked.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum LineError {
    /// The device cannot be opened.
    #[error(
        "{port} cannot be opened ({cause}); is the board plugged in, and may you use the port?"
    )]
    Open {
        /// The device, or the program that stands for it.
        port: String,
        /// What the operating system said.
        cause: std::io::Error,
    },
    /// Another program has the device.
    #[error("{0} is in use by another program; a board listens to one host at a time")]
    InUse(String),
    /// Nothing comes any more.
    #[error("the connection to the board is lost ({0})")]
    Gone(String),
    /// No answer.
    #[error(
        "the board does not answer `{0}`; is the right firmware on it? (`cargo xtask firmware`)"
    )]
    Silent(&'static str),
    /// Host and board speak different versions.
    #[error(
        "the board speaks version {board} of the protocol and this program version {host}; build the firmware anew with \
         `cargo xtask firmware`"
    )]
    Version {
        /// The board's.
        board: u8,
        /// This program's.
        host: u8,
    },
    /// The board's constants are none.
    #[error(
        "the board reports {0}, which is impossible; build the firmware anew with `cargo xtask firmware`"
    )]
    Constants(String),
    /// After a broken link somebody else answers.
    #[error(
        "after the link was broken a board with other firmware or constants answered; complete repeats until \
        then are kept"
    )]
    AnotherBoard,
    /// Nothing of a recording came whole.
    #[error("nothing was recorded: {0}")]
    Nothing(String),
    /// What was recorded cannot be kept.
    #[error("the recording cannot be written ({0}); has the disk space?")]
    Keep(std::io::Error),
    /// The board refuses.
    #[error("the board refuses to {asked}: {reason}")]
    Refused {
        /// What it was asked for.
        asked: &'static str,
        /// Why, with what to do.
        reason: String,
    },
    /// The command is no command for this board.
    #[error("{command}: {reason}")]
    Command {
        /// The command.
        command: String,
        /// What is wrong with it, and what to do.
        reason: String,
    },
    /// A time of more samples than memory is allowed for.
    #[error("the longest {what} at this board's period is {longest_s:.0} s; ask for less")]
    TooLong {
        /// What is too long.
        what: &'static str,
        /// The longest, s.
        longest_s: f64,
    },
    /// The rig is not as a calibration needs it.
    #[error("the rig cannot be calibrated: {0}")]
    Calibration(String),
    /// A rig file is wrong.
    #[error("{file}: {reason}")]
    RigFile {
        /// The file.
        file: PathBuf,
        /// The key, what is wrong with it, and what to do.
        reason: String,
    },
    /// The command's file is wrong.
    #[error(transparent)]
    Data(#[from] DataError),
    /// A file cannot be written.
    #[error(transparent)]
    Output(#[from] OutputError),
}
