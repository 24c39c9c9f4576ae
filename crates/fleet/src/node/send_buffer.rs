//! What the share has said to a session, until the program has it.

use std::collections::VecDeque;

use motorlink_telemetry::share::frame::{self, Frame};

/// While this much waits, the share is not read: its own queues drop samples then, and count them.
const FULL: usize = 1 << 20;
/// The most in one answer, unless one message is longer.
const ANSWER: usize = 1 << 18;

/// Messages of the share, numbered from 1 on.
#[derive(Debug, Default)]
pub struct SendBuffer {
    /// How many the program has.
    gone: u64,
    waiting: VecDeque<Vec<u8>>,
    bytes: usize,
}

impl SendBuffer {
    /// Whether more should be read from the share.
    pub fn has_room(&self) -> bool {
        self.bytes < FULL
    }

    /// Whether far too much waits: refusals of a program that asks and does not pull.
    pub fn is_over(&self) -> bool {
        self.bytes > 2 * FULL
    }

    /// A message of the share.
    pub fn push(&mut self, frame: &Frame) {
        let mut bytes = Vec::with_capacity(frame.payload.len() + 8);
        // No message of a share is too long.
        if frame::append(frame.kind, &frame.payload, &mut bytes).is_ok() {
            self.bytes += bytes.len();
            self.waiting.push_back(bytes);
        }
    }

    /// The program has all up to this one.
    pub fn acknowledged(&mut self, number: u64) {
        while self.gone < number {
            let Some(gone) = self.waiting.pop_front() else { return };
            self.bytes -= gone.len();
            self.gone += 1;
        }
    }

    /// Whether nothing waits.
    pub fn is_empty(&self) -> bool {
        self.waiting.is_empty()
    }

    /// The next messages: the number of the first one, how many there are, and their bytes. They wait until
    /// they are acknowledged.
    pub fn next(&self) -> (u64, u64, Vec<u8>) {
        let (mut count, mut bytes) = (0, Vec::new());
        for message in &self.waiting {
            if count > 0 && bytes.len() + message.len() > ANSWER {
                break;
            }
            bytes.extend(message);
            count += 1;
        }
        (self.gone + 1, count, bytes)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn text(size: usize) -> Frame {
        Frame::text(vec![b' '; size])
    }

    #[test]
    fn messages_wait_until_the_program_has_them() {
        let mut outbox = SendBuffer::default();
        for size in 1..=3 {
            outbox.push(&text(size));
        }
        let all = outbox.next();
        assert_eq!((all.0, all.1), (1, 3));
        assert_eq!(outbox.next(), all);
        outbox.acknowledged(2);
        let (first, count, bytes) = outbox.next();
        assert_eq!((first, count, bytes.len()), (3, 1, 8 + 3));
        // An old acknowledgement changes nothing, one from the future neither.
        outbox.acknowledged(1);
        outbox.acknowledged(u64::MAX);
        assert!(outbox.is_empty());
        outbox.push(&text(1));
        assert_eq!(outbox.next().0, 4);
    }

    #[test]
    fn an_answer_and_the_box_have_a_limit() {
        let mut outbox = SendBuffer::default();
        while outbox.has_room() {
            outbox.push(&text(100_000));
        }
        assert_eq!(outbox.waiting.len(), FULL.div_ceil(100_008));
        assert_eq!(outbox.next().1, 2);
        let mut long = SendBuffer::default();
        long.push(&text(ANSWER + 1));
        assert_eq!(long.next().1, 1);
    }
}
