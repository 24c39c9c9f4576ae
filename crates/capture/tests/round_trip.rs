//! What is written in a format is read from it again; any bytes are read without a panic.

use std::sync::Arc;

use motorlink_capture::{
    Captured, Damage, Direction, FdFrame, Format, Plain, Reader, Stamp, Wire, Writer, rmd, st,
};
use motorlink_proto::can::CanFrame;
use motorlink_proto::st::Profile;
use proptest::prelude::*;

/// Formats that are written.
const WRITTEN: [Format; 3] = [Format::Candump, Format::Asc, Format::Pcapng];

fn read(bytes: &[u8], format: Option<Format>) -> Vec<Captured> {
    let mut entries = Vec::new();
    let mut reader = match Reader::new(bytes, format, Plain::Can(Some(0x141))) {
        Ok(reader) => reader,
        Err(_) => return entries,
    };
    while let Some(entry) = reader.next().expect("a slice can be read") {
        entries.push(entry);
    }
    entries
}

fn written(format: Format, entries: &[Captured]) -> Vec<u8> {
    let mut writer = Writer::new(format, Vec::new()).unwrap().expect("it is written");
    for entry in entries {
        writer.write(entry).expect("the format has it");
    }
    writer.into_inner().unwrap()
}

fn entry(us: i64, direction: Option<Direction>, wire: Wire) -> Captured {
    let time = Some(Stamp::Wall((1_436_509_053_000_000 + us) * 1_000));
    Captured { place: 0, time, channel: Some(Arc::from("can0")), direction, wire }
}

fn any_frame() -> impl Strategy<Value = Wire> {
    let data = prop::collection::vec(any::<u8>(), 0..=8);
    let classic = (any::<u32>(), any::<bool>(), data)
        .prop_map(|(id, extended, data)| Wire::Can(CanFrame::data_frame(id, extended, &data)));
    let remote = (any::<u32>(), any::<bool>(), 0u8..=8)
        .prop_map(|(id, extended, len)| Wire::Can(CanFrame::remote_frame(id, extended, len)));
    let sizes = prop::sample::select(vec![0usize, 1, 8, 12, 16, 20, 24, 32, 48, 64]);
    let fd = (any::<u32>(), any::<bool>(), 0u8..=3, sizes, any::<u8>()).prop_map(
        |(id, extended, flags, len, byte)| {
            let id = if extended { id & 0x1FFF_FFFF } else { id & 0x7FF };
            Wire::Fd(Box::new(FdFrame { id, extended, flags, data: vec![byte; len] }))
        },
    );
    prop_oneof![classic, remote, fd]
}

fn any_entries() -> impl Strategy<Value = Vec<Captured>> {
    let direction = prop::sample::select(vec![Direction::Sent, Direction::Received]);
    let one = (0i64..1 << 40, direction, any_frame())
        .prop_map(|(us, direction, wire)| entry(us, Some(direction), wire));
    prop::collection::vec(one, 1..20).prop_map(|mut entries| {
        entries.sort_by_key(|entry| entry.time.map(Stamp::ns));
        entries
    })
}

proptest! {
    #[test]
    fn what_is_written_is_read_again(entries in any_entries()) {
        let start = entries[0].time.map_or(0, Stamp::ns);
        for format in WRITTEN {
            let bytes = written(format, &entries);
            let again = read(&bytes, None);
            prop_assert_eq!(again.len(), entries.len(), "{}", format);
            for (wanted, found) in entries.iter().zip(&again) {
                prop_assert_eq!(&found.wire, &wanted.wire, "{}", format);
                prop_assert_eq!(found.direction, wanted.direction);
                match format {
                    // Times count from the first entry, and channels have numbers.
                    Format::Asc => prop_assert_eq!(
                        found.time,
                        Some(Stamp::Relative(wanted.time.map_or(0, Stamp::ns) - start))
                    ),
                    _ => prop_assert_eq!((found.time, &found.channel), (wanted.time, &wanted.channel)),
                }
            }
        }
    }

    #[test]
    fn any_bytes_are_read_and_decoded(bytes in prop::collection::vec(any::<u8>(), 0..400)) {
        stands(&bytes);
    }

    #[test]
    fn a_file_survives_flipped_bits(entries in any_entries(), bit in any::<prop::sample::Index>()) {
        for format in WRITTEN {
            let mut bytes = written(format, &entries);
            let at = bit.index(8 * bytes.len());
            bytes[at / 8] ^= 1 << (at % 8);
            stands(&bytes);
        }
    }
}

/// Reads the bytes as every format, and decodes what is read with both protocols.
fn stands(bytes: &[u8]) {
    for format in Format::ALL.map(Some).into_iter().chain([None]) {
        let mut motors = rmd::Decoder::new();
        let mut line = st::Decoder::new(Profile::Spec);
        for entry in read(bytes, format) {
            if let Some((_, described)) = motors.decode(&entry) {
                assert!(!described.to_string().contains(char::is_control));
            }
            line.decode(&entry, |_, _, item| assert!(!format!("{item:?}").is_empty()));
            if let Wire::Damage(damage) = &entry.wire {
                assert!(!damage.to_string().contains(char::is_control), "{damage}");
            }
        }
        line.end(|_, _, _| {});
    }
}

#[test]
fn every_prefix_of_a_file_is_read_as_far_as_it_goes() {
    let frame = |n: u8| Wire::Can(CanFrame::new(0x141, [0x9A, n, 0, 0, 0, 0, 0, 0]));
    let entries: Vec<Captured> =
        (0..4).map(|n| entry(n.into(), Some(Direction::Received), frame(n))).collect();
    for format in WRITTEN {
        let bytes = written(format, &entries);
        for len in 0..bytes.len() {
            let found = read(&bytes[..len], None);
            let whole = found.iter().filter(|entry| matches!(entry.wire, Wire::Can(_))).count();
            let is_damaged = found.iter().any(|entry| matches!(entry.wire, Wire::Damage(_)));
            assert!(whole <= entries.len(), "{format} {len}");
            for (wanted, found) in entries.iter().zip(&found).take(whole.saturating_sub(1)) {
                assert_eq!(found.wire, wanted.wire, "{format} {len}");
            }
            // A binary file does not end within a packet without a word.
            let is_cut = format == Format::Pcapng && len > 28 && whole < entries.len();
            assert!(!is_cut || is_damaged || ends_at_a_block(&bytes[..len]), "{format} {len}");
        }
    }
}

/// Whether a little-endian pcapng file ends where a block ends.
fn ends_at_a_block(mut bytes: &[u8]) -> bool {
    while let Some((head, _)) = bytes.split_first_chunk::<8>() {
        let size = u32::from_le_bytes([head[4], head[5], head[6], head[7]]) as usize;
        let Some(rest) = bytes.get(size..) else { return false };
        bytes = rest;
    }
    bytes.is_empty()
}

#[test]
fn a_serial_line_goes_through_pcapng() {
    let wire = |bytes: &[u8]| Wire::Serial(bytes.to_vec());
    let entries = [
        entry(0, Some(Direction::Sent), wire(&[0x22, 0x01])),
        entry(1, Some(Direction::Sent), wire(&[0x1E, 0x41])),
        entry(900, Some(Direction::Received), wire(&[0xF0, 0x04, 0xCE, 0x07, 0, 0, 0xCA])),
    ];
    let again = read(&written(Format::Pcapng, &entries), None);
    assert!(again.iter().map(|entry| &entry.wire).eq(entries.iter().map(|entry| &entry.wire)));
    let mut line = st::Decoder::new(Profile::Spec);
    let mut said = Vec::new();
    for entry in &again {
        line.decode(entry, |_, _, item| {
            let st::Item::Message(message) = item else { panic!("{item:?}") };
            said.push(message.to_string());
        });
    }
    assert_eq!(said, ["GET_REG SPEED_MEAS, motor 1", "ACK 1998 rpm"]);
    let mut writer = Writer::new(Format::Candump, Vec::new()).unwrap().unwrap();
    assert!(writer.write(&entries[0]).is_err());
}

#[test]
fn a_pause_ends_a_frame_of_a_serial_line() {
    let entries = [
        entry(0, None, Wire::Serial(vec![0x22, 0x01])),
        entry(200_000, None, Wire::Serial(vec![0x22, 0x01, 0x1E, 0x41])),
    ];
    let mut line = st::Decoder::new(Profile::Spec);
    let mut said = Vec::new();
    for entry in &entries {
        line.decode(entry, |_, bytes, item| said.push((bytes.len(), format!("{item:?}"))));
    }
    assert_eq!(said[0], (2, "Broken(Incomplete(4))".to_owned()));
    assert_eq!((said.len(), said[1].0), (2, 4));
}

#[test]
fn lost_frames_and_big_endian_files_are_read() {
    // A section in big-endian with a CAN interface, and a packet behind three lost ones.
    let mut file = Vec::new();
    let mut block = |kind: u32, body: &[u8]| {
        let length = (body.len() as u32 + 12).to_be_bytes();
        file.extend(kind.to_be_bytes());
        file.extend(length);
        file.extend(body);
        file.extend(length);
    };
    block(0x0A0D_0D0A, &[&0x1A2B_3C4Du32.to_be_bytes()[..], &[0, 1, 0, 0], &[0xFF; 8]].concat());
    // Times in 2^-10 s, counted from 1 000 000 000 s.
    let offset = 1_000_000_000i64.to_be_bytes();
    let options =
        [&[0, 9, 0, 1, 0x8A, 0, 0, 0][..], &[0, 14, 0, 8], &offset, &[0, 0, 0, 0]].concat();
    block(1, &[&227u16.to_be_bytes()[..], &[0; 6], &options].concat());
    let packet = [0, 0, 1, 0x41, 8, 0, 0, 0, 0x9A, 25, 0, 240, 0, 0, 0, 0];
    let numbers = [0u32, 0, 1536, 16, 16].map(u32::to_be_bytes).concat();
    let options = [&[0, 4, 0, 8][..], &3u64.to_be_bytes(), &[0, 0, 0, 0]].concat();
    block(6, &[&numbers[..], &packet, &options].concat());
    let found = read(&file, None);
    assert_eq!(found[0].wire, Wire::Damage(Damage::Dropped(3)));
    assert_eq!(found[1].time, Some(Stamp::Wall(1_000_000_001_500_000_000)));
    assert_eq!(found[1].wire, Wire::Can(CanFrame::new(0x141, [0x9A, 25, 0, 240, 0, 0, 0, 0])));
}
