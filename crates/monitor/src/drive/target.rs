//! A motor of a line, and refusals of this side.

use motorlink_telemetry::share::message::MotorName;
use motorlink_telemetry::share::program::{Lane, Refusal};
use motorlink_telemetry::share::words::Speaks;
use motorlink_telemetry::signal::Motor;

/// A motor of a line.
#[derive(Debug, Clone)]
pub(super) struct Target {
    pub(super) name: MotorName,
    pub(super) motor: Motor,
    pub(super) speaks: Speaks,
}

impl Target {
    /// The motor of this number on a line.
    pub(super) fn new(line: &str, number: u8, speaks: Speaks) -> Result<Self, Refusal> {
        let motor = speaks.motor(number).ok_or_else(|| {
            Refusal::usage(format!("{line}: no motor can have the number {number}"))
        })?;
        Ok(Target { name: MotorName { line: line.to_owned(), motor: number }, motor, speaks })
    }

    /// Whose replies a confirmation is about: all of the line, or those of the motor.
    pub(super) fn lane(&self) -> Lane {
        let motor = match self.speaks {
            Speaks::St(_) => None,
            Speaks::Rmd => Some(self.name.motor),
        };
        (self.name.line.clone(), motor)
    }
}
