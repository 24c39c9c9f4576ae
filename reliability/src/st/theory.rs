//! The expected fraction of damaged frames that pass the checksum.

use motorlink_link::fault::Rng;
use motorlink_proto::st::{
    Frame, HEADER_ACK, HEADER_NACK, MAX_FRAME, MotorNumber, Parse, Profile, Slave,
};
use motorlink_proto::time::Instant;

use super::drive::{MOTORS, Memory};
use super::traffic;

/// Number of sampled frames of the mix.
const FRAMES: usize = 400;
/// Number of sampled patterns per frame, if not all are tested.
const TRIED: usize = 200;
/// More wrong bits than this are treated as random.
const MANY: usize = 8;

/// Probability that a request and a reply of the mix pass damaged, at this bit error rate: the
/// probability of k wrong bits times the fraction of k-bit patterns that pass.
pub fn undetected(profile: Profile, rate: f64) -> (f64, f64) {
    let mut rng = Rng::with_seed(1);
    let mut slave = Slave::new(profile, MotorNumber::new(MOTORS).expect("1 to 7"));
    let mut drive = Memory::new();
    let (mut requests, mut replies) = (0.0, 0.0);
    for _ in 0..FRAMES {
        let mut out = [0; MAX_FRAME];
        let request = traffic::next(profile, &mut rng).frame(&mut out).to_vec();
        let mut take = |byte: &u8| slave.receive(Instant(0), *byte, &mut drive).map(<[u8]>::to_vec);
        let reply = request.iter().filter_map(&mut take).last().expect("each frame is answered");
        requests += passes(&request, rate, |_| true, &mut rng);
        // A master accepts only these headers as a reply.
        let reply_header = |header| matches!(header, HEADER_ACK | HEADER_NACK);
        replies += passes(&reply, rate, reply_header, &mut rng);
    }
    (requests / FRAMES as f64, replies / FRAMES as f64)
}

fn passes(frame: &[u8], rate: f64, header: impl Fn(u8) -> bool, rng: &mut Rng) -> f64 {
    let bits = frame.len() * 8;
    // The probability of no wrong bit, then of one more in each step.
    let mut chance = (1.0 - rate).powi(bits as i32);
    let mut left = 1.0 - chance;
    let mut sum = 0.0;
    for wrong in 1..=MANY.min(bits) {
        chance *= (bits - wrong + 1) as f64 / wrong as f64 * rate / (1.0 - rate);
        left -= chance;
        if chance > 1e-12 {
            sum += chance * share(frame, wrong, &header, rng);
        }
    }
    sum + left.max(0.0) / 256.0
}

/// The fraction of the patterns with `wrong` wrong bits that pass. All patterns up to two bits are
/// tested if there are not too many; otherwise a random sample. Frames pass with the headers that
/// `header` accepts.
pub fn share(frame: &[u8], wrong: usize, header: impl Fn(u8) -> bool, rng: &mut Rng) -> f64 {
    let bits = frame.len() * 8;
    let mut damaged = frame.to_vec();
    let mut flip = |pattern: &[usize]| {
        pattern.iter().for_each(|bit| damaged[bit / 8] ^= 1 << (bit % 8));
        let parsed = Frame::parse(&damaged);
        let passes = matches!(parsed, Parse::Frame(frame, _) if header(frame.header));
        pattern.iter().for_each(|bit| damaged[bit / 8] ^= 1 << (bit % 8));
        usize::from(passes)
    };
    let (passed, tried) = match wrong {
        1 => ((0..bits).map(|bit| flip(&[bit])).sum(), bits),
        2 if bits < 400 => {
            let pairs = (0..bits).flat_map(|a| (0..a).map(move |b| [a, b]));
            (pairs.map(|pair| flip(&pair)).sum::<usize>(), bits * (bits - 1) / 2)
        }
        _ => {
            let mut pattern = Vec::with_capacity(wrong);
            let mut passed = 0;
            for _ in 0..TRIED {
                pattern.clear();
                while pattern.len() < wrong {
                    let bit = rng.usize(..bits);
                    if !pattern.contains(&bit) {
                        pattern.push(bit);
                    }
                }
                passed += flip(&pattern);
            }
            (passed, TRIED)
        }
    };
    passed as f64 / tried as f64
}

#[cfg(test)]
mod tests {
    use super::*;

    fn frame(size: usize) -> Vec<u8> {
        let payload: Vec<u8> = (0..size).map(|n| (n * 37 + 11) as u8).collect();
        let mut out = [0; MAX_FRAME];
        Frame { header: 0x21, payload: &payload }.encode(&mut out).unwrap().to_vec()
    }

    /// Two wrong bits cancel if they have the same weight and opposite signs. A frame with a wrong
    /// length never passes. That leaves (m - 1) (m - 2) / (2 m (8 m - 1)) of the pairs in m bytes.
    #[test]
    fn two_wrong_bits_pass_about_one_time_in_sixteen_and_many_one_in_256() {
        let mut rng = Rng::with_seed(1);
        let exact = share(&frame(32), 2, |_| true, &mut rng);
        let closed = 34.0 * 33.0 / (2.0 * 35.0 * 279.0);
        assert!((exact - closed).abs() < 0.01, "{exact}, not about {closed}");
        let many =
            (0..200).map(|_| share(&frame(127), 20, |_| true, &mut rng)).sum::<f64>() / 200.0;
        assert!((0.002..0.006).contains(&many), "{many}, not about 1 in 256");
    }
}
