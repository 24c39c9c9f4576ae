//! Recordings that somebody has put one behind the other. Each numbers its channels from the start.

use std::collections::BTreeMap;
use std::io::Cursor;

use mcap::records::MessageHeader;
use motorlink_proto::st::MotorNumber;
use motorlink_recording::read::{Damage, Recording, Tables};
use motorlink_recording::schema::{SignalsRow, SignalsType, Time, name};
use motorlink_telemetry::signal::{Motor, Signal};

use super::files::{chunk_starts, compressed};

/// A recording of one signal with one value, in as many chunks.
fn recorded(signal: &str, value: f64, chunks: u64) -> Vec<u8> {
    let motor = Motor::St(MotorNumber::FIRST);
    let topic = name::signals_topic("st0", motor, None);
    let ty = SignalsType::new(&topic, &[Signal::named(motor, signal).unwrap()]);
    let mut file = Cursor::new(Vec::new());
    let mut writer = compressed().create(&mut file).unwrap();
    let schema = writer.add_schema(ty.name(), "ros2msg", ty.definition().as_bytes()).unwrap();
    let channel_id = writer.add_channel(schema, &topic, "cdr", &BTreeMap::new()).unwrap();
    for n in 0..chunks {
        let row = SignalsRow { stamp: Time(n), span_s: 0.0, values: vec![value] };
        let header = MessageHeader { channel_id, sequence: 0, log_time: n, publish_time: n };
        writer.write_to_known_channel(&header, &ty.encode(&row)).unwrap();
        writer.flush().unwrap();
    }
    writer.finish().unwrap();
    drop(writer);
    file.into_inner()
}

fn tables(file: &[u8]) -> Tables {
    Recording::new(Cursor::new(file)).unwrap().tables(|_, _| true).unwrap()
}

/// The values of each signal.
fn values(file: &[u8]) -> Vec<(String, Vec<f64>)> {
    let columns = tables(file).tables.into_iter();
    columns.map(|table| (table.fields[0].signal.clone(), table.columns[0].clone())).collect()
}

fn expected() -> Vec<(String, Vec<f64>)> {
    [("SPEED_MEAS", 1500.0), ("BUS_VOLTAGE", 24.0)]
        .map(|(signal, value)| (signal.to_owned(), vec![value; 2]))
        .to_vec()
}

#[test]
fn signals_of_an_appended_recording_keep_their_names() {
    let (speed, voltage) = (recorded("SPEED_MEAS", 1500.0, 2), recorded("BUS_VOLTAGE", 24.0, 2));
    assert_eq!(values(&[&speed[..], &voltage].concat()), expected());
    // The first one was not finished.
    let data_end = [0x0F, 4, 0, 0, 0, 0, 0, 0, 0];
    let end = speed.windows(9).position(|bytes| bytes == data_end).unwrap();
    assert_eq!(values(&[&speed[..end], &voltage].concat()), expected());
    // Nor was the second one.
    let end = voltage.windows(9).position(|bytes| bytes == data_end).unwrap();
    assert_eq!(values(&[&speed[..], &voltage[..end]].concat()), expected());
}

#[test]
fn what_is_repaired_of_several_recordings_keeps_its_names() {
    let file = [recorded("SPEED_MEAS", 1500.0, 2), recorded("BUS_VOLTAGE", 24.0, 2)].concat();
    let mut whole = Vec::new();
    assert_eq!(Recording::new(Cursor::new(file)).unwrap().write_to(&mut whole).unwrap(), 4);
    assert_eq!(values(&whole), expected());
    let mut recording = Recording::checked(Cursor::new(&whole)).unwrap();
    assert_eq!(recording.losses(), []);
    let counts: Vec<u64> = recording.channels().map(|channel| recording.count(channel)).collect();
    assert_eq!(counts, [2, 2]);
    assert_eq!(recording.messages().count(), 4);
}

#[test]
fn messages_whose_description_is_damaged_are_not_those_of_the_next_recording() {
    let (mut speed, voltage) =
        (recorded("SPEED_MEAS", 1500.0, 2), recorded("BUS_VOLTAGE", 24.0, 2));
    let first = chunk_starts(&speed)[0];
    speed[first + 60] ^= 0x10;
    let file = [speed, voltage].concat();
    assert_eq!(values(&file), expected()[1..]);
    let mut recording = Recording::new(Cursor::new(&file)).unwrap();
    assert_eq!(recording.messages().count(), 2);
    let unknown = recording.losses().iter().any(|loss| loss.damage == Damage::UnknownChannel);
    assert!(unknown, "{:?}", recording.losses());
}

#[test]
fn equal_recordings_share_their_channels() {
    let file = recorded("SPEED_MEAS", 1500.0, 2);
    let file = [&file[..], &file].concat();
    assert_eq!(values(&file), [("SPEED_MEAS".to_owned(), vec![1500.0; 4])]);
    assert_eq!(Recording::new(Cursor::new(file)).unwrap().channels().count(), 1);
}
