//! Frames as text, for logs. A frame alone does not show its sender: request and reply have the
//! same identifier, and for some commands the same bytes.

use super::command::{Code, CommandInfo};
use super::message::SetTorque4;
use super::motor::{Dialect, MotorId, TORQUE4_ID};
use super::payload::{Field, Payload};
use crate::can::CanFrame;
use core::fmt;

/// The direction of a frame.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Direction {
    /// A request.
    HostToDrive,
    /// A reply.
    DriveToHost,
}

/// Heading of the four torques (chapter 4), which have no code.
const TORQUE4: &str = "Multiple motor torque closed loop control";

/// A frame that displays itself with names and physical units.
#[derive(Debug, Clone, Copy)]
pub struct Described {
    frame: CanFrame,
    direction: Option<Direction>,
}

/// What a frame is about.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[non_exhaustive]
pub enum Subject {
    /// A request to this motor, or its reply.
    Motor(MotorId, Code),
    /// The torque command to motors 1 to 4.
    Torque4,
    /// A reply of a motor with a similar protocol.
    Dialect(Dialect, MotorId),
    /// A standard data frame of 8 bytes that is none of this protocol.
    Foreign,
    /// Not a standard data frame of 8 bytes.
    NotData,
}

/// Describes a frame as text. `None` is a frame whose direction is not known.
pub fn describe(frame: CanFrame, direction: impl Into<Option<Direction>>) -> Described {
    Described { frame, direction: direction.into() }
}

impl Described {
    /// The frame.
    pub const fn frame(&self) -> &CanFrame {
        &self.frame
    }

    /// The direction; `None` if it is not known.
    pub const fn direction(&self) -> Option<Direction> {
        self.direction
    }

    /// What the frame is about.
    pub fn subject(&self) -> Subject {
        let Some((id, data)) = self.frame.eight_bytes() else { return Subject::NotData };
        if id == TORQUE4_ID {
            return Subject::Torque4;
        }
        if let Some(motor) = MotorId::from_can_id(u32::from(id)) {
            let [code, ..] = *data;
            return Subject::Motor(motor, Code::from(code));
        }
        match Dialect::from_can_id(u32::from(id)) {
            Some((dialect, motor)) => Subject::Dialect(dialect, motor),
            None => Subject::Foreign,
        }
    }

    /// The values of the frame. None are known while the direction is not, unless request and reply
    /// have the same values.
    pub fn fields(&self) -> &'static [Field] {
        let row = match self.subject() {
            Subject::Torque4 => return SetTorque4::FIELDS,
            Subject::Motor(_, code) => code.info(),
            _ => None,
        };
        let Some(row) = row else { return &[] };
        match self.direction {
            Some(Direction::HostToDrive) => row.request,
            Some(Direction::DriveToHost) => row.reply,
            None if row.echo => row.request,
            None => &[],
        }
    }
}

impl fmt::Display for Described {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let (id, data) = (self.frame.id(), self.frame.padded_data());
        match self.subject() {
            Subject::NotData => write!(f, "{id:#05x}: not a standard data frame of 8 bytes"),
            Subject::Torque4 => {
                write!(f, "motors 1 to 4: {TORQUE4}")?;
                fields(SetTorque4::FIELDS, &data, ":", f)
            }
            Subject::Motor(motor, code) => self.exchange(motor, code, &data, f),
            Subject::Dialect(dialect, motor) => {
                write!(f, "reply of a {dialect} motor, ID {motor}")?;
                bytes(&data, f)
            }
            Subject::Foreign => {
                write!(f, "{id:#05x}: not a frame of this protocol")?;
                bytes(&data, f)
            }
        }
    }
}

impl Described {
    fn exchange(
        &self,
        motor: MotorId,
        code: Code,
        data: &[u8; 8],
        f: &mut fmt::Formatter<'_>,
    ) -> fmt::Result {
        let arrow = match self.direction {
            Some(Direction::HostToDrive) => '>',
            Some(Direction::DriveToHost) => '<',
            None => '?',
        };
        write!(f, "motor {motor} {arrow} {:#04X}", code.number())?;
        let Some(row) = code.info() else {
            f.write_str(" not a command of V1.62")?;
            return bytes(data, f);
        };
        write!(f, " {}", row.code)?;
        match self.direction {
            Some(Direction::HostToDrive) => return fields(row.request, data, ":", f),
            Some(Direction::DriveToHost) => return fields(row.reply, data, ":", f),
            None if row.echo => return fields(row.request, data, ":", f),
            None => {}
        }
        f.write_str(": request")?;
        fields(row.request, data, "", f)?;
        f.write_str(", or reply")?;
        fields(row.reply, data, "", f)
    }
}

impl CommandInfo {
    /// Whether `data` may be this request: the bytes that it does not use are 0. If not, `data` is a
    /// reply.
    pub fn may_be_request(&self, data: &[u8; 8]) -> bool {
        let used = self.request.iter().fold(0xFF, |used, field| used | field.mask());
        u64::from_le_bytes(*data) & !used == 0
    }
}

/// The values behind `before`, with commas between them.
fn fields(
    fields: &[Field],
    data: &[u8; 8],
    before: &str,
    f: &mut fmt::Formatter<'_>,
) -> fmt::Result {
    let mut separator = before;
    for field in fields {
        f.write_str(separator)?;
        f.write_str(" ")?;
        f.write_str(field.name)?;
        f.write_str(" ")?;
        fmt::Display::fmt(&field.shown(data), f)?;
        separator = ",";
    }
    Ok(())
}

fn bytes(data: &[u8; 8], f: &mut fmt::Formatter<'_>) -> fmt::Result {
    f.write_str(":")?;
    data.iter().try_for_each(|byte| write!(f, " {byte:02X}"))
}

#[cfg(test)]
mod tests {
    extern crate std;
    use super::*;
    use std::string::{String, ToString};

    fn sent(id: u16, data: [u8; 8]) -> String {
        describe(CanFrame::new(id, data), Direction::HostToDrive).to_string()
    }

    fn received(id: u16, data: [u8; 8]) -> String {
        describe(CanFrame::new(id, data), Direction::DriveToHost).to_string()
    }

    #[test]
    fn a_request_is_shown_with_names_and_units() {
        assert_eq!(
            sent(0x141, [0xA4, 0, 0xF4, 0x01, 0x39, 0x00, 0, 0]),
            "motor 1 > 0xA4 Position closed-loop command 2: max_speed 500 °/s, angle 0.57 °"
        );
        assert_eq!(
            sent(0x160, [0xA5, 0x01, 0, 0, 0x28, 0x23, 0, 0]),
            "motor 32 > 0xA5 Position closed-loop command 3: direction counterclockwise, angle 90.00 °"
        );
        assert_eq!(sent(0x142, [0x80, 0, 0, 0, 0, 0, 0, 0]), "motor 2 > 0x80 Motor off command");
    }

    #[test]
    fn the_same_bytes_read_as_a_reply_show_the_values_of_the_reply() {
        assert_eq!(
            received(0x141, [0x9A, 0xFB, 0, 0xF0, 0x00, 0, 0, 0x08]),
            "motor 1 < 0x9A Read motor status 1 and error flag commands: temperature -5 °C, \
             voltage 24.0 V, errors over temperature protection"
        );
        assert_eq!(
            received(0x141, [0xA1, 0x19, 0, 0x08, 0x0A, 0, 0xFF, 0x3F]),
            "motor 1 < 0xA1 Torque closed-loop command: temperature 25 °C, iq 33.000 A, \
             speed 10 °/s, encoder 16383"
        );
        assert_eq!(
            received(0x141, [0x92, 0x60, 0x73, 0xFF, 0xFF, 0xFF, 0xFF, 0xFF]),
            "motor 1 < 0x92 Read multi turns angle command: angle -360.00 °"
        );
    }

    #[test]
    fn the_four_torques_are_named() {
        assert_eq!(
            sent(0x280, [0x64, 0, 0x9C, 0xFF, 0, 0, 0xD0, 0x07]),
            "motors 1 to 4: Multiple motor torque closed loop control: iq_1 1.600 A, \
             iq_2 -1.600 A, iq_3 0.000 A, iq_4 32.000 A"
        );
    }

    #[test]
    fn a_frame_without_a_direction_shows_both_meanings() {
        let either = |data| describe(CanFrame::new(0x141, data), None).to_string();
        assert_eq!(
            either([0xA2, 0, 0, 0, 0x10, 0x27, 0, 0]),
            "motor 1 ? 0xA2 Speed closed-loop command: request speed 100.00 °/s, or reply \
             temperature 0 °C, iq 0.000 A, speed 10000 °/s, encoder 0"
        );
        assert_eq!(
            either([0x94, 0, 0, 0, 0, 0, 0, 0]),
            "motor 1 ? 0x94 Read single circle angle command: request, or reply angle 0.00 °"
        );
        assert_eq!(either([0x80, 0, 0, 0, 0, 0, 0, 0]), "motor 1 ? 0x80 Motor off command");
    }

    #[test]
    fn a_byte_that_no_request_has_shows_a_reply() {
        let may_be = |data: [u8; 8]| Code::from(data[0]).info().unwrap().may_be_request(&data);
        assert!(may_be([0x9A, 0, 0, 0, 0, 0, 0, 0]) && !may_be([0x9A, 25, 0, 0, 0, 0, 0, 0]));
        assert!(may_be([0xA2, 0, 0, 0, 1, 2, 3, 4]) && !may_be([0xA2, 25, 0, 0, 1, 2, 3, 4]));
        assert!(may_be([0xA5, 1, 0, 0, 1, 2, 0, 0]) && !may_be([0xA5, 1, 0, 0, 1, 2, 3, 4]));
    }

    #[test]
    fn frames_outside_v1_62_are_marked() {
        let data = [0x9A, 1, 2, 3, 4, 5, 6, 7];
        assert_eq!(received(0x241, data), "reply of a V3/V4 motor, ID 1: 9A 01 02 03 04 05 06 07");
        assert_eq!(
            received(0x182, data),
            "reply of a LK-Tech V2.36 motor, ID 2: 9A 01 02 03 04 05 06 07"
        );
        assert_eq!(
            sent(0x141, [0x60, 1, 2, 3, 4, 5, 6, 7]),
            "motor 1 > 0x60 not a command of V1.62: 60 01 02 03 04 05 06 07"
        );
        assert!(received(0x7FF, data).starts_with("0x7ff: not a frame of this protocol"));
        let short = CanFrame::data_frame(0x141, false, &[0x9A]);
        let text = describe(short, Direction::HostToDrive).to_string();
        assert_eq!(text, "0x141: not a standard data frame of 8 bytes");
    }
}
