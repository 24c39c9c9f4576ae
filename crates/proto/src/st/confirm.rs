//! Confirmations: a question whose answer shows whether the last replies match their requests.
//!
//! A reply that comes twice, or late, shifts all later replies by one. A single exchange cannot
//! detect that. A question with an answer of another size does.

use super::master::{question_with_answer, size_behind};
use super::{Counters, MAX_PAYLOAD, Request};

/// The exchanges that a confirmation is about. The last one determines its question.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct LastExchange {
    /// Payload size of the acknowledge; `None` after a refusal or a failure.
    size: Option<u8>,
    /// How often the line had been lost at the first request that is not confirmed.
    losses: u32,
    /// Whether there is such a request.
    has_requests: bool,
    /// Alternates between questions.
    turn: bool,
}

impl LastExchange {
    /// Records the start of an exchange that is not the question of a confirmation.
    pub const fn requested(&mut self, seen: Counters) {
        if !self.has_requests {
            self.has_requests = true;
            self.losses = seen.losses;
        }
    }

    /// Records the end of an exchange: the payload size of the acknowledge, if there is one.
    pub const fn finished(&mut self, size: Option<usize>) {
        self.size = match size {
            Some(size) if size <= MAX_PAYLOAD => Some(size as u8),
            Some(_) => Some(MAX_PAYLOAD as u8),
            None => None,
        };
    }

    /// Makes the next confirmation one of later exchanges: a confirmation ended, or the caller knows
    /// that the line was lost, such as from a failed exchange.
    pub const fn restart(&mut self) {
        self.has_requests = false;
    }

    /// Starts a confirmation of the replies since the [`restart`](Self::restart).
    pub const fn confirm(&mut self) -> Confirmation {
        let LastExchange { losses, has_requests, .. } = *self;
        Confirmation { losses, has_requests, size: self.next(), is_repeated: false }
    }

    /// The answer size of the next question.
    const fn next(&mut self) -> u8 {
        self.turn = !self.turn;
        size_behind(self.size, self.turn)
    }
}

/// A confirmation. Perform [`request`](Self::request) for motor number 0. If the drive refuses it
/// and [`repeat`](Self::repeat) returns true, perform the new request. The replies are confirmed if
/// the drive acknowledged, [`accepts`](Self::accepts) the payload's size, and the line
/// [`is_the_same`](Self::is_the_same).
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Confirmation {
    losses: u32,
    has_requests: bool,
    /// Payload size of the answer.
    size: u8,
    is_repeated: bool,
}

impl Confirmation {
    /// The question.
    pub const fn request(&self) -> Request<'static> {
        question_with_answer(self.size)
    }

    /// Takes another question after a refusal, which may be the reply to the last request. Returns
    /// false, without another question, from the second refusal on.
    pub const fn repeat(&mut self, last: &mut LastExchange) -> bool {
        if self.is_repeated {
            return false;
        }
        self.is_repeated = true;
        self.size = last.next();
        true
    }

    /// Whether the answer to the question has a payload of this size.
    pub const fn accepts(&self, size: usize) -> bool {
        self.size as usize == size
    }

    /// Whether the line was not lost since the first request that is confirmed. If it was lost, its
    /// recovery says nothing about the replies before.
    pub const fn is_the_same(&self, seen: Counters) -> bool {
        !self.has_requests || self.losses == seen.losses
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::st::{Frame, MAX_FRAME};

    const SEEN: Counters = Counters { unasked_bytes: 0, identifications: 0, losses: 0 };

    #[test]
    fn a_question_has_an_answer_of_another_size_than_the_last_reply() {
        for size in [None, Some(0), Some(1), Some(2), Some(4), Some(8), Some(32)] {
            let mut last = LastExchange::default();
            last.finished(size);
            let mut sizes = [0; 2];
            for answer in &mut sizes {
                let confirmation = last.confirm();
                assert!(size.is_none_or(|size| !confirmation.accepts(size)), "{size:?}");
                *answer = confirmation.size;
                let mut frame = [0; MAX_FRAME];
                assert!(Frame::command(0, &confirmation.request(), &mut frame).is_some());
            }
            assert_ne!(sizes[0], sizes[1], "{size:?}");
        }
    }

    #[test]
    fn a_refused_question_is_replaced_once() {
        let mut last = LastExchange::default();
        let mut confirmation = last.confirm();
        let first = confirmation.size;
        assert!(confirmation.repeat(&mut last));
        assert_ne!(confirmation.size, first);
        assert!(!confirmation.repeat(&mut last));
    }

    #[test]
    fn a_line_that_was_lost_is_another_one() {
        let mut last = LastExchange::default();
        let lost = Counters { losses: 1, ..SEEN };
        last.requested(SEEN);
        let confirmation = last.confirm();
        assert!(confirmation.is_the_same(SEEN));
        assert!(!confirmation.is_the_same(lost));
        // Each request since the last confirmation counts, not only the last one.
        last.requested(SEEN);
        last.requested(lost);
        assert!(!last.confirm().is_the_same(lost));
        last.restart();
        last.requested(lost);
        assert!(last.confirm().is_the_same(lost));
        last.restart();
        assert!(last.confirm().is_the_same(SEEN), "nothing was requested");
    }
}
