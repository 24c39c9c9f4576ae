//! The message of a frame on the wire.

use motorlink::port;
use motorlink_proto::can::CanFrame;
use motorlink_proto::rmd::IDENTIFIERS;
use serde::{Deserialize, Serialize};

use super::message::{Message, Time, named, with_dependencies};

/// `motorlink/msg/Frame`: one frame on the wire, or bytes that are none.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct Frame {
    /// When it was sent, or its last byte came.
    pub stamp: Time,
    /// From the program's point of view.
    pub direction: Direction,
    /// The CAN identifier, with the flags [`Frame::EXTENDED`] and [`Frame::REMOTE`]; 0 on a serial line.
    pub id: u32,
    /// What it is.
    pub result: FrameResult,
    /// The bytes on a serial line, the data of a CAN frame. Of a remote frame zeros: as many bytes as it
    /// asks for.
    pub data: Vec<u8>,
}

/// The direction of a [`Frame`].
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(from = "u8", into = "u8")]
#[repr(u8)]
pub enum Direction {
    /// From the program to the motors.
    Sent = 0,
    /// From the motors to the program.
    Received = 1,
}

named!(Direction as "uint8": Sent = "SENT", Received = "RECEIVED");

impl From<u8> for Direction {
    fn from(direction: u8) -> Self {
        if direction == 0 { Direction::Sent } else { Direction::Received }
    }
}

impl From<port::Direction> for Direction {
    fn from(direction: port::Direction) -> Self {
        match direction {
            port::Direction::Sent => Direction::Sent,
            port::Direction::Received => Direction::Received,
        }
    }
}

/// What a [`Frame`] is.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(from = "u8", into = "u8")]
#[repr(u8)]
pub enum FrameResult {
    /// A frame of the protocol.
    Frame = 0,
    /// A frame of the protocol in which the drive refuses a request.
    Nack = 1,
    /// Bytes that are no frame.
    Damaged = 2,
    /// A CAN frame that is not of this protocol.
    Foreign = 3,
}

named!(FrameResult as "uint8": Frame = "FRAME", Nack = "NACK", Damaged = "DAMAGED",
       Foreign = "FOREIGN");

impl From<u8> for FrameResult {
    fn from(result: u8) -> Self {
        match result {
            0 => FrameResult::Frame,
            1 => FrameResult::Nack,
            3 => FrameResult::Foreign,
            _ => FrameResult::Damaged,
        }
    }
}

impl Frame {
    /// Of [`id`](Self::id): the identifier has 29 bits.
    pub const EXTENDED: u32 = 1 << 31;
    /// Of [`id`](Self::id): a remote transmission request.
    pub const REMOTE: u32 = 1 << 30;

    /// Of a frame on a CAN bus with RMD motors.
    pub fn of_can(stamp: Time, direction: Direction, frame: &CanFrame) -> Self {
        let is_ours = frame.eight_bytes().is_some_and(|(id, _)| (IDENTIFIERS.is_used)(id));
        let result = if is_ours { FrameResult::Frame } else { FrameResult::Foreign };
        let flag = |is_set, flag| if is_set { flag } else { 0 };
        let id = frame.id()
            | flag(frame.is_extended(), Self::EXTENDED)
            | flag(frame.is_remote(), Self::REMOTE);
        let data = frame.padded_data()[..usize::from(frame.len())].to_vec();
        Frame { stamp, direction, id, result, data }
    }

    /// The frame on a CAN bus.
    pub fn as_can(&self) -> CanFrame {
        let (id, extended) =
            (self.id & !(Self::EXTENDED | Self::REMOTE), self.id & Self::EXTENDED != 0);
        match self.id & Self::REMOTE != 0 {
            true => CanFrame::remote_frame(id, extended, self.data.len().min(8) as u8),
            false => CanFrame::data_frame(id, extended, &self.data),
        }
    }
}

impl Message for Frame {
    const TYPE: &'static str = "motorlink/msg/Frame";

    fn definition() -> String {
        let fields = format!(
            "# One frame on the wire, or bytes that are none.\n\
             builtin_interfaces/Time stamp # when it was sent, or its last byte came\n\
             # from the point of view of the program that recorded\n\
             {}uint8 direction\n\
             # the CAN identifier; these flags are added; 0 on a serial line\n\
             uint32 EXTENDED={}\nuint32 REMOTE={}\nuint32 id\n\
             # a frame of the protocol; one in which the drive refuses a request; bytes that are no\n\
             # frame; a CAN frame that is not of the protocol\n\
             {}uint8 result\n\
             # the bytes on a serial line, the data of a CAN frame; of a remote frame zeros\n\
             uint8[] data\n",
            Direction::constants(),
            Frame::EXTENDED,
            Frame::REMOTE,
            FrameResult::constants(),
        );
        with_dependencies(&fields, &[Time::DEPENDENCY])
    }
}

#[cfg(test)]
mod tests {
    use super::super::message::tests::returns;
    use super::*;

    const STAMP: Time = Time(1_764_000_000_123_456_789);

    #[test]
    fn a_frame_is_decoded_to_what_was_encoded_and_no_part_of_it_is() {
        returns(Frame {
            stamp: STAMP,
            direction: Direction::Received,
            id: Frame::EXTENDED | 0x141,
            result: FrameResult::Foreign,
            data: vec![0x9A, 0, 1],
        });
    }

    #[test]
    fn frames_of_others_on_a_bus_are_foreign() {
        let result = |frame| Frame::of_can(STAMP, Direction::Received, &frame);
        assert_eq!(result(CanFrame::new(0x141, [0x9C; 8])).result, FrameResult::Frame);
        assert_eq!(result(CanFrame::new(0x701, [5; 8])).result, FrameResult::Foreign);
        let extended = result(CanFrame::data_frame(0x1_0141, true, &[1]));
        assert_eq!((extended.id, extended.result), (0x8001_0141, FrameResult::Foreign));
    }

    #[test]
    fn every_frame_of_a_bus_is_kept_as_it_was() {
        for frame in [
            CanFrame::new(0x141, [0x9C; 8]),
            CanFrame::data_frame(0x1_0141, true, &[1]),
            CanFrame::data_frame(0x7FF, false, &[]),
            CanFrame::remote_frame(0x141, false, 8),
            CanFrame::remote_frame(0x1_0141, true, 3),
        ] {
            assert_eq!(Frame::of_can(STAMP, Direction::Sent, &frame).as_can(), frame);
        }
    }
}
