//! Recordings that may be broken.

use std::collections::BTreeMap;
use std::io::Cursor;

use mcap::records::MessageHeader;
use mcap::{Compression, WriteOptions};
use motorlink_recording::read::Recording;
use motorlink_recording::schema::{
    DiagnosticArray, Frame, JointState, Log, Message, SignalsType, Time,
};

/// Any bytes as a recording. By the index and from the beginning the same messages are found, or a loss
/// is listed.
pub fn recording(data: &[u8]) {
    let read = |recording: Result<Recording<Cursor<&[u8]>>, _>| {
        let mut recording = recording.ok()?;
        let messages: Vec<(u64, Vec<u8>)> = recording
            .messages()
            .map(|message| message.expect("reading from memory does not fail"))
            .map(|message| (message.log_time, message.data().to_vec()))
            .collect();
        let names: Vec<String> = recording.attachments().map(str::to_owned).collect();
        for name in names {
            recording.attachment(&name).expect("reading from memory does not fail");
        }
        let types: Vec<SignalsType> = recording
            .channels()
            .filter_map(|channel| recording.schema(channel))
            .filter_map(|schema| {
                SignalsType::parse(&schema.name, std::str::from_utf8(&schema.data).ok()?)
            })
            .collect();
        for (_, data) in &messages {
            let _ = (Frame::decode(data), Log::decode(data));
            let _ = (JointState::decode(data), DiagnosticArray::decode(data));
            types.iter().for_each(|it| drop(it.decode(data)));
        }
        Some((messages, recording.losses().to_vec()))
    };
    let by_index = read(Recording::new(Cursor::new(data)));
    let checked = read(Recording::checked(Cursor::new(data)));
    assert_eq!(by_index.is_some(), checked.is_some());
    if let (Some((some, losses)), Some((all, found))) = (by_index, checked) {
        assert!(some == all || !losses.is_empty() || !found.is_empty());
    }
}

/// Whole files, with and without compression.
pub fn seeds() -> Vec<Vec<u8>> {
    [None, Some(Compression::Zstd)].map(seed).to_vec()
}

fn seed(compression: Option<Compression>) -> Vec<u8> {
    let mut file = Cursor::new(Vec::new());
    let mut writer = WriteOptions::new()
        .profile("ros2")
        .compression(compression)
        .create(&mut file)
        .expect("memory does not fail");
    let schema = writer
        .add_schema(Log::TYPE, "ros2msg", Log::definition().as_bytes())
        .expect("the first schema");
    let channel_id =
        writer.add_channel(schema, "/events", "cdr", &BTreeMap::new()).expect("the first channel");
    for n in 1..4 {
        let log = Log {
            stamp: Time(n),
            severity: 20.into(),
            name: "st0/motor1".to_owned(),
            message: "started".to_owned(),
            by: String::new(),
            kind: "commanded".to_owned(),
        };
        let header = MessageHeader { channel_id, sequence: 0, log_time: n, publish_time: n };
        writer.write_to_known_channel(&header, &log.encode()).expect("memory does not fail");
        writer.flush().expect("memory does not fail");
    }
    writer.finish().expect("memory does not fail");
    drop(writer);
    file.into_inner()
}
