//! The units of a line, bytes or CAN frames, and how faults change them.

use std::fmt::Debug;

use fastrand::Rng;
use motorlink_proto::can::{CanFrame, Identifiers};

use crate::direction::Direction;

/// The effect of an inverted bit on a unit.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Struck<T> {
    /// The changed unit arrives.
    Changed(T),
    /// It does not arrive.
    Lost,
    /// It arrives twice.
    Twice,
}

/// The smallest unit of a transmission: a byte of a serial line, a frame of a CAN bus.
pub trait Unit: Copy {
    /// Number of bits that can be inverted.
    const BITS: u32;
    /// Number of bits that can be inverted without detection.
    const DATA_BITS: u32;

    /// The unit with bit `bit` of [`BITS`](Self::BITS) wrong.
    fn struck(self, bit: u32) -> Struck<Self>;

    /// The unit with bit `bit` of [`DATA_BITS`](Self::DATA_BITS) changed.
    fn corrupted(self, bit: u32) -> Self;

    /// The second copy of a unit that arrives twice.
    fn copied(self) -> Self {
        self
    }

    /// The protocol of the line, which noise avoids.
    type Protocol: Clone + Debug;

    /// A random unit.
    fn noise(way: Direction, protocol: &Self::Protocol, rng: &mut Rng) -> Self;

    /// The unit on a line that is stuck at 0 or 1; `None` if nothing arrives.
    fn stuck(high: bool) -> Option<Self>;

    /// Units with the same number keep their order.
    fn order(&self) -> u32;
}

impl Unit for u8 {
    const BITS: u32 = 8;
    const DATA_BITS: u32 = 0;
    type Protocol = ();

    fn struck(self, bit: u32) -> Struck<Self> {
        Struck::Changed(self ^ 1 << bit)
    }

    fn corrupted(self, _: u32) -> Self {
        self
    }

    fn noise(_: Direction, (): &(), rng: &mut Rng) -> Self {
        rng.u8(..)
    }

    fn stuck(high: bool) -> Option<Self> {
        Some(if high { 0xFF } else { 0x00 })
    }

    fn order(&self) -> u32 {
        0
    }
}

/// Number of bits of a standard frame with eight bytes of data, without stuff bits: 64 data bits,
/// and 44 up to and including the CRC's fields.
const FRAME_BITS: u32 = 108;

impl Unit for CanFrame {
    const BITS: u32 = FRAME_BITS;
    const DATA_BITS: u32 = 64;
    type Protocol = Identifiers;

    /// The CRC detects an inverted bit, and no node accepts the frame. A controller usually sends
    /// it again, which is only a delay. If the very last bit is inverted, the receiver has accepted
    /// the frame already, and the sender sends it again.
    fn struck(self, bit: u32) -> Struck<Self> {
        if bit == FRAME_BITS - 1 { Struck::Twice } else { Struck::Lost }
    }

    fn corrupted(self, bit: u32) -> Self {
        let mut data = [0; 8];
        let given = self.data();
        data.iter_mut().zip(given).for_each(|(slot, byte)| *slot = *byte);
        data[bit as usize / 8] ^= 1 << (bit % 8);
        CanFrame::data_frame(self.id(), self.is_extended(), &data[..given.len()])
    }

    /// To the drives: a frame outside their protocol, so that no motor moves. To the program: such
    /// a frame, or a reply without a request.
    fn noise(way: Direction, protocol: &Identifiers, rng: &mut Rng) -> Self {
        let data = rng.u64(..).to_le_bytes();
        if way == Direction::Received && !protocol.replies.is_empty() && rng.bool() {
            return CanFrame::new(rng.u16(protocol.replies.clone()), data);
        }
        if rng.bool() {
            return CanFrame::data_frame(rng.u32(..), true, &data[..rng.usize(..=8)]);
        }
        let id = rng.u16(..0x800);
        CanFrame::new(if (protocol.is_used)(id) { 0x7FF } else { id }, data)
    }

    fn stuck(_: bool) -> Option<Self> {
        None
    }

    fn order(&self) -> u32 {
        self.id()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn noise_is_never_a_command_to_a_drive() {
        let is_used = |id| (0x141..=0x160).contains(&id) || id == 0x280;
        let protocol = Identifiers { replies: 0x141..0x161, is_used };
        let mut rng = Rng::with_seed(1);
        let mut replies = 0;
        for _ in 0..20_000 {
            let frame = CanFrame::noise(Direction::Sent, &protocol, &mut rng);
            assert!(frame.is_extended() || !is_used(frame.id() as u16), "{frame:?}");
            let frame = CanFrame::noise(Direction::Received, &protocol, &mut rng);
            let is_reply = !frame.is_extended() && protocol.replies.contains(&(frame.id() as u16));
            replies += usize::from(is_reply);
        }
        assert!(replies > 5_000, "the program also gets replies without a request");
    }

    #[test]
    fn a_wrong_bit_loses_a_frame_and_the_last_one_repeats_it() {
        let frame = CanFrame::new(0x141, [0x9A, 0, 0, 0, 0, 0, 0, 0]);
        assert_eq!(frame.struck(0), Struck::Lost);
        assert_eq!(frame.struck(CanFrame::BITS - 1), Struck::Twice);
        assert_eq!(frame.corrupted(8).data(), [0x9A, 1, 0, 0, 0, 0, 0, 0]);
        assert_eq!(0x22u8.struck(1), Struck::Changed(0x20));
    }
}
