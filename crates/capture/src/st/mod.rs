//! The bytes of a line of ST's protocol in a capture: their frames, and what those mean.

mod duplex;
mod message;
mod split;
mod transcript;

use std::sync::Arc;

use motorlink_proto::st::Profile;

use crate::captured::{Captured, Direction, Wire};
pub use duplex::Duplex;
pub use message::{Answer, Message, Value};
pub use split::{Broken, Piece, Splitter};
pub use transcript::Transcript;

/// A pause after which a frame is not continued. Adapters deliver bytes up to 16 ms late.
const PAUSE_NS: i64 = 100_000_000;
/// Lines that are told apart. A damaged capture can have any number of names.
const MOST_LINES: usize = 64;

/// Decodes the bytes of a capture, which it must get in their order.
#[derive(Debug)]
pub struct Decoder {
    profile: Profile,
    lines: Vec<Line>,
}

/// A line, with both of its directions.
#[derive(Debug)]
struct Line {
    channel: Option<Arc<str>>,
    transcript: Transcript,
    /// Bytes that were sent, that were received, and whose direction the capture does not have.
    splitters: [Splitter; 3],
    last: [Option<Captured>; 3],
}

/// What a line said.
#[derive(Debug)]
pub enum Item<'a> {
    /// A frame and its meaning.
    Message(Message<'a>),
    /// Bytes that are no frame.
    Broken(Broken),
}

impl Decoder {
    /// A decoder at the begin of the capture of a drive of `profile`.
    pub fn new(profile: Profile) -> Self {
        Decoder { profile, lines: Vec::new() }
    }

    /// Decodes the line with this name as that of a drive of `profile`.
    #[must_use]
    pub fn with_line(mut self, channel: &Arc<str>, profile: Profile) -> Self {
        self.lines.push(Line::new(Some(Arc::clone(channel)), profile));
        self
    }

    /// Passes an entry. `said` gets the entry in which each item ends, its bytes, and the item.
    pub fn decode(&mut self, entry: &Captured, mut said: impl FnMut(&Captured, &[u8], Item<'_>)) {
        let bytes = match &entry.wire {
            Wire::Serial(bytes) => bytes,
            Wire::Damage(_) => {
                return self.lines.iter_mut().for_each(|line| line.transcript.lose());
            }
            // Of a bus that was captured at the same time.
            Wire::Can(_) | Wire::Fd(_) | Wire::Error { .. } => return,
        };
        let slot = match entry.direction {
            Some(Direction::Sent) => 0,
            Some(Direction::Received) => 1,
            None => 2,
        };
        let line = self.line(entry);
        let last = line.last[slot].as_ref();
        let pause = last.and_then(|last| entry.time?.since(last.time?));
        if pause.is_some_and(|ns| ns > PAUSE_NS) {
            line.end(slot, &mut said);
        }
        line.splitters[slot].push(bytes);
        line.last[slot] = Some(Captured { wire: Wire::Serial(Vec::new()), ..entry.clone() });
        line.pieces(slot, &mut said);
    }

    /// Ends the capture: frames that are not complete are broken.
    pub fn end(&mut self, mut said: impl FnMut(&Captured, &[u8], Item<'_>)) {
        for line in &mut self.lines {
            (0..line.splitters.len()).for_each(|slot| line.end(slot, &mut said));
        }
    }

    fn line(&mut self, entry: &Captured) -> &mut Line {
        let channel = &entry.channel;
        let known = self.lines.iter().position(|line| line.channel == *channel);
        let index = known.unwrap_or_else(|| {
            if self.lines.len() == MOST_LINES {
                self.lines.clear();
            }
            self.lines.push(Line::new(channel.clone(), self.profile));
            self.lines.len() - 1
        });
        &mut self.lines[index]
    }
}

impl Line {
    fn new(channel: Option<Arc<str>>, profile: Profile) -> Self {
        let transcript = Transcript::new(profile);
        Line { channel, transcript, splitters: Default::default(), last: Default::default() }
    }

    fn pieces(&mut self, slot: usize, said: &mut impl FnMut(&Captured, &[u8], Item<'_>)) {
        let Line { transcript, splitters, last, .. } = self;
        let Some(last) = &last[slot] else { return };
        splitters[slot].pieces(|bytes, piece| match piece {
            Piece::Frame(frame) => said(
                last,
                bytes,
                Item::Message(transcript.read((last.time, last.direction), None, &frame)),
            ),
            Piece::Broken(broken) => {
                transcript.lose();
                said(last, bytes, Item::Broken(broken));
            }
        });
    }

    fn end(&mut self, slot: usize, said: &mut impl FnMut(&Captured, &[u8], Item<'_>)) {
        let Line { transcript, splitters, last, .. } = self;
        let Some(last) = &last[slot] else { return };
        splitters[slot].end(|bytes, piece| match piece {
            Piece::Frame(frame) => said(
                last,
                bytes,
                Item::Message(transcript.read((last.time, last.direction), None, &frame)),
            ),
            Piece::Broken(broken) => {
                transcript.lose();
                said(last, bytes, Item::Broken(broken));
            }
        });
    }
}

#[cfg(test)]
mod tests {
    use motorlink_proto::can::CanFrame;

    use super::*;

    #[test]
    fn each_line_has_the_profile_of_its_drive() {
        let [spec, firmware]: [Arc<str>; 2] = ["st0".into(), "st1".into()];
        let mut decoder = Decoder::new(Profile::Spec).with_line(&firmware, Profile::Mcsdk54);
        let mut said = Vec::new();
        for channel in [spec, firmware] {
            // GET_REG FLUXWK_BUS, and its reply.
            for bytes in [vec![0x02, 0x01, 0x18, 0x1B], vec![0xF0, 0x02, 0x62, 0x00, 0x55]] {
                let channel = Some(Arc::clone(&channel));
                let wire = Wire::Serial(bytes);
                let entry = Captured { place: 1, time: None, channel, direction: None, wire };
                decoder.decode(&entry, |_, _, item| match item {
                    Item::Message(message) => said.push(message.to_string()),
                    Item::Broken(broken) => panic!("{broken:?}"),
                });
            }
        }
        assert_eq!((&*said[1], &*said[3]), ("ACK 98 %", "ACK 9.8 %"));
    }

    #[test]
    fn frames_of_a_bus_that_was_captured_too_change_nothing() {
        let entry = |channel: &str, wire| Captured {
            place: 1,
            time: None,
            channel: Some(channel.into()),
            direction: None,
            wire,
        };
        let mut decoder = Decoder::new(Profile::Spec);
        let mut said = Vec::new();
        for (channel, wire) in [
            ("st0", Wire::Serial(vec![0x22, 0x01, 0x1E, 0x41])),
            ("can0", Wire::Can(CanFrame::new(0x141, [0x9A, 0, 0, 0, 0, 0, 0, 0]))),
            ("st0", Wire::Serial(vec![0xF0, 0x04, 0xCE, 0x07, 0x00, 0x00, 0xCA])),
        ] {
            decoder.decode(&entry(channel, wire), |_, _, item| match item {
                Item::Message(message) => said.push(message.to_string()),
                Item::Broken(broken) => panic!("{broken:?}"),
            });
        }
        assert_eq!(said, ["GET_REG SPEED_MEAS, motor 1", "ACK 1998 rpm"]);
    }
}
