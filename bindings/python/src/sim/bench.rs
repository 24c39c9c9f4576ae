//! Drives on virtual time.

use std::path::PathBuf;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::Instant as Moment;

use motorlink_link::fault::Faults;
use motorlink_proto::time::{Instant, Micros};
use motorlink_testbench::scenario::Kind;
use motorlink_testbench::{Bench, BenchConfig, Command, Recording};
use pyo3::prelude::*;
use pyo3::types::{PyByteArray, PyDict};

use super::port::SimPort;
use super::serving::SimServing;
use crate::error::invalid_value;
use crate::number::{array_bytes, digits};

/// Step of virtual time between checks of the real time.
const SLICE: Micros = Micros::from_millis(20);
/// Longest delay of a signal, such as Ctrl-C.
const LOOK: std::time::Duration = std::time::Duration::from_millis(20);

/// An ST drive and a bus of RMD motors. Their time advances while it is waited for.
#[pyclass(frozen, module = "motorlink._core")]
pub(crate) struct SimBench(Arc<Bench>);

#[pymethods]
impl SimBench {
    /// A bench of a configuration: `toml` or `json` text, or the `path` of a TOML file.
    #[new]
    #[pyo3(signature = (*, toml = "", json = None, path = None, seed = None))]
    fn new(
        py: Python<'_>,
        toml: &str,
        json: Option<&str>,
        path: Option<PathBuf>,
        seed: Option<i64>,
    ) -> PyResult<Self> {
        let seed = seed.map(|seed| noise_seed(py, seed)).transpose()?;
        let config = match (json, path) {
            (Some(json), _) => BenchConfig::parse_json(json),
            (None, Some(path)) => BenchConfig::read(&path),
            (None, None) => BenchConfig::parse(toml),
        };
        let config = config.map(|config| match seed {
            Some(seed) => config.seeded(seed),
            None => config,
        });
        let bench = config.and_then(|config| Bench::new(&config));
        Ok(SimBench(Arc::new(bench.map_err(|error| invalid_value(py, error))?)))
    }

    /// The bench as a port, with faults.
    #[pyo3(signature = (fault = None))]
    fn port(&self, py: Python<'_>, fault: Option<&str>) -> PyResult<SimPort> {
        let faults = fault.map(str::parse).transpose().map_err(|error| invalid_value(py, error))?;
        Ok(SimPort { bench: Arc::clone(&self.0), faults: faults.unwrap_or(Faults::NONE) })
    }

    /// The profile of the ST drive.
    #[getter]
    fn profile(&self) -> &'static str {
        self.0.profile().name()
    }

    /// The time, s.
    #[getter]
    fn now(&self) -> f64 {
        self.0.now().0 as f64 / 1e6
    }

    /// Advances the time, s. A signal ends it.
    fn run(&self, py: Python<'_>, seconds: f64) -> PyResult<()> {
        let span = microseconds(py, "a time", seconds)?;
        let end = self.0.now() + span;
        while py.detach(|| self.advance(end)) {
            py.check_signals()?;
        }
        Ok(())
    }

    /// Executes a command in JSON. Returns the reply in JSON.
    fn execute(&self, py: Python<'_>, command: &str) -> PyResult<String> {
        let answer = Command::read(command).and_then(|command| self.0.execute(&command));
        answer.map(|answer| answer.to_string()).map_err(|why| invalid_value(py, why))
    }

    /// Names and units of all signals, motor by motor.
    #[getter]
    fn signals(&self) -> Vec<(&str, &'static str)> {
        let signals = self.0.signals().iter();
        signals.map(|signal| (signal.name.as_str(), signal.kind.unit())).collect()
    }

    /// The values of a motor's signals, as words where they have some.
    fn truth<'py>(&self, py: Python<'py>, motor: &str) -> PyResult<Bound<'py, PyDict>> {
        let truth = PyDict::new(py);
        for (signal, value) in self.0.signals().iter().zip(py.detach(|| self.0.values())) {
            let Some((_, name)) = signal.name.split_once('.').filter(|(of, _)| *of == motor) else {
                continue;
            };
            match signal.kind {
                Kind::Number { .. } => truth.set_item(name, value)?,
                Kind::Named(names) => truth.set_item(name, names.name(value as u8))?,
            }
        }
        Ok(truth)
    }

    /// Records signals from now on, once every `every` s.
    fn record(&self, py: Python<'_>, signals: Vec<String>, every: f64) -> PyResult<SimRecording> {
        let signals: Vec<&str> = signals.iter().map(String::as_str).collect();
        let every = microseconds(py, "a sample period", every)?;
        let recording = py.detach(|| self.0.record(&signals, every));
        let recording = recording.map_err(|why| invalid_value(py, why))?;
        let every = recording.every().0;
        Ok(SimRecording { recording: Mutex::new(Some(recording)), every })
    }

    /// A hash of the state of all drives.
    #[getter]
    fn state_hash(&self, py: Python<'_>) -> u64 {
        py.detach(|| self.0.state_hash())
    }

    /// Serves the drives on ports, on real time.
    #[pyo3(signature = (*, st = None, rmd = None))]
    fn serve(&self, py: Python<'_>, st: Option<&str>, rmd: Option<&str>) -> PyResult<SimServing> {
        SimServing::new(py, &self.0, st, rmd)
    }
}

impl SimBench {
    /// Advances the time to `end`, at most for the delay of signals. Returns whether some is left.
    fn advance(&self, end: Instant) -> bool {
        let began = Moment::now();
        loop {
            let left = end.since(self.0.now());
            if left == Micros(0) || began.elapsed() > LOOK {
                return left > Micros(0);
            }
            self.0.run(left.min(SLICE));
        }
    }
}

/// The seed of a configuration.
fn noise_seed(py: Python<'_>, seed: i64) -> PyResult<u32> {
    u32::try_from(seed).map_err(|_| {
        invalid_value(py, format_args!("a seed of {seed}: give 0 to {}, 32 bits", u32::MAX))
    })
}

/// A time in s, up to a day.
fn microseconds(py: Python<'_>, what: &str, seconds: f64) -> PyResult<Micros> {
    const DAY: u64 = 86_400_000_000;
    let span = digits(py, what, seconds, 1e-6, "s").ok().filter(|span: &u64| *span <= DAY);
    span.map(Micros).ok_or_else(|| {
        invalid_value(py, format_args!("{what} of {seconds} s: give 0 to 86400 s, a day"))
    })
}

/// Signals that are recorded while time advances.
#[pyclass(frozen, module = "motorlink._core")]
pub(crate) struct SimRecording {
    recording: Mutex<Option<Recording>>,
    /// From row to row, µs.
    #[pyo3(get)]
    every: u64,
}

#[pymethods]
impl SimRecording {
    /// The values since the last call as `float64` in native byte order, row by row.
    fn take<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyByteArray>> {
        let rows = py.detach(|| self.lock().as_ref().map(Recording::take));
        array_bytes(py, rows.as_deref().unwrap_or(&[]))
    }

    /// Ends it. A second call does nothing.
    fn end(&self) {
        drop(self.lock().take());
    }
}

impl SimRecording {
    fn lock(&self) -> MutexGuard<'_, Option<Recording>> {
        self.recording.lock().unwrap_or_else(PoisonError::into_inner)
    }
}
