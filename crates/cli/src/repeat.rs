//! `--every`: samples from the engine of the line. They go on after an outage.

use std::path::PathBuf;
use std::time::{Duration, Instant};

use motorlink::time::{Instant as Moment, Micros};
use motorlink_telemetry::acquisition::Acquisition;
use motorlink_telemetry::line as telemetry;
use motorlink_telemetry::rows::{Absent, Gap, Item, Rows, Trouble};
use motorlink_telemetry::runner::{Ended, Remote, Runner};
use motorlink_telemetry::sample::Sample;
use motorlink_telemetry::signal::Signal;
use motorlink_telemetry::subscription::Full;
use serde_json::Value;

use crate::columns::Columns;
use crate::csv::CsvFile;
use crate::failure::{Failure, Kind, Problem};
use crate::interrupt;
use crate::json::{Cell, Line};
use crate::output::{Printer, is_read, missed, missed_text, never_wait, note, print_line};
use crate::span::parse_span;

/// Records that wait until stdout is read.
const QUEUE: usize = 100_000;
/// How often to look whether the rates are known.
const LOOK: Duration = Duration::from_millis(20);
/// How often to look at the rates, once they are known.
const SECOND: Duration = Duration::from_secs(1);
/// With --count: how long no sample may come, besides two periods and the timeout of a reply.
const PATIENCE: Duration = Duration::from_secs(10);
/// A period that is longer than asked by this factor is said.
const SLOWER: f64 = 1.05;
/// It is said again if it changes by this factor.
const OTHER: f64 = 1.5;

/// How often to read, and where the samples go.
#[derive(clap::Args, Clone)]
pub struct Repeat {
    /// Repeat at this interval, such as 100ms, until Ctrl-C; a note says if the line is too slow
    #[arg(long, value_name = "TIME", value_parser = parse_span)]
    pub every: Option<Duration>,
    /// Stop after this many samples; exit code 3 if none comes for 10 s, two periods and the timeout
    #[arg(long, value_name = "N", requires = "every", value_parser = clap::value_parser!(u64).range(1..))]
    count: Option<u64>,
    /// Also write the samples to this file, as comma-separated values; - is stdout, without the table
    #[arg(long, value_name = "FILE", requires = "every", value_hint = clap::ValueHint::FilePath)]
    csv: Option<PathBuf>,
    /// Overwrite the file of --csv if it exists
    #[arg(long, requires = "csv")]
    force: bool,
}

/// What is read again and again, and how it is shown.
pub struct Watch<S, D> {
    pub line: Box<dyn telemetry::Line>,
    pub signals: Vec<Signal>,
    pub output: Printer,
    /// JSON results begin with it.
    pub object: Line,
    /// The cells of a row's values.
    pub shown: S,
    /// The failure of a line whose replies and requests do not go together.
    pub doubt: D,
}

impl<S, D> Watch<S, D>
where
    S: FnMut(&[Result<Sample, Absent>]) -> Result<Vec<Cell>, Failure>,
    D: Fn() -> Failure,
{
    /// Prints samples with their time, until the end that `repeat` has. A failed line is tried again
    /// until it works.
    pub fn run(mut self, every: Duration, repeat: &Repeat) -> Result<(), Failure> {
        let patience = repeat.count.map(|_| {
            let waits = every.saturating_mul(2).saturating_add(self.line.rules().timeout);
            PATIENCE.saturating_add(waits)
        });
        let mut sink = Sink::new(repeat, self.output, &self.object, patience)?;
        let mut pace = Pace::new(every);
        let wants = self.signals.iter().map(|signal| (*signal, every.into())).collect();
        let mut rows = Rows::new(self.signals);
        let runner = Runner::start("motorlink-line", Acquisition::new(self.line))?;
        let (_, subscription) = runner.remote().subscribe(wants, QUEUE, Full::DropNewest)?;
        let ending = subscription.clone();
        interrupt::take_over_with(move || ending.close());
        let mut left = repeat.count.unwrap_or(u64::MAX);
        let mut last = Instant::now();
        while left > 0 && !interrupt::interrupted() {
            match subscription.wait(pace.patience()) {
                Some(record) => rows.take(&record),
                None if subscription.is_closed() && !interrupt::interrupted() => Err(Ended)?,
                None => {}
            }
            while let Some(item) = rows.next_item().filter(|_| left > 0) {
                if !may_print() {
                    break;
                }
                match item {
                    Item::Row(row) => {
                        let cells = (self.shown)(&row.values)?;
                        if cells.iter().all(|cell| cell.row().is_none()) {
                            return self.output.cells(self.object.clone(), cells);
                        }
                        sink.row(row.time, cells)?;
                        left -= 1;
                        last = Instant::now();
                    }
                    Item::Gap(Gap { time, why, unconfirmed }) => {
                        let failure = match why {
                            Trouble::Failed(error) => Failure::from(&*error),
                            Trouble::Doubtful(_) => (self.doubt)(),
                        };
                        sink.gap(time, failure, unconfirmed)?;
                    }
                    Item::Lost(count) => sink.lost(count)?,
                }
            }
            if let Some(patience) = patience.filter(|it| left > 0 && last.elapsed() > *it) {
                return Err(sink.given_up(patience));
            }
            if left > 0 {
                pace.look(runner.remote())?;
            }
        }
        match sink.refusal {
            Some(refusal) => Err(refusal),
            None if repeat.count.is_some() && left > 0 => Err(Failure::Interrupted),
            None => Ok(()),
        }
    }
}

/// Says that the line is too slow, before much time is lost.
struct Pace {
    every: Duration,
    next: Instant,
    /// The period that was said.
    said: Option<Micros>,
}

impl Pace {
    fn new(every: Duration) -> Self {
        Pace { every, next: Instant::now(), said: None }
    }

    fn patience(&self) -> Duration {
        self.next.saturating_duration_since(Instant::now()).max(LOOK)
    }

    fn look(&mut self, engine: &Remote) -> Result<(), Failure> {
        if Instant::now() < self.next {
            return Ok(());
        }
        let slowest = |engine: &mut Acquisition| {
            let rates = engine.is_predicted().then(|| engine.rates().map(|rate| rate.predicted));
            rates.and_then(Iterator::max)
        };
        self.next = Instant::now() + LOOK;
        let Some(predicted) = engine.with(slowest)? else { return Ok(()) };
        self.next = Instant::now() + SECOND;
        let ratio = |longer: Micros, shorter: Micros| longer.0 as f64 / shorter.0 as f64;
        let asked = Micros::from(self.every);
        let differs =
            self.said.is_none_or(|said| ratio(predicted, said).max(ratio(said, predicted)) > OTHER);
        if ratio(predicted, asked) > SLOWER && differs {
            let [asked, carried] = [asked, predicted].map(hertz);
            note(format!("asked {asked}; this line carries about {carried}"));
            self.said = Some(predicted);
        }
        Ok(())
    }
}

/// Waits until stdout takes more; `false` if a signal ended the wait.
fn may_print() -> bool {
    while !interrupt::interrupted() {
        if is_read(LOOK) {
            return true;
        }
    }
    false
}

/// The rate of a period, with two or three digits.
fn hertz(period: Micros) -> String {
    let rate = 1e6 / period.0.max(1) as f64;
    let decimals =
        [100.0, 10.0, 1.0].iter().filter(|limit| rate < **limit).count().saturating_sub(1);
    format!("{} Hz", format!("{rate:.decimals$}").parse::<f64>().unwrap_or(rate))
}

/// Where the samples of a loop go.
struct Sink<'a> {
    output: Printer,
    object: &'a Line,
    columns: Columns,
    recording: Option<CsvFile>,
    /// Whether stdout has the table.
    prints: bool,
    /// The first value that the drive refused.
    refusal: Option<Failure>,
    /// Names of refused values that a note was printed for.
    noted: Vec<String>,
    /// The time of the first sample or event.
    began: Option<Moment>,
    /// Why the outage that lasts began.
    lasting: Option<Box<Problem>>,
    /// When an outage ends the loop.
    patience: Option<Duration>,
}

impl<'a> Sink<'a> {
    fn new(
        repeat: &Repeat,
        output: Printer,
        object: &'a Line,
        patience: Option<Duration>,
    ) -> Result<Self, Failure> {
        let create = |path: &PathBuf| CsvFile::create(path, repeat.force);
        let recording = repeat.csv.as_ref().map(create).transpose()?;
        let is_stdout = recording.as_ref().is_some_and(CsvFile::is_stdout);
        if is_stdout && output.json {
            return Err(Failure::usage("--json and --csv - both write to stdout")
                .trying("leave one out, or give --csv a file"));
        }
        let (columns, prints) = (Columns::on_stdout(), !is_stdout);
        if prints && recording.is_some() {
            // A reader that waits does not stop the recording.
            never_wait(if output.json { missed } else { missed_text });
        }
        Ok(Sink {
            output,
            object,
            columns,
            recording,
            prints,
            refusal: None,
            noted: Vec::new(),
            began: None,
            lasting: None,
            patience,
        })
    }

    /// The time since the first sample or event. The first exchange also recovers the line, which is
    /// not counted.
    fn since_first(&mut self, time: Moment) -> Duration {
        time.since(*self.began.get_or_insert(time)).into()
    }

    fn row(&mut self, time: Moment, cells: Vec<Cell>) -> Result<(), Failure> {
        let elapsed = self.since_first(time);
        if let Some(problem) = self.lasting.take() {
            self.back(elapsed, problem.kind)?;
        }
        self.sample(elapsed, cells)
    }

    /// An outage is said once. A failure that the next exchange would have again ends the loop.
    fn gap(&mut self, time: Moment, failure: Failure, unconfirmed: u64) -> Result<(), Failure> {
        let elapsed = self.since_first(time);
        match failure {
            Failure::Failed(problem) if matches!(problem.kind, Kind::Link | Kind::Silent) => {
                if self.lasting.is_some() {
                    return Ok(());
                }
                self.outage(elapsed, &problem, unconfirmed)?;
                self.lasting = Some(problem);
                Ok(())
            }
            other => Err(other),
        }
    }

    /// No sample has come for too long.
    fn given_up(&mut self, patience: Duration) -> Failure {
        let problem = self.lasting.take();
        let failure = problem.map_or_else(|| Failure::link("no values"), Failure::Failed);
        failure.then(format!("no sample for {} s", patience.as_secs()))
    }

    /// Records that were lost because stdout was not read.
    fn lost(&mut self, count: u64) -> Result<(), Failure> {
        match self.output.json {
            true => print_line(&missed(count)),
            false => {
                note(format!(
                    "{count} replies were dropped here, because stdout was not read in time"
                ));
                Ok(())
            }
        }
    }

    fn sample(&mut self, elapsed: Duration, cells: Vec<Cell>) -> Result<(), Failure> {
        let seconds = elapsed.as_secs_f64();
        for (name, failure) in cells.iter().filter_map(|cell| Some((&cell.name, cell.refusal()?))) {
            if !self.output.json && !self.noted.iter().any(|noted| noted == name) {
                note(failure.text());
                self.noted.push(name.clone());
            }
        }
        if let Some(recording) = &mut self.recording {
            recording.sample(seconds, &cells)?;
        }
        if self.output.json {
            print_line(&Value::from(self.object.clone().at(seconds).cells(&cells)))?;
        } else if self.prints {
            self.columns.print(seconds, &cells)?;
        }
        let refusal = self.refusal.take();
        self.refusal = refusal.or_else(|| cells.into_iter().find_map(|cell| cell.read.err()));
        Ok(())
    }

    fn outage(
        &mut self,
        elapsed: Duration,
        problem: &Problem,
        unconfirmed: u64,
    ) -> Result<(), Failure> {
        if let Some(recording) = &mut self.recording {
            recording.event(elapsed.as_secs_f64(), "outage")?;
        }
        if self.output.json {
            let event = self.event(elapsed, "outage").with("error", problem.object());
            let event = match unconfirmed {
                0 => event,
                count => event.with("unconfirmed", count),
            };
            return print_line(&Value::from(event));
        }
        let retry = match self.patience {
            Some(patience) => format!("trying again for {} s", patience.as_secs()),
            None => "trying again until Ctrl-C".to_owned(),
        };
        let text = problem.text();
        match problem.kind {
            Kind::Silent => note(format!("{text}; {retry}")),
            _ => note(format!("the line is lost: {text}; {retry}")),
        }
        if unconfirmed > 0 {
            note(format!("the last {unconfirmed} samples are left out: nothing confirmed them"));
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
        self.object.clone().at(elapsed.as_secs_f64()).with("event", name)
    }
}
