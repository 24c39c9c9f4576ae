//! Encoder counts and angles. Only this module computes with the zero point, so that encoder
//! position, single-turn angle and multi-turn angle agree.

use crate::units::{
    CentiDegrees, Quantity, Rounding, Scale, TurnCentiDegrees, WideCentiDegrees, decimal_places,
};

/// Digits of 0.01° in a turn.
pub const FULL_TURN: u16 = TurnCentiDegrees::MAX.0 + 1;

/// Width of an encoder, 12 to 18 bits per turn (chapter 4, note). The default is 14, as in the
/// document's frames.
///
/// A position has 16 bits in a frame. Of a wider encoder the frame carries the upper 16 bits
/// (docs/SPEC-NOTES.md R6).
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct EncoderBits(u8);

impl EncoderBits {
    /// `None` unless `bits` is 12 to 18.
    pub const fn new(bits: u8) -> Option<Self> {
        if bits >= 12 && bits <= 18 { Some(EncoderBits(bits)) } else { None }
    }

    /// The width in bits.
    pub const fn bits(self) -> u8 {
        self.0
    }

    /// An encoder value of a frame as an angle of the motor shaft in degrees, 0 to 360.
    pub fn degrees(self, counts: u16) -> f64 {
        self.scale().value(counts.into())
    }

    /// The angle of a count of a frame. Its range ends with the last count of this encoder.
    pub fn scale(self) -> Scale {
        let last = i64::from(1u32.wrapping_shl(self.width().min(16))).wrapping_sub(1);
        let digit = 360.0 / (last as f64 + 1.0);
        let Scale { symbol, suffix, .. } = TurnCentiDegrees::UNIT;
        let (decimals, rounding) = (decimal_places(digit), Rounding::Nearest);
        Scale { digit, symbol, suffix, decimals, least: 0, most: last, rounding }
    }

    /// Limits a value from a frame to the range of this encoder.
    pub(super) fn cut(self, counts: u16) -> u16 {
        self.narrow(self.widen(counts))
    }

    /// Multi-turn counts as a frame carries them: within the turn, at most 16 bits.
    pub(super) fn narrow(self, counts: i64) -> u16 {
        self.narrow_word(counts as u32)
    }

    /// The lower 32 bits have all that a frame carries.
    // A call takes less flash than the inlined code.
    #[inline(never)]
    fn narrow_word(self, counts: u32) -> u16 {
        let unused = 16u32.saturating_sub(self.width());
        let wire = counts.wrapping_shr(self.dropped()) as u16;
        wire.wrapping_shl(unused).wrapping_shr(unused)
    }

    /// Encoder counts of a value from a frame.
    pub(super) fn widen(self, counts: u16) -> i64 {
        i64::from(u32::from(counts).wrapping_shl(self.dropped()))
    }

    /// Counts from zero as an angle, rounded down to a digit.
    pub(super) fn multi_turn(self, counts: i64) -> WideCentiDegrees {
        WideCentiDegrees(counts.wrapping_mul(i64::from(FULL_TURN)).wrapping_shr(self.width()))
    }

    /// Counts from zero as an angle within the turn, rounded down to a digit.
    pub(super) fn circle(self, counts: i64) -> TurnCentiDegrees {
        TurnCentiDegrees(self.multi_turn(self.within_turn(counts)).0 as u16)
    }

    /// The counts from zero that are nearest to an angle.
    pub(super) fn counts(self, angle: CentiDegrees) -> i64 {
        let turns = angle.0.div_euclid(i32::from(FULL_TURN));
        let rest = angle.0.rem_euclid(i32::from(FULL_TURN)) as u32;
        // 36000 is 1125 << 5, so 18 bits of encoder fit into 32-bit arithmetic.
        let scaled = rest.wrapping_shl(self.width().saturating_sub(5));
        let within = scaled.wrapping_add(1125 / 2) / 1125;
        i64::from(turns).wrapping_mul(self.turn().into()).wrapping_add(i64::from(within))
    }

    /// Counts reduced to one turn.
    pub(super) fn within_turn(self, counts: i64) -> i64 {
        i64::from(counts as u32 & self.turn().wrapping_sub(1))
    }

    /// Counts of a turn.
    // Not 64 bits, whose shift is a call on a Cortex-M.
    pub(super) fn turn(self) -> u32 {
        1u32.wrapping_shl(self.width())
    }

    fn width(self) -> u32 {
        // `& 31` tells the compiler that no shift by the width is longer than a word.
        u32::from(self.0) & 31
    }

    /// Low bits that a frame does not carry.
    fn dropped(self) -> u32 {
        self.width().saturating_sub(16)
    }
}

impl Default for EncoderBits {
    fn default() -> Self {
        EncoderBits(14)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn widths() -> impl Iterator<Item = EncoderBits> {
        (0..=255).filter_map(EncoderBits::new)
    }

    #[test]
    fn there_are_seven_widths_and_14_is_the_default() {
        assert!(widths().map(EncoderBits::bits).eq(12..=18));
        assert_eq!(EncoderBits::default().bits(), 14);
    }

    #[test]
    fn a_count_is_a_part_of_a_turn_and_the_range_ends_with_the_last_count() {
        for bits in widths() {
            let scale = bits.scale();
            assert_eq!(scale.most, (1 << bits.bits().min(16)) - 1);
            for counts in [0, 1, 1000, scale.most] {
                let exact = counts as f64 * 360.0 / (scale.most as f64 + 1.0);
                assert!((scale.value(counts) - exact).abs() < 1e-9);
                assert_eq!(bits.degrees(counts as u16), scale.value(counts));
            }
            assert!(scale.value(scale.most) < 360.0);
        }
        assert_eq!(EncoderBits::default().scale().decimals, 2);
        assert_eq!(EncoderBits::new(18).unwrap().scale().decimals, 3);
    }

    #[test]
    #[cfg_attr(miri, ignore = "an interpreter takes long")]
    fn an_angle_turned_into_counts_and_back_is_off_by_no_more_than_a_count() {
        for bits in widths() {
            let count = 36_000 / (1 << bits.bits()) + 1;
            for angle in (-100_000_000..100_000_000).step_by(77_777) {
                let back = bits.multi_turn(bits.counts(CentiDegrees(angle))).0;
                assert!((back - i64::from(angle)).abs() <= count, "{angle} became {back}");
            }
        }
    }

    #[test]
    fn the_ends_of_the_angle_do_not_overflow() {
        for bits in widths() {
            for angle in [i32::MIN, i32::MAX] {
                let back = bits.multi_turn(bits.counts(CentiDegrees(angle))).0;
                assert!((back - i64::from(angle)).abs() <= 9);
            }
        }
    }

    #[test]
    fn a_wide_encoder_sends_its_upper_16_bits() {
        let wide = EncoderBits::new(18).unwrap();
        assert_eq!(wide.narrow(0x3FFFF), 0xFFFF);
        assert_eq!(wide.narrow(-1), 0xFFFF);
        assert_eq!(wide.widen(0x8000), 0x20000);
        let narrow = EncoderBits::new(12).unwrap();
        assert_eq!(narrow.narrow(0x1234), 0x234);
        assert_eq!(narrow.cut(0xFFFF), 0xFFF);
        assert_eq!(narrow.degrees(0x800), 180.0);
        assert_eq!(wide.degrees(0x8000), 180.0);
    }
}
