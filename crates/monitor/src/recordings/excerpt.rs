//! What a recording has, and a part of it for a plot.
//!
//! A part has the frames and columns of a share: JSON has no NaN, and numbers as text are three times as
//! long.

use std::collections::BTreeMap;
use std::fs::File;
use std::io;

use motorlink_recording::read::{Content, Recording, Types, lost};
use motorlink_recording::schema::Log;
use motorlink_telemetry::share::data::Data;
use motorlink_telemetry::share::frame::{self, FrameKind};
use motorlink_telemetry::share::message::encode;

use super::downsample::{Downsample, FEWEST, Point};
use crate::message::{RecordedEvent, RecordedSignal, RecordingContent, RecordingPart};

/// The most points of a signal.
const MOST_POINTS: usize = 20_000;
/// The most signals of a part.
pub const MOST_SIGNALS: usize = 64;
/// The most events of a part.
const MOST_EVENTS: usize = 500;
/// Samples before and after a part are looked for in this time: signals are read twice a second at
/// least.
const BESIDE: f64 = 2.0;

/// Which part of a recording is wanted.
#[derive(Debug, Clone, PartialEq)]
pub struct Wanted {
    /// Numbers of signals, as in [`RecordingContent::signals`].
    pub signals: Vec<usize>,
    /// In seconds from the first message.
    pub from: f64,
    /// In seconds from the first message.
    pub to: f64,
    /// The most points of each signal.
    pub points: usize,
}

/// The signals of a recording by their numbers.
struct Signals {
    signals: Vec<RecordedSignal>,
    /// The numbers of the signals of each channel.
    of_channel: BTreeMap<u16, Vec<usize>>,
}

impl Signals {
    fn of(recording: &Recording<File>, types: &Types) -> Self {
        let mut all = Signals { signals: Vec::new(), of_channel: BTreeMap::new() };
        for channel in recording.channels() {
            let Some(ty) = types.signals(channel.id) else { continue };
            let path = channel.topic.trim_start_matches('/');
            let motor = path.rsplit_once('/').map_or(path, |(motor, _)| motor);
            let numbers = ty.fields().iter().map(|field| {
                let name = field.signal.clone();
                // Recordings one behind the other have a channel each.
                let is_same = |it: &RecordedSignal| it.motor == motor && it.name == name;
                all.signals.iter().position(is_same).unwrap_or_else(|| {
                    let (motor, unit) = (motor.to_owned(), field.unit.clone());
                    all.signals.push(RecordedSignal { motor, name, unit, doc: field.doc.clone() });
                    all.signals.len() - 1
                })
            });
            let numbers = numbers.collect();
            all.of_channel.insert(channel.id, numbers);
        }
        all
    }
}

/// What a recording has.
pub fn content(name: String, file: File) -> Result<RecordingContent, String> {
    let recording = Recording::new(file).map_err(|error| error.to_string())?;
    let [first, last] = recording.times().unwrap_or_default();
    let Signals { signals, .. } = Signals::of(&recording, &recording.types());
    Ok(RecordingContent {
        name,
        zero: first as f64 / 1e9,
        seconds: last.saturating_sub(first) as f64 / 1e9,
        signals,
        damage: lost(recording.losses()),
    })
}

/// Reads a part of a recording: a text, then the samples of each signal. `None`: it is not wanted any
/// more, which `goes_on` says.
pub fn read(
    file: File,
    wanted: &Wanted,
    goes_on: &dyn Fn() -> bool,
) -> Result<Option<Vec<u8>>, String> {
    let io = |error: io::Error| error.to_string();
    let mut recording = Recording::new(file).map_err(|error| error.to_string())?;
    let types = recording.types();
    let Signals { signals, of_channel } = Signals::of(&recording, &types);
    let [first, last] = recording.times().unwrap_or_default();
    let seconds = last.saturating_sub(first) as f64 / 1e9;
    let (from, to) = (wanted.from.max(0.0), wanted.to.min(seconds));
    let since = |time: u64| (time as i128 - i128::from(first)) as f64 / 1e9;
    let time = |t: f64| first.saturating_add((t.max(0.0) * 1e9) as u64);

    let points = wanted.points.clamp(FEWEST, MOST_POINTS);
    let mut columns: BTreeMap<usize, Downsample> = BTreeMap::new();
    for number in wanted.signals.iter().filter(|number| **number < signals.len()) {
        columns.insert(*number, Downsample::new(from, to, points));
    }
    let mut events: Vec<RecordedEvent> = Vec::new();
    let mut more_events = 0;
    for message in recording.messages_between(time(from - BESIDE)..=time(to + BESIDE)) {
        if !goes_on() {
            return Ok(None);
        }
        let message = message.map_err(io)?;
        match types.content(&message) {
            Ok(Content::Signals(row)) => {
                let (t, span) = (since(row.stamp.0), row.span_s);
                let numbers = of_channel.get(&message.channel.id);
                for (number, value) in numbers.into_iter().flatten().zip(row.values) {
                    if let Some(column) = columns.get_mut(number) {
                        column.push(Point { t, span, value });
                    }
                }
            }
            Ok(Content::Event(event)) if (from..=to).contains(&since(event.stamp.0)) => {
                match events.len() < MOST_EVENTS {
                    true => events.push(of(event, since)),
                    false => more_events += 1,
                }
            }
            // Damaged messages are counted when all of the file is checked.
            Ok(_) | Err(_) => {}
        }
    }
    events.sort_by(|a, b| a.t.total_cmp(&b.t));
    let damage = lost(recording.losses());
    let mut bytes = Vec::new();
    let head = encode(&RecordingPart { from, to, events, more_events, damage });
    frame::append(FrameKind::Text, &head, &mut bytes).map_err(|error| error.to_string())?;
    for (number, column) in columns {
        let data = samples(number, first as f64 / 1e9, &column.finish());
        // There is none of a signal without samples.
        if let Some(data) = data.encode() {
            frame::append(FrameKind::Data, &data, &mut bytes).map_err(|error| error.to_string())?;
        }
    }
    Ok(Some(bytes))
}

fn samples(number: usize, t0: f64, points: &[Point]) -> Data {
    let column = |of: fn(&Point) -> f64| points.iter().map(of).collect();
    let columns = vec![column(|it| it.t), column(|it| it.span), column(|it| it.value)];
    Data { group: u32::try_from(number).unwrap_or(u32::MAX), sequence: 0, lost: 0, t0, columns }
}

fn of(event: Log, since: impl Fn(u64) -> f64) -> RecordedEvent {
    let Log { stamp, name, message, by, kind, .. } = event;
    RecordedEvent { t: since(stamp.0), of: name, kind, by, message }
}
