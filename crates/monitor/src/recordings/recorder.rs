//! The recording that is made, in a thread of its own. It needs no page and no web server.

use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::mpsc::{Receiver, RecvTimeoutError, Sender, channel};
use std::thread::JoinHandle;
use std::time::{Duration, SystemTime, UNIX_EPOCH};

use motorlink_proto::time::Micros;
use motorlink_recording::record::{Abort, Config, Port, Progress, Recorder};
use motorlink_recording::schema::name;
use motorlink_recording::write::Output;
use motorlink_recording::{RecordError, WriteError};
use motorlink_telemetry::share::address::Address;
use motorlink_telemetry::share::client::Refusal;
use motorlink_telemetry::share::drive_protocol::DriveProtocol;
use motorlink_telemetry::share::message::{Line, Reason};
use tokio::sync::{oneshot, watch};

use super::folder::Name;
use crate::message::{Gap, MeanRate, Phase, Recorded};

/// How often pages are told how far it is.
const TOLD: Duration = Duration::from_millis(500);
/// How many recordings of the same second get a name.
const NUMBERS: u32 = 100;

/// What to record.
pub struct Order {
    pub folder: PathBuf,
    pub share: Arc<dyn Address>,
    pub lines: Vec<Line>,
    pub period: Micros,
    /// The page that asked for it.
    pub by: String,
}

/// A recording in its thread.
pub struct Making {
    ends: Sender<()>,
    abort: Abort,
    thread: JoinHandle<()>,
}

/// What pages are told. Whatever ends the thread, they are told that it is over.
struct ProgressSender(watch::Sender<Option<Recorded>>);

impl Making {
    /// Begins a recording. `begun` gets its name as soon as it is known that it begins.
    ///
    /// # Errors
    /// The system gives no thread.
    pub fn start(
        order: Order,
        told: watch::Sender<Option<Recorded>>,
        begun: oneshot::Sender<Result<String, Refusal>>,
    ) -> Result<Self, Refusal> {
        let (ends, end) = channel();
        let abort = Abort::default();
        let of_thread = abort.clone();
        let telling = ProgressSender(told);
        telling.0.send_replace(Some(Recorded::starting(&order.by)));
        let thread = std::thread::Builder::new().name("monitor-record".to_owned());
        let thread = thread.spawn(move || run(&order, &telling, &of_thread, &end, begun));
        let thread =
            thread.map_err(|error| Refusal::usage(format!("cannot start a thread: {error}")))?;
        Ok(Making { ends, abort, thread })
    }

    /// Whether nothing is recorded any more.
    pub fn is_over(&self) -> bool {
        self.thread.is_finished()
    }

    /// Ends it. Does not wait for that.
    pub fn end(&self) {
        self.abort.abort();
        // It has ended already.
        let _ = self.ends.send(());
    }
}

impl ProgressSender {
    fn change(&self, change: impl FnOnce(&mut Recorded)) {
        self.0.send_modify(|told| {
            if let Some(told) = told {
                change(told);
            }
        });
    }
}

impl Drop for ProgressSender {
    fn drop(&mut self) {
        self.change(|told| {
            if told.is_active() {
                told.phase = Phase::Failed;
                told.message = Some("the server has a fault".to_owned());
            }
        });
    }
}

fn run(
    order: &Order,
    telling: &ProgressSender,
    abort: &Abort,
    end: &Receiver<()>,
    begun: oneshot::Sender<Result<String, Refusal>>,
) {
    let recorder = match start(order, telling, abort) {
        Ok(recorder) => recorder,
        Err(refusal) => {
            telling.change(|told| {
                told.phase = Phase::Failed;
                told.message = Some(refusal.message.clone());
            });
            // The page may have gone. The recording does not depend on it.
            let _ = begun.send(Err(refusal));
            return;
        }
    };
    let lines = recorder.lines().iter();
    let motors = lines.flat_map(|line| line.motors.iter().map(|it| name::path(&line.label, *it)));
    let motors: Vec<String> = motors.collect();
    telling.change(|told| {
        told.phase = Phase::Recording;
        told.motors = motors;
    });
    let name = telling.0.borrow().as_ref().map(|told| told.name.clone()).unwrap_or_default();
    let _ = begun.send(Ok(name));
    loop {
        let progress = recorder.progress();
        telling.change(|told| told.take(&progress));
        if progress.is_over {
            break;
        }
        match end.recv_timeout(TOLD) {
            Err(RecvTimeoutError::Timeout) => {}
            Ok(()) | Err(RecvTimeoutError::Disconnected) => break,
        }
    }
    telling.change(|told| told.phase = Phase::Ending);
    let ended = recorder.end();
    telling.change(|told| match ended {
        Ok(progress) => {
            told.take(&progress);
            told.phase = Phase::Ended;
        }
        Err(error) => {
            told.phase = Phase::Failed;
            told.message = Some(error.to_string());
        }
    });
}

/// Starts to record the lines whose motors answer. The others are left out.
fn start(order: &Order, telling: &ProgressSender, abort: &Abort) -> Result<Recorder, Refusal> {
    make(&order.folder)?;
    let mut config = order.config()?;
    let mut numbers = 1..=NUMBERS;
    let mut name = None;
    loop {
        if name.is_none() {
            name = numbers.next().map(|number| Name::of(SystemTime::now(), number));
        }
        let Some(file) = name.clone() else {
            return Err(Refusal::usage("all names of this second are taken"));
        };
        config.output.path = order.folder.join(file.to_string());
        telling.change(|told| told.name = file.to_string());
        match Recorder::start_unless(abort, &config) {
            Ok(recorder) => return Ok(recorder),
            Err(RecordError::File(WriteError::Exists { .. })) => name = None,
            Err(RecordError::NoMotor { port, .. }) if config.ports.len() > 1 => {
                config.ports.retain(|it| it.name.to_string() != port);
                let line = order.lines.iter().find(|it| order.share.port(&it.line) == port);
                telling.change(|told| told.left_out.extend(line.map(|it| it.line.clone())));
            }
            Err(error) => return Err(refused(&error)),
        }
    }
}

/// Makes the folder if it is not there.
fn make(folder: &Path) -> Result<(), Refusal> {
    if folder.is_dir() {
        return Ok(());
    }
    let made = std::fs::create_dir(folder);
    made.map_err(|error| {
        Refusal::usage(format!("cannot make the folder {}: {error}", folder.display()))
    })
}

impl Order {
    fn config(&self) -> Result<Config, Refusal> {
        let port = |line: &Line| {
            let name = self.share.port(&line.line);
            let profile = DriveProtocol::of(line).and_then(DriveProtocol::profile);
            Ok(Port {
                name: name.parse().map_err(|error| Refusal::usage(format!("{error}")))?,
                profile: profile.unwrap_or_default(),
                timeout: None,
                motors: Vec::new(),
                ids: Default::default(),
                full_scale: None,
            })
        };
        Ok(Config {
            ports: self.lines.iter().map(port).collect::<Result<_, Refusal>>()?,
            clients: Vec::new(),
            signals: Vec::new(),
            period: self.period,
            settings: true,
            output: Output::default(),
            by: Arc::from(format!("recording of {}", self.by)),
            command: format!("motorlink monitor: asked for by {}", self.by),
        })
    }
}

impl Recorded {
    fn starting(by: &str) -> Self {
        let began = SystemTime::now().duration_since(UNIX_EPOCH).unwrap_or_default();
        Recorded { by: by.to_owned(), began: began.as_secs_f64(), ..Recorded::default() }
    }

    /// Whether it is not over.
    pub fn is_active(&self) -> bool {
        matches!(self.phase, Phase::Starting | Phase::Recording | Phase::Ending)
    }

    fn take(&mut self, progress: &Progress) {
        self.seconds = progress.elapsed.as_secs_f64();
        self.bytes = progress.written.bytes;
        self.values = progress.counts.values;
        self.lost = progress.counts.lost;
        self.unconfirmed = progress.counts.unconfirmed;
        self.rates = progress.rates.map(|(asked, achieved)| [asked, achieved]);
        let slowest = progress.slowest.clone();
        self.slowest = slowest.map(|(motor, rate)| MeanRate { motor, rate });
        let gap = |(motor, gap): &(String, Duration)| Gap {
            motor: motor.clone(),
            seconds: gap.as_secs_f64(),
        };
        self.gaps = progress.gaps.iter().map(gap).collect();
        self.silent.clone_from(&progress.silent);
        self.refused.clone_from(&progress.refused);
    }
}

fn refused(error: &RecordError) -> Refusal {
    let reason = match error {
        RecordError::NoMotor { .. } => Reason::Silent,
        RecordError::Line(_) | RecordError::Share { .. } | RecordError::Ended(_) => Reason::Line,
        _ => Reason::Usage,
    };
    Refusal::new(reason, error.to_string())
}
