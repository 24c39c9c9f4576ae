//! Requests and replies of a motor have the same identifier. This module tells them apart.
//!
//! A frame is a reply if it has a byte that no request has. Any other frame is a request, if a reply
//! is not expected: the exchange before it is known to be over. If a reply is expected, the frame may
//! also be the request again, because the motor is silent. Only the direction of the capture tells
//! these apart.

use motorlink_proto::rmd::{Code, DEFAULT_TIMEOUT, Direction, MotorId, MotorSet};

use crate::captured::{self, Captured, Stamp};

/// The direction of a frame.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Way {
    /// Request or reply; `None` if it cannot be known.
    pub direction: Option<Direction>,
    /// From what it is known.
    pub by: KnownBy,
}

/// From what the direction of a frame is known.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum KnownBy {
    /// The frame itself.
    Frame,
    /// The capture has it.
    Log,
    /// The frames before it.
    Pairing,
    /// The caller said it.
    Caller,
    /// It is not known.
    Nothing,
}

impl KnownBy {
    /// A word for programs.
    pub const fn word(self) -> &'static str {
        match self {
            KnownBy::Frame => "frame",
            KnownBy::Log => "log",
            KnownBy::Pairing => "pairing",
            KnownBy::Caller => "option",
            KnownBy::Nothing => "nothing",
        }
    }
}

/// The time in which a motor replies.
const REPLY_WITHIN_NS: i64 = DEFAULT_TIMEOUT.0 as i64 * 1_000;

/// The exchanges on a bus.
#[derive(Debug, Default)]
pub(super) struct Bus {
    motors: [Motor; MotorId::COUNT],
    sender: Sender,
    /// Whether the capturing machine received a frame. On a virtual bus it sends them all.
    has_received: bool,
}

/// Who is behind frames that the capturing machine sent.
#[derive(Debug, Default, Clone, Copy, PartialEq, Eq)]
enum Sender {
    #[default]
    Unknown,
    Host,
    Drive,
}

#[derive(Debug, Default)]
struct Motor {
    /// Whether the direction of an earlier frame is known.
    is_synced: bool,
    /// The last request of each code, in the order of time. A host may send several at once.
    open: Vec<Open>,
    last: Option<Stamp>,
}

/// A request without a reply so far.
#[derive(Debug, Clone, Copy)]
struct Open {
    code: Code,
    time: Option<Stamp>,
}

impl Motor {
    /// Whether a frame with this code and time may be a reply.
    fn is_answered_by(&self, code: Code, time: Option<Stamp>) -> bool {
        self.open.iter().any(|open| open.code.is_answered_by(code) && !is_late(open.time, time))
    }

    fn request(&mut self, code: Code, time: Option<Stamp>) {
        self.open.retain(|open| open.code != code && !is_late(open.time, time));
        self.open.push(Open { code, time });
    }

    /// A motor replies in the order of the requests: earlier ones get no reply any more.
    fn reply(&mut self, code: Code) {
        let answered = self.open.iter().position(|open| open.code.is_answered_by(code));
        self.open.drain(..answered.map_or(0, |at| at + 1));
    }
}

fn is_late(then: Option<Stamp>, now: Option<Stamp>) -> bool {
    let elapsed = then.zip(now).and_then(|(then, now)| now.since(then));
    elapsed.is_some_and(|ns| ns > REPLY_WITHIN_NS)
}

impl Bus {
    /// The direction of a frame of a motor.
    pub(super) fn exchange(
        &mut self,
        entry: &Captured,
        id: MotorId,
        code: Code,
        data: &[u8; 8],
    ) -> Way {
        let motor = &mut self.motors[id.index()];
        let is_reply = code.info().is_some_and(|row| !row.may_be_request(data));
        let answers = motor.is_answered_by(code, entry.time);
        // No reply comes so late after the frame before.
        let is_first = motor.last.is_some() && is_late(motor.last, entry.time);
        motor.last = entry.time;
        self.has_received |= entry.direction == Some(captured::Direction::Received);

        let (direction, by) = match (entry.direction, self.sender) {
            (_, _) if is_reply => {
                if entry.direction == Some(captured::Direction::Sent) {
                    self.sender = Sender::Drive;
                }
                (Some(Direction::DriveToHost), KnownBy::Frame)
            }
            // If nothing was received, the motors may be on this machine, too.
            (Some(captured::Direction::Sent), Sender::Host) if self.has_received || !answers => {
                (Some(Direction::HostToDrive), KnownBy::Log)
            }
            (Some(captured::Direction::Sent), Sender::Unknown) if !answers => {
                self.sender = Sender::Host;
                (Some(Direction::HostToDrive), KnownBy::Log)
            }
            (Some(captured::Direction::Received), Sender::Drive) => {
                (Some(Direction::HostToDrive), KnownBy::Log)
            }
            (Some(captured::Direction::Received), Sender::Host) if answers => {
                (Some(Direction::DriveToHost), KnownBy::Log)
            }
            (Some(captured::Direction::Sent), Sender::Drive) if self.has_received && answers => {
                (Some(Direction::DriveToHost), KnownBy::Log)
            }
            // A reply to a request that is not in the capture, or a request of another host.
            (Some(captured::Direction::Received), Sender::Host) => (None, KnownBy::Nothing),
            (Some(captured::Direction::Sent), Sender::Drive) if self.has_received => {
                (None, KnownBy::Nothing)
            }
            _ if answers => (None, KnownBy::Nothing),
            _ if motor.is_synced || is_first => (Some(Direction::HostToDrive), KnownBy::Pairing),
            _ => (None, KnownBy::Nothing),
        };
        match direction {
            Some(Direction::HostToDrive) => motor.request(code, entry.time),
            Some(Direction::DriveToHost) => motor.reply(code),
            // It may be the request again.
            None if answers => motor.request(code, entry.time),
            None => {}
        }
        motor.is_synced |= direction.is_some();
        Way { direction, by }
    }

    /// After 0x280, which opens an exchange with each of its motors.
    pub(super) fn torque4(&mut self, entry: &Captured) {
        for id in MotorSet::TORQUE4 {
            let motor = &mut self.motors[id.index()];
            motor.request(Code::SetTorque, entry.time);
            (motor.is_synced, motor.last) = (true, entry.time);
        }
    }

    /// After a loss of frames.
    pub(super) fn lose(&mut self) {
        self.motors = Default::default();
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::captured::Wire;
    use motorlink_proto::can::CanFrame;

    const READ: [u8; 8] = [0x9A, 0, 0, 0, 0, 0, 0, 0];
    const STATUS: [u8; 8] = [0x9A, 25, 0, 240, 0, 0, 0, 0];
    const OFF: [u8; 8] = [0x80, 0, 0, 0, 0, 0, 0, 0];
    const ANGLE: [u8; 8] = [0x92, 0, 0, 0, 0, 0, 0, 0];

    /// Passes frames of motor 1: `>` sent, `<` received, `-` not known. Gives what they are.
    fn told(bus: &mut Bus, frames: &[(i64, char, [u8; 8])]) -> String {
        let mut out = String::new();
        for (ms, direction, data) in frames {
            let direction = match direction {
                '>' => Some(captured::Direction::Sent),
                '<' => Some(captured::Direction::Received),
                _ => None,
            };
            let entry = Captured {
                place: 1,
                time: Some(Stamp::Relative(ms * 1_000_000)),
                channel: None,
                direction,
                wire: Wire::Can(CanFrame::new(0x141, *data)),
            };
            let motor = MotorId::new(1).unwrap();
            let way = bus.exchange(&entry, motor, Code::from(data[0]), data);
            out.push(match way.direction {
                Some(Direction::HostToDrive) => '>',
                Some(Direction::DriveToHost) => '<',
                None => '?',
            });
        }
        out
    }

    #[test]
    fn without_directions_a_certain_reply_makes_the_rest_certain() {
        let mut bus = Bus::default();
        let frames = [(0, '-', READ), (1, '-', STATUS), (10, '-', READ), (11, '-', STATUS)];
        assert_eq!(told(&mut bus, &frames), "?<><");
        // The second frame may be a reply, or the request again.
        assert_eq!(told(&mut bus, &[(20, '-', OFF), (21, '-', OFF), (30, '-', READ)]), ">?>");
    }

    #[test]
    fn what_cannot_be_known_is_not_known() {
        let mut bus = Bus::default();
        assert_eq!(told(&mut bus, &[(0, '-', ANGLE), (1, '-', ANGLE), (10, '-', ANGLE)]), "???");
        bus.lose();
        assert_eq!(told(&mut bus, &[(11, '-', OFF)]), "?");
    }

    #[test]
    fn a_frame_after_silence_is_a_request() {
        let mut bus = Bus::default();
        assert_eq!(told(&mut bus, &[(0, '-', OFF), (51, '-', OFF), (52, '-', OFF)]), "?>?");
        // A motor that does not answer: both are requests.
        assert_eq!(told(&mut bus, &[(200, '-', OFF), (300, '-', OFF)]), ">>");
    }

    #[test]
    fn the_requests_to_a_silent_motor_are_no_replies() {
        let speed = |rpm| [0xA2, 0, 0, 0, rpm, 0, 0, 0];
        let mut bus = Bus::default();
        let alive = [(0, '-', speed(1)), (1, '-', [0xA2, 25, 0, 0, 1, 0, 0, 0])];
        assert_eq!(told(&mut bus, &alive), "?<");
        let silent: Vec<_> = (2..9).map(|n| (10 * i64::from(n), '-', speed(n))).collect();
        assert_eq!(told(&mut bus, &silent), ">??????");
        let silent: Vec<_> = (2..9).map(|n| (100 * i64::from(n), '-', READ)).collect();
        assert_eq!(told(&mut bus, &silent), ">>>>>>>");
    }

    #[test]
    fn a_reply_to_clear_errors_may_have_another_code() {
        let mut bus = Bus::default();
        let clear = [0x9B, 0, 0, 0, 0, 0, 0, 0];
        let frames = [(0, '>', clear), (1, '<', READ), (2, '>', clear), (3, '<', clear)];
        assert_eq!(told(&mut bus, &frames), "><><");
    }

    #[test]
    fn the_log_of_a_host_has_the_directions() {
        let mut bus = Bus::default();
        assert_eq!(
            told(&mut bus, &[(0, '>', OFF), (1, '<', OFF), (2, '>', ANGLE), (3, '<', ANGLE)]),
            "><><"
        );
        // This host did not request it: another host's request, or a late reply.
        assert_eq!(told(&mut bus, &[(10, '<', ANGLE)]), "?");
        assert_eq!(told(&mut bus, &[(11, '<', STATUS)]), "<");
    }

    #[test]
    fn a_listener_receives_requests_too() {
        let mut bus = Bus::default();
        let frames = [(0, '<', READ), (1, '<', STATUS), (10, '<', READ), (11, '<', STATUS)];
        assert_eq!(told(&mut bus, &frames), "?<><");
    }

    #[test]
    fn a_reply_is_no_request_although_other_requests_were_sent_before_it() {
        let alive = [(0, '-', READ), (1, '-', STATUS)];
        let status_2 = [0x9C, 0, 0, 0, 0, 0, 0, 0];
        let reply_2 = [0x9C, 25, 0, 0, 0, 0, 0, 16];
        let mut bus = Bus::default();
        assert_eq!(told(&mut bus, &alive), "?<");
        // The motor is at 0 °, so that its reply looks like the request.
        let frames = [(10, '-', ANGLE), (11, '-', status_2), (12, '-', ANGLE), (13, '-', reply_2)];
        assert_eq!(told(&mut bus, &frames), ">>?<");
        // It replies in order, so that the exchange before is over.
        assert_eq!(told(&mut bus, &[(14, '-', OFF), (15, '-', READ), (16, '-', STATUS)]), ">><");
        assert_eq!(told(&mut bus, &[(17, '-', OFF)]), ">");
    }

    #[test]
    fn a_frame_to_four_motors_does_not_end_their_exchanges() {
        let mut bus = Bus::default();
        assert_eq!(told(&mut bus, &[(0, '-', READ), (1, '-', STATUS), (10, '-', ANGLE)]), "?<>");
        let four = Captured {
            place: 1,
            time: Some(Stamp::Relative(10_500_000)),
            channel: None,
            direction: None,
            wire: Wire::Can(CanFrame::new(0x280, [0; 8])),
        };
        bus.torque4(&four);
        assert_eq!(told(&mut bus, &[(11, '-', ANGLE)]), "?");
    }

    #[test]
    fn a_machine_that_sent_everything_may_be_both_ends() {
        // A virtual bus: the second frame may be the reply.
        let mut bus = Bus::default();
        assert_eq!(told(&mut bus, &[(0, '>', OFF), (1, '>', OFF)]), ">?");
        assert_eq!(told(&mut bus, &[(2, '>', READ), (3, '>', STATUS)]), "><");
        assert_eq!(told(&mut bus, &[(4, '>', READ), (5, '>', STATUS), (6, '>', OFF)]), "><>");
        assert_eq!(told(&mut bus, &[(7, '>', OFF)]), "?");
        // It received a reply, so that it is the host.
        let mut bus = Bus::default();
        assert_eq!(told(&mut bus, &[(0, '>', OFF), (1, '<', OFF), (2, '>', OFF)]), "><>");
        assert_eq!(told(&mut bus, &[(3, '>', OFF)]), ">");
    }

    #[test]
    fn the_log_of_a_drive_has_the_directions_too() {
        let mut bus = Bus::default();
        let frames = [(0, '<', READ), (1, '>', STATUS), (10, '<', OFF), (11, '>', OFF)];
        assert_eq!(told(&mut bus, &frames), "?<><");
    }
}
