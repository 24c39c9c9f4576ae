//! Messages as the types of the schema, and signals as columns.

use std::collections::BTreeMap;
use std::io::{self, Read, Seek};

use super::message::Message;
use super::recording::Recording;
use crate::schema::{
    DiagnosticArray, Frame, JointState, Log, MESSAGE_ENCODING, Malformed, Message as _,
    SCHEMA_ENCODING, SignalField, SignalsRow, SignalsType,
};

/// A decoded message.
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
pub enum Content {
    /// Values of one instant; [`Types::signals`] has their names and units.
    Signals(SignalsRow),
    /// A frame on the wire.
    Frame(Frame),
    /// Position, speed and current of a motor.
    JointState(JointState),
    /// State and faults of motors as text.
    Diagnostics(DiagnosticArray),
    /// Something that happened.
    Event(Log),
    /// A message of a type that this program does not know.
    Other,
}

/// The types of the channels of a recording, to decode its messages.
#[derive(Debug, Clone, Default)]
pub struct Types(BTreeMap<u16, Type>);

#[derive(Debug, Clone)]
enum Type {
    Signals(SignalsType),
    Frame,
    JointState,
    Diagnostics,
    Event,
}

impl Types {
    /// The signals of a channel.
    pub fn signals(&self, channel: u16) -> Option<&SignalsType> {
        match self.0.get(&channel) {
            Some(Type::Signals(signals)) => Some(signals),
            _ => None,
        }
    }

    /// Decodes a message.
    ///
    /// # Errors
    /// It is not of the type of its channel.
    pub fn content(&self, message: &Message) -> Result<Content, Malformed> {
        let data = message.data();
        Ok(match self.0.get(&message.channel.id) {
            Some(Type::Signals(signals)) => Content::Signals(signals.decode(data)?),
            Some(Type::Frame) => Content::Frame(Frame::decode(data)?),
            Some(Type::JointState) => Content::JointState(JointState::decode(data)?),
            Some(Type::Diagnostics) => Content::Diagnostics(DiagnosticArray::decode(data)?),
            Some(Type::Event) => Content::Event(Log::decode(data)?),
            None => Content::Other,
        })
    }
}

/// The signals of one topic: a column for each, and the time of each row.
#[derive(Debug, Clone, PartialEq)]
pub struct Table {
    /// For example `/st0/motor1/signals`.
    pub topic: String,
    /// Names and units of the columns.
    pub fields: Vec<SignalField>,
    /// The time of each row, ns since 1970.
    pub times: Vec<u64>,
    /// The time between the first request and the last reply of each row, s.
    pub spans: Vec<f64>,
    /// The values of each signal. NaN: no value at this time.
    pub columns: Vec<Vec<f64>>,
}

impl Table {
    /// Motor and port, for example `st0/motor1`.
    pub fn motor(&self) -> &str {
        let path = self.topic.trim_start_matches('/');
        path.rsplit_once('/').map_or(path, |(motor, _)| motor)
    }
}

/// What a recording has of signals and events.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Tables {
    /// Time of the first row of all signals, chosen or not, ns since 1970.
    pub first: Option<u64>,
    /// A table for each topic with signals.
    pub tables: Vec<Table>,
    /// What happened, in the order of time.
    pub events: Vec<Log>,
    /// Messages that are not of the type of their topic.
    pub malformed: u64,
}

impl Tables {
    /// Time 0 of the recording, ns since 1970: the first row, or the first event without any row.
    pub fn zero(&self) -> u64 {
        self.first.or(self.events.first().map(|event| event.stamp.0)).unwrap_or(0)
    }
}

impl<R: Read + Seek> Recording<R> {
    /// The types of the channels.
    pub fn types(&self) -> Types {
        let known = self.channels().filter_map(|channel| {
            let schema = self.schema(channel)?;
            if (&*schema.encoding, &*channel.encoding) != (SCHEMA_ENCODING, MESSAGE_ENCODING) {
                return None;
            }
            let text = std::str::from_utf8(&schema.data).ok()?;
            let ty = match &*schema.name {
                Frame::TYPE => Type::Frame,
                JointState::TYPE => Type::JointState,
                DiagnosticArray::TYPE => Type::Diagnostics,
                Log::TYPE => Type::Event,
                name => Type::Signals(SignalsType::parse(name, text)?),
            };
            Some((channel.id, ty))
        });
        Types(known.collect())
    }

    /// Reads all signals and events. `wanted` chooses the topics of signals.
    ///
    /// # Errors
    /// The file cannot be read.
    pub fn tables(&mut self, wanted: impl Fn(&str, &SignalField) -> bool) -> io::Result<Tables> {
        let types = self.types();
        let mut read = Tables::default();
        let mut places = BTreeMap::new();
        for channel in self.channels() {
            let Some(signals) = types.signals(channel.id) else { continue };
            let chosen = signals.fields().iter().enumerate();
            let chosen: Vec<usize> =
                chosen.filter(|(_, field)| wanted(&channel.topic, field)).map(|(n, _)| n).collect();
            if chosen.is_empty() {
                continue;
            }
            let fields: Vec<_> = chosen.iter().map(|n| signals.fields()[*n].clone()).collect();
            let known = read
                .tables
                .iter()
                .position(|table| table.topic == channel.topic && table.fields == fields);
            let place = known.unwrap_or_else(|| {
                let (topic, columns) = (channel.topic.clone(), vec![Vec::new(); fields.len()]);
                let (times, spans) = (Vec::new(), Vec::new());
                read.tables.push(Table { topic, fields, times, spans, columns });
                read.tables.len() - 1
            });
            places.insert(channel.id, (place, chosen));
        }
        for message in self.messages() {
            let message = message?;
            match types.content(&message) {
                Ok(Content::Signals(row)) => {
                    read.first = Some(read.first.map_or(row.stamp.0, |at| at.min(row.stamp.0)));
                    let Some((place, chosen)) = places.get(&message.channel.id) else { continue };
                    let table = &mut read.tables[*place];
                    table.times.push(row.stamp.0);
                    table.spans.push(row.span_s);
                    for (column, n) in table.columns.iter_mut().zip(chosen) {
                        column.push(row.values[*n]);
                    }
                }
                Ok(Content::Event(event)) => read.events.push(event),
                Ok(_) => {}
                Err(_) => read.malformed += 1,
            }
        }
        read.tables.iter_mut().for_each(Table::sort);
        read.events.sort_by_key(|event| event.stamp);
        Ok(read)
    }
}

impl Table {
    /// Rows in the order of time. Two recordings in one file may overlap.
    fn sort(&mut self) {
        if self.times.is_sorted() {
            return;
        }
        let mut order: Vec<usize> = (0..self.times.len()).collect();
        order.sort_by_key(|row| self.times[*row]);
        self.times = order.iter().map(|row| self.times[*row]).collect();
        for column in self.columns.iter_mut().chain([&mut self.spans]) {
            *column = order.iter().map(|row| column[*row]).collect();
        }
    }
}
