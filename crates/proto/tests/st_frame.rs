//! Frames under every prefix and bit flips.

use motorlink_proto::st::*;
use proptest::prelude::*;

fn encoded(header: u8, payload: &[u8]) -> Vec<u8> {
    let mut out = [0xA5; MAX_FRAME];
    Frame { header, payload }.encode(&mut out).expect("it fits").to_vec()
}

#[test]
fn a_payload_over_128_bytes_or_a_short_buffer_is_not_encoded() {
    let mut out = [0xA5; 256];
    assert_eq!(Frame { header: 1, payload: &[0; 129] }.encode(&mut out), None);
    assert!(out.iter().all(|&byte| byte == 0xA5));
    for size in 0..7 {
        assert_eq!(Frame { header: 1, payload: &[0; 4] }.encode(&mut out[..size]), None);
    }
}

#[test]
fn the_checksum_folds_the_high_byte_in() {
    assert_eq!(checksum(&[]), 0);
    assert_eq!(checksum(&[0xFF, 0x01, 0x09]), 0x0A);
    assert_eq!(checksum(&[0xFF; 130]), 0xFF);
    assert_eq!(checksum(&[0xFF, 0xFF]), 0xFF);
}

#[test]
#[cfg_attr(miri, ignore = "an interpreter takes long")]
fn every_header_and_length_parses_as_the_document_says() {
    for header in 0..=255u8 {
        for length in 0..=255u8 {
            let expected = if length > 128 { Parse::Bad(Bad::Length(length)) } else { Parse::More };
            assert_eq!(Frame::parse(&[header, length]), expected);
        }
        let frame = Frame { header, payload: &[] };
        assert_eq!(Frame::header(frame.code(), frame.motor()), header);
    }
}

#[test]
#[cfg_attr(miri, ignore = "an interpreter takes long")]
fn every_single_bit_flip_outside_the_length_is_refused() {
    for payload in [&[][..], &[0x1E], &[0xFF; 128], &[0; 128], &[0x5B, 0x40, 0x06, 0, 0]] {
        let frame = encoded(0x21, payload);
        for bit in (0..frame.len() * 8).filter(|bit| bit / 8 != 1) {
            let mut flipped = frame.clone();
            flipped[bit / 8] ^= 1 << (bit % 8);
            assert!(matches!(Frame::parse(&flipped), Parse::Bad(Bad::Checksum { .. })), "{bit}");
        }
    }
}

/// The checksum, computed as paragraph 3.3 describes it.
fn checksum_by_the_words(bytes: &[u8]) -> u8 {
    let accumulator: u32 = bytes.iter().map(|&byte| u32::from(byte)).sum();
    ((accumulator / 256 + accumulator % 256) % 256) as u8
}

proptest! {
    #[test]
    fn every_prefix_means_more(header: u8, payload in proptest::collection::vec(any::<u8>(), 0..=128)) {
        let frame = encoded(header, &payload);
        for cut in 0..frame.len() {
            prop_assert_eq!(Frame::parse(&frame[..cut]), Parse::More);
        }
        let whole = Frame { header, payload: &payload };
        prop_assert_eq!(Frame::parse(&frame), Parse::Frame(whole, frame.len()));
        let followed = [&frame[..], &[0xFF, 0x00]].concat();
        prop_assert_eq!(Frame::parse(&followed), Parse::Frame(whole, frame.len()));
    }

    #[test]
    fn the_checksum_is_that_of_the_document(bytes in proptest::collection::vec(any::<u8>(), 0..=130)) {
        prop_assert_eq!(checksum(&bytes), checksum_by_the_words(&bytes));
    }

    #[test]
    fn a_request_reads_back_what_was_written(
        code in 0u8..32, motor in 0u8..8,
        payload in proptest::collection::vec(any::<u8>(), 0..=128), firmware: bool,
    ) {
        let profile = if firmware { Profile::Mcsdk54 } else { Profile::Spec };
        let header = Frame::header(code, motor);
        let mut out = [0; MAX_FRAME];
        if let Ok(request) = (Frame { header, payload: &payload }).request(profile) {
            let bytes = Frame::command(motor, &request, &mut out).expect("it came from a frame").to_vec();
            let Parse::Frame(frame, _) = Frame::parse(&bytes) else { panic!("not a frame") };
            // Bytes after a message are ignored. NaNs compare unequal as numbers.
            prop_assert!(payload.starts_with(frame.payload));
            prop_assert_eq!(frame.header, header);
        }
    }
}
