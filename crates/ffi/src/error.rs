//! The one list of errors: of calls, and of exchanges.

use core::ffi::{CStr, c_char};

/// What became of a call, or of an exchange. 0 is success.
#[repr(i32)]
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum motorlink_error {
    /// Done.
    Ok = 0,

    /// A pointer that is needed is NULL.
    NullPointer = 1,
    /// A pointer is not aligned as its type demands.
    Misaligned = 2,
    /// The storage is smaller than this library needs: it was declared with another header.
    StorageTooSmall = 3,
    /// The storage was never initialised, or something wrote over it.
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
    /// No reply in time. It is not known whether the drive did what was asked.
    Timeout = 21,
    /// A reply began and stopped (ST).
    Incomplete = 22,
    /// A byte came that begins no reply (ST).
    NotAReply = 23,
    /// A reply is damaged (ST).
    Damaged = 24,
    /// The drive did not understand what it received; `error_code` tells why (ST).
    NotUnderstood = 25,
    /// Two replies that differ came at once (ST).
    Ambiguous = 26,
    /// The line was lost before, and the drive does not answer a question; nothing else was sent (ST).
    Lost = 27,
    /// The line is not in step and does not fall silent; nothing was sent (ST).
    Noise = 28,
    /// The drive acknowledged, with something that is no value of a register (ST).
    WrongReply = 29,
    /// The motor did not answer before, or was not asked before, and cannot be trusted yet. Nothing
    /// but a question was sent, unless it was an Off or a Stop. Ask again (RMD).
    Quarantined = 40,
    /// A limit that the caller set, or the document's range, is exceeded; nothing was sent.
    Limit = 41,
    /// No reply of this protocol, but one of RMD V3 or V4, or LK-Tech V2.36 (RMD).
    Foreign = 42,
    /// The reply has another content than the request that it has to repeat. It is not known what the
    /// motor did (RMD).
    Altered = 43,
    /// What was sent came back: an adapter or the wiring echoes, or another host asks the same. Only a
    /// question was sent to a drive (ST); what the motor did is not known (RMD).
    Echo = 44,
}

/// Success, as all functions give it.
pub const MOTORLINK_OK: i32 = 0;

impl motorlink_error {
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
            Self::Quarantined => c"the motor cannot be trusted yet: ask again",
            Self::Limit => c"beyond a limit",
            Self::Foreign => c"the motor answers in another protocol",
            Self::Altered => c"the reply does not repeat the request",
            Self::Echo => c"what was sent came back",
        }
    }

    const ALL: [Self; 25] = [
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
        Self::Quarantined,
        Self::Limit,
        Self::Foreign,
        Self::Altered,
        Self::Echo,
    ];
}

/// The error in words, in English, without a full stop. Never NULL; any number is taken. The text
/// is constant. A program that does not call this does not carry the texts.
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
