//! Whether a motor's next reply can be trusted.
//!
//! A reply carries a code and no number. When a motor or an adapter stands still and then answers
//! everything at once, an old reply would pass for a new one. So a motor that owes a reply is left
//! alone for the quarantine time and then asked for its status, and for nothing else, until the only
//! reply that it owed came, or until it was heard and then silent for the quarantine time. A motor
//! that was not asked before may owe a former host anything: it has to answer two questions first, and
//! then to be silent.

use super::command::Code;
use crate::time::{Instant, Micros};

/// What may still come from a motor.
#[derive(Debug, Clone, Copy)]
pub(super) struct Doubt {
    owed: Owed,
    /// Whether replies to Off and to Stop are among it.
    off: bool,
    stop: bool,
    /// The quarantine time after the last reply that did not come. For [`Owed::Unknown`] also the end of the
    /// wait for silence behind an Off or a Stop.
    until: Instant,
    /// When the motor was last heard since then.
    heard: Option<Instant>,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Owed {
    Nothing,
    /// A reply with this code.
    One(u8),
    /// Replies with this code.
    Several(u8),
    /// Replies with different codes.
    Mixed,
    /// Whatever a former host asked for.
    Unknown,
}

/// What may be sent to a motor.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Admitted {
    Request,
    Question,
    /// The request, and behind it the question: the reply to the request may be an older one's.
    Both,
}

impl Doubt {
    pub(super) const NONE: Doubt =
        Doubt { owed: Owed::Nothing, off: false, stop: false, until: Instant(0), heard: None };
    pub(super) const UNKNOWN: Doubt = Doubt { owed: Owed::Unknown, ..Doubt::NONE };

    pub(super) const fn is_none(&self) -> bool {
        matches!(self.owed, Owed::Nothing)
    }

    /// Whether the motor may owe a former host anything.
    pub(super) const fn is_unknown(&self) -> bool {
        matches!(self.owed, Owed::Unknown)
    }

    /// The reply to a request with this code did not come in time.
    pub(super) fn owes(&mut self, now: Instant, quarantine: Micros, code: u8) {
        self.owed = match self.owed {
            Owed::Nothing => Owed::One(code),
            Owed::One(owed) | Owed::Several(owed) if owed == code => Owed::Several(code),
            Owed::Unknown => Owed::Unknown,
            _ => Owed::Mixed,
        };
        match Code::from(code) {
            Code::Off => self.off = true,
            Code::Stop => self.stop = true,
            _ => {}
        }
        self.until = self.until.max(now + quarantine);
        self.heard = None;
    }

    /// The reply to an open exchange came.
    pub(super) fn answered(&mut self, now: Instant) {
        self.heard = Some(now);
    }

    /// A reply with this code came to no open exchange. Whether it is one that was owed.
    pub(super) fn came(&mut self, now: Instant, code: u8) -> bool {
        match self.owed {
            Owed::One(owed) if answers(owed, code) => *self = Doubt::NONE,
            Owed::Several(owed) if answers(owed, code) => self.heard = Some(now),
            Owed::Mixed => self.heard = Some(now),
            // Before the motor was asked this may be another host's frame.
            Owed::Unknown if self.heard.is_some() => self.heard = Some(now),
            _ => return false,
        }
        true
    }

    /// What may be sent when a request with this code is made; or when to ask again.
    pub(super) fn admit(
        &mut self,
        now: Instant,
        quarantine: Micros,
        code: u8,
    ) -> Result<Admitted, Instant> {
        if self.owed == Owed::Nothing {
            return Ok(Admitted::Request);
        }
        let silent = self.heard.map(|heard| heard + quarantine);
        if silent.is_some_and(|silent| now >= silent) {
            *self = Doubt::NONE;
            return Ok(Admitted::Request);
        }
        let own = match Code::from(code) {
            code if code.ends_motion() && self.is_unknown() => {
                let sent = if code == Code::Off { &mut self.off } else { &mut self.stop };
                let again = core::mem::replace(sent, true);
                return match silent {
                    // Sent again and again it would never let the motor fall silent.
                    Some(silent) if again && now < self.until => Err(silent.min(self.until)),
                    _ => {
                        self.until = now + quarantine + quarantine;
                        Ok(Admitted::Both)
                    }
                };
            }
            Code::Off => self.off,
            Code::Stop => self.stop,
            _ => {
                return match silent.unwrap_or(self.until) {
                    until if now < until => Err(until),
                    _ => Ok(Admitted::Question),
                };
            }
        };
        if own && now < self.until { Err(self.until) } else { Ok(Admitted::Request) }
    }
}

/// Whether a reply with the code `came` answers a request with the code `asked`.
pub(super) fn answers(asked: u8, came: u8) -> bool {
    let (asked, came) = (Code::from(asked), Code::from(came));
    asked == came || (asked == Code::ClearErrors && came == Code::ReadStatus)
}
