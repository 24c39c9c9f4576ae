//! Whether a START_MOTOR had an effect. A drive acknowledges it in any case (SPEC-NOTES S31).

use core::fmt;

use super::code::{Command, Flags, Status};
use super::message::Request;
use super::register::RegisterId;

/// A start and the reads that show its effect. Perform [`request`](Self::request) and pass the value of
/// the register to [`replied`](Self::replied), until that returns the result.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Starting {
    /// START_MOTOR is sent.
    #[default]
    Command,
    /// STATUS is read.
    Status,
    /// FLAGS is read, because the state is a fault.
    Faults(Status),
}

/// Why a motor did not start.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[non_exhaustive]
pub enum NotStarted {
    /// The drive has faults.
    Faults {
        /// The state.
        status: Status,
        /// The faults.
        flags: Flags,
    },
    /// The motor is still stopping.
    Stopping {
        /// The state.
        status: Status,
    },
}

impl Starting {
    /// The next request.
    pub const fn request(self) -> Request<'static> {
        match self {
            Starting::Command => Request::ExecuteCommand(Command::StartMotor),
            Starting::Status => Request::GetRegister(RegisterId::STATUS),
            Starting::Faults(_) => Request::GetRegister(RegisterId::FLAGS),
        }
    }

    /// Takes the acknowledge of the request, with the value of the register that was read. Returns the
    /// state of a motor that starts, or why it does not.
    pub fn replied(&mut self, bits: i32) -> Option<Result<Status, NotStarted>> {
        match *self {
            Starting::Command => *self = Starting::Status,
            Starting::Status => match Status::from(bits as u8) {
                status @ (Status::FaultNow | Status::FaultOver) => *self = Starting::Faults(status),
                status @ (Status::AnyStop
                | Status::Stop
                | Status::StopIdle
                | Status::WaitStopMotor) => return Some(Err(NotStarted::Stopping { status })),
                status => return Some(Ok(status)),
            },
            Starting::Faults(status) => {
                return Some(Err(NotStarted::Faults { status, flags: Flags(bits as u32) }));
            }
        }
        None
    }
}

impl fmt::Display for NotStarted {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            NotStarted::Faults { status, flags } => {
                write!(f, "its state is {status}")?;
                let all = flags.occurred() | flags.present();
                let mut separator = ": ";
                for (bit, name, doc) in Flags::NAMES.iter().filter(|(bit, ..)| all & bit != 0) {
                    let present = if flags.present() & bit == 0 { "" } else { ", present" };
                    write!(f, "{separator}{name} ({doc}{present})")?;
                    separator = ", ";
                }
                Ok(())
            }
            NotStarted::Stopping { status } => {
                write!(f, "it is still stopping ({status}); start it when it is IDLE")
            }
        }
    }
}

impl core::error::Error for NotStarted {}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_motor_that_leaves_idle_starts() {
        let mut starting = Starting::default();
        assert_eq!(starting.request(), Request::ExecuteCommand(Command::StartMotor));
        assert_eq!(starting.replied(0), None);
        assert_eq!(starting.request(), Request::GetRegister(RegisterId::STATUS));
        assert_eq!(starting.replied(4), Some(Ok(Status::Start)));
    }

    #[test]
    fn a_fault_is_named() {
        let mut starting = Starting::default();
        assert_eq!((starting.replied(0), starting.replied(11)), (None, None));
        assert_eq!(starting.request(), Request::GetRegister(RegisterId::FLAGS));
        let flags = Flags::new(Flags::OVER_VOLT, 0);
        let why = NotStarted::Faults { status: Status::FaultOver, flags };
        assert_eq!(starting.replied(flags.0 as i32), Some(Err(why)));
    }

    #[test]
    fn a_motor_that_is_stopping_does_not_start() {
        for status in [Status::AnyStop, Status::Stop, Status::StopIdle, Status::WaitStopMotor] {
            let mut starting = Starting::Status;
            let why = NotStarted::Stopping { status };
            assert_eq!(starting.replied(u8::from(status).into()), Some(Err(why)));
        }
    }
}
