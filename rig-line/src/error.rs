//! Errors between host and board, each with its remedy.

use std::path::PathBuf;

use recordings::DataError;
use recordings::output::OutputError;

/// Why a request to a board failed.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum LineError {
    /// The device cannot be opened.
    #[error(
        "{port} cannot be opened ({cause}); check that the board is connected and that you have permission to \
             use the port"
    )]
    Open {
        /// The device, or the program behind it.
        port: String,
        /// Message of the operating system.
        cause: std::io::Error,
    },
    /// Another program uses the device.
    #[error("{0} is in use by another program; a board accepts one host at a time")]
    InUse(String),
    /// The connection is lost.
    #[error("the connection to the board is lost ({0})")]
    Gone(String),
    /// The board does not answer.
    #[error("the board does not answer `{0}`; check its firmware (`cargo xtask firmware`)")]
    Silent(&'static str),
    /// Host and board use different protocol versions.
    #[error(
        "the board uses version {board} of the protocol and this program version {host}; rebuild the firmware \
         with `cargo xtask firmware`"
    )]
    Version {
        /// Version of the board.
        board: u8,
        /// Version of this program.
        host: u8,
    },
    /// The board reports invalid constants.
    #[error(
        "the board reports {0}, which is impossible; rebuild the firmware with `cargo xtask firmware`"
    )]
    Constants(String),
    /// After a broken link a different board answers.
    #[error(
        "after the connection was lost, a board with other firmware or constants answered; the repeats that were \
            complete before are kept"
    )]
    AnotherBoard,
    /// No complete repeat was recorded.
    #[error("nothing was recorded: {0}")]
    Nothing(String),
    /// The recording cannot be stored.
    #[error("the recording cannot be written ({0}); check the space on the disk")]
    Keep(std::io::Error),
    /// The board refuses a request.
    #[error("the board refuses to {asked}: {reason}")]
    Refused {
        /// The request.
        asked: &'static str,
        /// The reason with its remedy.
        reason: String,
    },
    /// The command cannot be played on this board.
    #[error("{command}: {reason}")]
    Command {
        /// The command.
        command: String,
        /// The problem with its remedy.
        reason: String,
    },
    /// A time that exceeds the memory limit.
    #[error("the longest {what} at this board's period is {longest_s:.0} s; choose a shorter one")]
    TooLong {
        /// The quantity that is too long.
        what: &'static str,
        /// The limit, s.
        longest_s: f64,
    },
    /// The rig does not meet the requirements of a calibration.
    #[error("the rig cannot be calibrated: {0}")]
    Calibration(String),
    /// A problem in a rig file.
    #[error("{file}: {reason}")]
    RigFile {
        /// The file.
        file: PathBuf,
        /// The key and the problem with its remedy.
        reason: String,
    },
    /// A problem in the command file.
    #[error(transparent)]
    Data(#[from] DataError),
    /// A file cannot be written.
    #[error(transparent)]
    Output(#[from] OutputError),
}
