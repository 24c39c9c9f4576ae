//! Both directions of a line, as the program at one end sees them.

use super::split::{Piece, Splitter};
use crate::captured::Direction;

/// Splits what a program sends and receives. `T` is a time.
#[derive(Debug, Default)]
pub struct Duplex<T> {
    received: Splitter,
    sent: Splitter,
    /// When the last bytes came.
    time: T,
}

impl<T: Copy> Duplex<T> {
    /// Takes the next bytes. `said` gets the time, the direction and the bytes of each piece. The time of
    /// a received piece is that of its last bytes.
    pub fn take(
        &mut self,
        time: T,
        direction: Direction,
        bytes: &[u8],
        mut said: impl FnMut(T, Direction, &[u8], Piece<'_>),
    ) {
        match direction {
            Direction::Sent => {
                // The reply to the last request is over, or incomplete for good.
                self.end(&mut said);
                // A request is written at once.
                self.sent.push(bytes);
                self.sent.end(|bytes, piece| said(time, direction, bytes, piece));
            }
            Direction::Received => {
                self.time = time;
                self.received.push(bytes);
                self.received.pieces(|bytes, piece| said(time, direction, bytes, piece));
            }
        }
    }

    /// Nothing more comes.
    pub fn end(&mut self, mut said: impl FnMut(T, Direction, &[u8], Piece<'_>)) {
        let time = self.time;
        self.received.end(|bytes, piece| said(time, Direction::Received, bytes, piece));
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const REQUEST: [u8; 4] = [0x22, 1, 2, 0x25];
    const REPLY: [u8; 4] = [0xF0, 1, 6, 0xF7];

    fn split(seen: &[(Direction, &[u8])]) -> Vec<(usize, Direction, bool, usize)> {
        let (mut duplex, mut pieces) = (Duplex::default(), Vec::new());
        let mut said = |time, direction, bytes: &[u8], piece: Piece<'_>| {
            let is_frame = matches!(piece, Piece::Frame(_));
            pieces.push((time, direction, is_frame, bytes.len()));
        };
        for (time, (direction, bytes)) in seen.iter().enumerate() {
            duplex.take(time, *direction, bytes, &mut said);
        }
        duplex.end(&mut said);
        pieces
    }

    #[test]
    fn a_reply_in_parts_has_the_time_of_its_last_part() {
        use Direction::{Received, Sent};
        let seen = [(Sent, &REQUEST[..]), (Received, &REPLY[..2]), (Received, &REPLY[2..])];
        assert_eq!(split(&seen), [(0, Sent, true, 4), (2, Received, true, 4)]);
    }

    #[test]
    fn a_reply_without_its_end_comes_before_the_next_request() {
        use Direction::{Received, Sent};
        let seen = [(Received, &REPLY[..3]), (Sent, &REQUEST[..])];
        assert_eq!(split(&seen), [(0, Received, false, 3), (1, Sent, true, 4)]);
    }
}
