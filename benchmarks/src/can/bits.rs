//! The bits of a standard CAN data frame, stuff bits included.

/// Bits after the stuffed part: CRC delimiter, ACK slot and delimiter, end of frame.
const TAIL: u32 = 1 + 1 + 1 + 7;
/// Recessive bits between two frames.
pub(super) const INTERMISSION: u32 = 3;
/// Number of equal bits after which an opposite bit is stuffed.
const RUN: u32 = 5;

/// Bits of a data frame from start to end of frame. `id` has 11 bits, `data` at most 8 bytes.
pub(super) fn frame_bits(id: u16, data: &[u8]) -> u32 {
    let mut bits = Bits::default();
    // Start of frame, identifier, RTR, IDE, r0.
    bits.push(0, 1);
    bits.push(id, 11);
    bits.push(0, 3);
    bits.push(data.len() as u16, 4);
    data.iter().for_each(|&byte| bits.push(byte.into(), 8));
    bits.push(bits.crc, 15);
    bits.sent + TAIL
}

/// The bits sent so far.
#[derive(Default)]
struct Bits {
    crc: u16,
    /// The last sent bit, and the number of equal bits at the end.
    last: bool,
    run: u32,
    /// Stuff bits included.
    sent: u32,
}

impl Bits {
    /// The low `count` bits of `value`, the highest first.
    fn push(&mut self, value: u16, count: u32) {
        for place in (0..count).rev() {
            let bit = value >> place & 1 == 1;
            self.crc = crc15(self.crc, bit);
            self.send(bit);
            if self.run == RUN {
                self.send(!bit);
            }
        }
    }

    fn send(&mut self, bit: bool) {
        self.run = if self.sent > 0 && bit == self.last { self.run + 1 } else { 1 };
        self.last = bit;
        self.sent += 1;
    }
}

/// The checksum of the bits so far and one more: x^15 + x^14 + x^10 + x^8 + x^7 + x^4 + x^3 + 1.
fn crc15(crc: u16, bit: bool) -> u16 {
    let feedback = (crc >> 14 & 1 == 1) != bit;
    let shifted = crc << 1 & 0x7FFF;
    if feedback { shifted ^ 0x4599 } else { shifted }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Bits of an 8-byte frame with interframe space and without stuff bits.
    const UNSTUFFED: u32 = 108 + INTERMISSION;

    fn length(id: u16, data: [u8; 8]) -> u32 {
        frame_bits(id, &data) + INTERMISSION
    }

    #[test]
    fn the_checksum_is_that_of_the_crc_catalogue() {
        let mut bits = Bits::default();
        b"123456789".iter().for_each(|&byte| bits.push(byte.into(), 8));
        assert_eq!(bits.crc, 0x059E);
    }

    #[test]
    fn a_frame_of_zeros_has_a_stuff_bit_after_every_fifth() {
        // 34 zero bits from start of frame to checksum, and the ten bits after it.
        assert_eq!(frame_bits(0x000, &[]), 34 + 6 + 10);
    }

    #[test]
    fn a_stuff_bit_counts_in_the_next_run() {
        let mut bits = Bits::default();
        // Five zeros, a one stuffed; with it four ones make a run, and a zero is stuffed.
        bits.push(0b0_0000_1111, 9);
        assert_eq!((bits.sent, bits.last), (11, false));
    }

    #[test]
    fn every_frame_of_eight_bytes_is_within_the_bounds() {
        let mut word = 1u64;
        let (mut least, mut most) = (u32::MAX, 0);
        for id in 0x000..=0x7FF {
            // Knuth's generator, with runs of equal bits added.
            word = word.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(0x1405_7B7E_F767_814F);
            for data in [word, word & (word >> 9), 0, u64::MAX] {
                let length = length(id, data.to_le_bytes());
                least = least.min(length);
                most = most.max(length);
            }
        }
        assert!(least >= UNSTUFFED && most <= UNSTUFFED + 24, "{least} to {most} bits");
    }

    #[test]
    fn frames_of_the_protocol_have_their_length() {
        // Computed by long division and text search in another language.
        assert_eq!(length(0x141, [0x9C, 0, 0, 0, 0, 0, 0, 0]), 124);
        assert_eq!(length(0x141, [0xA4, 0, 0x68, 0x01, 0x28, 0x23, 0, 0]), 120);
        assert_eq!(length(0x144, [0xA1, 25, 0xF3, 0xFF, 0x38, 0xFF, 0x10, 0x27]), 117);
        assert_eq!(length(0x280, [0x64, 0, 0x9C, 0xFF, 0, 0, 0xD0, 0x07]), 120);
    }
}
