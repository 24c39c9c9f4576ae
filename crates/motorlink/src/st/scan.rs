//! The search for the baud rate of a drive.

use std::fmt;
use std::time::Duration;

use motorlink_link::port::{PortError, PortName};
use motorlink_proto::st::{ErrorCode, Failure, Profile, Recovery};

use super::{BoardInfo, Client, Error, Options};

/// The rates that drives are built with, the most frequent first.
pub const BAUD_RATES: [u32; 9] =
    [115_200, 1_843_200, 921_600, 460_800, 230_400, 57_600, 38_400, 19_200, 9_600];

/// How long a drive has to answer a question of a scan, unless the user says otherwise.
pub const SCAN_TIMEOUT: Duration = Duration::from_millis(200);

/// What answered at a rate.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum ScanResult {
    /// A drive that speaks the protocol.
    Drive(BoardInfo),
    /// A drive that speaks the protocol and refuses GET_BOARD_INFO.
    Refuses(ErrorCode),
    /// Bytes that are no reply: something speaks, at another rate or another protocol.
    Garbage,
    /// An echo of the question.
    Echo,
    /// Nothing.
    Silence,
}

impl fmt::Display for ScanResult {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            ScanResult::Drive(info) => {
                let [major, minor, patch] = info.version;
                write!(f, "{} {major}.{minor}.{patch}", info.name)
            }
            ScanResult::Refuses(code) => write!(f, "a drive that answers {code}"),
            ScanResult::Garbage => f.write_str("bytes that are no reply: is it another rate?"),
            ScanResult::Echo => f.write_str("each sent byte is received again"),
            ScanResult::Silence => f.write_str("silence"),
        }
    }
}

/// Opens a port, asks for the board information twice, and waits `patience` for each answer.
/// [`PortName::at_baud`] gives the port at each of [`BAUD_RATES`].
///
/// # Errors
/// What keeps the port from being opened.
pub fn scan(port: &PortName, patience: Duration) -> Result<ScanResult, Error> {
    let options = Options { timeout: patience, recovery: Recovery::Pad, ..Options::default() };
    let open = |profile| Client::open(port, Options { profile, ..options });
    // The board information is the same in each profile.
    let is_open = |opened: &Result<_, Error>| {
        !matches!(opened, Err(Error::Port(PortError::HeldInProfile { .. })))
    };
    let opened = Profile::ALL.into_iter().map(open).find(is_open);
    let client = match opened.unwrap_or_else(|| open(Profile::Spec)) {
        Ok(client) => client,
        Err(error @ Error::Port(_)) => return Err(error),
        Err(_) => return Ok(ScanResult::Silence),
    };
    // A drive that waits for the rest of a cut-off frame answers the second question.
    let mut heard = ScanResult::Silence;
    for _ in 0..2 {
        match client.board_info() {
            Ok(info) => return Ok(ScanResult::Drive(info)),
            Err(Error::Refused { code, .. }) => return Ok(ScanResult::Refuses(code)),
            Err(error @ Error::Port(_)) => return Err(error),
            Err(Error::Failed { failure: Failure::Timeout | Failure::Lost, .. }) => {}
            Err(Error::Failed { failure: Failure::Echo, .. }) => heard = ScanResult::Echo,
            Err(Error::Failed { failure: Failure::NotUnderstood(code), .. }) => {
                heard = ScanResult::Refuses(code);
            }
            Err(_) => heard = ScanResult::Garbage,
        }
    }
    Ok(heard)
}
