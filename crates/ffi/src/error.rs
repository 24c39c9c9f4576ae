//! The errors of calls and of exchanges.

use core::ffi::{CStr, c_char};

/// The result of a call, or of an exchange. 0 is success.
#[repr(i32)]
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum motorlink_error {
    /// Done.
    Ok = 0,

    /// A required pointer is NULL.
    NullPointer = 1,
    /// A pointer is not aligned for its type.
    Misaligned = 2,
    /// The storage is smaller than this library needs: header and library are of different versions.
    StorageTooSmall = 3,
    /// The storage was never initialised, or was overwritten.
    Uninitialised = 4,
    /// The storage belongs to an object of another kind.
    WrongKind = 5,
    /// A call for this object is under way: this one comes from one of its callbacks, from an
    /// interrupt or from another thread.
    InUse = 6,
    /// A number is outside of its range.
    BadArgument = 7,
    /// The payload does not fit a frame.
    TooLong = 8,
    /// An exchange is under way, with the drive (ST) or this motor (RMD).
    Busy = 9,

    /// The drive refused; `error_code` tells why (ST).
    Refused = 20,
    /// No reply in time. It is not known whether the drive executed the request.
    Timeout = 21,
    /// A reply began and stopped (ST).
    Incomplete = 22,
    /// A received byte does not begin a reply (ST).
    NotAReply = 23,
    /// A reply is damaged (ST).
    Damaged = 24,
    /// The drive did not understand what it received; `error_code` tells why (ST).
    NotUnderstood = 25,
    /// Two different replies arrived at once (ST).
    Ambiguous = 26,
    /// The line was out of sync before, and the drive does not answer a test question. The request was
    /// not sent (ST).
    Lost = 27,
    /// The line was out of sync before, and bytes keep arriving. Nothing was sent (ST).
    Noise = 28,
    /// The drive acknowledged, but the reply does not contain a value of the register (ST).
    WrongReply = 29,
    /// The value of a register is possible in the other profile only: the profile may be wrong (ST).
    Implausible = 30,
    /// A late reply of this motor may still come: the last request had no reply, or this is the first
    /// request to the motor. Only a read was sent, unless the request was Off or Stop. Ask again (RMD).
    Quarantined = 40,
    /// A limit that the caller set, or the document's range, is exceeded; nothing was sent.
    Limit = 41,
    /// The reply is of another protocol: RMD V3 or V4, or LK-Tech V2.36 (RMD).
    Foreign = 42,
    /// The reply should repeat the request and differs from it. It is not known what the motor did
    /// (RMD).
    Altered = 43,
    /// The frame that was sent was received: an adapter or the wiring echoes, or another host sends the
    /// same. Only a read was sent to a drive (ST). It is not known what the motor did (RMD).
    Echo = 44,
    /// Replies since the last confirmation may belong to other requests: a reply came twice or late, or
    /// the confirmation failed.
    Unconfirmed = 45,
}

/// Success, the same as MOTORLINK_ERROR_OK.
pub const MOTORLINK_OK: i32 = 0;

impl motorlink_error {
    /// For `?`.
    pub(crate) fn check(self) -> Result<(), Self> {
        if self == Self::Ok { Ok(()) } else { Err(self) }
    }

    const fn text(self) -> &'static CStr {
        match self {
            Self::Ok => c"done",
            Self::NullPointer => c"a pointer that is needed is NULL",
            Self::Misaligned => c"a pointer is not aligned as its type demands",
            Self::StorageTooSmall => c"the storage is smaller than this library needs",
            Self::Uninitialised => c"the storage was never initialised",
            Self::WrongKind => c"the storage belongs to an object of another kind",
            Self::InUse => c"a call for this object is under way",
            Self::BadArgument => c"a number is outside of its range",
            Self::TooLong => c"the payload does not fit a frame",
            Self::Busy => c"an exchange is under way",
            Self::Refused => c"the drive refused",
            Self::Timeout => c"no reply in time",
            Self::Incomplete => c"the reply stopped in the middle",
            Self::NotAReply => c"a byte came that begins no reply",
            Self::Damaged => c"the reply is damaged",
            Self::NotUnderstood => c"the drive did not understand what it received",
            Self::Ambiguous => c"two replies that differ came at once",
            Self::Lost => c"the line is lost and the drive does not answer",
            Self::Noise => c"the line does not fall silent",
            Self::WrongReply => c"the reply has no value of a register",
            Self::Implausible => c"the value is possible in the other profile only",
            Self::Quarantined => c"a late reply of the motor may still come: ask again after motorlink_rmd_host_retry",
            Self::Limit => c"beyond a limit",
            Self::Foreign => c"the motor answers in another protocol",
            Self::Altered => c"the reply does not repeat the request",
            Self::Echo => c"what was sent came back",
            Self::Unconfirmed => c"the last replies may belong to other requests",
        }
    }

    const ALL: [Self; 27] = [
        Self::Ok,
        Self::NullPointer,
        Self::Misaligned,
        Self::StorageTooSmall,
        Self::Uninitialised,
        Self::WrongKind,
        Self::InUse,
        Self::BadArgument,
        Self::TooLong,
        Self::Busy,
        Self::Refused,
        Self::Timeout,
        Self::Incomplete,
        Self::NotAReply,
        Self::Damaged,
        Self::NotUnderstood,
        Self::Ambiguous,
        Self::Lost,
        Self::Noise,
        Self::WrongReply,
        Self::Implausible,
        Self::Quarantined,
        Self::Limit,
        Self::Foreign,
        Self::Altered,
        Self::Echo,
        Self::Unconfirmed,
    ];
}

/// A sentence for an error, in English, without a full stop. Never NULL, for any number. The text is
/// constant. A program that does not call this function does not contain the texts.
#[unsafe(no_mangle)]
pub extern "C" fn motorlink_error_text(error: i32) -> *const c_char {
    let known = motorlink_error::ALL.iter().find(|known| **known as i32 == error);
    known.map_or(c"an unknown error", |known| known.text()).as_ptr()
}

/// A function's body with `?`, as the error that C gets.
pub(crate) fn answer(body: impl FnOnce() -> Result<(), motorlink_error>) -> motorlink_error {
    match body() {
        Ok(()) => motorlink_error::Ok,
        Err(error) => error,
    }
}
