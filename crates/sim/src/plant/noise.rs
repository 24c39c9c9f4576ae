//! Noise that depends only on a seed and a counter, so it can be computed in any order.

/// Two independent numbers with mean 0 and standard deviation 1, by the sum of two uniform ones
/// each (triangular, within ±2.45).
pub(super) fn pair(seed: u32, count: u32) -> (f32, f32) {
    /// Standard deviation of the sum of two numbers that are uniform over 2^16.
    const DEVIATION: f32 = 26_754.9;
    let bits = mix(u64::from(seed) << 32 | u64::from(count));
    let uniform = |at: u32| i32::from((bits >> (16 * at)) as u16);
    let number = |at| (uniform(at) + uniform(at + 1) - 65_535) as f32 * (1.0 / DEVIATION);
    (number(0), number(2))
}

/// Spreads each bit over all, the finalizer of SplitMix64 (Steele, Lea, Flood: Fast splittable
/// pseudorandom number generators, 2014).
const fn mix(bits: u64) -> u64 {
    let bits = bits.wrapping_add(0x9E37_79B9_7F4A_7C15);
    let bits = (bits ^ (bits >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
    let bits = (bits ^ (bits >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
    bits ^ (bits >> 31)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn noise_has_mean_0_and_deviation_1_and_is_not_its_neighbour() {
        const COUNT: u32 = 100_000;
        let [mut sum, mut squares, mut both, mut next] = [0.0f64; 4];
        for count in 0..COUNT {
            let (a, b) = pair(7, count);
            let (a, b, after) = (f64::from(a), f64::from(b), f64::from(pair(7, count + 1).0));
            sum += a + b;
            squares += a * a + b * b;
            both += a * b;
            next += a * after;
        }
        let count = f64::from(COUNT);
        assert!((sum / count).abs() < 0.01);
        assert!((squares / count - 2.0).abs() < 0.02);
        assert!((both / count).abs() < 0.01 && (next / count).abs() < 0.01);
    }
}
