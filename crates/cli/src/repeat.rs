//! Loops of samples, which continue after an outage of the line.

use std::path::PathBuf;
use std::time::Duration;

use motorlink::Clock;
use serde_json::Value;

use crate::columns::Columns;
use crate::failure::{Failure, Kind, Problem};
use crate::interrupt;
use crate::json::{Cell, Line};
use crate::output::{Printer, missed, missed_text, never_wait, note, print_line};
use crate::recording::Recording;
use crate::span::parse_span;

/// How often to read, and where the samples go.
#[derive(clap::Args, Clone)]
pub struct Repeat {
    /// Repeat at this interval, such as 100ms, until Ctrl-C
    #[arg(long, value_name = "TIME", value_parser = parse_span)]
    pub every: Option<Duration>,
    /// Stop after this many samples
    #[arg(long, value_name = "N", requires = "every")]
    count: Option<u64>,
    /// Also write the samples to this file, as comma-separated values; - is stdout, without the table
    #[arg(long, value_name = "FILE", requires = "every", value_hint = clap::ValueHint::FilePath)]
    csv: Option<PathBuf>,
    /// Overwrite the file of --csv if it exists
    #[arg(long, requires = "csv")]
    force: bool,
}

/// Prints one sample, or with --every many samples with their time. In a loop, a failed line is tried again
/// until it works. JSON results begin with `object`. `clock` is that of the port.
pub fn repeated(
    clock: &Clock,
    repeat: &Repeat,
    output: Printer,
    object: &Line,
    mut sample: impl FnMut() -> Result<Vec<Cell>, Failure>,
) -> Result<(), Failure> {
    let Some(every) = repeat.every else { return output.cells(object.clone(), sample()?) };
    let mut sink = Sink::new(repeat, output, object)?;
    interrupt::take_over();
    let mut outage = None;
    let mut left = repeat.count.unwrap_or(u64::MAX);
    let mut began = None;
    let mut due = Duration::ZERO;
    while left > 0 && !interrupt::interrupted() {
        let sampled = sample();
        // The time starts with the first sample, because the first exchange also recovers the line.
        let now = clock.now();
        let began = *began.get_or_insert(now);
        let elapsed = Duration::from(now.since(began));
        match sampled {
            Ok(cells) if cells.iter().all(|cell| cell.row().is_none()) => {
                return output.cells(object.clone(), cells);
            }
            Ok(cells) => {
                if let Some(kind) = outage.take() {
                    sink.back(elapsed, kind)?;
                }
                sink.sample(elapsed, cells)?;
                left -= 1;
            }
            Err(Failure::Failed(problem)) if matches!(problem.kind, Kind::Link | Kind::Silent) => {
                if outage.is_none() {
                    outage = Some(problem.kind);
                    sink.outage(elapsed, &problem)?;
                }
            }
            Err(other) => return Err(other),
        }
        // If the line is slow, samples are skipped.
        let now = Duration::from(clock.now().since(began));
        while due <= now {
            due += every;
        }
        if left > 0 && outage.is_none() {
            interrupt::wait_by(clock, due - now);
        } else if left > 0 {
            // The clock of a lost port may be virtual, but the port returns in real time.
            interrupt::wait(due - now);
        }
    }
    match sink.refusal {
        Some(refusal) => Err(refusal),
        None if repeat.count.is_some() && left > 0 => Err(Failure::Interrupted),
        None => Ok(()),
    }
}

/// Where the samples of a loop go.
struct Sink<'a> {
    output: Printer,
    object: &'a Line,
    columns: Columns,
    recording: Option<Recording>,
    /// Whether stdout has the table.
    prints: bool,
    /// The first value that the drive refused.
    refusal: Option<Failure>,
    /// Names of refused values that a note was printed for.
    noted: Vec<String>,
}

impl<'a> Sink<'a> {
    fn new(repeat: &Repeat, output: Printer, object: &'a Line) -> Result<Self, Failure> {
        let create = |path: &PathBuf| Recording::create(path, repeat.force);
        let recording = repeat.csv.as_ref().map(create).transpose()?;
        let is_stdout = recording.as_ref().is_some_and(Recording::is_stdout);
        if is_stdout && output.json {
            return Err(Failure::usage("--json and --csv - both write to stdout")
                .trying("leave one out, or give --csv a file"));
        }
        let (columns, prints) = (Columns::on_stdout(), !is_stdout);
        if prints && recording.is_some() {
            // A reader that waits does not stop the recording.
            never_wait(if output.json { missed } else { missed_text });
        }
        Ok(Sink { output, object, columns, recording, prints, refusal: None, noted: Vec::new() })
    }

    fn sample(&mut self, elapsed: Duration, cells: Vec<Cell>) -> Result<(), Failure> {
        let seconds = elapsed.as_secs_f64();
        for (name, failure) in cells.iter().filter_map(|cell| Some((cell.name(), cell.refusal()?)))
        {
            if !self.output.json && !self.noted.iter().any(|noted| noted == name) {
                note(failure.text());
                self.noted.push(name.to_owned());
            }
        }
        if let Some(recording) = &mut self.recording {
            recording.sample(seconds, &cells)?;
        }
        if self.output.json {
            print_line(&Value::from(self.object.clone().at(Some(seconds)).cells(&cells)))?;
        } else if self.prints {
            self.columns.print(seconds, &cells)?;
        }
        let refusal = self.refusal.take();
        self.refusal = refusal.or_else(|| cells.into_iter().find_map(Cell::into_refusal));
        Ok(())
    }

    fn outage(&mut self, elapsed: Duration, problem: &Problem) -> Result<(), Failure> {
        if let Some(recording) = &mut self.recording {
            recording.event(elapsed.as_secs_f64(), "outage")?;
        }
        let (text, retry) = (problem.text(), "trying again until Ctrl-C");
        match (self.output.json, problem.kind) {
            (true, _) => {
                let event = self.event(elapsed, "outage").with("error", problem.object());
                return print_line(&Value::from(event));
            }
            (false, Kind::Silent) => note(format!("{text}; {retry}")),
            (false, _) => note(format!("the line is lost: {text}; {retry}")),
        }
        Ok(())
    }

    fn back(&mut self, elapsed: Duration, kind: Kind) -> Result<(), Failure> {
        if let Some(recording) = &mut self.recording {
            recording.event(elapsed.as_secs_f64(), "back")?;
        }
        self.columns.repeat_header();
        match (self.output.json, kind) {
            (true, _) => return print_line(&Value::from(self.event(elapsed, "back"))),
            (false, Kind::Silent) => note("the motor answers again"),
            (false, _) => note("the line is back"),
        }
        Ok(())
    }

    fn event(&self, elapsed: Duration, name: &str) -> Line {
        self.object.clone().at(Some(elapsed.as_secs_f64())).with("event", name)
    }
}
