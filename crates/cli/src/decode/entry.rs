//! An entry of a capture with its meaning, for all forms of output.

use motorlink::can::CanFrame;
use motorlink::rmd::{self, Described, Subject};
use motorlink_capture::rmd::Way;
use motorlink_capture::{Captured, Wire, st::Item, st::Message};

/// What is printed of an entry.
pub struct Entry<'a> {
    pub at: &'a Captured,
    /// Whether it is a request or a reply; `None` if that is not known or has no meaning.
    pub is_request: Option<bool>,
    /// From what that is known.
    pub known_by: Option<&'static str>,
    pub frame: Frame<'a>,
    pub meaning: Meaning<'a>,
}

/// The bytes of an entry.
#[derive(Clone, Copy)]
pub enum Frame<'a> {
    None,
    Can(&'a CanFrame),
    /// Identifier, whether it has 29 bits, data.
    Fd(u32, bool, &'a [u8]),
    Bytes(&'a [u8]),
}

pub enum Meaning<'a> {
    Rmd(&'a Described),
    St(&'a Message<'a>),
    /// Something of another protocol.
    Other(&'static str),
    Damage(String),
}

impl<'a> Entry<'a> {
    pub fn of_rmd(at: &'a Captured, decoded: Option<&'a (Way, Described)>) -> Self {
        match (&at.wire, decoded) {
            (Wire::Can(frame), Some((way, described))) => Entry {
                at,
                is_request: way.direction.map(|way| way == rmd::Direction::HostToDrive),
                known_by: way.direction.map(|_| way.by.word()),
                frame: Frame::Can(frame),
                meaning: Meaning::Rmd(described),
            },
            (Wire::Serial(bytes), _) => Entry {
                frame: Frame::Bytes(bytes),
                ..Self::without_way(at, Meaning::Other("bytes of a serial line"))
            },
            _ => Self::of_other(at).unwrap_or_else(|| Self::without_way(at, Meaning::Other(""))),
        }
    }

    pub fn of_st(at: &'a Captured, bytes: &'a [u8], item: &'a Item<'a>) -> Self {
        let (is_request, meaning) = match item {
            Item::Message(message) => (Some(message.is_request()), Meaning::St(message)),
            Item::Broken(why) => (None, Meaning::Damage(why.to_string())),
        };
        let known_by = is_request.map(|_| "frame");
        Entry { at, is_request, known_by, frame: Frame::Bytes(bytes), meaning }
    }

    /// An entry that is not bytes of a serial line.
    pub fn of_other(at: &'a Captured) -> Option<Self> {
        let (frame, meaning) = match &at.wire {
            Wire::Serial(_) => return None,
            Wire::Can(frame) => (Frame::Can(frame), Meaning::Other("a CAN frame")),
            Wire::Fd(frame) => (
                Frame::Fd(frame.id, frame.extended, &frame.data),
                Meaning::Other("a CAN FD frame, which is not of this protocol"),
            ),
            Wire::Error { class, .. } => {
                (Frame::None, Meaning::Damage(motorlink_capture::error_frame(*class)))
            }
            Wire::Damage(damage) => (Frame::None, Meaning::Damage(damage.to_string())),
        };
        Some(Entry { frame, ..Self::without_way(at, meaning) })
    }

    fn without_way(at: &'a Captured, meaning: Meaning<'a>) -> Self {
        Entry { at, is_request: None, known_by: None, frame: Frame::None, meaning }
    }

    /// Whether it is of another protocol.
    pub fn is_other(&self) -> bool {
        match &self.meaning {
            Meaning::Other(_) => true,
            Meaning::Rmd(described) => {
                matches!(
                    described.subject(),
                    Subject::Dialect(..) | Subject::Foreign | Subject::NotData
                )
            }
            _ => false,
        }
    }
}
