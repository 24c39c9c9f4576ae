//! Failures: kinds, exit codes, messages.

use std::path::Path;

use motorlink::port::{NameError, NotDone, PortError};
use motorlink::relay::RelayError;
use motorlink::{rmd, st};
use motorlink_link::fault::FaultError;
use motorlink_link::{printable, printable_lines};
use motorlink_telemetry::line::LineError;
use motorlink_telemetry::runner::Ended;
use serde_json::{Map, Value, json};

use crate::{advice, pasteable};

/// Why the program ends early.
#[derive(Debug)]
pub enum Failure {
    /// It did not do what it was asked.
    Failed(Box<Problem>),
    /// Ctrl-C.
    Interrupted,
    /// The reader of the output has closed it.
    OutputClosed,
}

/// What went wrong, and where.
#[derive(Debug)]
pub struct Problem {
    pub kind: Kind,
    message: String,
    /// What to try.
    advice: Option<String>,
    /// Whether the message has angles or speeds of a motor shaft.
    is_of_motor_shaft: bool,
    /// `port`, `motor`, `code` and `name`, where they are known.
    facts: Map<String, Value>,
}

/// What kind of problem it is, which gives the exit code.
#[derive(Debug, Clone, Copy, PartialEq, Eq, serde::Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Kind {
    /// The drive refused, or did not do it.
    Refused,
    /// The motor has other settings than a file.
    Differs,
    /// A part of a capture is damaged or lost.
    Damaged,
    /// The command does not make sense.
    Usage,
    /// The connection failed.
    Link,
    /// One motor does not answer, or answers something else, which says nothing about the connection.
    Silent,
    /// The output cannot be written.
    Output,
    /// A recording is not whole.
    Lost,
}

impl Kind {
    fn exit_code(self) -> u8 {
        match self {
            Kind::Refused | Kind::Differs | Kind::Damaged => 1,
            Kind::Usage => 2,
            Kind::Link | Kind::Silent | Kind::Output => 3,
            Kind::Lost => 4,
        }
    }
}

impl Failure {
    pub fn refused(message: impl Into<String>) -> Self {
        Problem::new(Kind::Refused, message).into()
    }

    /// A difference between a motor and a file.
    pub fn differs(message: impl Into<String>) -> Self {
        Problem::new(Kind::Differs, message).into()
    }

    /// Damage in a capture.
    pub fn damaged(message: impl Into<String>) -> Self {
        Problem::new(Kind::Damaged, message).into()
    }

    pub fn usage(message: impl Into<String>) -> Self {
        Problem::new(Kind::Usage, message).into()
    }

    /// A recording is not whole.
    pub fn lost(message: impl Into<String>) -> Self {
        Problem::new(Kind::Lost, message).into()
    }

    pub fn link(message: impl Into<String>) -> Self {
        Problem::new(Kind::Link, message).into()
    }

    /// After stdout could not be written.
    pub fn output(error: &std::io::Error) -> Self {
        match error.kind() {
            std::io::ErrorKind::BrokenPipe => Failure::OutputClosed,
            _ => Problem::new(Kind::Output, format!("stdout cannot be written: {error}")).into(),
        }
    }

    /// After a file could not be written.
    pub fn file(path: &Path, error: &std::io::Error) -> Self {
        let message = format!("cannot write `{}`: {error}", printable(&path.display().to_string()));
        let failure: Failure = Problem::new(Kind::Output, message).into();
        match path.parent().filter(|folder| *folder != Path::new("") && !folder.exists()) {
            Some(folder) => {
                let folder = pasteable::quoted(&folder.display().to_string());
                failure.trying(format!("make its folder first: `mkdir -p {folder}`"))
            }
            None => failure,
        }
    }

    /// After a file could not be written any more.
    pub fn unwritten(message: impl Into<String>) -> Self {
        Problem::new(Kind::Output, message).into()
    }

    /// Two failures of one command. Both are reported; the exit code is that of the first, except that
    /// an interruption is never hidden.
    pub fn and(self, other: Self) -> Self {
        match (self, other) {
            (Failure::Interrupted, _) | (_, Failure::Interrupted) => Failure::Interrupted,
            (Failure::OutputClosed, other) => other,
            (Failure::Failed(mut problem), other) => {
                let text = match &other {
                    Failure::Failed(other) => other.text(),
                    _ => "stdout was closed before everything was written".to_owned(),
                };
                problem.message = format!("{}\n{text}", problem.message);
                Failure::Failed(problem)
            }
        }
    }

    /// With what to try.
    pub fn trying(mut self, advice: impl Into<String>) -> Self {
        if let Failure::Failed(problem) = &mut self {
            problem.advice = Some(printable_lines(&advice.into()));
        }
        self
    }

    /// With something else to try.
    pub fn trying_also(mut self, advice: &str) -> Self {
        if let Failure::Failed(problem) = &mut self {
            let before =
                problem.advice.take().map(|before| format!("{before}; ")).unwrap_or_default();
            problem.advice = Some(before + advice);
        }
        self
    }

    /// After a command to stop `motor` that may not have been carried out.
    pub fn of_stop(self, motor: impl std::fmt::Display) -> Self {
        match &self {
            Failure::Failed(problem) if !matches!(problem.kind, Kind::Usage | Kind::Output) => self
                .with_fact(format!("{motor} may still be turning"))
                .trying_also(advice::STOP_AGAIN),
            _ => self,
        }
    }

    /// After a motion command that was sent to `motor`: it may have been carried out, unless the motor
    /// refused it. `stop` is the command that stops the motor.
    pub fn of_motion(self, motor: impl std::fmt::Display, stop: &str) -> Self {
        if !matches!(self, Failure::Failed(_)) || !self.is_outcome_unknown() {
            return self;
        }
        self.with_fact(format!("{motor} may be turning now"))
            .trying_also(&format!("stop it: `{stop}`"))
    }

    /// Whether the command may have been carried out.
    pub fn is_outcome_unknown(&self) -> bool {
        match self {
            Failure::Failed(problem) => !matches!(problem.kind, Kind::Refused | Kind::Usage),
            _ => true,
        }
    }

    /// With other words for what happened.
    pub fn saying(mut self, message: String) -> Self {
        if let Failure::Failed(problem) = &mut self {
            problem.message = message;
        }
        self
    }

    /// With a fact before what happened.
    pub fn with_fact(mut self, fact: impl std::fmt::Display) -> Self {
        if let Failure::Failed(problem) = &mut self {
            problem.message = format!("{fact}: {}", problem.message);
        }
        self
    }

    /// With a fact behind what happened.
    pub fn then(mut self, fact: impl std::fmt::Display) -> Self {
        if let Failure::Failed(problem) = &mut self {
            let joint = if problem.message.ends_with('?') { "" } else { ";" };
            problem.message = format!("{}{joint} {fact}", problem.message);
        }
        self
    }

    /// With the shaft of the angles and speeds in the message, if it has some.
    pub fn at_motor_shaft(mut self, gear_ratio: f64) -> Self {
        if let Failure::Failed(problem) = &mut self
            && std::mem::take(&mut problem.is_of_motor_shaft)
        {
            return self.then(format!(
                "angles and speeds in this message are those of the motor shaft, {gear_ratio} times those \
                 of the output shaft"
            ));
        }
        self
    }

    /// The exit code.
    pub fn exit_code(&self) -> u8 {
        match self {
            Failure::Failed(problem) => problem.kind.exit_code(),
            Failure::Interrupted => 130,
            Failure::OutputClosed => 0,
        }
    }

    /// With its port, unless it is about the output. With the motor that was meant if a motor refused or
    /// is silent, unless it names another.
    pub fn about(mut self, port: &str, motor: u8) -> Self {
        if let Failure::Failed(problem) = &mut self
            && problem.kind != Kind::Output
        {
            problem.fact("port", port);
            if matches!(problem.kind, Kind::Refused | Kind::Differs | Kind::Silent) {
                problem.motor(motor);
            }
        }
        self
    }

    /// For people: what happened, and what to try.
    pub fn text(&self) -> String {
        match self {
            Failure::Failed(problem) => problem.text(),
            Failure::Interrupted | Failure::OutputClosed => String::new(),
        }
    }

    /// For programs: docs/JSON.md.
    pub fn object(&self) -> Value {
        match self {
            Failure::Failed(problem) => problem.object(),
            Failure::Interrupted | Failure::OutputClosed => Value::Null,
        }
    }
}

impl Problem {
    fn new(kind: Kind, message: impl Into<String>) -> Self {
        let message = printable_lines(&message.into());
        Problem { kind, message, advice: None, is_of_motor_shaft: false, facts: Map::new() }
    }

    /// What an error of the library is, with what to try.
    fn of(kind: Kind, error: &impl std::fmt::Display, advice: Option<&str>) -> Self {
        Problem { advice: advice.map(str::to_owned), ..Problem::new(kind, error.to_string()) }
    }

    /// Adds what is not known yet.
    fn fact(&mut self, name: &str, value: impl Into<Value>) {
        self.facts.entry(name).or_insert_with(|| value.into());
    }

    /// Adds the motor; ST's 0 is the drive.
    fn motor(&mut self, number: u8) {
        if number != 0 {
            self.fact("motor", number);
        }
    }

    /// For people: what happened, and what to try.
    pub fn text(&self) -> String {
        let message = self.pasteable(&self.message);
        let joint = if message.ends_with('?') { "" } else { ";" };
        match &self.advice {
            Some(advice) => format!("{message}{joint} {}", self.pasteable(advice)),
            None => message,
        }
    }

    /// With the options of the command line in each command.
    fn pasteable(&self, text: &str) -> String {
        let motor = self.facts.get("motor").and_then(Value::as_u64);
        pasteable::complete(text, motor.and_then(|motor| motor.try_into().ok()))
    }

    /// For programs: docs/JSON.md.
    pub fn object(&self) -> Value {
        let mut object = json!({ "kind": self.kind, "message": self.pasteable(&self.message) });
        let members = object.as_object_mut().expect("an object was made");
        let advice = self.advice.as_deref().map(|advice| self.pasteable(advice));
        members.extend(advice.map(|advice| ("try".to_owned(), json!(advice))));
        members.extend(self.facts.clone());
        object
    }
}

impl From<Problem> for Failure {
    fn from(problem: Problem) -> Self {
        Failure::Failed(Box::new(problem))
    }
}

impl From<st::Error> for Failure {
    fn from(error: st::Error) -> Self {
        let kind = match &error {
            st::Error::Refused { .. }
            | st::Error::Differs { .. }
            | st::Error::Implausible { .. }
            | st::Error::NotStarted { .. }
            | st::Error::NotArrived { .. } => Kind::Refused,
            st::Error::Port(error) => return error.into(),
            error if error.is_line_failure() => Kind::Link,
            _ => Kind::Usage,
        };
        let mut problem = Problem::of(kind, &error, advice::st(&error));
        match &error {
            st::Error::Refused { motor, code, .. } => {
                problem.motor(motor.0);
                problem.fact("code", u8::from(*code));
                problem.fact("name", code.to_string());
            }
            st::Error::NotArrived { motor, .. } => problem.motor(motor.number()),
            st::Error::NotStarted { motor, .. } | st::Error::Implausible { motor, .. } => {
                problem.motor(motor.0);
            }
            st::Error::Failed { motor, .. } | st::Error::Reply { motor, .. } => {
                problem.motor(motor.0);
            }
            _ => {}
        }
        problem.into()
    }
}

impl From<rmd::Error> for Failure {
    fn from(error: rmd::Error) -> Self {
        use rmd::Error::*;
        let kind = match &error {
            Port(error) => return error.into(),
            Echo { .. } | Altered { .. } => Kind::Link,
            NotArrived { .. } => Kind::Refused,
            error if error.is_line_failure() => Kind::Silent,
            _ => Kind::Usage,
        };
        let mut problem = Problem::of(kind, &error, advice::rmd(&error));
        problem.is_of_motor_shaft =
            matches!(error, Limit { .. } | FullTurn { .. } | NotArrived { .. });
        if let Some(motor) = error.motor().filter(|_| kind != Kind::Usage) {
            problem.motor(motor.number());
        }
        problem.into()
    }
}

impl From<&LineError> for Failure {
    fn from(error: &LineError) -> Self {
        match error {
            // The next request may be sent.
            error if error.is_unsent() => Problem::new(Kind::Silent, error.to_string()).into(),
            LineError::St(error) => error.clone().into(),
            LineError::Rmd(error) => error.clone().into(),
            LineError::Closed => Failure::link(error.to_string()),
            LineError::Reply | LineError::Implausible(_) => Failure::refused(error.to_string()),
            LineError::Protocol => Failure::usage(error.to_string()),
        }
    }
}

impl From<Ended> for Failure {
    fn from(error: Ended) -> Self {
        Failure::link(error.to_string())
    }
}

impl From<PortError> for Failure {
    fn from(error: PortError) -> Self {
        Failure::from(&error)
    }
}

impl From<&PortError> for Failure {
    fn from(error: &PortError) -> Self {
        let kind = match error {
            PortError::WrongKind { .. }
            | PortError::HeldInProfile { .. }
            | PortError::NotDone { kind: NotDone::Usage, .. } => Kind::Usage,
            PortError::NotDone {
                kind: NotDone::Refused | NotDone::Latched | NotDone::Held | NotDone::Unsent,
                ..
            } => Kind::Refused,
            _ => Kind::Link,
        };
        let failure: Failure = Problem::of(kind, error, advice::port(error)).into();
        match advice::port_kind(error) {
            Some(advice) => failure.trying(advice),
            None => failure,
        }
    }
}

impl From<RelayError> for Failure {
    fn from(error: RelayError) -> Self {
        match error {
            RelayError::Port(error) => error.into(),
            other => Problem::of(Kind::Usage, &other, advice::relay(&other)).into(),
        }
    }
}

impl From<std::io::Error> for Failure {
    fn from(error: std::io::Error) -> Self {
        match error.kind() {
            std::io::ErrorKind::BrokenPipe => Failure::OutputClosed,
            _ => Failure::link(error.to_string()),
        }
    }
}

/// What no command that makes sense ends with.
macro_rules! usage {
    ($($error:ty),+) => { $(
        impl From<$error> for Failure {
            fn from(error: $error) -> Self {
                Failure::usage(error.to_string())
            }
        }
    )+ };
}
usage!(FaultError, st::ValueError);

impl From<NameError> for Failure {
    fn from(error: NameError) -> Self {
        Problem::of(Kind::Usage, &error, advice::port_name(&error).as_deref()).into()
    }
}

impl From<st::UnknownRegister> for Failure {
    fn from(error: st::UnknownRegister) -> Self {
        let failure = Failure::usage(error.to_string());
        match error.text.contains(['*', '?']) {
            true => failure.trying(format!(
                "`motorlink st registers '{}'` lists the registers that match: give their names",
                error.text
            )),
            false => failure.trying(advice::LIST_REGISTERS),
        }
    }
}
