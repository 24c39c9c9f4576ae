//! `motorlink decode`: the frames of a capture, with their meaning. docs/DECODE.md is the manual.

mod csv;
mod entry;
mod input;
mod object;
mod out;
mod text;

use std::fs::File;
use std::io::{self, Read};
use std::path::Path;
use std::sync::Arc;

use clap::Subcommand;
use motorlink::rmd::{Direction, MotorId};
use motorlink::st::Profile;
use motorlink_capture::{
    Captured, Damage, Format, Plain, Reader, Wire, rmd as rmd_capture, st as st_capture,
};

use motorlink_recording::read::{Line, MAGIC};
use motorlink_telemetry::share::drive_protocol::DriveProtocol;

use crate::failure::Failure;
use crate::output::note;
use crate::{hint, recordings};
use entry::{Entry, Meaning};
use out::Out;

#[derive(clap::Args)]
pub struct Args {
    #[command(subcommand)]
    protocol: Protocol,
}

#[derive(Subcommand)]
enum Protocol {
    /// Decode a serial line with ST's protocol
    ///
    /// Requests and replies have different headers, so their directions are known. A reply has the
    /// values of the request before it. The format of a file is found by its content. A pipe is decoded
    /// line by line.
    St {
        #[command(flatten)]
        common: Common,
        /// Protocol variant: spec is the document, mcsdk-5.4 is shipped firmware
        #[arg(long, env = "MOTORLINK_PROFILE", default_value = "spec", value_parser = hint::profile())]
        profile: Profile,
    },
    /// Decode a CAN bus with RMD motors
    ///
    /// Request and reply of a motor have the same identifier. docs/DECODE.md says how they are told
    /// apart. A frame whose direction cannot be known is marked with `?` and shows both meanings. The
    /// format of a file is found by its content. A pipe is decoded line by line.
    Rmd {
        #[command(flatten)]
        common: Common,
        /// The motor's ID, 1 to 32, of hexadecimal data bytes without an identifier
        #[arg(short, long, value_parser = hint::id(), hide_possible_values = true)]
        id: Option<MotorId>,
        /// Take every frame of a motor as a request (from the host), or as a reply
        #[arg(long, value_parser = hint::one_of(&hint::SENDERS))]
        direction: Option<Direction>,
    },
}

#[derive(clap::Args)]
struct Common {
    /// A capture or a recording (.mcap), `-` for stdin (the default), or the frames in hexadecimal
    #[arg(value_name = "FILE|HEX", value_hint = clap::ValueHint::FilePath)]
    input: Vec<String>,
    /// The format of the input, if its content does not show it
    #[arg(long, value_parser = formats())]
    format: Option<Format>,
    /// Print a JSON object per frame: docs/JSON.md
    #[arg(long, conflicts_with = "csv")]
    json: bool,
    /// Print comma-separated values, a row per value
    #[arg(long)]
    csv: bool,
}

fn formats() -> impl clap::builder::TypedValueParser<Value = Format> {
    use clap::builder::TypedValueParser;
    let names = Format::ALL.map(Format::name);
    clap::builder::PossibleValuesParser::new(names).try_map(|name| name.parse::<Format>())
}

pub fn run(args: Args) -> Result<(), Failure> {
    let (common, plain, decoder) = match args.protocol {
        Protocol::St { common, profile } => {
            (common, Plain::Serial, Decoder::St(st_capture::Decoder::new(profile)))
        }
        Protocol::Rmd { common, id, direction } => {
            let decoder =
                direction.map_or_else(rmd_capture::Decoder::new, rmd_capture::Decoder::of);
            (common, Plain::Can(id.map(MotorId::can_id)), Decoder::Rmd(Box::new(decoder)))
        }
    };
    let out = match (common.json, common.csv) {
        (true, _) => Out::new(out::Shape::Json),
        (_, true) => Out::new(out::Shape::Csv),
        _ => Out::new(out::Shape::Text),
    };
    if let [path] = &common.input[..]
        && common.format.is_none()
        && is_recording(Path::new(path))
    {
        return decode_recording(&recordings::Input::of(path), decoder, out);
    }
    let input = input::open(&common.input, common.format, plain)?;
    let (is_file, is_hex, name) = (input.is_file, input.is_hex, input.name);
    let failed = |error: io::Error| Failure::usage(format!("cannot read {name}: {error}"));
    let mut reader = Reader::new(input.content, input.format, plain).map_err(&failed)?;
    let counts = decode(decoder, out, is_hex, |out| {
        // Before it waits for more input, all output is written.
        if !is_file && reader.may_wait() {
            out.flush()?;
        }
        reader.next().map_err(&failed)
    })?;
    counts.report(!is_hex)
}

/// Decodes the frames of a recording. What its drives speak is recorded, too.
fn decode_recording(input: &recordings::Input, decoder: Decoder, out: Out) -> Result<(), Failure> {
    let mut recording = input.open()?;
    let lines = recording.lines();
    let is_wanted: fn(&Line) -> bool = match decoder {
        Decoder::St(_) => |line| matches!(line.speaks, DriveProtocol::St(_)),
        Decoder::Rmd(_) => |line| line.speaks == DriveProtocol::Rmd,
    };
    if !lines.values().any(|line| is_wanted(line)) {
        let labels: Vec<&str> = lines.values().map(|line| &*line.label).collect();
        return Err(match labels.is_empty() {
            true => input.has_no_frames(recording.losses()),
            false => Failure::usage(format!("{} has no line with this protocol", input.name()))
                .trying(format!("its lines are {}; try the other protocol", labels.join(", "))),
        });
    }
    let decoder = match decoder {
        Decoder::St(decoder) => {
            Decoder::St(lines.values().fold(decoder, |decoder, line| match line.speaks {
                DriveProtocol::St(profile) => decoder.with_line(&line.label, profile),
                DriveProtocol::Rmd => decoder,
            }))
        }
        Decoder::Rmd(decoder) => Decoder::Rmd(decoder),
    };
    let (mut frames, mut place) = (recording.frames(), 0);
    let counts = decode(decoder, out, false, |_| {
        let is_next =
            |it: &io::Result<(Arc<Line>, _)>| it.as_ref().map_or(true, |(line, _)| is_wanted(line));
        let Some(frame) = frames.find(is_next) else { return Ok(None) };
        let (line, frame) = frame.map_err(|error| input.failed(&error))?;
        place += 1;
        Ok(Some(frame.captured(place, &line)))
    })?;
    let malformed = frames.malformed();
    input.note_frames(&recording, malformed);
    counts.report(true)
}

/// Whether a file is an MCAP file.
fn is_recording(path: &Path) -> bool {
    let mut magic = [0; MAGIC.len()];
    let read = File::open(path).and_then(|mut file| {
        // A FIFO is not read before its turn.
        if file.metadata()?.is_file() { file.read_exact(&mut magic) } else { Ok(()) }
    });
    read.is_ok() && magic == MAGIC
}

/// Decodes everything. `next` gives the next entry; `None` at the end.
fn decode(
    mut decoder: Decoder,
    mut out: Out,
    is_hex: bool,
    mut next: impl FnMut(&mut Out) -> Result<Option<Captured>, Failure>,
) -> Result<Counts, Failure> {
    let mut counts = Counts::default();
    out.begin()?;
    while let Some(captured) = next(&mut out)? {
        if let (Wire::Damage(damage @ Damage::Line { .. }), true) = (&captured.wire, is_hex) {
            return Err(Failure::usage(damage.to_string()));
        }
        decoder.decode(&captured, &mut |entry| {
            counts.add(&entry);
            out.entry(&entry)
        })?;
    }
    decoder.end(&mut |entry| {
        counts.add(&entry);
        out.entry(&entry)
    })?;
    out.flush()?;
    Ok(counts)
}

enum Decoder {
    St(st_capture::Decoder),
    Rmd(Box<rmd_capture::Decoder>),
}

type Said<'a> = &'a mut dyn FnMut(Entry<'_>) -> Result<(), Failure>;

impl Decoder {
    fn decode(&mut self, captured: &Captured, said: Said<'_>) -> Result<(), Failure> {
        match self {
            Decoder::Rmd(decoder) => {
                let decoded = decoder.decode(captured);
                said(Entry::of_rmd(captured, decoded.as_ref()))
            }
            Decoder::St(decoder) => {
                let mut result = Ok(());
                decoder.decode(captured, |at, bytes, item| {
                    if result.is_ok() {
                        result = said(Entry::of_st(at, bytes, &item));
                    }
                });
                result?;
                match Entry::of_other(captured) {
                    Some(entry) => said(entry),
                    None => Ok(()),
                }
            }
        }
    }

    fn end(&mut self, said: Said<'_>) -> Result<(), Failure> {
        let mut result = Ok(());
        if let Decoder::St(decoder) = self {
            decoder.end(|at, bytes, item| {
                if result.is_ok() {
                    result = said(Entry::of_st(at, bytes, &item));
                }
            });
        }
        result
    }
}

/// What was found.
#[derive(Default)]
struct Counts {
    requests: u64,
    replies: u64,
    unknown: u64,
    others: u64,
    damaged: u64,
    /// The first entry with damage.
    first: Option<u64>,
}

impl Counts {
    fn add(&mut self, entry: &Entry<'_>) {
        match &entry.meaning {
            Meaning::Damage(_) => {
                self.damaged += 1;
                self.first.get_or_insert(entry.at.place);
            }
            _ if entry.is_other() => self.others += 1,
            _ => match entry.is_request {
                Some(true) => self.requests += 1,
                Some(false) => self.replies += 1,
                None => self.unknown += 1,
            },
        }
    }

    /// The sum on stderr, and a failure if there was damage.
    fn report(&self, is_summed_up: bool) -> Result<(), Failure> {
        let counted = |count: u64, one: &str, many: &str| match count {
            1 => format!("1 {one}"),
            count => format!("{count} {many}"),
        };
        let all = self.requests + self.replies + self.unknown + self.others;
        let mut parts = vec![
            counted(self.requests, "request", "requests"),
            counted(self.replies, "reply", "replies"),
        ];
        for (count, what) in [
            (self.unknown, "of unknown direction"),
            (self.others, "of other protocols"),
            (self.damaged, "damaged or lost"),
        ] {
            if count > 0 {
                parts.push(format!("{count} {what}"));
            }
        }
        if is_summed_up {
            note(format!("{}: {}", counted(all, "frame", "frames"), parts.join(", ")));
        }
        match self.first {
            None => Ok(()),
            Some(first) => Err(Failure::damaged(match self.damaged {
                1 => format!("entry {first} is damaged or lost"),
                count => {
                    format!("{count} entries are damaged or lost, the first one is entry {first}")
                }
            })),
        }
    }
}
