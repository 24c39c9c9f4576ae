//! Small recordings in memory.

use std::collections::BTreeMap;
use std::io::{Cursor, Read, Seek};

use mcap::records::MessageHeader;
use mcap::{Compression, WriteOptions, Writer};
use motorlink_recording::read::{Loss, Recording};

/// Messages in each chunk of a file.
pub const IN_A_CHUNK: u64 = 5;

/// A message: topic, log time, content.
pub type Sent = (String, u64, Vec<u8>);

pub fn options() -> WriteOptions {
    WriteOptions::new().profile("ros2").library("test").compression(None)
}

pub fn compressed() -> WriteOptions {
    options().compression(Some(Compression::Zstd))
}

/// The `n`th message.
fn message(n: u64) -> Sent {
    let topic = format!("/topic{}", n % 2);
    let content = format!("message {n} {}", "abc".repeat(n as usize % 7));
    (topic, 1_700_000_000_000_000_000 + n * 1_000_000, content.into_bytes())
}

/// As many messages as are in these chunks.
pub fn messages(chunks: u64) -> Vec<Sent> {
    (0..chunks * IN_A_CHUNK).map(message).collect()
}

/// Writes chunks, an attachment and metadata. Does not finish. Returns the number of the first channel.
pub fn write<W: std::io::Write + Seek>(writer: &mut Writer<W>, chunks: u64) -> u16 {
    let values = BTreeMap::from([("version".to_owned(), "1".to_owned())]);
    writer
        .write_metadata(&mcap::records::Metadata { name: "motorlink".into(), metadata: values })
        .unwrap();
    let attachment = mcap::Attachment {
        log_time: 1,
        create_time: 2,
        name: "st0_motor1.toml".into(),
        media_type: "application/toml".into(),
        data: b"[settings]\n".as_slice().into(),
    };
    writer.attach(&attachment).unwrap();
    let schema = writer.add_schema("test/msg/Text", "ros2msg", b"string text").unwrap();
    let ids: Vec<u16> = ["/topic0", "/topic1"]
        .iter()
        .map(|topic| writer.add_channel(schema, topic, "cdr", &BTreeMap::new()).unwrap())
        .collect();
    for chunk in 0..chunks {
        for n in chunk * IN_A_CHUNK..(chunk + 1) * IN_A_CHUNK {
            let (topic, log_time, data) = message(n);
            let channel_id = ids[usize::from(topic == "/topic1")];
            let header =
                MessageHeader { channel_id, sequence: n as u32, log_time, publish_time: log_time };
            writer.write_to_known_channel(&header, &data).unwrap();
        }
        writer.flush().unwrap();
    }
    ids[0]
}

/// A finished file.
pub fn finished(options: WriteOptions, chunks: u64) -> Vec<u8> {
    let mut file = Cursor::new(Vec::new());
    let mut writer = options.create(&mut file).unwrap();
    write(&mut writer, chunks);
    writer.finish().unwrap();
    drop(writer);
    file.into_inner()
}

/// Where each chunk of a file begins, and where the data ends.
pub fn chunk_starts(file: &[u8]) -> Vec<usize> {
    let summary = mcap::Summary::read(file).unwrap().unwrap();
    let mut starts: Vec<usize> =
        summary.chunk_indexes.iter().map(|chunk| chunk.chunk_start_offset as usize).collect();
    starts.sort_unstable();
    starts
}

/// What a reader gives: the messages, and what it lost.
pub fn all<R: Read + Seek>(mut recording: Recording<R>) -> (Vec<Sent>, Vec<Loss>) {
    let messages = recording
        .messages()
        .map(|message| message.unwrap())
        .map(|message| (message.channel.topic.clone(), message.log_time, message.data().to_vec()))
        .collect();
    (messages, recording.losses().to_vec())
}

pub fn read(file: &[u8]) -> (Vec<Sent>, Vec<Loss>) {
    all(Recording::new(Cursor::new(file)).unwrap())
}

pub fn check(file: &[u8]) -> (Vec<Sent>, Vec<Loss>) {
    all(Recording::checked(Cursor::new(file)).unwrap())
}
