//! Frames as text, for logs. A frame alone does not show its sender: request and reply have the
//! same identifier, and for some commands the same bytes.

use super::command::Code;
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

/// A frame that displays itself with names and physical units.
#[derive(Debug, Clone, Copy)]
pub struct Described {
    frame: CanFrame,
    direction: Direction,
}

/// Describes a frame as text.
pub const fn describe(frame: CanFrame, direction: Direction) -> Described {
    Described { frame, direction }
}

impl fmt::Display for Described {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Some((id, data)) = self.frame.eight_bytes() else {
            return write!(f, "{:#05x}: not a standard data frame of 8 bytes", self.frame.id());
        };
        if id == TORQUE4_ID {
            f.write_str("motors 1 to 4: Multiple motor torque closed loop control")?;
            return fields(SetTorque4::FIELDS, data, f);
        }
        if let Some(motor) = MotorId::from_can_id(u32::from(id)) {
            return self.exchange(motor, data, f);
        }
        match Dialect::from_can_id(u32::from(id)) {
            Some((dialect, motor)) => write!(f, "reply of a {dialect} motor, ID {motor}")?,
            None => write!(f, "{id:#05x}: not a frame of this protocol")?,
        }
        bytes(data, f)
    }
}

impl Described {
    fn exchange(&self, motor: MotorId, data: &[u8; 8], f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let arrow = match self.direction {
            Direction::HostToDrive => '>',
            Direction::DriveToHost => '<',
        };
        let [code, ..] = *data;
        write!(f, "motor {motor} {arrow} {code:#04X}")?;
        let Some(row) = Code::from(code).info() else {
            f.write_str(" not a command of V1.62")?;
            return bytes(data, f);
        };
        write!(f, " {}", row.code)?;
        match self.direction {
            Direction::HostToDrive => fields(row.request, data, f),
            Direction::DriveToHost => fields(row.reply, data, f),
        }
    }
}

fn fields(fields: &[Field], data: &[u8; 8], f: &mut fmt::Formatter<'_>) -> fmt::Result {
    let mut separator = ':';
    for field in fields {
        write!(f, "{separator} {} {}", field.name, field.shown(data))?;
        separator = ',';
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
