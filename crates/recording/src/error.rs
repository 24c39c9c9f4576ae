//! Why a recording ends early or does not begin.

use std::io;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use motorlink_telemetry::event::CommandError;
use motorlink_telemetry::line::LineError;
use motorlink_telemetry::runner::Ended;
use motorlink_telemetry::share::message::Protocol;
use motorlink_telemetry::signal::UnknownSignal;

/// The number of "file exists" on all systems.
const EEXIST: i32 = 17;

/// Why nothing is recorded.
#[derive(Debug, thiserror::Error)]
pub enum RecordError {
    /// No port was given.
    #[error("no port to record was given")]
    NoPort,
    /// The file.
    #[error(transparent)]
    File(#[from] WriteError),
    /// A port.
    #[error(transparent)]
    Line(#[from] LineError),
    /// The start was ended before the recording began.
    #[error("the recording was ended before it began")]
    Aborted,
    /// A port without a motor that answers.
    #[error("no motor answers at {port}: {}", without_port(why, port))]
    NoMotor {
        /// The port.
        port: String,
        /// What its drives speak.
        protocol: Protocol,
        /// The last error.
        why: Box<CommandError>,
    },
    /// Motors are named, and no port has such motors.
    #[error("{}", no_line(*.protocol))]
    NoLine {
        /// What the motors speak.
        protocol: Protocol,
    },
    /// A share that cannot be followed.
    #[error("`{port}`: {why}")]
    Share {
        /// The port.
        port: String,
        /// What is wrong.
        why: String,
    },
    /// No motor has a signal.
    #[error(transparent)]
    Signal(#[from] UnknownSignal),
    /// An engine has ended.
    #[error(transparent)]
    Ended(#[from] Ended),
    /// The system gives no thread.
    #[error("cannot start a thread: {0}")]
    Thread(io::Error),
}

fn no_line(protocol: Protocol) -> &'static str {
    match protocol {
        Protocol::St => "numbers of motors are for ST drives, and no port is a serial line",
        Protocol::Rmd => "IDs are for RMD motors, and no port is a CAN bus",
    }
}

/// The error without the port, if it begins with it.
fn without_port(why: &CommandError, port: &str) -> String {
    let text = why.to_string();
    let rest = text.strip_prefix(port).and_then(|rest| rest.strip_prefix(": "));
    rest.map(str::to_owned).unwrap_or(text)
}

/// A file of a recording cannot be written.
#[derive(Debug, Clone, thiserror::Error)]
pub enum WriteError {
    /// It is not overwritten unasked.
    #[error("{} exists already", .path.display())]
    Exists {
        /// The file.
        path: PathBuf,
    },
    /// It cannot be made.
    #[error("cannot write {}: {error}", .path.display())]
    Create {
        /// The file.
        path: PathBuf,
        /// What the system says.
        error: Arc<io::Error>,
    },
    /// It cannot be written any more.
    #[error(
        "cannot write {} any more: {why}; it has {messages} messages, {bytes} bytes, and stays readable",
        .path.display()
    )]
    Write {
        /// The file.
        path: PathBuf,
        /// What the system says.
        why: String,
        /// The number of the system's error.
        code: Option<i32>,
        /// Messages that the file has.
        messages: u64,
        /// Bytes that the file has.
        bytes: u64,
    },
    /// Another program wrote or shortened it.
    #[error(
        "{} was changed by another program after {bytes} bytes: messages are lost",
        .path.display()
    )]
    Changed {
        /// The file.
        path: PathBuf,
        /// Bytes that it had.
        bytes: u64,
    },
    /// Somebody removed it.
    #[error("{} was removed while it was written: {bytes} bytes are lost", .path.display())]
    Removed {
        /// The file.
        path: PathBuf,
        /// Bytes that it had.
        bytes: u64,
    },
}

impl WriteError {
    /// The file.
    pub fn path(&self) -> &Path {
        let (WriteError::Exists { path }
        | WriteError::Create { path, .. }
        | WriteError::Write { path, .. }
        | WriteError::Changed { path, .. }
        | WriteError::Removed { path, .. }) = self;
        path
    }

    /// The number of the system's error, if it gave one.
    pub fn code(&self) -> Option<i32> {
        match self {
            WriteError::Exists { .. } => Some(EEXIST),
            WriteError::Create { error, .. } => error.raw_os_error(),
            WriteError::Write { code, .. } => *code,
            WriteError::Changed { .. } | WriteError::Removed { .. } => None,
        }
    }

    pub(crate) fn create(path: &Path, error: io::Error) -> Self {
        WriteError::Create { path: path.to_owned(), error: error.into() }
    }
}
