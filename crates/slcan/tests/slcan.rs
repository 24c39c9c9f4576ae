//! Both ends of slcan, with recorded lines, with garbage, and with each other.

use motorlink_proto::can::CanFrame;
use motorlink_proto::time::Instant;
use motorlink_slcan::{Answer, Device, HostCodec, LONGEST_FRAME, encode};
use proptest::prelude::*;

fn text(frame: &CanFrame) -> String {
    String::from_utf8_lossy(encode(frame, &mut [0xA5; LONGEST_FRAME])).into_owned()
}

fn answers(codec: &mut HostCodec, bytes: &[u8]) -> Vec<Answer> {
    let mut found = Vec::new();
    for chunk in bytes.chunks(100) {
        codec.spare()[..chunk.len()].copy_from_slice(chunk);
        codec.filled(chunk.len());
        found.extend(std::iter::from_fn(|| codec.answer()));
    }
    found
}

fn say(device: &mut Device, bytes: &str) -> (String, Vec<CanFrame>) {
    let mut reply = Vec::new();
    let frames = bytes
        .bytes()
        .filter_map(|byte| device.receive(byte, |answer| reply.extend_from_slice(answer)))
        .collect();
    (String::from_utf8(reply).expect("slcan is ASCII"), frames)
}

fn deliver(device: &Device, now: u64, frame: &CanFrame, heard: &mut Vec<u8>) {
    device.deliver(Instant(now), frame, |line| heard.extend_from_slice(line));
}

fn status_request() -> CanFrame {
    CanFrame::new(0x141, [0x9C, 0, 0, 0, 0, 0, 0, 0])
}

#[test]
fn frames_are_written_like_recorded_ones() {
    for (frame, line) in [
        (status_request(), "t14189C00000000000000\r"),
        (CanFrame::data_frame(0x7FF, false, &[]), "t7FF0\r"),
        (CanFrame::data_frame(0x1ABC_DEF0, true, &[0xFE, 1]), "T1ABCDEF02FE01\r"),
        (CanFrame::remote_frame(0x123, false, 8), "r1238\r"),
        (CanFrame::remote_frame(0x123, true, 3), "R000001233\r"),
    ] {
        assert_eq!(text(&frame), line);
        let mut codec = HostCodec::default();
        let either_case = format!("{line}{}{}", &line[..1], line[1..].to_ascii_lowercase());
        assert_eq!(answers(&mut codec, either_case.as_bytes()), [Answer::Frame(frame); 2]);
    }
}

#[test]
fn the_host_parses_every_answer_of_an_adapter() {
    let mut codec = HostCodec::default();
    assert_eq!(
        answers(&mut codec, b"\rz\rZ\r\x07V1013\rNA123\rF00\r\r\nt12311A1234\r"),
        [
            Answer::Done,
            Answer::Done,
            Answer::Done,
            Answer::Refused,
            Answer::Info,
            Answer::Info,
            Answer::Info,
            Answer::Done,
            Answer::Frame(CanFrame::data_frame(0x123, false, &[0x1A])),
        ]
    );
    assert_eq!(codec.garbage(), 0);
}

#[test]
fn the_host_counts_garbage_and_finds_the_next_frame() {
    let frame = text(&status_request());
    for garbage in [
        "$GPRMC,1,2\r",
        "t1419000\r",
        "t8001AA\r",
        "t14190011223344556677\r",
        "t1411AA123\r",
        "tXYZ0\r",
        "T2000000000\r",
        "t141\x07",
        "0123456789012345678901234567890123456789\r",
    ] {
        let mut codec = HostCodec::default();
        let found = answers(&mut codec, format!("{garbage}{frame}").as_bytes());
        assert_eq!(found.last(), Some(&Answer::Frame(status_request())), "{garbage:?}");
        assert_eq!(codec.garbage(), 1, "{garbage:?}");
    }
}

#[test]
fn every_prefix_of_a_frame_waits_for_more() {
    let line = text(&status_request());
    for end in 0..line.len() {
        let mut codec = HostCodec::default();
        assert_eq!(answers(&mut codec, &line.as_bytes()[..end]), []);
        assert_eq!(answers(&mut codec, &line.as_bytes()[end..]), [Answer::Frame(status_request())]);
    }
}

#[test]
fn the_device_answers_a_host_that_opens_drives_and_closes() {
    let mut device = Device::default();
    let exchange = |device: &mut Device, line: &str| say(device, line).0;
    for (line, answer) in [
        ("t14189C00000000000000\r", "\x07"), // not open yet
        ("F\r", "\x07"),
        ("C\r", "\r"),
        ("S9\r", "\x07"),
        ("Sx\r", "\x07"),
        ("S8\r", "\r"),
        ("s031C\r", "\r"),
        ("M00000000\r", "\r"),
        ("mFFFFFFFF\r", "\r"),
        ("\r", "\r"),
        ("V\r", "V1010\r"),
        ("N\r", "NML01\r"),
        ("X1\r", "\r"),
        ("O\r", "\r"),
        ("O\r", "\r"),
        ("S8\r", "\x07"), // open
        ("F\r", "F00\r"),
        ("Q\r", "\x07"),
        ("t14189C0000000000000\r", "\x07"),
        ("t14189C000000000000000\r", "\x07"),
        ("0123456789012345678901234567890123456789\r", "\x07"),
        ("L\r", "\r"),
        ("r1418\r", "\x07"), // listens only
        ("C\r", "\r"),
    ] {
        assert_eq!(exchange(&mut device, line), answer, "{line:?}");
    }
}

#[test]
fn the_device_passes_frames_in_both_directions_while_it_is_open() {
    let mut device = Device::default();
    let mut heard = Vec::new();
    deliver(&device, 0, &status_request(), &mut heard);
    assert!(heard.is_empty(), "a closed channel is silent");

    let (answer, frames) = say(&mut device, "O\rt14189c00000000000000\rR000001238\r");
    assert_eq!(answer, "\rz\rZ\r");
    assert_eq!(frames, [status_request(), CanFrame::remote_frame(0x123, true, 8)]);

    deliver(&device, 0, &status_request(), &mut heard);
    say(&mut device, "Z1\r");
    deliver(&device, 60_255_999, &CanFrame::data_frame(1, false, &[]), &mut heard);
    assert_eq!(String::from_utf8_lossy(&heard), "t14189C00000000000000\rt001000FF\r");
}

proptest! {
    #[test]
    fn a_frame_is_transmitted_from_device_to_host_and_back(
        id: u32, extended: bool, remote: bool, bytes in prop::collection::vec(any::<u8>(), 0..=8),
    ) {
        let frame = if remote {
            CanFrame::remote_frame(id, extended, bytes.len() as u8)
        } else {
            CanFrame::data_frame(id, extended, &bytes)
        };
        let mut device = Device::default();
        let mut wire = Vec::new();
        say(&mut device, "O\rZ1\r");
        deliver(&device, id.into(), &frame, &mut wire);
        prop_assert_eq!(answers(&mut HostCodec::default(), &wire), [Answer::Frame(frame)]);
        prop_assert_eq!(say(&mut device, &text(&frame)).1, [frame]);
    }

    #[test]
    fn after_any_garbage_the_second_line_is_parsed(
        garbage in prop::collection::vec(any::<u8>(), 0..700),
    ) {
        let mut codec = HostCodec::default();
        answers(&mut codec, &garbage);
        let found = answers(&mut codec, format!("\r{}", text(&status_request())).as_bytes());
        prop_assert_eq!(found.last(), Some(&Answer::Frame(status_request())));

        let mut device = Device::default();
        let mut reply = Vec::new();
        for byte in garbage {
            device.receive(byte, |answer| reply.extend_from_slice(answer));
        }
        prop_assert!(say(&mut device, "\rO\rt0010\r").1.len() == 1);
    }
}
