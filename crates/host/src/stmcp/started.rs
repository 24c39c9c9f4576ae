//! Which motors were started and not stopped, as far as requests and replies tell.

use motorlink_proto::stmcp::{Command, Motor, RegisterId, Request};

/// Every motor that a drive can have.
const ALL: u8 = 0x7F;

/// A motor counts as started from the START on, whose reply may be lost, and until a STOP is
/// acknowledged.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub(super) struct Started {
    /// Bit n: motor n + 1.
    motors: u8,
    /// What motor number 0 addresses; `None` while that is not known.
    current: Option<Motor>,
}

impl Started {
    /// A request for motor number `motor` leaves. Gives the motor that it addresses, where that is
    /// known, for [`acknowledged`](Self::acknowledged).
    pub(super) fn asked(&mut self, motor: u8, request: Option<&Request<'_>>) -> Option<Motor> {
        if request.is_some_and(starts) {
            self.presume(motor);
        }
        // Unless the drive acknowledges, its current motor may have changed or not.
        let current = self.current.take();
        Motor::new(motor).or(current)
    }

    /// The request that was [`asked`](Self::asked) last was acknowledged.
    pub(super) fn acknowledged(&mut self, addressed: Option<Motor>, request: Option<&Request<'_>>) {
        match request {
            Some(Request::SetRegister { register: RegisterId::TARGET_MOTOR, .. }) => return,
            Some(Request::Execute(Command::StopMotor | Command::ScStop)) => {
                self.motors &= !addressed.map_or(0, bit);
            }
            _ => {}
        }
        self.current = addressed;
    }

    /// Takes motor number `motor` for started.
    pub(super) fn presume(&mut self, motor: u8) {
        self.motors |= Motor::new(motor).or(self.current).map_or(ALL, bit);
    }

    /// The drive has no such motor.
    pub(super) fn is_missing(&mut self, motor: Motor) {
        self.motors &= !bit(motor);
    }

    /// Says that the drive's current motor is not known.
    pub(super) fn forget_current(&mut self) {
        self.current = None;
    }

    pub(super) fn is_empty(self) -> bool {
        self.motors == 0
    }

    pub(super) fn motors(self) -> impl Iterator<Item = Motor> {
        (1..=Motor::MAX).filter_map(Motor::new).filter(move |motor| self.motors & bit(*motor) != 0)
    }
}

/// Whether a request may set a motor turning until it is stopped. An alignment ends by itself.
pub(super) fn starts(request: &Request<'_>) -> bool {
    matches!(request, Request::Execute(Command::StartMotor | Command::StartStop | Command::ScStart))
}

const fn bit(motor: Motor) -> u8 {
    1 << motor.index()
}
