//! Recordings in progress. No thread of them waits for Python.

use std::collections::BTreeMap;
use std::path::PathBuf;
use std::sync::mpsc::{self, Receiver, RecvTimeoutError};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

use motorlink::port::PortName;
use motorlink::rmd::MotorSet;
use motorlink::st::MotorNumber;
use motorlink::{Clock, LOOK};
use motorlink_recording::record::client::{Client, Kind};
use motorlink_recording::record::frames::Outlet;
use motorlink_recording::record::{Config, Line, Port, Progress, Recorder};
use motorlink_recording::schema::name;
use motorlink_recording::write::{LEAST_ROTATION, LEAST_SIZE, Output, Rotate};
use motorlink_recording::{RecordError, WriteError};
use motorlink_telemetry::event::CommandError;
use motorlink_telemetry::signal::Motor;
use pyo3::prelude::*;

use crate::error::{invalid_value, line_error, link_error, recording_error};
use crate::number::span;
use crate::rmd::motor_id;
use crate::sampling::period;
use crate::shared::Owner;
use crate::signals::attended;
use crate::st::{no_such_motor, profile_named};

/// An open client to record.
#[pyclass(frozen, module = "motorlink._core")]
pub(crate) struct RecordedClient(Client);

impl RecordedClient {
    /// A client whose time is that of the machine.
    pub(crate) fn new(
        py: Python<'_>,
        port: &str,
        clock: &Clock,
        outlet: &Outlet,
        kind: Kind,
    ) -> PyResult<Self> {
        if clock.is_virtual() {
            let why = "has a time of its own, which advances only while it is used";
            return Err(invalid_value(py, format_args!("{port} cannot be recorded: it {why}")));
        }
        let (port, clock, outlet) = (port.to_owned(), clock.clone(), outlet.clone());
        Ok(RecordedClient(Client { port, clock, outlet, motors: Vec::new(), kind }))
    }
}

/// A recording in progress.
#[pyclass(frozen, module = "motorlink._core")]
pub(crate) struct RecordingInProgress {
    state: Mutex<State>,
    owner: Owner,
    motors: Vec<String>,
}

enum State {
    Running(Recorder),
    /// The file is being ended.
    Ending(Progress, Receiver<Result<Progress, WriteError>>),
    Ended(Progress, Option<WriteError>),
}

/// How far it is. The fields are those of `recording.Status` in Python.
#[derive(IntoPyObject)]
struct Status {
    seconds: f64,
    files: Vec<PathBuf>,
    bytes: u64,
    rows: u64,
    values: u64,
    frames: u64,
    unconfirmed: u64,
    lost: u64,
    asked_hz: Option<f64>,
    achieved_hz: Option<f64>,
    refused: Vec<String>,
    silent: Vec<String>,
    gaps: BTreeMap<String, f64>,
    is_over: bool,
}

#[pymethods]
impl RecordingInProgress {
    /// Makes the file, opens the ports, and begins.
    #[staticmethod]
    fn start(
        py: Python<'_>,
        ports: Vec<String>,
        clients: Vec<PyRef<'_, RecordedClient>>,
        path: PathBuf,
        signals: Vec<String>,
        rate: f64,
        profile: &str,
        timeout: Option<f64>,
        motors: Vec<i64>,
        ids: Vec<i64>,
        settings: bool,
        force: bool,
        max_size: Option<u64>,
        rotate_size: Option<u64>,
        rotate_seconds: Option<f64>,
        fsync: Option<f64>,
        command: String,
    ) -> PyResult<Self> {
        let profile = profile_named(py, profile)?;
        let timeout = timeout.map(|timeout| span(py, "a timeout", timeout)).transpose()?;
        let number = |motor: i64| {
            let number = u8::try_from(motor).ok().and_then(MotorNumber::new);
            number.ok_or_else(|| no_such_motor(py, motor))
        };
        let motors: Vec<MotorNumber> = motors.into_iter().map(number).collect::<PyResult<_>>()?;
        let ids: MotorSet = ids.into_iter().map(|id| motor_id(py, id)).collect::<PyResult<_>>()?;
        let port = |text: String| -> PyResult<Port> {
            let name: PortName = text.parse().map_err(|error| invalid_value(py, error))?;
            let (motors, full_scale) = (motors.clone(), None);
            Ok(Port { name, profile, timeout, motors, ids, full_scale })
        };
        let ports = ports.into_iter().map(port).collect::<PyResult<_>>()?;
        let of_client = |client: PyRef<'_, RecordedClient>| {
            let mut client = client.0.clone();
            client.motors = match client.kind {
                Kind::St { .. } => motors.iter().copied().map(Motor::St).collect(),
                Kind::Rmd { .. } => ids.map(Motor::Rmd).collect(),
            };
            client
        };
        let config = Config {
            ports,
            clients: clients.into_iter().map(of_client).collect(),
            signals,
            period: period(py, rate)?,
            settings,
            output: Output {
                path: path.clone(),
                force,
                rotate: rotation(py, rotate_size, rotate_seconds)?,
                max_size: max_size.map(|size| enough(py, "max_size", size)).transpose()?,
                sync_every: fsync.map(|fsync| span(py, "fsync", fsync)).transpose()?,
            },
            by: Arc::from(format!("motorlink record {}", std::process::id())),
            command,
        };
        let started = attended(py, move || Recorder::start(&config))?;
        let recorder = started.map_err(|error| refused(py, error))?;
        let motors = recorder.lines().iter().flat_map(motors_of).collect();
        let state = Mutex::new(State::Running(recorder));
        Ok(RecordingInProgress { state, owner: Owner::new(), motors })
    }

    /// The motors: `st0/motor1`.
    #[getter]
    fn motors(&self) -> Vec<String> {
        self.motors.clone()
    }

    /// Whether this process has started it. A forked process has not.
    #[getter]
    fn is_here(&self) -> bool {
        self.owner.is_here()
    }

    /// How far it is.
    fn status(&self, py: Python<'_>) -> Status {
        let (progress, ended) = py.detach(|| {
            let mut state = self.lock();
            let ended = state.wait(Duration::ZERO);
            match &*state {
                State::Running(recorder) => (recorder.progress(), ended),
                State::Ending(progress, _) | State::Ended(progress, _) => (progress.clone(), ended),
            }
        });
        let Progress { elapsed, written, counts, rates, refused, silent, gaps, is_over, .. } =
            progress;
        Status {
            seconds: elapsed.as_secs_f64(),
            files: written.files,
            bytes: written.bytes,
            rows: counts.rows,
            values: counts.values,
            frames: counts.frames,
            unconfirmed: counts.unconfirmed,
            lost: counts.lost,
            asked_hz: rates.map(|(asked, _)| asked),
            achieved_hz: rates.map(|(_, achieved)| achieved),
            refused,
            silent,
            gaps: gaps.into_iter().map(|(motor, gap)| (motor, gap.as_secs_f64())).collect(),
            is_over: is_over || ended,
        }
    }

    /// Begins to end it, and does not wait.
    fn begin_end(&self, py: Python<'_>) {
        if self.owner.is_here() {
            py.detach(|| self.lock().end());
        }
    }

    /// Ends it, and waits so many s for the disk. Whether the file is complete; an error if it cannot be
    /// written.
    fn finish(&self, py: Python<'_>, wait: f64) -> PyResult<bool> {
        self.begin_end(py);
        let deadline = Instant::now() + span(py, "a time", wait)?;
        loop {
            let over = py.detach(|| {
                let left = deadline.saturating_duration_since(Instant::now());
                self.lock().wait(left.min(LOOK))
            });
            if over {
                break;
            }
            py.check_signals()?;
            if Instant::now() >= deadline {
                return Ok(false);
            }
        }
        match &*self.lock() {
            State::Ended(_, Some(error)) => Err(unwritten(py, error)),
            _ => Ok(true),
        }
    }
}

impl RecordingInProgress {
    fn lock(&self) -> MutexGuard<'_, State> {
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl Drop for RecordingInProgress {
    /// Nothing waits here: the interpreter is locked.
    fn drop(&mut self) {
        match self.owner.is_here() {
            true => self.lock().end(),
            false => {
                // The threads of the parent are not in this process: they cannot be waited for.
                let progress = Progress::default();
                std::mem::forget(std::mem::replace(
                    &mut *self.lock(),
                    State::Ended(progress, None),
                ));
            }
        }
    }
}

impl State {
    /// Begins the end, in a thread.
    fn end(&mut self) {
        let State::Running(recorder) = self else { return };
        let (tell, told) = mpsc::channel();
        let next = State::Ending(recorder.progress(), told);
        if let State::Running(recorder) = std::mem::replace(self, next) {
            // Without a thread the recorder ends here.
            let _ = std::thread::Builder::new().spawn(move || drop(tell.send(recorder.end())));
        }
    }

    /// Waits for the end; whether it has come.
    fn wait(&mut self, time: Duration) -> bool {
        let State::Ending(progress, told) = self else { return matches!(self, State::Ended(..)) };
        let progress = progress.clone();
        let ended = match told.recv_timeout(time) {
            Ok(Ok(progress)) => State::Ended(progress, None),
            Ok(Err(error)) => State::Ended(progress, Some(error)),
            Err(RecvTimeoutError::Timeout) => return false,
            Err(RecvTimeoutError::Disconnected) => State::Ended(progress, None),
        };
        *self = ended;
        true
    }
}

fn motors_of(line: &Line) -> impl Iterator<Item = String> + '_ {
    line.motors.iter().map(|motor| name::path(&line.label, *motor))
}

fn rotation(py: Python<'_>, size: Option<u64>, seconds: Option<f64>) -> PyResult<Option<Rotate>> {
    match (size, seconds) {
        (None, None) => Ok(None),
        (Some(size), None) => Ok(Some(Rotate::Bytes(enough(py, "rotate_size", size)?))),
        (None, Some(seconds)) => {
            let time = span(py, "rotate_seconds", seconds)?;
            match time >= LEAST_ROTATION {
                true => Ok(Some(Rotate::Time(time))),
                false => {
                    let least = LEAST_ROTATION.as_secs();
                    Err(invalid_value(py, format_args!("a file takes {least} s at least")))
                }
            }
        }
        (Some(_), Some(_)) => {
            Err(invalid_value(py, "give rotate_size or rotate_seconds, not both"))
        }
    }
}

fn enough(py: Python<'_>, what: &str, size: u64) -> PyResult<u64> {
    match size >= LEAST_SIZE {
        true => Ok(size),
        false => Err(invalid_value(
            py,
            format_args!("{what} of {size} bytes: give {LEAST_SIZE} or more"),
        )),
    }
}

fn refused(py: Python<'_>, error: RecordError) -> PyErr {
    match &error {
        RecordError::File(why) => unwritten(py, why),
        RecordError::Line(why) => line_error(py, why),
        RecordError::NoMotor { why, .. } => match &**why {
            CommandError::Line(why) => {
                let cause = line_error(py, why);
                let raised = PyErr::from_type(cause.get_type(py), (error.to_string(),));
                raised.set_cause(py, Some(cause));
                raised
            }
            _ => link_error(py, &error),
        },
        RecordError::NoPort | RecordError::NoLine { .. } | RecordError::Signal(_) => {
            invalid_value(py, &error)
        }
        RecordError::Ended(_) | RecordError::Aborted | RecordError::Share { .. } => {
            link_error(py, &error)
        }
        RecordError::Thread(_) => link_error(py, &error),
    }
}

fn unwritten(py: Python<'_>, error: &WriteError) -> PyErr {
    let hint = match error {
        WriteError::Exists { .. } => "; give another name, or force=True to overwrite it",
        _ => "",
    };
    recording_error(py, format_args!("{error}{hint}"), error.path(), error.code())
}
