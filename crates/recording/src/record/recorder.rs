//! Records lines in threads: an engine each, one that makes messages, one that writes them.

use std::collections::BTreeSet;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

use motorlink_proto::time::{Instant as Moment, Micros};
use motorlink_telemetry::acquisition::Rate;
use motorlink_telemetry::runner::Runner;
use motorlink_telemetry::signal::Motor;
use parking_lot::Mutex;

use super::abort::Abort;
use super::choice::{self, Group};
use super::client::{Client, Lent};
use super::content::{Content, Counts, Line};
use super::followed::{self, Followed};
use super::losses::Losses;
use super::open::{Opened, Port, open};
use super::settings;
use super::topics::Topics;
use super::track::Track;
use super::wall::{DayInUse, wall_now};
use crate::error::{RecordError, WriteError};
use crate::schema::{self, Log, Severity, Time, drive, name, recording};
use crate::write::{Attached, Entry, Output, Pairs, Series, Writer, Written};

/// How often messages are made of what came.
pub(super) const TURN: Duration = Duration::from_millis(20);
/// How often the rates of the engines are asked for.
pub(super) const RATES: Duration = Duration::from_millis(1_100);
/// How long the end waits until the last values are confirmed.
const CONFIRMATION: Duration = Duration::from_millis(500);

/// How long the end waits until a share has said its last rows, which it confirms within 0.1 s.
const OF_SHARE: Duration = Duration::from_millis(250);

/// How long it waits for them besides. A share that says nothing is given up earlier.
const LAST: Duration = Duration::from_secs(5);

/// What is recorded.
#[derive(Debug, Clone)]
pub struct Config {
    /// The ports.
    pub ports: Vec<Port>,
    /// Open clients.
    pub clients: Vec<Client>,
    /// The names of the signals. Empty: a set that fits most uses.
    pub signals: Vec<String>,
    /// How often they are read.
    pub period: Micros,
    /// Whether the settings of the motors are read before.
    pub settings: bool,
    /// Where it goes.
    pub output: Output,
    /// The name of the program among those that use the motors.
    pub by: Arc<str>,
    /// The command line, for the metadata.
    pub command: String,
}

/// How far a recording is.
#[derive(Debug, Clone, Default)]
pub struct Progress {
    /// How long it has recorded.
    pub elapsed: Duration,
    /// What is in the files.
    pub written: Written,
    /// Values, frames, losses.
    pub counts: Counts,
    /// The rate of the signals that have values, Hz: asked, and the least that is reached.
    pub rates: Option<(f64, f64)>,
    /// Signals that the drives refuse to give, as `st0/motor1/SPEED_MEAS`.
    pub refused: Vec<String>,
    /// Motors of which no value came, as `st0/motor1`.
    pub silent: Vec<String>,
    /// Motors without values for longer than 1 s (at low rates: three periods), and for how long in all.
    pub gaps: Vec<(String, Duration)>,
    /// The motor whose fast signals have the lowest mean rate since the start, and this rate in Hz.
    pub slowest: Option<(String, f64)>,
    /// Nothing more is recorded: the file cannot be written, or has the size that it may have.
    pub is_over: bool,
}

/// A recording in progress. It ends when this is dropped.
#[derive(Debug)]
pub struct Recorder {
    shared: Arc<Shared>,
    lines: Vec<Line>,
    thread: Option<JoinHandle<Result<Written, WriteError>>>,
}

#[derive(Debug, Default)]
struct Shared {
    progress: Mutex<Progress>,
    ends: AtomicBool,
}

/// A line, and what is made of it.
enum Recorded {
    /// This program reads the drives.
    Engine {
        track: Track,
        runner: Runner,
        lent: Option<Lent>,
        /// Rates of the engine, until they are taken.
        rates: Arc<Mutex<Option<Vec<Rate>>>>,
    },
    /// A share reads them.
    Share(Followed),
}

impl Recorder {
    /// Makes the file, opens the ports, reads the settings, and begins.
    ///
    /// # Errors
    /// See [`RecordError`]. No file is left then.
    pub fn start(config: &Config) -> Result<Self, RecordError> {
        Self::start_unless(&Abort::default(), config)
    }

    /// As [`start`](Self::start), which another thread may end.
    ///
    /// # Errors
    /// See [`RecordError`]. No file is left then.
    pub fn start_unless(abort: &Abort, config: &Config) -> Result<Self, RecordError> {
        if config.ports.is_empty() && config.clients.is_empty() {
            return Err(RecordError::NoPort);
        }
        let day = DayInUse::new();
        let series = Series::create(config.output.clone())?;
        let opened = open(&config.ports, &config.clients, &config.by, abort)?;
        let motors: Vec<Motor> = opened.iter().flat_map(|it| it.line.motors.clone()).collect();
        choice::check(&motors, &config.signals)?;
        let mut entries = vec![about(config)];
        let mut events = Vec::new();
        for it in &opened {
            for motor in &it.line.motors {
                drive(config, it, *motor, &mut entries, &mut events);
                abort.check()?;
            }
        }
        let choose = |it: &Opened| choice::choose(&it.line.motors, &config.signals, config.period);
        let groups: Vec<_> = opened.iter().map(choose).collect();
        let mut targets = Vec::new();
        for (Opened { runner, line, share, .. }, groups) in opened.iter().zip(&groups) {
            let Some(place) = share.clone() else { continue };
            // The share reads the signals from now on.
            runner.remote().end();
            let target = followed::target(place, line, groups, &config.by);
            targets.push((line.port.clone(), target));
        }
        let mut streams = followed::streams(targets)?.into_iter();
        let (mut topics, mut recorded) = (Topics::default(), Vec::new());
        let mut shares = BTreeSet::new();
        for (it, groups) in opened.into_iter().zip(groups) {
            let followed = it.share.as_ref().and_then(|(share, _)| Some((share, streams.next()?)));
            recorded.push(match followed {
                Some((share, stream)) => {
                    // Shares differ in the names of their ports. The first line of each has its events.
                    let is_first = shares.insert(share.port(""));
                    let content = Content::new(it.line, groups, &mut topics);
                    Recorded::Share(Followed::new(content, stream, is_first))
                }
                None => Recorded::read(it, groups, &mut topics)?,
            });
        }
        let lines = recorded.iter().map(|it| it.content().line().clone()).collect();
        abort.begun()?;
        let writer = Writer::start(series).map_err(RecordError::Thread)?;
        for entry in entries.into_iter().chain(topics.take()).chain(events) {
            writer.queue().push(entry);
        }
        let shared = Arc::new(Shared::default());
        shared.progress.lock().written = writer.progress().written;
        let theirs = Arc::clone(&shared);
        let thread = std::thread::Builder::new().name("motorlink-record".to_owned());
        let thread = thread.spawn(move || {
            let _day = day;
            run(recorded, writer, &theirs)
        });
        let thread = Some(thread.map_err(RecordError::Thread)?);
        Ok(Recorder { shared, lines, thread })
    }

    /// The lines that are recorded.
    pub fn lines(&self) -> &[Line] {
        &self.lines
    }

    /// How far it is.
    pub fn progress(&self) -> Progress {
        self.shared.progress.lock().clone()
    }

    /// Ends the recording and the file. Motors are not affected.
    ///
    /// # Errors
    /// The file cannot be written any more.
    pub fn end(mut self) -> Result<Progress, WriteError> {
        let written = self.close().unwrap_or_else(|| Ok(self.progress().written))?;
        Ok(Progress { written, ..self.progress() })
    }

    fn close(&mut self) -> Option<Result<Written, WriteError>> {
        self.shared.ends.store(true, Ordering::SeqCst);
        let thread = self.thread.take()?;
        thread.thread().unpark();
        thread.join().ok()
    }
}

impl Drop for Recorder {
    fn drop(&mut self) {
        self.close();
    }
}

fn run(
    mut recorded: Vec<Recorded>,
    writer: Writer,
    shared: &Shared,
) -> Result<Written, WriteError> {
    let began = Instant::now();
    let mut asked = began;
    let mut losses = Losses::default();
    while !shared.ends.load(Ordering::SeqCst) && !shared.progress.lock().is_over {
        std::thread::park_timeout(TURN);
        // The engine counts the values of the last second.
        if asked.elapsed() >= RATES {
            asked = Instant::now();
            recorded.iter_mut().for_each(Recorded::ask_rates);
        }
        turn(&mut recorded, &writer, &mut losses);
        tell(&recorded, &writer, &losses, began, shared);
    }
    await_confirmation(&mut recorded, &writer, &mut losses);
    let gaps = take_means(&recorded, &mut shared.progress.lock());
    let mut counts = Counts::default();
    for it in recorded {
        let ended = it.end(&mut |entry| {
            writer.queue().push(entry);
        });
        counts = counts.plus(ended);
    }
    counts.lost += writer.queue().lost();
    shared.progress.lock().counts = counts;
    if !gaps.is_empty() {
        writer.queue().push(Entry::Metadata(schema::gaps::NAME.to_owned(), gaps));
    }
    writer.end()
}

/// What is missing of each motor up to now; also for the file.
fn take_means(recorded: &[Recorded], progress: &mut Progress) -> Pairs {
    let now = wall_now();
    let gaps = recorded.iter().flat_map(|it| it.content().gaps(now));
    progress.gaps = gaps.map(|(motor, ns)| (motor, Duration::from_nanos(ns))).collect();
    let means = recorded.iter().flat_map(|it| it.content().mean_rates(now));
    progress.slowest = means.min_by(|(_, one), (_, other)| one.total_cmp(other));
    let text = |(motor, gap): &(String, Duration)| (motor.clone(), schema::gaps::text(*gap));
    progress.gaps.iter().map(text).collect()
}

fn turn(recorded: &mut [Recorded], writer: &Writer, losses: &mut Losses) {
    let now = wall_now();
    for it in recorded {
        it.take(now, &mut |entry| {
            writer.queue().push(entry);
        });
    }
    losses.tell(now, writer.queue());
}

fn tell(recorded: &[Recorded], writer: &Writer, losses: &Losses, began: Instant, shared: &Shared) {
    let of_writer = writer.progress();
    let mut progress = shared.progress.lock();
    progress.elapsed = began.elapsed();
    progress.written = of_writer.written;
    progress.is_over = of_writer.is_complete || of_writer.failed.is_some();
    let counts = recorded.iter().map(|it| it.content().counts);
    progress.counts = counts.fold(Counts::default(), Counts::plus);
    progress.counts.lost += losses.known;
    let rates = recorded.iter().flat_map(|it| it.content().rates());
    progress.rates = rates.reduce(|(asked, one), (_, other)| (asked, one.min(other)));
    progress.refused = recorded.iter().flat_map(|it| it.content().refused()).collect();
    progress.silent = recorded.iter().flat_map(|it| it.content().silent()).collect();
    take_means(recorded, &mut progress);
}

fn await_confirmation(recorded: &mut [Recorded], writer: &Writer, losses: &mut Losses) {
    let began = Instant::now();
    let ends: Vec<_> = recorded.iter().map(Recorded::now).collect();
    let is_pending = |recorded: &[Recorded]| {
        recorded.iter().zip(&ends).any(|(it, end)| match it {
            Recorded::Engine { track, .. } => end.is_some_and(|end| track.is_pending_before(end)),
            Recorded::Share(_) => began.elapsed() < OF_SHARE,
        })
    };
    let mut turn_while = |recorded: &mut [Recorded], is_so: &dyn Fn(&[Recorded]) -> bool| {
        while is_so(recorded) {
            std::thread::park_timeout(TURN);
            turn(recorded, writer, losses);
        }
    };
    turn_while(recorded, &|it| is_pending(it) && began.elapsed() < CONFIRMATION);
    // A network may be late with what the shares have said.
    recorded.iter_mut().for_each(Recorded::ask_last);
    let asked = Instant::now();
    turn_while(recorded, &|it| it.iter().any(Recorded::awaits_last) && asked.elapsed() < LAST);
}

impl Recorded {
    /// Reads a line.
    fn read(
        Opened { runner, line, anchor, taps, lent, .. }: Opened,
        groups: Vec<Group>,
        topics: &mut Topics,
    ) -> Result<Self, RecordError> {
        let track = Track::new(line, groups, anchor, taps, topics);
        for (subscription, wants) in track.subscriptions() {
            let (theirs, wants) = (subscription.clone(), wants.clone());
            runner.remote().with(|engine| engine.subscribe(theirs, wants))?;
        }
        Ok(Recorded::Engine { track, runner, lent, rates: Arc::default() })
    }

    fn content(&self) -> &Content {
        match self {
            Recorded::Engine { track, .. } => track.content(),
            Recorded::Share(followed) => followed.content(),
        }
    }

    /// The clock of an engine.
    fn now(&self) -> Option<Moment> {
        match self {
            Recorded::Engine { runner, .. } => {
                runner.remote().with(|engine| engine.clock().now()).ok()
            }
            Recorded::Share(_) => None,
        }
    }

    fn take(&mut self, now: Time, put: &mut dyn FnMut(Entry)) {
        match self {
            Recorded::Engine { track, rates, .. } => {
                if let Some(rates) = rates.lock().take() {
                    track.take_rates(&rates);
                }
                track.take(now, put);
            }
            Recorded::Share(followed) => followed.take(now, put),
        }
    }

    /// Ends it, and gives what was recorded.
    fn end(self, put: &mut dyn FnMut(Entry)) -> Counts {
        match self {
            Recorded::Engine { mut track, runner, lent, .. } => {
                // It moves no motor, so there is none to be stopped.
                runner.end();
                drop(lent);
                track.end(wall_now(), put);
                track.counts()
            }
            Recorded::Share(mut followed) => {
                followed.end(wall_now(), put);
                followed.content().counts
            }
        }
    }

    fn ask_last(&mut self) {
        if let Recorded::Share(followed) = self {
            followed.ask_last(wall_now());
        }
    }

    fn awaits_last(&self) -> bool {
        matches!(self, Recorded::Share(followed) if followed.awaits_last())
    }

    /// Asks for the rates without waiting for them.
    fn ask_rates(&mut self) {
        match self {
            Recorded::Engine { runner, rates, .. } => {
                let rates = Arc::clone(rates);
                // An engine that has ended has no rates.
                let _ = runner.remote().post(move |engine| {
                    *rates.lock() = Some(engine.rates().collect());
                });
            }
            Recorded::Share(followed) => followed.ask_rates(wall_now()),
        }
    }
}

/// What is known of the recording.
fn about(config: &Config) -> Entry {
    let pairs = [
        (recording::VERSION, env!("CARGO_PKG_VERSION").to_owned()),
        (recording::FORMAT, recording::FORMAT_1.to_owned()),
        (recording::BEGAN, wall_now().text()),
        (recording::COMMAND, config.command.clone()),
    ];
    let pairs = pairs.into_iter().map(|(key, value)| (key.to_owned(), value)).collect();
    Entry::Metadata(recording::NAME.to_owned(), pairs)
}

/// What is known of a motor: identity and settings.
fn drive(
    config: &Config,
    opened: &Opened,
    motor: Motor,
    entries: &mut Vec<Entry>,
    events: &mut Vec<Entry>,
) {
    let Opened { runner, line, .. } = opened;
    let mut pairs: Pairs = line.pairs();
    pairs.insert(drive::MOTOR.to_owned(), motor.number().to_string());
    if opened.share.is_some() {
        pairs.insert(drive::NO_FRAMES.to_owned(), "a share holds the port".to_owned());
    }
    let profile = line.speaks.profile().unwrap_or_default();
    let mut said = |message: String| {
        let stamp = wall_now();
        let log = Log {
            stamp,
            severity: Severity::Warn,
            name: name::path(&line.label, motor),
            message,
            by: String::new(),
            kind: "absent_settings".to_owned(),
        };
        events.push(Entry::message(Topics::EVENTS, stamp, &log));
    };
    if config.settings {
        match settings::read(runner.remote(), &config.by, motor, profile) {
            Ok(dump) => {
                for (number, line) in dump.identity().iter().enumerate() {
                    pairs.insert(format!("{}{number}", drive::IDENTITY), line.clone());
                }
                if !dump.absent().is_empty() {
                    said(format!("no settings of {}: it refuses them", dump.absent().join(", ")));
                }
                let attachment = name::settings_attachment(&line.label, motor);
                pairs.insert(drive::SETTINGS.to_owned(), attachment.clone());
                entries.push(Entry::Attached(Attached {
                    name: attachment,
                    media_type: schema::SETTINGS_TYPE.to_owned(),
                    time: wall_now().0,
                    data: dump.text().into_bytes(),
                }));
            }
            Err(why) => said(format!("its settings are not recorded: {why}")),
        }
    }
    entries.push(Entry::Metadata(drive::NAME.to_owned(), pairs));
}
