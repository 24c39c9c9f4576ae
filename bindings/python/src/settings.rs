//! Settings of motors, for both protocols and both APIs: steps out, outcomes in.

use std::fmt;
use std::sync::{Mutex, PoisonError};

use motorlink::settings::{
    Answer, Ask, Cause, Comparison, Difference, Dump, Next, Permissions, Procedure, RestoreError,
    RmdTuning, Setting, SettingsFile, StTuning, Step, StepError, Tuning, Undone, Unread,
};
use motorlink::st::{self, MotorNumber};
use pyo3::IntoPyObjectExt;
use pyo3::prelude::*;
use pyo3::types::PyList;

use crate::error::{ErrorClass, class_of, invalid_value, link_error, settings_error, st_error};
use crate::rmd::{RmdRequest, motor_id};
use crate::st::{StRequest, motor_number, profile_named};
use crate::values;

/// The settings of one motor.
#[pyclass(frozen, module = "motorlink._core")]
pub(crate) struct MotorSettings(Box<dyn AnySettings>);

/// A dump, a comparison or a restore in progress.
#[pyclass(module = "motorlink._core")]
pub(crate) struct SettingsSteps(Box<Steps>);

/// The settings of a motor, and those of a file.
#[pyclass(frozen, module = "motorlink._core")]
pub(crate) struct SettingsComparison(Box<dyn AnyComparison>);

/// Takes the outcome of a step, or nothing. Then it gives the next step.
type Steps = dyn FnMut(Python<'_>, Option<Outcome<'_>>) -> PyResult<NextStep> + Send + Sync;
/// The name of a step, and its request or the result.
type NextStep = (&'static str, Py<PyAny>);
/// The reply to a request, empty for another step, or the exception.
type Outcome<'a> = Result<&'a [u8], Raised>;

/// The settings of a motor of either protocol.
trait AnySettings: Send + Sync {
    fn dumping(&self) -> SettingsSteps;
    fn comparing(&self, py: Python<'_>, text: &str) -> PyResult<SettingsSteps>;
    fn motor(&self) -> u8;
}

/// A comparison of either protocol.
trait AnyComparison: Send + Sync {
    fn differences(&self, py: Python<'_>) -> PyResult<Py<PyAny>>;
    fn restoring(&self, dry_run: bool, permissions: Permissions) -> SettingsSteps;
}

/// Requests of a protocol in Python.
trait InPython: Tuning + Copy + Send + Sync + 'static {
    /// A motor and a request, the arguments of an exchange.
    fn exchange(py: Python<'_>, motor: u8, request: Self::Request) -> PyResult<Py<PyAny>>;
}

#[pymethods]
impl MotorSettings {
    /// Those of a motor of an ST drive.
    #[staticmethod]
    fn st(py: Python<'_>, motor: i64, profile: &str) -> PyResult<Self> {
        let number = motor_number(py, motor)?;
        let motor = MotorNumber::new(number)
            .ok_or_else(|| st_error(py, &st::Error::NoSuchMotor(number)))?;
        let profile = profile_named(py, profile)?;
        Ok(MotorSettings(Box::new(StTuning { motor, profile })))
    }

    /// Those of an RMD motor.
    #[staticmethod]
    fn rmd(py: Python<'_>, motor: i64) -> PyResult<Self> {
        Ok(MotorSettings(Box::new(RmdTuning { motor: motor_id(py, motor)? })))
    }

    /// The motor's number.
    #[getter]
    fn motor(&self) -> u8 {
        self.0.motor()
    }

    /// Reads all settings. The result is the arguments of a `SettingsDump`.
    fn dumping(&self) -> SettingsSteps {
        self.0.dumping()
    }

    /// Reads the settings that this text of a file has. The result is a `SettingsComparison`.
    fn comparing(&self, py: Python<'_>, text: &str) -> PyResult<SettingsSteps> {
        self.0.comparing(py, text)
    }
}

#[pymethods]
impl SettingsComparison {
    /// The settings that differ, a `SettingDifference` each.
    fn differences(&self, py: Python<'_>) -> PyResult<Py<PyAny>> {
        self.0.differences(py)
    }

    /// Writes the settings that differ, or only checks whether it may. The result is `None`.
    #[pyo3(signature = (*, dry_run, to_rom, running))]
    fn restoring(&self, dry_run: bool, to_rom: bool, running: bool) -> SettingsSteps {
        self.0.restoring(dry_run, Permissions { rom: to_rom, running })
    }
}

#[pymethods]
impl SettingsSteps {
    /// The next step, with its value: `ask` and the arguments of an exchange, `check` and the same,
    /// `confirm`, `done` and the result. Not to be called after `done` or an error.
    fn next(&mut self, py: Python<'_>) -> PyResult<NextStep> {
        (self.0)(py, None)
    }

    /// Takes the reply to a request; empty for another step.
    fn answered(&mut self, py: Python<'_>, reply: &[u8]) -> PyResult<()> {
        (self.0)(py, Some(Ok(reply))).map(drop)
    }

    /// Takes the exception of the step.
    fn failed(&mut self, error: Bound<'_, PyAny>) -> PyResult<()> {
        let py = error.py();
        (self.0)(py, Some(Err(Raised::new(py, PyErr::from_value(error))))).map(drop)
    }
}

impl SettingsSteps {
    /// Takes the steps of `procedure`; `done` gives its result in Python.
    fn new<T: InPython, R: 'static>(
        tuning: T,
        procedure: Procedure<'static, T::Id, Raised, R>,
        done: impl Fn(Python<'_>, R) -> PyResult<Py<PyAny>> + Send + Sync + 'static,
    ) -> Self
    where
        T::Id: 'static,
    {
        // A procedure is not `Sync`.
        let mut procedure = Mutex::new(procedure);
        let mut asked: Option<Ask<T::Id>> = None;
        SettingsSteps(Box::new(move |py, outcome| {
            let procedure = procedure.get_mut().unwrap_or_else(PoisonError::into_inner);
            if let Some(outcome) = outcome {
                let outcome = outcome.and_then(|reply| match &asked {
                    Some(ask) => tuning.answer(ask, reply).ok_or_else(|| Raised::misfit(py)),
                    None => Ok(Answer::default()),
                });
                procedure.answered(outcome);
                return Ok(("", py.None()));
            }
            let motor = tuning.kind().motor;
            Ok(match procedure.next() {
                Next::Step(Step::Ask(ask)) => {
                    let request = tuning.request(&ask);
                    asked = Some(ask);
                    ("ask", T::exchange(py, motor, request)?)
                }
                Next::Step(Step::Check(ask)) => {
                    asked = None;
                    ("check", T::exchange(py, motor, tuning.request(&ask))?)
                }
                Next::Step(Step::Confirm) => {
                    asked = None;
                    ("confirm", py.None())
                }
                Next::Done(result) => ("done", done(py, result)?),
            })
        }))
    }
}

impl<T: InPython<Id: 'static>> AnySettings for T {
    fn motor(&self) -> u8 {
        self.kind().motor
    }

    fn dumping(&self) -> SettingsSteps {
        SettingsSteps::new(*self, Dump::reading(*self), |py, dump| {
            let dump = dump.map_err(|raised: Raised| raised.error)?;
            let values: PyResult<Vec<_>> = dump
                .values()
                .map(|(setting, digits)| {
                    (&setting.name, value(py, setting, digits)?, setting.scale.symbol)
                        .into_py_any(py)
                })
                .collect();
            (dump.text(), values?, dump.absent().to_vec()).into_py_any(py)
        })
    }

    fn comparing(&self, py: Python<'_>, text: &str) -> PyResult<SettingsSteps> {
        let tuning = *self;
        let file = SettingsFile::parse(text, self)
            .map_err(|error| invalid_value(py, format_args!("{error}; nothing was sent")))?;
        let reading = Comparison::reading(tuning, &file);
        Ok(SettingsSteps::new(tuning, reading, move |py, compared| {
            let comparison = compared.map_err(|unread| not_read(py, tuning, unread))?;
            let comparison: Box<dyn AnyComparison> = Box::new(Compared { tuning, comparison });
            SettingsComparison(comparison).into_py_any(py)
        }))
    }
}

struct Compared<T: Tuning> {
    tuning: T,
    comparison: Comparison<T::Id>,
}

impl<T: InPython<Id: 'static>> AnyComparison for Compared<T> {
    fn differences(&self, py: Python<'_>) -> PyResult<Py<PyAny>> {
        let differences = self.comparison.differences().map(|difference| {
            let Difference { setting, now, file, .. } = difference;
            let (now, file) = (value(py, setting, now)?, value(py, setting, file)?);
            values::setting_difference(py, (setting.name.as_str(), now, file, setting.scale.symbol))
        });
        let differences: PyResult<Vec<_>> = differences.collect();
        Ok(PyList::new(py, differences?)?.into_any().unbind())
    }

    fn restoring(&self, dry_run: bool, permissions: Permissions) -> SettingsSteps {
        let tuning = self.tuning;
        let procedure = match dry_run {
            true => self.comparison.checking(permissions),
            false => self.comparison.restoring(permissions, || false),
        };
        SettingsSteps::new(tuning, procedure, move |py, restored| match restored {
            Ok(()) => Ok(py.None()),
            Err(error) => Err(not_restored(py, tuning, error)),
        })
    }
}

impl InPython for StTuning {
    fn exchange(py: Python<'_>, _: u8, (motor, request): Self::Request) -> PyResult<Py<PyAny>> {
        (motor, StRequest::for_bytes(request)).into_py_any(py)
    }
}

impl InPython for RmdTuning {
    fn exchange(py: Python<'_>, motor: u8, request: Self::Request) -> PyResult<Py<PyAny>> {
        (motor, Py::new(py, RmdRequest::for_bytes(request))?).into_py_any(py)
    }
}

/// The exception of a step.
pub(crate) struct Raised {
    error: PyErr,
    class: ErrorClass,
    message: String,
}

impl Raised {
    fn new(py: Python<'_>, error: PyErr) -> Self {
        let class = class_of(py, &error);
        let message = match class {
            ErrorClass::Interruption => "interrupted".to_owned(),
            _ => error.value(py).to_string(),
        };
        Raised { error, class, message }
    }

    /// A reply to another request.
    fn misfit(py: Python<'_>) -> Self {
        let message = "the reply does not fit the request".to_owned();
        let error = link_error(py, &message);
        Raised { error, class: ErrorClass::Line, message }
    }

    /// The exception, unless it is raised by itself at the end.
    fn cause(self) -> Option<PyErr> {
        (self.class != ErrorClass::Interruption).then_some(self.error)
    }
}

impl fmt::Display for Raised {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.message)
    }
}

impl StepError for Raised {
    fn is_refusal(&self) -> bool {
        self.class == ErrorClass::Refusal
    }

    fn is_line_failure(&self) -> bool {
        self.class == ErrorClass::Line
    }

    fn is_interruption(&self) -> bool {
        self.class == ErrorClass::Interruption
    }
}

/// A value in its unit: an integer if one digit is one unit.
fn value(py: Python<'_>, setting: &Setting, digits: i64) -> PyResult<Py<PyAny>> {
    match setting.scale.decimals {
        0 => digits.into_py_any(py),
        _ => setting.scale.value(digits).into_py_any(py),
    }
}

/// The exception for settings of a file that cannot be read.
fn not_read(py: Python<'_>, tuning: impl Tuning, unread: Unread<Raised>) -> PyErr {
    let advice = match (unread.error.is_refusal(), unread.settings.len()) {
        (false, _) => "",
        (true, 1) => "; remove the line if the drive does not have this setting",
        (true, _) => "; remove these lines if the drive does not have these settings",
    };
    let message = format!("{unread}; nothing was written{advice}");
    settings_error(py, message, tuning.kind().motor, [&[], &[], &[], &[]], unread.error.cause())
}

/// The exception for settings that were not restored.
fn not_restored(py: Python<'_>, tuning: impl Tuning, error: RestoreError<Raised>) -> PyErr {
    let motor = tuning.kind().motor;
    let nothing =
        |message: String, cause| settings_error(py, message, motor, [&[], &[], &[], &[]], cause);
    let said = error.to_string();
    match error {
        RestoreError::Rom { .. } => nothing(format!("{said}; to_rom=True allows it"), None),
        RestoreError::Running { .. } => {
            nothing(format!("{said}; stop it first, or allow it with running=True"), None)
        }
        RestoreError::Before(raised) => nothing(said, raised.cause()),
        RestoreError::Undone(undone) => {
            let advice = match undone.is_complete() {
                true => "",
                false => "; `motor.settings.diff` shows what differs",
            };
            let Undone { cause, rolled_back, changed, unknown, unknown_in_rom, .. } = *undone;
            let cause = match cause {
                Cause::Exchange { error, .. } => error.cause(),
                Cause::Differs { .. } | Cause::Interrupted => None,
            };
            let states = [&*rolled_back, &*changed, &*unknown, &*unknown_in_rom];
            settings_error(py, format!("{said}{advice}"), motor, states, cause)
        }
        _ => nothing(said, None),
    }
}
