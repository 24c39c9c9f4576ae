//! A fingerprint of a whole state.

use core::fmt::{Debug, Write};

/// Hashes a value's `Debug` form with 64-bit FNV-1a. That form contains every field, and floats
/// with all significant digits, so different states have different hashes except by chance.
pub fn fingerprint(value: &impl Debug) -> u64 {
    struct Fnv(u64);
    impl Write for Fnv {
        fn write_str(&mut self, text: &str) -> core::fmt::Result {
            for byte in text.bytes() {
                self.0 = (self.0 ^ u64::from(byte)).wrapping_mul(0x0000_0100_0000_01B3);
            }
            Ok(())
        }
    }
    let mut hash = Fnv(0xCBF2_9CE4_8422_2325);
    write!(hash, "{value:?}").expect("hashing never fails, nor does a derived Debug");
    hash.0
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_field_counts_to_the_last_digit() {
        let hash = fingerprint(&(1.0f32, [2u8, 3]));
        assert_eq!(hash, fingerprint(&(1.0f32, [2u8, 3])));
        assert_ne!(hash, fingerprint(&(1.0f32.next_up(), [2u8, 3])));
        assert_ne!(hash, fingerprint(&(1.0f32, [2u8, 4])));
        assert_eq!(fingerprint(&()), fingerprint(&()));
    }
}
