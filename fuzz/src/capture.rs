//! Captures in every format.

use motorlink_capture::{Format, Plain, Reader, Wire, rmd, st};
use motorlink_proto::st::Profile;

/// Any bytes as a file of each format, decoded with both protocols.
pub fn decode(data: &[u8]) {
    for format in Format::ALL.map(Some).into_iter().chain([None]) {
        for plain in [Plain::Serial, Plain::Can(Some(0x141))] {
            read(data, format, plain);
        }
    }
}

fn read(data: &[u8], format: Option<Format>, plain: Plain) {
    let Ok(mut reader) = Reader::new(data, format, plain) else { return };
    let mut motors = rmd::Decoder::new();
    let mut line = st::Decoder::new(Profile::Spec);
    let (mut passed, mut said) = (0, 0);
    let mut note = |bytes: &[u8], item: st::Item<'_>| {
        said += bytes.len();
        let text = match item {
            st::Item::Message(message) => {
                assert!(message.values().len() < 40);
                message.to_string()
            }
            st::Item::Broken(why) => why.to_string(),
        };
        shown(&text);
    };
    while let Some(entry) = reader.next().expect("a slice can be read") {
        if let Some(channel) = &entry.channel {
            shown(channel);
        }
        match &entry.wire {
            Wire::Serial(bytes) => passed += bytes.len(),
            Wire::Damage(damage) => shown(&damage.to_string()),
            _ => {}
        }
        if let Some((way, described)) = motors.decode(&entry) {
            assert_eq!(way.direction, described.direction());
            shown(&described.to_string());
        }
        line.decode(&entry, |_, bytes, item| note(bytes, item));
    }
    line.end(|_, bytes, item| note(bytes, item));
    assert_eq!(said, passed, "every byte of a line is in one frame, or is damage");
}

fn shown(text: &str) {
    assert!(!text.contains(char::is_control), "{text:?} commands a terminal");
}
