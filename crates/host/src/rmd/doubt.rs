//! Motors whose late replies may still come, however late.
//!
//! A reply carries a code and no number. When a motor or an adapter stands still for longer than the
//! guard time and then answers everything at once, an old reply would pass for a new one. So a motor
//! that let a request time out is asked nothing but a question until all that it owes has come, or
//! until it was heard and then silent for the guard time.

use motorlink_proto::rmd::{Counters, MotorId};
use motorlink_proto::time::{Duration, Instant};

/// What each motor owes.
pub(super) struct Doubts([Doubt; MotorId::COUNT]);

#[derive(Clone, Copy)]
struct Doubt {
    /// Replies that did not come in time; at its end it is not known how many.
    owed: u8,
    /// When the motor was last heard since.
    heard: Option<Instant>,
}

/// Whether a motor's next reply can be trusted.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Trust {
    /// Yes.
    Full,
    /// If nothing comes until then.
    From(Instant),
    /// When it has answered a question.
    None,
}

impl Doubts {
    pub(super) const NONE: Doubts = Doubts([Doubt { owed: 0, heard: None }; MotorId::COUNT]);

    /// A reply did not come in time.
    pub(super) fn timed_out(&mut self, id: MotorId) {
        let doubt = self.of(id);
        *doubt = Doubt { owed: doubt.owed.saturating_add(1), heard: None };
    }

    /// A reply came for an exchange that is open, or seemed to.
    pub(super) fn answered(&mut self, now: Instant, id: MotorId) {
        self.of(id).heard = Some(now);
    }

    /// A frame came that belongs to no open exchange.
    pub(super) fn came_late(&mut self, now: Instant, id: MotorId) {
        let doubt = self.of(id);
        doubt.heard = Some(now);
        if doubt.owed < u8::MAX {
            doubt.owed = doubt.owed.saturating_sub(1);
        }
    }

    /// Whether the next reply of a motor can be trusted; `guard` is the silence that shows it.
    pub(super) fn trust(&mut self, now: Instant, id: MotorId, guard: Duration) -> Trust {
        let doubt = self.of(id);
        let until = doubt.heard.map(|heard| heard + guard);
        match until {
            _ if doubt.owed == 0 => Trust::Full,
            None => Trust::None,
            Some(until) if now < until => Trust::From(until),
            Some(_) => {
                *doubt = Doubt { owed: 0, heard: None };
                Trust::Full
            }
        }
    }

    fn of(&mut self, id: MotorId) -> &mut Doubt {
        &mut self.0[usize::from(id.number()) - 1]
    }
}

/// Frames that belonged to no open exchange.
pub(super) fn strays(counters: &Counters) -> u64 {
    u64::from(counters.late) + u64::from(counters.unasked)
}

#[cfg(test)]
mod tests {
    use super::*;

    const GUARD: Duration = Duration(100);

    #[test]
    fn a_late_reply_ends_the_doubt_that_it_caused() {
        let (mut doubts, id) = (Doubts::NONE, MotorId::new(3).unwrap());
        assert_eq!(doubts.trust(Instant(0), id, GUARD), Trust::Full);
        doubts.timed_out(id);
        assert_eq!(doubts.trust(Instant(0), id, GUARD), Trust::None);
        doubts.came_late(Instant(10), id);
        assert_eq!(doubts.trust(Instant(10), id, GUARD), Trust::Full);
    }

    #[test]
    fn a_motor_that_owes_several_replies_has_to_be_silent() {
        let (mut doubts, id) = (Doubts::NONE, MotorId::new(32).unwrap());
        for _ in 0..400 {
            doubts.timed_out(id);
        }
        assert_eq!(doubts.trust(Instant(0), id, GUARD), Trust::None);
        doubts.answered(Instant(10), id);
        assert_eq!(doubts.trust(Instant(10), id, GUARD), Trust::From(Instant(110)));
        for _ in 0..300 {
            doubts.came_late(Instant(50), id);
        }
        assert_eq!(doubts.trust(Instant(149), id, GUARD), Trust::From(Instant(150)));
        assert_eq!(doubts.trust(Instant(150), id, GUARD), Trust::Full);
        assert_eq!(doubts.trust(Instant(151), id, GUARD), Trust::Full);
    }
}
