//! Recordings as arrays. No value is a Python object of its own.

use std::fs::File;
use std::io;
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex, PoisonError};

use motorlink_recording::read::{Drive, ReadError, Recording, Table, Tables, lost};
use motorlink_recording::schema::{
    Direction, FrameResult, Log, SETTINGS_TYPE, SignalField, recording,
};
use motorlink_telemetry::label::distinct;
use pyo3::prelude::*;
use pyo3::types::{PyByteArray, PyBytes, PyDict, PyList};

use crate::error::recording_error;
use crate::number::array_bytes;
use crate::signals::attended;

/// The name of the time in a table.
const TIME: &str = "t";

/// An open recording.
#[pyclass(frozen, module = "motorlink._core")]
pub(crate) struct RecordingFile {
    path: PathBuf,
    recording: Arc<Mutex<Recording<File>>>,
}

#[pymethods]
impl RecordingFile {
    /// Opens a file, whole or broken.
    #[staticmethod]
    fn open(py: Python<'_>, path: PathBuf) -> PyResult<Self> {
        let opened = path.clone();
        let opened = attended(py, move || Recording::open(&opened))?;
        let recording =
            Arc::new(Mutex::new(opened.map_err(|error| unreadable(py, &path, &error))?));
        Ok(RecordingFile { path, recording })
    }

    /// Reads all signals and events. Returns time 0 in ns since 1970, the tables, the events, and how
    /// many messages are not of the type of their topic.
    ///
    /// A table is its motor, its topic, its columns `(name, unit, values)`, its times in ns, and the
    /// spans of its rows in s. The first column is the time since time 0.
    fn tables<'py>(&self, py: Python<'py>) -> PyResult<(u64, Bound<'py, PyList>, Vec<Event>, u64)> {
        let read: Tables = self.read(py, |recording| recording.tables(|_, _| true))?;
        let zero = read.zero();
        let tables = PyList::empty(py);
        for table in read.tables {
            tables.append(table_of(py, zero, table)?)?;
        }
        let events = read.events.into_iter().map(|event| event_of(zero, event)).collect();
        Ok((zero, tables, events, read.malformed))
    }

    /// Reads the frames of a line. Returns their columns: times in ns, directions, identifiers,
    /// results, where the bytes of each begin, all bytes; and how many messages are no frames.
    fn frames<'py>(&self, py: Python<'py>, label: String) -> PyResult<Frames<'py>> {
        let (columns, malformed) = self.read(py, move |recording| {
            let mut frames = recording.frames();
            let mut columns = Columns::default();
            for frame in &mut frames {
                let (line, frame) = frame?;
                if *line.label == *label {
                    columns.times.push(frame.stamp.0);
                    columns.directions.push(frame.direction as u8);
                    columns.ids.push(frame.id);
                    columns.results.push(frame.result as u8);
                    columns.begins.push(columns.data.len() as u64);
                    columns.data.extend(&frame.data);
                }
            }
            columns.begins.push(columns.data.len() as u64);
            Ok((columns, frames.malformed()))
        })?;
        Ok((
            array_bytes(py, &columns.times)?,
            PyByteArray::new(py, &columns.directions),
            array_bytes(py, &columns.ids)?,
            PyByteArray::new(py, &columns.results),
            array_bytes(py, &columns.begins)?,
            PyBytes::new(py, &columns.data),
            malformed,
        ))
    }

    /// The labels of the lines whose frames were recorded.
    #[getter]
    fn lines(&self) -> Vec<String> {
        let mut labels: Vec<String> =
            self.lock().lines().values().map(|line| line.label.to_string()).collect();
        labels.sort();
        labels.dedup();
        labels
    }

    /// What was lost, as far as it was read; `None`: nothing.
    #[getter]
    fn lost(&self) -> Option<String> {
        lost(self.lock().losses())
    }

    /// Bytes that could not be read so far.
    #[getter]
    fn lost_bytes(&self) -> u64 {
        self.lock().lost_bytes()
    }

    /// All metadata records.
    #[getter]
    fn metadata<'py>(&self, py: Python<'py>) -> PyResult<Vec<(String, Bound<'py, PyDict>)>> {
        let recording = self.lock();
        let records = recording.metadata().iter();
        records.map(|it| Ok((it.name.clone(), facts(py, &it.values)?))).collect()
    }

    /// What is known of the recording.
    #[getter]
    fn about<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        let recording = self.lock();
        let about = recording.metadata().iter().find(|it| it.name == recording::NAME);
        about.map_or_else(|| Ok(PyDict::new(py)), |about| facts(py, &about.values))
    }

    /// The motors: name, label, port, protocol, profile, number, identity, settings.
    #[getter]
    fn drives(&self) -> Vec<Recorded> {
        let mut recording = self.lock();
        let drives: Vec<Drive> = recording.drives().collect();
        let of = |drive: Drive| {
            let settings =
                drive.settings.as_deref().and_then(|name| settings(&mut recording, name));
            let Drive { name, label, port, protocol, profile, motor, identity, .. } = drive;
            (name, label, port, protocol, profile, motor, identity, settings)
        };
        drives.into_iter().map(of).collect()
    }
}

/// A motor for Python.
type Recorded =
    (String, String, String, String, Option<String>, Option<u8>, Vec<String>, Option<String>);

/// An event for Python: time in s and ns, severity, whom it concerns, kind, sentence, who.
type Event = (f64, u64, &'static str, String, String, String, String);

type Frames<'py> = (
    Bound<'py, PyByteArray>,
    Bound<'py, PyByteArray>,
    Bound<'py, PyByteArray>,
    Bound<'py, PyByteArray>,
    Bound<'py, PyByteArray>,
    Bound<'py, PyBytes>,
    u64,
);

#[derive(Default)]
struct Columns {
    times: Vec<u64>,
    directions: Vec<u8>,
    ids: Vec<u32>,
    results: Vec<u8>,
    begins: Vec<u64>,
    data: Vec<u8>,
}

impl RecordingFile {
    /// Reads something of the file. Signal handlers run meanwhile.
    fn read<T: Send + 'static>(
        &self,
        py: Python<'_>,
        read: impl FnOnce(&mut Recording<File>) -> io::Result<T> + Send + 'static,
    ) -> PyResult<T> {
        let recording = Arc::clone(&self.recording);
        let work = move || read(&mut recording.lock().unwrap_or_else(PoisonError::into_inner));
        attended(py, work)?.map_err(|error| unreadable(py, &self.path, &error.into()))
    }

    fn lock(&self) -> std::sync::MutexGuard<'_, Recording<File>> {
        self.recording.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

/// The names of the directions of frames, by number.
#[pyfunction]
pub(crate) fn recorded_directions() -> Vec<&'static str> {
    Direction::ALL.iter().map(|direction| direction.name()).collect()
}

/// The names of what frames are, by number.
#[pyfunction]
pub(crate) fn recorded_results() -> Vec<&'static str> {
    FrameResult::ALL.iter().map(|result| result.name()).collect()
}

fn unreadable(py: Python<'_>, path: &Path, error: &ReadError) -> PyErr {
    let errno = match error {
        ReadError::Io(error) => error.raw_os_error(),
        _ => None,
    };
    let message = format_args!("cannot read `{}`: {error}", path.display());
    recording_error(py, message, path, errno)
}

/// Seconds since time 0. An event may be before it.
fn since(zero: u64, time: u64) -> f64 {
    (i128::from(time) - i128::from(zero)) as f64 / 1e9
}

fn table_of<'py>(py: Python<'py>, zero: u64, table: Table) -> PyResult<Bound<'py, PyAny>> {
    let motor = table.motor().to_owned();
    let Table { topic, fields, times, spans, columns } = table;
    let list = PyList::empty(py);
    let t: Vec<f64> = times.iter().map(|time| since(zero, *time)).collect();
    list.append((TIME, "s", array_bytes(py, &t)?))?;
    let names = fields.iter().map(|field: &SignalField| field.signal.clone());
    let names =
        distinct([TIME.to_owned()].into_iter().chain(names), |name, n| format!("{name}_{n}"));
    for ((name, field), column) in names.into_iter().skip(1).zip(fields).zip(columns) {
        list.append((name, field.unit, array_bytes(py, &column)?))?;
    }
    let (times, spans) = (array_bytes(py, &times)?, array_bytes(py, &spans)?);
    (motor, topic, list, times, spans).into_pyobject(py).map(Bound::into_any)
}

fn event_of(zero: u64, event: Log) -> Event {
    let Log { stamp, severity, name, message, by, kind } = event;
    (since(zero, stamp.0), stamp.0, severity.name(), name, kind, message, by)
}

fn facts<'py>(
    py: Python<'py>,
    values: &std::collections::BTreeMap<String, String>,
) -> PyResult<Bound<'py, PyDict>> {
    let facts = PyDict::new(py);
    for (name, value) in values {
        facts.set_item(name, value)?;
    }
    Ok(facts)
}

/// The settings in an attachment. `None` if it is damaged.
fn settings(recording: &mut Recording<File>, name: &str) -> Option<String> {
    let read = recording.attachment(name).ok()??;
    (read.media_type == SETTINGS_TYPE).then(|| String::from_utf8(read.data).ok())?
}
