//! A bus at 1 Mbit/s: a bit takes a microsecond, and the lowest identifier is transmitted first.

use motorlink_proto::can::CanFrame;
use motorlink_proto::time::{Instant, Micros};

use super::bits::{INTERMISSION, frame_bits};

/// The sender of a frame.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Sender {
    Host,
    Motor,
}

/// A frame in transit.
#[derive(Debug, Clone, Copy)]
pub(super) struct Transfer {
    pub(super) sender: Sender,
    pub(super) frame: CanFrame,
    /// When the sender has it ready; then, when the others have received it.
    pub(super) at: Instant,
}

/// The bus and the frames that its nodes want to send.
#[derive(Debug, Default)]
pub(super) struct Wire {
    queued: Vec<Transfer>,
    idle_from: Instant,
    carried: u64,
}

impl Wire {
    /// Queues a frame, to be sent from its time on.
    pub(super) fn queue(&mut self, transfer: Transfer) {
        self.queued.push(transfer);
    }

    /// Transmits the frame that wins the arbitration on the idle bus; `None` if there is no frame.
    pub(super) fn carry(&mut self) -> Option<Transfer> {
        let ready = self.queued.iter().map(|transfer| transfer.at).min()?;
        let start = ready.max(self.idle_from);
        let contenders = self.queued.iter().enumerate().filter(|(_, other)| other.at <= start);
        let (winner, _) = contenders.min_by_key(|(_, transfer)| transfer.frame.id())?;
        let mut transfer = self.queued.remove(winner);
        let bits = frame_bits(transfer.frame.id() as u16, transfer.frame.data());
        transfer.at = start + Micros(bits.into());
        self.idle_from = transfer.at + Micros(INTERMISSION.into());
        self.carried += u64::from(bits + INTERMISSION);
        Some(transfer)
    }

    /// Bits of all frames so far, interframe spaces included.
    pub(super) const fn carried(&self) -> u64 {
        self.carried
    }

    /// When the bus is idle again.
    pub(super) const fn idle_from(&self) -> Instant {
        self.idle_from
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn transfer(id: u16, at: u64) -> Transfer {
        Transfer { sender: Sender::Motor, frame: CanFrame::new(id, [0x55; 8]), at: Instant(at) }
    }

    #[test]
    fn the_lowest_identifier_of_those_that_wait_goes_first() {
        let mut wire = Wire::default();
        for (id, at) in [(0x143, 0), (0x142, 50), (0x141, 50), (0x140, 900)] {
            wire.queue(transfer(id, at));
        }
        let order = std::iter::from_fn(|| wire.carry()).map(|transfer| transfer.frame.id());
        assert!(order.eq([0x143, 0x141, 0x142, 0x140]));
    }

    #[test]
    fn frames_follow_each_other_after_the_interframe_space() {
        let mut wire = Wire::default();
        wire.queue(transfer(0x141, 10));
        wire.queue(transfer(0x142, 10));
        let first = wire.carry().unwrap();
        let second = wire.carry().unwrap();
        let length = |transfer: &Transfer| {
            u64::from(frame_bits(transfer.frame.id() as u16, transfer.frame.data()))
        };
        assert_eq!(first.at, Instant(10 + length(&first)));
        assert_eq!(second.at, Instant(first.at.0 + 3 + length(&second)));
        assert_eq!(wire.carried(), wire.idle_from().0 - 10);
    }
}
