//! Whether a motor's next reply can be trusted.
//!
//! A reply carries a code and no sequence number. If a motor or an adapter stalls and then sends
//! all replies at once, an old reply looks like a new one. So a motor with a pending late reply is
//! left alone for the quarantine time. After that it is asked only for its status, until one of
//! these is true:
//!
//! * the only pending reply was received;
//! * the motor answered and was then silent for the quarantine time.
//!
//! A motor without any exchange so far may have pending replies to a former host. It has to answer
//! two questions, and then be silent for the quarantine time.

use super::command::{Code, Command, ReadMotionStatus, ReadStatus};
use crate::time::{Instant, Micros};

/// Which late replies a motor may still send.
#[derive(Debug, Clone, Copy)]
pub(super) struct ReplyTrust {
    pending: Pending,
    /// Whether replies to Off and to Stop are pending.
    off: bool,
    stop: bool,
    /// The end of the quarantine time after the last missing reply. For [`Pending::Unknown`] also
    /// the end of the wait for silence after an Off or a Stop.
    until: Instant,
    /// When the motor last sent a frame since then.
    heard: Option<Instant>,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Pending {
    Nothing,
    /// One reply with this code.
    One(u8),
    /// Replies with this code.
    Several(u8),
    /// Replies with different codes.
    Mixed,
    /// Replies to any request of a former host.
    Unknown,
}

/// What may be sent to a motor.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Admitted {
    Request,
    Question,
    /// The request and then the question: the reply to the request may belong to an older request.
    Both,
}

impl ReplyTrust {
    pub(super) const NONE: ReplyTrust = ReplyTrust {
        pending: Pending::Nothing,
        off: false,
        stop: false,
        until: Instant(0),
        heard: None,
    };
    pub(super) const UNKNOWN: ReplyTrust =
        ReplyTrust { pending: Pending::Unknown, ..ReplyTrust::NONE };

    pub(super) const fn is_none(&self) -> bool {
        matches!(self.pending, Pending::Nothing)
    }

    /// Whether replies to a former host may be pending.
    pub(super) const fn is_unknown(&self) -> bool {
        matches!(self.pending, Pending::Unknown)
    }

    /// Records that the reply to a request with this code did not come in time.
    pub(super) fn missed(&mut self, now: Instant, quarantine: Micros, code: u8) {
        self.pending = match self.pending {
            Pending::Nothing => Pending::One(code),
            Pending::One(pending) | Pending::Several(pending) if pending == code => {
                Pending::Several(code)
            }
            Pending::Unknown => Pending::Unknown,
            _ => Pending::Mixed,
        };
        match Code::from(code) {
            Code::Off => self.off = true,
            Code::Stop => self.stop = true,
            _ => {}
        }
        self.until = self.until.max(now + quarantine);
        self.heard = None;
    }

    /// Moves the moments of this motor to a clock that was set back to `now`.
    pub(super) fn begin_anew(&mut self, now: Instant, quarantine: Micros) {
        self.until = self.until.min(now + quarantine);
        self.heard = self.heard.map(|heard| heard.min(now));
    }

    /// Records the reply to an open exchange.
    pub(super) fn answered(&mut self, now: Instant) {
        self.heard = Some(now);
    }

    /// Takes a reply with this code for which no exchange is open. Returns whether it was pending.
    pub(super) fn late_reply(&mut self, now: Instant, code: u8) -> bool {
        match self.pending {
            Pending::One(pending) if answers(pending, code) => *self = ReplyTrust::NONE,
            Pending::Several(pending) if answers(pending, code) => self.heard = Some(now),
            Pending::Mixed => self.heard = Some(now),
            // Before the first answer of the motor, this may be another host's frame.
            Pending::Unknown if self.heard.is_some() => self.heard = Some(now),
            _ => return false,
        }
        true
    }

    /// What may be sent for a request with this code. An error is the time of the next attempt.
    pub(super) fn admit(
        &mut self,
        now: Instant,
        quarantine: Micros,
        code: u8,
    ) -> Result<Admitted, Instant> {
        if self.pending == Pending::Nothing {
            return Ok(Admitted::Request);
        }
        let silent = self.heard.map(|heard| heard + quarantine);
        if silent.is_some_and(|silent| now >= silent) {
            *self = ReplyTrust::NONE;
            return Ok(Admitted::Request);
        }
        let own = match Code::from(code) {
            code if code.motion().stops() && self.is_unknown() => {
                let sent = if code == Code::Off { &mut self.off } else { &mut self.stop };
                let again = core::mem::replace(sent, true);
                return match silent {
                    // Repeated Offs and Stops would keep the motor from being silent.
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

/// Whether a reply with the code `reply` answers a request with the code `request`.
pub(super) fn answers(request: u8, reply: u8) -> bool {
    Code::from(request).is_answered_by(Code::from(reply))
}

/// A status question whose reply has another code than the reply to `request`.
pub fn question_behind(request: u8) -> [u8; 8] {
    match answers(request, Code::ReadStatus.into()) {
        true => ReadMotionStatus.encode(),
        false => ReadStatus.encode(),
    }
}
