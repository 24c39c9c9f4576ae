//! Signals as columns.

use std::collections::BTreeMap;
use std::io::Cursor;

use mcap::records::MessageHeader;
use motorlink_proto::st::MotorNumber;
use motorlink_recording::read::{Content, Recording};
use motorlink_recording::schema::{Log, Message, Severity, SignalsRow, SignalsType, Time, name};
use motorlink_telemetry::signal::{Motor, Signal};

use super::files::compressed;

const START: u64 = 1_700_000_000_000_000_000;

/// A motor whose rows are not in the order of time, an event, and a message that is no row.
fn recorded() -> Vec<u8> {
    let motor = Motor::St(MotorNumber::new(1).unwrap());
    let topic = name::signals_topic("st0", motor, None);
    let signals = ["SPEED_MEAS", "BUS_VOLTAGE"].map(|name| Signal::named(motor, name).unwrap());
    let ty = SignalsType::new(&topic, &signals);
    let mut file = Cursor::new(Vec::new());
    let mut writer = compressed().create(&mut file).unwrap();
    let mut add = |name: &str, definition: &str, topic: &str| {
        let schema = writer.add_schema(name, "ros2msg", definition.as_bytes()).unwrap();
        writer.add_channel(schema, topic, "cdr", &BTreeMap::new()).unwrap()
    };
    let rows = add(ty.name(), &ty.definition(), &topic);
    let events = add(Log::TYPE, &Log::definition(), name::EVENTS);
    let row = |n: u64, values: [f64; 2]| {
        let stamp = Time(START + n);
        ty.encode(&SignalsRow { stamp, span_s: n as f64, values: values.to_vec() })
    };
    let event = Log {
        stamp: Time(START + 2),
        severity: Severity::Info,
        name: "st0/motor1".to_owned(),
        message: "started".to_owned(),
        by: "here".to_owned(),
        kind: "commanded".to_owned(),
    };
    let sent = [
        (rows, row(1, [100.0, 24.0])),
        (rows, row(3, [300.0, f64::NAN])),
        (events, event.encode()),
        (rows, row(2, [200.0, 25.0])),
        (rows, vec![0, 1, 0, 0, 5]),
    ];
    for (channel_id, data) in sent {
        let header =
            MessageHeader { channel_id, sequence: 0, log_time: START, publish_time: START };
        writer.write_to_known_channel(&header, &data).unwrap();
    }
    writer.finish().unwrap();
    drop(writer);
    file.into_inner()
}

#[test]
fn a_topic_is_a_table_with_a_column_for_each_signal() {
    let mut recording = Recording::new(Cursor::new(recorded())).unwrap();
    let read = recording.tables(|_, _| true).unwrap();
    let table = &read.tables[0];
    assert_eq!((&*table.topic, table.motor()), ("/st0/motor1/signals", "st0/motor1"));
    let names: Vec<(&str, &str)> =
        table.fields.iter().map(|field| (&*field.signal, &*field.unit)).collect();
    assert_eq!(names, [("SPEED_MEAS", "rpm"), ("BUS_VOLTAGE", "V")]);
    assert_eq!(read.first, Some(START + 1));
    assert_eq!(table.times, [START + 1, START + 2, START + 3]);
    assert_eq!(table.spans, [1.0, 2.0, 3.0]);
    assert_eq!(table.columns[0], [100.0, 200.0, 300.0]);
    assert_eq!(table.columns[1][..2], [24.0, 25.0]);
    assert!(table.columns[1][2].is_nan());
    assert_eq!((read.events.len(), &*read.events[0].kind), (1, "commanded"));
    assert_eq!(read.malformed, 1);
}

#[test]
fn signals_are_chosen() {
    let mut recording = Recording::new(Cursor::new(recorded())).unwrap();
    let read = recording.tables(|_, field| field.signal == "BUS_VOLTAGE").unwrap();
    assert_eq!((read.tables[0].fields.len(), read.tables[0].columns[0][1]), (1, 25.0));
    assert!(recording.tables(|_, _| false).unwrap().tables.is_empty());
}

#[test]
fn messages_are_decoded_as_their_types() {
    let mut recording = Recording::new(Cursor::new(recorded())).unwrap();
    let types = recording.types();
    let contents: Vec<_> =
        recording.messages().map(|message| types.content(&message.unwrap())).collect();
    assert!(matches!(&contents[0], Ok(Content::Signals(row)) if row.values == [100.0, 24.0]));
    assert!(matches!(&contents[2], Ok(Content::Event(event)) if event.message == "started"));
    assert!(contents[4].is_err());
}
