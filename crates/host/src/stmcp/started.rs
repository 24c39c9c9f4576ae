//! Which motors were started and not stopped, as far as requests and replies tell.

use motorlink_proto::stmcp::{Command, Motor, RegisterId, Request};

/// Every motor that a drive can have.
const ALL: u8 = 0x7F;

/// What a request does to the account of started motors.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Effect {
    None,
    /// It may set a motor turning until it is stopped. An alignment ends by itself.
    Starts,
    Stops,
    /// Motor number 0 addresses another motor from now on.
    Retargets,
}

impl Effect {
    pub(super) fn of(request: Option<&Request<'_>>) -> Self {
        match request {
            Some(Request::Execute(command)) => match command {
                Command::StartMotor | Command::StartStop | Command::ScStart => Effect::Starts,
                Command::StopMotor | Command::ScStop => Effect::Stops,
                _ => Effect::None,
            },
            Some(Request::SetRegister { register: RegisterId::TARGET_MOTOR, .. }) => {
                Effect::Retargets
            }
            _ => Effect::None,
        }
    }
}

/// A motor counts as started from the START on, whose reply may be lost, and until a STOP is
/// acknowledged.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub(crate) struct Started {
    /// Bit n: motor n + 1.
    motors: u8,
    /// What motor number 0 addresses; `None` while that is not known.
    current: Option<Motor>,
}

impl Started {
    /// A request for motor number `motor` leaves. Gives the motor that it addresses, where that is
    /// known, for [`acknowledged`](Self::acknowledged).
    pub(super) fn asked(&mut self, motor: u8, effect: Effect) -> Option<Motor> {
        if effect == Effect::Starts {
            self.presume(motor);
        }
        // Unless the drive acknowledges, its current motor may have changed or not.
        let current = self.current.take();
        Motor::new(motor).or(current)
    }

    /// The request that was [`asked`](Self::asked) last was acknowledged.
    pub(super) fn acknowledged(&mut self, addressed: Option<Motor>, effect: Effect) {
        match effect {
            Effect::Retargets => return,
            Effect::Stops => self.motors &= !addressed.map_or(0, bit),
            Effect::None | Effect::Starts => {}
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

    pub(crate) fn is_empty(self) -> bool {
        self.motors == 0
    }

    pub(crate) fn motors(self) -> impl Iterator<Item = Motor> {
        (1..=Motor::MAX).filter_map(Motor::new).filter(move |motor| self.motors & bit(*motor) != 0)
    }
}

const fn bit(motor: Motor) -> u8 {
    1 << motor.index()
}
