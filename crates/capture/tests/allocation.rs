//! Frames of a log are decoded without an allocation.

use std::fmt::Write;

use motorlink_capture::{Plain, Reader, rmd};

#[test]
fn a_frame_of_a_log_is_decoded_without_an_allocation() {
    let line = "(1436509053.249713) can0 141#9A1900F000000009\n";
    let log = line.repeat(1_000);
    let mut reader = Reader::new(log.as_bytes(), None, Plain::Can(None)).unwrap();
    let mut decoder = rmd::Decoder::new();
    let mut text = String::with_capacity(1_000);
    let mut decode = |reader: &mut Reader<&[u8]>| {
        let Some(entry) = reader.next().unwrap() else { return false };
        let (_, described) = decoder.decode(&entry).unwrap();
        text.clear();
        write!(text, "{described}").unwrap();
        true
    };
    // The channel and its bus are new with the first frame.
    assert!(decode(&mut reader));
    let counted = allocation_counter::measure(|| while decode(&mut reader) {});
    assert_eq!(counted.count_total, 0);
}
