//! Errors of the host library as exceptions of `motorlink.errors`, with the library's messages.

use std::fmt::Display;
use std::path::Path;

use motorlink::port::{NotDone, PortError};
use motorlink::st::{ErrorCode, Failure, Implausible, Target};
use motorlink::{rmd, st};
use motorlink_telemetry::line::LineError;
use pyo3::exceptions::PyException;
use pyo3::prelude::*;
use pyo3::sync::PyOnceLock;
use pyo3::types::{PyDict, PyTuple, PyType};

/// The exception.
#[derive(Debug, Clone, Copy)]
enum Kind {
    Refused,
    Implausible,
    Link,
    ReplyTimeout,
    Port,
    InvalidValue,
    FullTurn,
    NotArrived,
    UnknownRegister,
    Closed,
    Settings,
    Recording,
    Any,
}

/// What an exception says about the request.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum ErrorClass {
    /// The drive refused it.
    Refusal,
    /// It may have been carried out.
    Line,
    /// The caller wants an end: Ctrl-C, a cancelled task, an exception of a signal handler.
    Interruption,
    Other,
}

/// The attributes of an exception.
#[derive(Default)]
struct Facts<'a> {
    port: Option<&'a str>,
    motor: Option<u8>,
    code: Option<ErrorCode>,
    misread: Option<&'a Implausible>,
}

impl Kind {
    fn class(self, py: Python<'_>) -> PyResult<&Bound<'_, PyType>> {
        static CLASSES: [PyOnceLock<Py<PyType>>; 13] = [const { PyOnceLock::new() }; 13];
        let name = match self {
            Kind::Refused => "RefusedError",
            Kind::Implausible => "ImplausibleValueError",
            Kind::Link => "LinkError",
            Kind::ReplyTimeout => "ReplyTimeoutError",
            Kind::Port => "PortError",
            Kind::InvalidValue => "InvalidValueError",
            Kind::FullTurn => "FullTurnError",
            Kind::NotArrived => "NotArrivedError",
            Kind::UnknownRegister => "UnknownRegisterError",
            Kind::Closed => "ClosedError",
            Kind::Settings => "SettingsError",
            Kind::Recording => "RecordingError",
            Kind::Any => "MotorlinkError",
        };
        CLASSES[self as usize].import(py, "motorlink.errors", name)
    }

    fn raise(self, py: Python<'_>, message: impl Display, facts: Facts<'_>) -> PyErr {
        let made = || {
            let named = PyDict::new(py);
            named.set_item("port", facts.port)?;
            named.set_item("motor", facts.motor)?;
            if let Some(code) = facts.code {
                named.set_item("code", code.number())?;
                named.set_item("name", code.name())?;
            }
            if let Some(Implausible { read, fits }) = facts.misread {
                named.set_item("register", read.register.to_string())?;
                named.set_item("digits", read.digits())?;
                named.set_item("profile", fits.profile.name())?;
            }
            self.class(py)?.call((message.to_string(),), Some(&named))
        };
        made().map_or_else(|error| error, PyErr::from_value)
    }
}

/// A value that cannot be sent.
pub(crate) fn invalid_value(py: Python<'_>, message: impl Display) -> PyErr {
    Kind::InvalidValue.raise(py, message, Facts::default())
}

/// An unknown register.
pub(crate) fn unknown_register(py: Python<'_>, message: impl Display) -> PyErr {
    Kind::UnknownRegister.raise(py, message, Facts::default())
}

/// A closed client.
pub(crate) fn closed(py: Python<'_>, port: &str) -> PyErr {
    let facts = Facts { port: Some(port), ..Facts::default() };
    Kind::Closed.raise(py, format_args!("{port} was closed by this program; open it again"), facts)
}

/// A client of the parent process, in a forked process.
pub(crate) fn elsewhere(py: Python<'_>, port: &str) -> PyErr {
    let facts = Facts { port: Some(port), ..Facts::default() };
    let why = "was opened by another process, which this one was forked from; open it in this one";
    Kind::Closed.raise(py, format_args!("{port} {why}"), facts)
}

/// A reply that does not belong to its request.
pub(crate) fn link_error(py: Python<'_>, message: impl Display) -> PyErr {
    Kind::Link.raise(py, message, Facts::default())
}

/// Settings that were not restored: those that have their old values again, those of the file, those
/// that are unknown, and those that are unknown in ROM.
pub(crate) fn settings_error(
    py: Python<'_>,
    message: impl Display,
    motor: u8,
    states: [&[String]; 4],
    cause: Option<PyErr>,
) -> PyErr {
    let error = Kind::Settings.raise(py, message, Facts { motor: Some(motor), ..Facts::default() });
    let names = ["rolled_back", "changed", "unknown", "unknown_in_rom"];
    for (name, settings) in names.into_iter().zip(states) {
        let set = PyTuple::new(py, settings).and_then(|all| error.value(py).setattr(name, all));
        if let Err(error) = set {
            return error;
        }
    }
    error.set_cause(py, cause);
    error
}

/// A recording that cannot be read or written. `errno` is what the system says.
pub(crate) fn recording_error(
    py: Python<'_>,
    message: impl Display,
    path: &Path,
    errno: Option<i32>,
) -> PyErr {
    let error = Kind::Recording.raise(py, message, Facts::default());
    let value = error.value(py);
    let set = value.setattr("path", path).and_then(|()| value.setattr("errno", errno));
    set.err().unwrap_or(error)
}

/// What an exception of an exchange says about its request.
pub(crate) fn class_of(py: Python<'_>, error: &PyErr) -> ErrorClass {
    let is = |kind: Kind| kind.class(py).is_ok_and(|class| error.is_instance(py, class));
    if !is(Kind::Any) {
        return ErrorClass::Interruption;
    }
    if is(Kind::Link) || is(Kind::ReplyTimeout) || is(Kind::Closed) {
        return ErrorClass::Line;
    }
    let code = error.value(py).getattr("code").and_then(|code| code.extract::<u8>());
    match code {
        Ok(code) if ErrorCode::from(code) != ErrorCode::BadMotorSelected => ErrorClass::Refusal,
        _ => ErrorClass::Other,
    }
}

/// An error of an ST client.
pub(crate) fn st_error(py: Python<'_>, error: &st::Error) -> PyErr {
    use st::Error;
    // Motor number 0 is the motor that the drive has selected.
    let named = |number: u8| Some(number).filter(|number| *number != 0);
    let about = |port, motor: &Target| Facts {
        port: Some(port),
        motor: named(motor.0),
        ..Facts::default()
    };
    let (kind, facts) = match error {
        Error::Refused { port, motor, code, .. } => {
            let code = Some(*code);
            (Kind::Refused, Facts { code, ..about(port, motor) })
        }
        Error::Failed { port, motor, failure, .. } => {
            let kind = match failure {
                Failure::Timeout => Kind::ReplyTimeout,
                _ => Kind::Link,
            };
            (kind, about(port, motor))
        }
        Error::Reply { port, motor, .. } => (Kind::Link, about(port, motor)),
        Error::Implausible { port, motor, why } => {
            (Kind::Implausible, Facts { misread: Some(why), ..about(port, motor) })
        }
        Error::Unconfirmed { port, .. } => {
            (Kind::Link, Facts { port: Some(port), ..Facts::default() })
        }
        Error::Limit { motor, .. } => {
            (Kind::InvalidValue, Facts { motor: named(motor.0), ..Facts::default() })
        }
        Error::NotArrived { motor, .. } => {
            (Kind::NotArrived, Facts { motor: Some(motor.number()), ..Facts::default() })
        }
        Error::NotStarted { motor, .. } => {
            (Kind::Refused, Facts { motor: named(motor.0), ..Facts::default() })
        }
        Error::Differs { motor, .. } => {
            (Kind::Refused, Facts { motor: Some(motor.number()), ..Facts::default() })
        }
        Error::Port(error) => return port_error(py, error),
        _ => (Kind::InvalidValue, Facts::default()),
    };
    kind.raise(py, error, facts)
}

/// A negative acknowledge without a port.
pub(crate) fn refusal(py: Python<'_>, code: ErrorCode) -> PyErr {
    let facts = Facts { code: Some(code), ..Facts::default() };
    Kind::Refused.raise(py, format_args!("the drive refused: {code} ({})", code.doc()), facts)
}

/// A value of another profile, without a port.
pub(crate) fn implausible(py: Python<'_>, why: &Implausible) -> PyErr {
    Kind::Implausible.raise(py, why, Facts { misread: Some(why), ..Facts::default() })
}

/// An error of an RMD client.
pub(crate) fn rmd_error(py: Python<'_>, error: &rmd::Error) -> PyErr {
    use rmd::Error;
    let motor = error.motor().map(rmd::MotorId::number);
    let facts = |port| Facts { port, motor, ..Facts::default() };
    let (kind, facts) = match error {
        Error::Timeout { port, .. }
        | Error::Adapter { port, .. }
        | Error::Quarantined { port, .. }
        | Error::Shared { port, .. } => (Kind::ReplyTimeout, facts(Some(port))),
        Error::Foreign { port, .. }
        | Error::Altered { port, .. }
        | Error::Unconfirmed { port, .. }
        | Error::Echo { port, .. } => (Kind::Link, facts(Some(port))),
        Error::FullTurn { .. } => {
            let facts = facts(None);
            let hint = "full_turn=True sends it anyway";
            return Kind::FullTurn.raise(py, format_args!("{error}; {hint}"), facts);
        }
        Error::NotArrived { .. } => (Kind::NotArrived, facts(None)),
        Error::Port(error) => return port_error(py, error),
        _ => (Kind::InvalidValue, facts(None)),
    };
    kind.raise(py, error, facts)
}

/// An error of a line.
pub(crate) fn line_error(py: Python<'_>, error: &LineError) -> PyErr {
    match error {
        LineError::St(error) => st_error(py, error),
        LineError::Rmd(error) => rmd_error(py, error),
        LineError::Implausible(why) => implausible(py, why),
        LineError::Protocol | LineError::Reply | LineError::Closed => {
            Kind::Link.raise(py, error, Facts::default())
        }
    }
}

/// An error of a port. An exception of Python code in the port is its cause. KeyboardInterrupt and
/// exceptions of other signal handlers are raised unchanged.
pub(crate) fn port_error(py: Python<'_>, error: &PortError) -> PyErr {
    let raised = match error {
        PortError::WrongKind { .. } | PortError::HeldInProfile { .. } => {
            return invalid_value(py, error);
        }
        PortError::NotDone { port, motor, kind, .. } => {
            let kind = match kind {
                NotDone::Refused | NotDone::Latched | NotDone::Held | NotDone::Unsent => {
                    Kind::Refused
                }
                NotDone::Usage => Kind::InvalidValue,
                NotDone::Silent | NotDone::Unheard => Kind::ReplyTimeout,
                NotDone::Unconfirmed | NotDone::Line => Kind::Link,
            };
            let motor = Some(*motor).filter(|motor| *motor != 0);
            return kind.raise(py, error, Facts { port: Some(port), motor, ..Facts::default() });
        }
        PortError::Io { source, .. } => source.get_ref().and_then(|raised| raised.downcast_ref()),
        _ => None,
    };
    let cause = raised.map(|raised: &PyErr| raised.clone_ref(py));
    match cause {
        Some(cause) if error.is_interruption() || !cause.is_instance_of::<PyException>(py) => cause,
        cause => {
            let error = Kind::Port.raise(py, error, Facts::default());
            error.set_cause(py, cause);
            error
        }
    }
}
