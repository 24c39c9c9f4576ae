//! `motorlink info`: what a recording contains.

use std::collections::{BTreeMap, BTreeSet};
use std::fs::File;

use indexmap::IndexMap;
use motorlink_link::{printable, printable_lines};
use motorlink_recording::read::{Content, Drive, Metadata, Recording, lost};
use motorlink_recording::schema::{self, Log, Loss, SETTINGS_TYPE, SignalField, Time, drive};
use serde_json::{Map, Value, json};

use super::input::Input;
use crate::failure::Failure;
use crate::json;
use crate::output::Printer;
use crate::text::{counted, flow};

/// The width of a line of signals or files.
const SIGNALS: usize = 66;

#[derive(clap::Args)]
pub struct Args {
    #[command(flatten)]
    input: Input,
    /// Print the settings that this motor had at the start, for example of `st0/motor1`
    #[arg(long, value_name = "MOTOR", conflicts_with = "events")]
    settings: Option<String>,
    /// Print all events
    #[arg(long)]
    events: bool,
    /// Print JSON instead of text
    #[arg(long)]
    json: bool,
}

pub fn run(args: &Args) -> Result<(), Failure> {
    let printer = Printer { json: args.json };
    let mut recording = args.input.open()?;
    if let Some(motor) = &args.settings {
        return settings(args, &mut recording, motor, printer);
    }
    let contents = Contents::read(&args.input, &mut recording)?;
    recording.check_whole().map_err(|error| args.input.failed(&error))?;
    if args.events {
        args.input.note_losses(recording.losses());
        for event in &contents.events {
            printer.result(event_line(event), event_object(event))?;
        }
        return Ok(());
    }
    let lines = contents.lines(&args.input, &recording);
    printer.result(lines.join("\n"), contents.object(&args.input, &recording))
}

/// Prints the settings of a motor.
fn settings(
    args: &Args,
    recording: &mut Recording<File>,
    motor: &str,
    printer: Printer,
) -> Result<(), Failure> {
    let wanted = motor.trim_matches('/').replace('/', "_");
    let names: Vec<String> = recording.attachments().map(str::to_owned).collect();
    let is_wanted = |name: &&String| {
        **name == motor || name.strip_suffix(".toml").is_some_and(|name| name == wanted)
    };
    let found = names.iter().find(is_wanted);
    let file = args.input.name();
    let Some(name) = found else {
        let known: Vec<String> = names
            .iter()
            .filter_map(|name| name.strip_suffix(".toml"))
            .map(|name| format!("`{}`", printable(&name.replacen('_', "/", 1))))
            .collect();
        let failure = Failure::usage(format!("{file} has no settings of `{motor}`"));
        return Err(match known.is_empty() {
            true => failure,
            false => failure.trying(format!("it has those of {}", known.join(", "))),
        });
    };
    let read = recording.attachment(name).map_err(|error| args.input.failed(&error))?;
    let text = read.filter(|read| read.media_type == SETTINGS_TYPE);
    let text = text.and_then(|read| String::from_utf8(read.data).ok());
    let Some(text) = text else {
        return Err(Failure::usage(format!("the settings of `{motor}` in {file} are damaged")));
    };
    let object = json!({ "recording": file, "settings": text });
    printer.result(printable_lines(text.trim_end()), object)
}

/// What was read of a recording.
struct Contents {
    topics: Vec<Topic>,
    /// Kinds of events with their numbers, in the order of their first appearance.
    kinds: IndexMap<String, u64>,
    events: Vec<Log>,
}

struct Topic {
    name: String,
    ty: String,
    fields: Vec<SignalField>,
    messages: u64,
    times: Option<[u64; 2]>,
}

impl Topic {
    /// Messages per second.
    fn rate(&self) -> Option<f64> {
        let [first, last] = self.times?;
        let seconds = (last - first) as f64 / 1e9;
        (self.messages > 2 && seconds > 0.0).then(|| (self.messages - 1) as f64 / seconds)
    }
}

impl Contents {
    fn read(input: &Input, recording: &mut Recording<File>) -> Result<Self, Failure> {
        let types = recording.types();
        let mut topics: BTreeMap<u16, Topic> = BTreeMap::new();
        for channel in recording.channels() {
            let fields = types.signals(channel.id).map(|ty| ty.fields().to_vec());
            let ty = recording.schema(channel).map_or(String::new(), |schema| schema.name.clone());
            let name = channel.topic.clone();
            let fields = fields.unwrap_or_default();
            topics.insert(channel.id, Topic { name, ty, fields, messages: 0, times: None });
        }
        let mut events = Vec::new();
        for message in recording.messages() {
            let message = message.map_err(|error| input.failed(&error))?;
            let at = message.log_time;
            if let Some(topic) = topics.get_mut(&message.channel.id) {
                topic.messages += 1;
                let [first, last] = topic.times.unwrap_or([at; 2]);
                topic.times = Some([first.min(at), last.max(at)]);
            }
            if message.channel.topic == schema::name::EVENTS
                && let Ok(Content::Event(event)) = types.content(&message)
            {
                events.push(event);
            }
        }
        let mut kinds = IndexMap::new();
        for event in &events {
            *kinds.entry(event.kind.clone()).or_insert(0) += 1;
        }
        let mut topics: Vec<Topic> = topics.into_values().collect();
        topics.sort_by(|a, b| a.name.cmp(&b.name));
        Ok(Contents { topics, kinds, events })
    }

    fn times(&self) -> Option<[u64; 2]> {
        let times = self.topics.iter().filter_map(|topic| topic.times);
        times.reduce(|[a, b], [c, d]| [a.min(c), b.max(d)])
    }

    fn messages(&self) -> u64 {
        self.topics.iter().map(|topic| topic.messages).sum()
    }

    /// How much the recorder lost, and of what: lines, and the recorder itself.
    fn lost(&self, wanted: Loss) -> Option<(u64, String)> {
        let losses = self.events.iter().filter_map(|log| Some((&log.name, Loss::of(log)?)));
        let losses = losses.filter(|(_, (loss, _))| *loss == wanted);
        let (mut sum, mut names) = (0u64, BTreeSet::new());
        for (name, (_, count)) in losses {
            sum = sum.saturating_add(count);
            names.insert(name.as_str());
        }
        let names: Vec<&str> = names.into_iter().collect();
        (sum > 0).then(|| (sum, names.join(", ")))
    }

    fn lines(&self, input: &Input, recording: &Recording<File>) -> Vec<String> {
        let mut lines = Vec::new();
        let mut row = |name: &str, text: String| {
            lines.push(format!("{name:<9}  {}", printable(&text)).trim_end().to_owned());
        };
        row("recording", format!("{}, {} bytes", input.name(), recording.size()));
        if let Some([first, last]) = self.times() {
            let seconds = (last - first) as f64 / 1e9;
            row(
                "time",
                format!("{seconds:.3} s, from {} to {}", Time(first).text(), Time(last).text()),
            );
        }
        let about = recording.metadata().iter().find(|it| it.name == schema::recording::NAME);
        let fact = |name: &str| about.and_then(|about| about.values.get(name));
        if let Some(version) = fact(schema::recording::VERSION) {
            row("program", format!("motorlink {version}"));
        } else {
            row("program", recording.library().to_owned());
        }
        if let Some(command) = fact(schema::recording::COMMAND) {
            row("command", command.clone());
        }
        for (n, drive) in recording.drives().enumerate() {
            row(if n == 0 { "drives" } else { "" }, drive_line(&drive));
            for line in &drive.identity {
                row("", format!("  {line}"));
            }
        }
        for (label, why) in without_frames(recording) {
            row("frames", format!("those of {label} are not recorded: {why}"));
        }
        let widths = self.topics.iter().map(|topic| topic.name.len());
        let width = widths.max().unwrap_or(0).min(SIGNALS);
        for (n, topic) in self.topics.iter().enumerate() {
            let rate = topic.rate().map_or(String::new(), |rate| format!(", {rate:.1} Hz"));
            let messages = counted(topic.messages, "message");
            let text = format!("{:<width$}  {messages}{rate}", topic.name);
            row(if n == 0 { "topics" } else { "" }, text);
            for line in flow(topic.fields.iter().map(in_words), "  ", "", SIGNALS) {
                row("", format!("  {line}"));
            }
        }
        let kinds: Vec<String> =
            self.kinds.iter().map(|(kind, count)| format!("{count} {kind}")).collect();
        row("events", if kinds.is_empty() { "none".to_owned() } else { kinds.join(", ") });
        let attached = flow(recording.attachments(), "  ", "", SIGNALS);
        for (n, line) in attached.into_iter().enumerate() {
            row(if n == 0 { "attached" } else { "" }, line);
        }
        let gaps = gaps(recording).map(|(motor, seconds)| format!("{motor} for {seconds} s"));
        for (n, line) in flow(gaps, ", ", "", SIGNALS).into_iter().enumerate() {
            row(if n == 0 { "no values" } else { "" }, line);
        }
        let lost = lost(recording.losses()).into_iter();
        let lost = lost.chain(self.lost(Loss::Messages).map(|(count, names)| {
            format!("{count} messages in {names}: the recorder or its disk was too slow")
        }));
        let lost = lost.chain(self.lost(Loss::Rows).map(|(count, names)| {
            format!("{count} rows of {names}: nothing confirmed their values")
        }));
        let lost: Vec<String> = lost.collect();
        for (n, text) in lost.iter().enumerate() {
            row(if n == 0 { "lost" } else { "" }, text.clone());
        }
        if lost.is_empty() {
            row("lost", "nothing".to_owned());
        }
        lines
    }

    fn object(&self, input: &Input, recording: &Recording<File>) -> Value {
        let mut object = Map::new();
        let mut add = |name: &str, value: Value| object.insert(name.to_owned(), value);
        add("recording", input.name().into());
        add("bytes", recording.size().into());
        add("messages", self.messages().into());
        if let Some([first, last]) = self.times() {
            add("first", Time(first).text().into());
            add("last", Time(last).text().into());
            add("duration", json::quantity((last - first) as f64 / 1e9, 3, "s"));
        }
        let about = recording.metadata().iter().find(|it| it.name == schema::recording::NAME);
        add("about", about.map_or(json!({}), |about| json!(about.values)));
        add("drives", drives(recording).map(|drive| json!(drive.values)).collect());
        let topics = self.topics.iter().map(|topic| {
            let mut object = json!({
                "topic": topic.name,
                "type": topic.ty,
                "messages": topic.messages,
            });
            if let Some(rate) = topic.rate() {
                object["rate"] = json::quantity(rate, 1, "Hz");
            }
            if !topic.fields.is_empty() {
                let signal = |field: &SignalField| match field.unit.is_empty() {
                    true => json!({ "name": field.signal }),
                    false => json!({ "name": field.signal, "unit": field.unit }),
                };
                object["signals"] = topic.fields.iter().map(signal).collect();
            }
            object
        });
        add("topics", topics.collect());
        let kinds: Map<String, Value> =
            self.kinds.iter().map(|(kind, count)| (kind.clone(), (*count).into())).collect();
        add("events", kinds.into());
        add("attachments", recording.attachments().collect());
        let gaps = gaps(recording).filter_map(|(motor, seconds)| {
            let seconds: f64 = seconds.parse().ok()?;
            Some(json!({ "motor": motor, "seconds": seconds }))
        });
        add("gaps", gaps.collect());
        let count = |loss| self.lost(loss).map_or(0, |(count, _)| count).into();
        add("lost_messages", count(Loss::Messages));
        add("unconfirmed_rows", count(Loss::Rows));
        if let Some(why) = lost(recording.losses()) {
            add("lost", json!({ "bytes": recording.lost_bytes(), "why": why }));
        }
        object.into()
    }
}

fn drives(recording: &Recording<File>) -> impl Iterator<Item = &Metadata> {
    recording.metadata().iter().filter(|metadata| metadata.name == drive::NAME)
}

/// The motors that had no values for a time, and the time in seconds.
fn gaps(recording: &Recording<File>) -> impl Iterator<Item = (&str, &str)> {
    let found = recording.metadata().iter().filter(|it| it.name == schema::gaps::NAME);
    found.flat_map(|gaps| &gaps.values).map(|(motor, seconds)| (motor.as_str(), seconds.as_str()))
}

/// The lines whose frames are not recorded, and why.
fn without_frames(recording: &Recording<File>) -> BTreeMap<&str, &str> {
    let facts = drives(recording).filter_map(|drive| {
        let fact = |name: &str| drive.values.get(name).map(String::as_str);
        Some((fact(drive::LABEL)?, fact(drive::NO_FRAMES)?))
    });
    facts.collect()
}

/// `st0/motor1 at serial:/dev/ttyACM0, st spec`.
fn drive_line(drive: &Drive) -> String {
    let kind = [drive.protocol.as_str(), drive.profile.as_deref().unwrap_or("")];
    let kind: Vec<&str> = kind.into_iter().filter(|text| !text.is_empty()).collect();
    format!("{} at {}, {}", drive.name, drive.port, kind.join(" "))
}

/// `SPEED_MEAS [rpm]`.
fn in_words(field: &SignalField) -> String {
    match &*field.unit {
        "" => field.signal.clone(),
        unit => format!("{} [{unit}]", field.signal),
    }
}

fn event_line(event: &Log) -> String {
    let by = if event.by.is_empty() { String::new() } else { format!(" ({})", event.by) };
    printable(&format!("{}  {:<10}  {}{by}", event.stamp.text(), event.name, event.message))
}

fn event_object(event: &Log) -> Value {
    json!({
        "time": event.stamp.text(),
        "event": event.kind,
        "of": event.name,
        "by": event.by,
        "message": event.message,
    })
}
