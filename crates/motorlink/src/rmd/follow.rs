//! Follows what somebody else's host says to motors: which of them it may have set moving.

use std::collections::VecDeque;

use motorlink_proto::can::CanFrame;
use motorlink_proto::rmd::{Code, MotorId, MotorSet, TORQUE4_ID};
use motorlink_proto::time::{Instant, Micros};

/// How long a request may wait for its reply.
const LATE: Micros = Micros::from_millis(2_000);
/// Requests to a motor that wait for their reply.
const WAITING: usize = 64;

/// Reads along on a bus, from the client's frames and those of the bus.
///
/// It errs to one side. A motor counts as moving from the command on that may move it, and until it
/// has acknowledged an 0x80 or 0x81 that was sent after that.
#[derive(Debug, Default)]
pub(crate) struct Follower {
    /// Motors that were set moving and not stopped.
    pub(crate) moving: MotorSet,
    /// Requests without a reply yet, by motor, oldest first.
    asked: [VecDeque<SeenRequest>; MotorId::COUNT],
    /// Motors for which commands of other nodes were reported to the present client.
    pub(crate) unguarded: MotorSet,
}

#[derive(Debug, Clone, Copy)]
struct SeenRequest {
    code: u8,
    at: Instant,
    number: u64,
    /// No motion command follows, and it is one that ends motion.
    ends: bool,
}

/// What a frame of the bus is.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct Heard {
    /// The number of the client's frame that it replies to.
    pub(crate) reply_to: Option<u64>,
    /// A motor that somebody else commands; told once while a client is there.
    pub(crate) unguarded: Option<MotorId>,
}

impl Follower {
    /// The client sends `frame`, its frame of this `number`.
    pub(crate) fn sent(&mut self, now: Instant, frame: &CanFrame, number: u64) {
        let Some((can_id, &[code, ..])) = frame.eight_bytes() else { return };
        let moved = MotorSet::moved_by(frame);
        self.moving = self.moving.union(moved);
        for id in moved {
            self.of(id).iter_mut().for_each(|asked| asked.ends = false);
        }
        if can_id == TORQUE4_ID {
            for id in MotorSet::TORQUE4 {
                self.ask(
                    id,
                    SeenRequest { code: Code::SetTorque.into(), at: now, number, ends: false },
                );
            }
        } else if let Some(id) = MotorId::from_can_id(can_id.into()) {
            let ends = Code::from(code).motion().stops();
            self.ask(id, SeenRequest { code, at: now, number, ends });
        }
    }

    /// The bus carries `frame`, which is not the client's.
    pub(crate) fn heard(&mut self, now: Instant, frame: &CanFrame) -> Heard {
        let moved = MotorSet::moved_by(frame);
        let Some((can_id, &[code, ..])) = frame.eight_bytes() else {
            return Heard { reply_to: None, unguarded: None };
        };
        let reply = MotorId::from_can_id(can_id.into()).and_then(|id| {
            let asked = self.of(id);
            asked.retain(|asked| now.since(asked.at) <= LATE);
            let place = asked.iter().position(|asked| asked.code == code)?;
            Some((id, asked.remove(place)?))
        });
        if let Some((id, SeenRequest { ends: true, .. })) = reply {
            self.moving.remove(id);
        }
        let news = if reply.is_some() { MotorSet::EMPTY } else { moved.without(self.unguarded) };
        self.unguarded = self.unguarded.union(news);
        Heard { reply_to: reply.map(|(_, asked)| asked.number), unguarded: news.into_iter().next() }
    }

    fn ask(&mut self, id: MotorId, asked: SeenRequest) {
        let waiting = self.of(id);
        if waiting.len() == WAITING {
            waiting.pop_front();
        }
        waiting.push_back(asked);
    }

    fn of(&mut self, id: MotorId) -> &mut VecDeque<SeenRequest> {
        &mut self.asked[id.index()]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn frame(id: u8, code: u8) -> CanFrame {
        CanFrame::new(0x140 + u16::from(id), [code, 1, 2, 3, 4, 5, 6, 7])
    }

    const NONE: [u8; 0] = [];

    fn ids(follower: &Follower) -> Vec<u8> {
        follower.moving.map(MotorId::number).collect()
    }

    /// A conversation: `>` is the client's frame, `<` one of the bus; motor, code.
    fn after(talk: &[(char, u8, u8)]) -> Follower {
        let mut follower = Follower::default();
        for (n, &(way, id, code)) in talk.iter().enumerate() {
            let now = Instant(n as u64 * 1_000);
            match way {
                '>' => follower.sent(now, &frame(id, code), n as u64),
                _ => {
                    follower.heard(now, &frame(id, code));
                }
            }
        }
        follower
    }

    #[test]
    fn a_motor_moves_from_its_command_on_until_its_end_is_acknowledged() {
        for code in [0x88, 0xA1, 0xA2, 0xA3, 0xA4, 0xA5, 0xA6, 0xA8] {
            assert_eq!(ids(&after(&[('>', 2, code)])), [2], "{code:#04x}");
            for end in [0x80, 0x81] {
                let told = [('>', 2, code), ('<', 2, code), ('>', 2, end)];
                assert_eq!(ids(&after(&told)), [2], "{code:#04x} {end:#04x}");
                let done = [&told[..], &[('<', 2, end)]].concat();
                assert_eq!(ids(&after(&done)), NONE, "{code:#04x} {end:#04x}");
            }
        }
        assert_eq!(ids(&after(&[('>', 1, 0x9A), ('>', 32, 0x92)])), NONE);
    }

    #[test]
    fn an_acknowledge_from_before_the_last_command_ends_nothing() {
        let late = [('>', 1, 0xA2), ('>', 1, 0x80), ('>', 1, 0xA2), ('<', 1, 0x80)];
        assert_eq!(ids(&after(&late)), [1]);
        let again = [&late[..], &[('>', 1, 0x80), ('<', 1, 0x80)]].concat();
        assert_eq!(ids(&after(&again)), NONE);
        // The first acknowledge is late, the second end was lost.
        let lost = [('>', 1, 0xA2), ('>', 1, 0x80), ('>', 1, 0xA2), ('>', 1, 0x80), ('<', 1, 0x80)];
        assert_eq!(ids(&after(&lost)), [1]);
        // The reply of another motor, and a reply without a request.
        assert_eq!(ids(&after(&[('>', 1, 0xA2), ('>', 1, 0x80), ('<', 2, 0x80)])), [1]);
        assert_eq!(ids(&after(&[('>', 1, 0xA2), ('<', 1, 0x80)])), [1]);
    }

    #[test]
    fn an_end_that_was_repeated_counts() {
        let talk = [('>', 1, 0xA2), ('>', 1, 0x81), ('>', 1, 0x81), ('<', 1, 0x81)];
        assert_eq!(ids(&after(&talk)), NONE);
    }

    #[test]
    fn torques_in_one_frame_move_motors_1_to_4() {
        let mut follower = Follower::default();
        follower.sent(Instant(0), &CanFrame::new(TORQUE4_ID, [0; 8]), 7);
        assert_eq!(ids(&follower), [1, 2, 3, 4]);
        for id in 1..=4 {
            let heard = follower.heard(Instant(500), &frame(id, 0xA1));
            assert_eq!(heard, Heard { reply_to: Some(7), unguarded: None });
        }
    }

    #[test]
    fn what_other_nodes_command_is_told_once_a_client() {
        let mut follower = Follower::default();
        let own = follower.heard(Instant(0), &frame(3, 0xA2)).unguarded;
        assert_eq!(own.map(MotorId::number), Some(3));
        assert_eq!(follower.heard(Instant(0), &frame(3, 0xA2)).unguarded, None);
        follower.sent(Instant(0), &frame(4, 0xA2), 1);
        assert_eq!(follower.heard(Instant(0), &frame(4, 0xA2)).unguarded, None, "a reply");
        assert!(follower.heard(Instant(0), &frame(4, 0xA2)).unguarded.is_some(), "another's");
        assert_eq!(follower.heard(Instant(0), &frame(5, 0x9A)).unguarded, None, "moves nothing");
        assert_eq!(ids(&follower), [4], "it is not guarded either");
        follower.unguarded = MotorSet::EMPTY;
        assert!(follower.heard(Instant(0), &frame(3, 0xA2)).unguarded.is_some());
    }

    #[test]
    fn what_no_motor_takes_moves_none() {
        let mut follower = Follower::default();
        follower.sent(Instant(0), &CanFrame::data_frame(0x141, true, &[0xA2; 8]), 1);
        follower.sent(Instant(0), &CanFrame::remote_frame(0x141, false, 8), 1);
        follower.sent(Instant(0), &CanFrame::data_frame(0x141, false, &[0xA2; 7]), 1);
        assert_eq!(ids(&follower), NONE);
    }
}
