//! The messages of a share: as docs/SHARE-PROTOCOL.md shows them, in pieces, and damaged.

use motorlink_telemetry::share::data::{Data, DataError};
use motorlink_telemetry::share::frame::{
    Frame, FrameError, FrameKind, HEADER, LONGEST, LONGEST_REQUEST, Reader, append,
};
use motorlink_telemetry::share::message::{EventKind, Request, Text, decode, encode};
use proptest::prelude::*;

const PAGE: &str = include_str!("../../../../docs/SHARE-PROTOCOL.md");

fn stream(payloads: &[(FrameKind, Vec<u8>)]) -> Vec<u8> {
    let mut bytes = Vec::new();
    for (kind, payload) in payloads {
        append(*kind, payload, &mut bytes).unwrap();
    }
    bytes
}

fn texts(begin: &str) -> Vec<&'static str> {
    let found: Vec<_> = PAGE.lines().filter(|line| line.starts_with(begin)).collect();
    assert!(found.len() > 10, "{begin}: {}", found.len());
    found
}

#[test]
fn every_text_of_the_page_is_a_message_and_is_written_the_same() {
    for line in texts("{\"id\"") {
        let request: Request = decode(line.as_bytes()).unwrap();
        assert_eq!(String::from_utf8(encode(&request)).unwrap(), line);
    }
    for line in texts("{\"kind\"") {
        let text: Text = decode(line.as_bytes()).unwrap();
        assert_eq!(String::from_utf8(encode(&text)).unwrap(), line);
    }
}

#[test]
fn the_samples_of_the_page_are_read_and_written_the_same() {
    let is_hex = |line: &&str| line.len() == 47 && line.split(' ').all(|byte| byte.len() == 2);
    let bytes: Vec<u8> = PAGE
        .lines()
        .filter(is_hex)
        .flat_map(|line| line.split(' '))
        .map(|byte| u8::from_str_radix(byte, 16).unwrap())
        .collect();
    let columns = vec![vec![0.0, 0.01], vec![0.001, 0.001], vec![1500.0, 1501.0]];
    let data = Data { group: 1, sequence: 0, lost: 0, t0: 12.25, columns };
    assert_eq!(Data::decode(&bytes), Ok(data.clone()));
    assert_eq!(data.encode(), Some(bytes));
}

#[test]
fn members_of_later_versions_are_ignored() {
    let request: Request =
        decode(br#"{"id":9,"later":[1],"ask":"stop","motor":{"line":"a","motor":1,"x":2}}"#)
            .unwrap();
    assert_eq!(encode(&request), br#"{"id":9,"ask":"stop","motor":{"line":"a","motor":1}}"#);
}

#[test]
fn texts_of_later_versions_are_told_apart_from_damage() {
    let text = |json: &str| decode::<Text>(json.as_bytes());
    assert_eq!(text(r#"{"kind":"news","x":1}"#).unwrap(), Text::Later);
    let event = text(r#"{"kind":"event","wall":1,"event":"landed","message":"it has landed"}"#);
    assert!(matches!(event, Ok(Text::Event(event)) if event.event == EventKind::Later));
    assert!(text(r#"{"kind":7}"#).is_err());
    assert!(text(r#"{"kind":"missed"}"#).is_err());
}

#[test]
fn samples_that_no_message_can_have_are_not_written() {
    let data = |columns| Data { group: 1, sequence: 0, lost: 0, t0: 0.0, columns };
    for columns in [vec![], vec![vec![1.0]], vec![vec![], vec![]], vec![vec![1.0], vec![]]] {
        assert_eq!(data(columns).encode(), None);
    }
}

#[test]
fn samples_of_another_version_are_named() {
    let columns = vec![vec![0.0], vec![0.0]];
    let mut bytes = Data { group: 1, sequence: 0, lost: 0, t0: 0.0, columns }.encode().unwrap();
    bytes[0] = 2;
    assert_eq!(Data::decode(&bytes), Err(DataError::Version(2)));
}

#[test]
fn sizes_have_limits() {
    let mut stream = Vec::new();
    append(FrameKind::Data, &vec![0; LONGEST], &mut stream).unwrap();
    let size = LONGEST + 1;
    let refused = append(FrameKind::Data, &vec![0; size], &mut stream);
    assert_eq!(refused, Err(FrameError::TooLong { size, most: LONGEST }));
    assert_eq!(stream.len(), HEADER + LONGEST);
    let mut reader = Reader::new(LONGEST_REQUEST);
    reader.push(&stream[..HEADER]);
    let most = LONGEST_REQUEST;
    assert_eq!(reader.take(), Err(FrameError::TooLong { size: LONGEST, most }));
    assert_eq!(reader.take(), Err(FrameError::TooLong { size: LONGEST, most }));
}

fn payloads() -> impl Strategy<Value = Vec<(FrameKind, Vec<u8>)>> {
    let kind = prop_oneof![Just(FrameKind::Text), Just(FrameKind::Data)];
    prop::collection::vec((kind, prop::collection::vec(any::<u8>(), 0..40)), 0..5)
}

fn data() -> impl Strategy<Value = Data> {
    let columns = (1..6usize, 2..6usize).prop_flat_map(|(rows, columns)| {
        prop::collection::vec(prop::collection::vec(-1e12..1e12, rows), columns)
    });
    (any::<u32>(), any::<u32>(), any::<u32>(), -1e12..1e12, columns).prop_map(
        |(group, sequence, lost, t0, columns)| Data { group, sequence, lost, t0, columns },
    )
}

proptest! {
    #[test]
    fn a_stream_in_pieces_gives_its_payloads(payloads in payloads(), piece in 1..20usize) {
        let mut reader = Reader::default();
        let mut taken = Vec::new();
        for piece in stream(&payloads).chunks(piece) {
            reader.push(piece);
            while let Some(Frame { kind, payload }) = reader.take().unwrap() {
                taken.push((kind, payload));
            }
        }
        prop_assert_eq!(taken, payloads);
    }

    #[test]
    fn a_part_of_a_message_means_more(payload in prop::collection::vec(any::<u8>(), 0..40)) {
        let bytes = stream(&[(FrameKind::Text, payload)]);
        for end in 0..bytes.len() {
            let mut reader = Reader::default();
            reader.push(&bytes[..end]);
            prop_assert_eq!(reader.take(), Ok(None));
        }
    }

    #[test]
    fn damage_is_an_error_or_another_message(bytes in prop::collection::vec(any::<u8>(), 0..200)) {
        let mut reader = Reader::default();
        reader.push(&bytes);
        while let Ok(Some(_)) = reader.take() {}
        let _ = Data::decode(&bytes);
        let _ = decode::<Request>(&bytes);
        let _ = decode::<Text>(&bytes);
    }

    #[test]
    fn samples_are_read_as_written(data in data(), cut in any::<prop::sample::Index>(), by in any::<u8>()) {
        let mut bytes = data.encode().unwrap();
        prop_assert_eq!(bytes.len() % 8, 0);
        prop_assert_eq!(Data::decode(&bytes), Ok(data));
        let at = cut.index(bytes.len());
        prop_assert!(Data::decode(&bytes[..at]).is_err());
        bytes[at] = by;
        let _ = Data::decode(&bytes);
    }
}
