//! What a line carries: bytes or CAN frames, and how each takes damage.

use std::fmt::Debug;

use fastrand::Rng;
use motorlink_proto::can::{CanFrame, Identifiers};

use super::spec::Way;

/// What becomes of a unit with a wrong bit.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Struck<T> {
    /// It arrives like this.
    Changed(T),
    /// It does not arrive.
    Lost,
    /// It arrives twice.
    Twice,
}

/// The least that travels: a byte of a serial line, a frame of a CAN bus.
pub trait Unit: Copy {
    /// Bits that can arrive wrong.
    const BITS: u32;
    /// Bits that can be corrupted without anybody noticing.
    const DATA_BITS: u32;

    /// The unit with bit `bit` of [`BITS`](Self::BITS) wrong.
    fn struck(self, bit: u32) -> Struck<Self>;

    /// The unit with bit `bit` of [`DATA_BITS`](Self::DATA_BITS) changed.
    fn corrupted(self, bit: u32) -> Self;

    /// Its second copy, where it arrives twice.
    fn copied(self) -> Self {
        self
    }

    /// What noise has to know of the protocol on the line.
    type Protocol: Clone + Debug;

    /// A unit that nobody sent.
    fn noise(way: Way, protocol: &Self::Protocol, rng: &mut Rng) -> Self;

    /// What comes from a line that is stuck at 0 or 1; `None` where nothing does.
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

    fn noise(_: Way, (): &(), rng: &mut Rng) -> Self {
        rng.u8(..)
    }

    fn stuck(high: bool) -> Option<Self> {
        Some(if high { 0xFF } else { 0x00 })
    }

    fn order(&self) -> u32 {
        0
    }
}

/// Bits of a standard frame with eight bytes of data, without stuff bits: 44 up to and including
/// the CRC's fields around 64 of data.
const FRAME_BITS: u32 = 108;

impl Unit for CanFrame {
    const BITS: u32 = FRAME_BITS;
    const DATA_BITS: u32 = 64;
    type Protocol = Identifiers;

    /// The CRC finds a wrong bit and nobody takes the frame; sending it again, as a controller does
    /// unless told not to, would only make it later. The receiver of a frame whose very last bit is
    /// wrong has taken it already while its sender sends it again.
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

    /// To the drives: a frame that is none of their protocol's, so that none of them moves. To the
    /// program: such a frame or a reply that it did not ask for.
    fn noise(way: Way, protocol: &Identifiers, rng: &mut Rng) -> Self {
        let data = rng.u64(..).to_le_bytes();
        if way == Way::Received && !protocol.replies.is_empty() && rng.bool() {
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
    fn noise_never_speaks_to_a_drive() {
        let is_used = |id| (0x141..=0x160).contains(&id) || id == 0x280;
        let protocol = Identifiers { replies: 0x141..0x161, is_used };
        let mut rng = Rng::with_seed(1);
        let mut replies = 0;
        for _ in 0..20_000 {
            let frame = CanFrame::noise(Way::Sent, &protocol, &mut rng);
            assert!(frame.is_extended() || !is_used(frame.id() as u16), "{frame:?}");
            let frame = CanFrame::noise(Way::Received, &protocol, &mut rng);
            let is_reply = !frame.is_extended() && protocol.replies.contains(&(frame.id() as u16));
            replies += usize::from(is_reply);
        }
        assert!(replies > 5_000, "the program does get replies that it did not ask for");
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
