//! `motorlink convert`: a recording in another format.

use std::io::{self, Write};
use std::path::{Path, PathBuf};

use motorlink_capture::{Format, WriteError, Writer};
use motorlink_link::printable;
use motorlink_recording::read::{Table, Tables};
use motorlink_recording::schema::Log;

use super::input::Input;
use super::pick::Pick;
use crate::failure::Failure;
use crate::output::{Printer, note};
use crate::outputs::Output;
use crate::text::{counted, csv_cell};

#[derive(clap::Args)]
pub struct Args {
    #[command(flatten)]
    input: Input,
    /// The new file; its ending is the format: `.csv` has the signals; `.log` (candump), `.asc` and
    /// `.pcapng` have the frames. `-` is stdout, in CSV
    #[arg(value_name = "OUT", value_hint = clap::ValueHint::FilePath)]
    output: PathBuf,
    #[command(flatten)]
    pick: Pick,
    /// Give times in s since 1970 instead of s since the first sample
    #[arg(long)]
    unix: bool,
    /// Replace the new file if it exists
    #[arg(long)]
    force: bool,
    /// Print one line of JSON instead of text
    #[arg(long)]
    json: bool,
}

impl Args {
    fn written(&self, to: &Output, what: &str, count: (&str, u64)) -> Result<(), Failure> {
        self.input.written(Printer { json: self.json }, (to, &self.output), what, count)
    }
}

/// What the new file has.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Kind {
    Signals,
    Frames(Format),
}

pub fn run(args: &Args) -> Result<(), Failure> {
    let kind = kind(&args.output)?;
    if kind != Kind::Signals && (args.pick.is_some() || args.unix) {
        return Err(Failure::usage("--signals and --unix are for .csv: other formats have frames"));
    }
    let output = args.input.output("OUT", &args.output, args.force, args.json)?;
    match kind {
        Kind::Signals => signals(args, &output),
        Kind::Frames(format) => frames(args, format, &output),
    }
}

/// The format that the ending of a name says.
fn kind(path: &Path) -> Result<Kind, Failure> {
    let ending = path.extension().and_then(|ending| ending.to_str()).map(str::to_ascii_lowercase);
    match ending.as_deref() {
        Some("csv") => Ok(Kind::Signals),
        Some("log") => Ok(Kind::Frames(Format::Candump)),
        Some("asc") => Ok(Kind::Frames(Format::Asc)),
        Some("pcapng") => Ok(Kind::Frames(Format::Pcapng)),
        _ if path.as_os_str() == "-" || is_stream(path) => Ok(Kind::Signals),
        _ => {
            let name = printable(&path.display().to_string());
            Err(Failure::usage(format!("`{name}` does not say the format"))
                .trying("give a name that ends in .csv, .log, .asc or .pcapng"))
        }
    }
}

fn signals(args: &Args, output: &Output) -> Result<(), Failure> {
    let tables = args.input.tables(&args.pick)?;
    let csv = Csv::new(&tables, args.unix);
    let mut rows = 0;
    output.write(|out| {
        rows = csv.write(out)?;
        Ok(())
    })?;
    let columns = csv.columns() as u64;
    let what = format!("{} of {}", counted(rows, "row"), counted(columns, "signal"));
    args.written(output, &what, ("rows", rows))
}

fn frames(args: &Args, format: Format, output: &Output) -> Result<(), Failure> {
    let mut recording = args.input.open()?;
    if recording.lines().is_empty() {
        return Err(args.input.has_no_frames(recording.losses()));
    }
    let (mut count, mut serial, mut malformed) = (0, 0, 0);
    output.write(|out| {
        let mut writer = Writer::new(format, out)?.expect("the format is written");
        let mut frames = recording.frames();
        for (place, frame) in (1..).zip(&mut frames) {
            let (line, frame) = frame?;
            match writer.write(&frame.captured(place, &line)) {
                Ok(()) => count += 1,
                Err(WriteError::Unwritable(_)) => serial += 1,
                Err(WriteError::Io(error)) => return Err(error),
            }
        }
        malformed = frames.malformed();
        writer.into_inner().map(drop)
    })?;
    args.input.note_frames(&recording, malformed);
    if serial > 0 {
        let left = format!("{serial} frames of serial lines are left out: only .pcapng has them");
        note(left);
    }
    args.written(output, &counted(count, "frame"), ("frames", count))
}

/// Whether it is a device or a FIFO, whose names have no ending.
fn is_stream(path: &Path) -> bool {
    path.metadata().is_ok_and(|found| !found.is_file() && !found.is_dir())
}

/// One table with all signals: a row for each instant of each topic, and for each event.
struct Csv<'a> {
    tables: &'a [Table],
    events: &'a [Log],
    /// Time 0, ns since 1970.
    zero: u64,
    is_unix: bool,
    has_motors: bool,
}

impl<'a> Csv<'a> {
    fn new(read: &'a Tables, is_unix: bool) -> Self {
        let mut motors: Vec<&str> = read.tables.iter().map(Table::motor).collect();
        motors.dedup();
        let has_motors = motors.len() > 1;
        let zero = read.zero();
        Csv { tables: &read.tables, events: &read.events, zero, is_unix, has_motors }
    }

    fn columns(&self) -> usize {
        self.tables.iter().map(|table| table.fields.len()).sum()
    }

    /// Writes the rows in the order of time. Returns their number, without events.
    fn write(&self, out: &mut dyn Write) -> io::Result<u64> {
        write!(out, "{}", if self.is_unix { "unix [s]" } else { "t [s]" })?;
        for table in self.tables {
            for field in &table.fields {
                let motor =
                    if self.has_motors { format!("{}/", table.motor()) } else { String::new() };
                let unit = match field.unit.is_empty() {
                    true => String::new(),
                    false => format!(" [{}]", field.unit),
                };
                let name = printable(&format!("{motor}{}{unit}", field.signal));
                write!(out, ",{}", csv_cell(&name))?;
            }
        }
        writeln!(out, ",event")?;
        let columns = self.columns();
        let mut places = vec![0; self.tables.len()];
        let mut events = self.events.iter().peekable();
        let mut rows = 0;
        loop {
            let next = |(n, table): (usize, &Table)| Some((*table.times.get(places[n])?, n));
            let row = self.tables.iter().enumerate().filter_map(next).min();
            let is_event = |event: &&Log| row.is_none_or(|(time, _)| event.stamp.0 <= time);
            if let Some(event) = events.next_if(is_event) {
                self.write_time(out, event.stamp.0)?;
                let text = printable(&format!("{} {}", event.kind, event.name));
                writeln!(out, "{},{}", ",".repeat(columns), csv_cell(&text))?;
                continue;
            }
            let Some((time, n)) = row else { return Ok(rows) };
            self.write_time(out, time)?;
            let before: usize = self.tables[..n].iter().map(|table| table.fields.len()).sum();
            let table = &self.tables[n];
            write!(out, "{}", ",".repeat(before))?;
            for column in &table.columns {
                match column[places[n]] {
                    value if value.is_nan() => write!(out, ",")?,
                    value => write!(out, ",{value}")?,
                }
            }
            writeln!(out, "{},", ",".repeat(columns - before - table.columns.len()))?;
            places[n] += 1;
            rows += 1;
        }
    }

    fn write_time(&self, out: &mut dyn Write, time: u64) -> io::Result<()> {
        const NANOS: u64 = 1_000_000_000;
        if self.is_unix {
            return write!(out, "{}.{:09}", time / NANOS, time % NANOS);
        }
        // An event may be before the first sample.
        let sign = if time < self.zero { "-" } else { "" };
        let micros = time.abs_diff(self.zero) / 1000;
        write!(out, "{sign}{}.{:06}", micros / 1_000_000, micros % 1_000_000)
    }
}
