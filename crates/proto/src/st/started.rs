//! Which motors were started and not stopped, as far as requests and replies tell.

use super::{Command, Frame, FrameCode, MotorNumber, Parse, Profile, RegisterId, Request};

/// Every motor that a drive can have.
const ALL: u8 = 0x7F;

/// What a request does to the accounts of started motors and of their setpoints.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Effect {
    /// Nothing that counts.
    #[default]
    None,
    /// It may set a motor turning until it is stopped. An alignment ends by itself.
    Starts,
    /// It stops a motor.
    Stops,
    /// Motor number 0 addresses another motor from now on.
    Retargets,
    /// It gives the speed that a start goes to.
    Ramps,
    /// It may give a start something other than a speed ramp to do.
    Supersedes,
    /// It may reset the drive.
    Resets,
}

impl Effect {
    /// What a request does.
    pub fn of(request: &Request<'_>) -> Self {
        match request {
            Request::ExecuteCommand(command) => match command {
                Command::StartMotor | Command::StartStop | Command::ScStart => Effect::Starts,
                Command::StopMotor | Command::ScStop => Effect::Stops,
                Command::Reset => Effect::Resets,
                _ => Effect::None,
            },
            Request::SetRegister { register, .. } => match *register {
                RegisterId::TARGET_MOTOR => Effect::Retargets,
                RegisterId::RAMP_FINAL_SPEED => Effect::Ramps,
                // A change of mode may bring a reference of the drive's own.
                RegisterId::CONTROL_MODE | RegisterId::TORQUE_REF | RegisterId::FLUX_REF => {
                    Effect::Supersedes
                }
                _ => Effect::None,
            },
            Request::SetRamp(_) => Effect::Ramps,
            Request::SetCurrentReference(_)
            | Request::SetTorqueRamp(_)
            | Request::SetPosition(_) => Effect::Supersedes,
            _ => Effect::None,
        }
    }

    /// What a raw frame does in the profile in which it does something.
    pub fn of_frame(frame: &Frame<'_>) -> Self {
        let code = |profile| FrameCode::from_number(frame.code(), profile);
        let effects = Profile::ALL.map(|profile| match frame.request(profile) {
            // Shipped firmware takes an old byte for the command (docs/SPEC-NOTES.md S18).
            Err(_) if code(profile) == Some(FrameCode::ExecuteCmd) => Effect::Starts,
            Ok(request) => Effect::of(&request),
            Err(_) => Effect::None,
        });
        effects.into_iter().find(|effect| *effect != Effect::None).unwrap_or(Effect::None)
    }
}

/// A motor counts as started from the START on, whose reply may be lost, and until a STOP is
/// acknowledged.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Started {
    /// Bit n: motor n + 1.
    motors: u8,
    /// What motor number 0 addresses; `None` while that is not known.
    current: Option<MotorNumber>,
    /// The motors that counted as started before a START to motor number 0, while that still addresses
    /// the same one.
    before_zero: Option<u8>,
}

impl Started {
    /// A request for motor number `motor` leaves. Gives the motor that it addresses, where that is
    /// known, for [`acknowledged`](Self::acknowledged).
    pub fn request_sent(&mut self, motor: u8, effect: Effect) -> Option<MotorNumber> {
        if motor != 0 || matches!(effect, Effect::Retargets | Effect::Resets) {
            self.before_zero = None;
        }
        if effect == Effect::Starts {
            self.presume(motor);
        }
        let addressed = self.addressed(motor);
        // Unless the drive acknowledges, its current motor may have changed or not.
        self.current = None;
        addressed
    }

    /// The motor that motor number `motor` addresses, where it is known.
    pub(super) fn addressed(&self, motor: u8) -> Option<MotorNumber> {
        MotorNumber::new(motor).or(self.current)
    }

    /// The request that was [`sent`](Self::request_sent) last was acknowledged.
    pub fn acknowledged(&mut self, addressed: Option<MotorNumber>, effect: Effect) {
        match effect {
            Effect::Retargets | Effect::Resets => return,
            Effect::Stops => {
                if let Some(before) = self.before_zero.take() {
                    self.motors = before;
                }
                self.motors &= !addressed.map_or(0, bit);
            }
            _ => {}
        }
        self.current = addressed;
    }

    /// Takes motor number `motor` for started. For number 0 that is every motor: a drive whose supply
    /// failed for a moment has another current motor than before.
    pub fn presume(&mut self, motor: u8) {
        if let Some(motor) = MotorNumber::new(motor) {
            self.motors |= bit(motor);
        } else {
            self.before_zero.get_or_insert(self.motors);
            self.motors = ALL;
        }
    }

    /// Takes for started what a START in `bytes` addresses, wherever it stands: shipped firmware
    /// reads the payload of the longest frame as frames (docs/SPEC-NOTES.md S10).
    pub(super) fn presume_within(&mut self, bytes: &[u8]) {
        let mut rest = bytes;
        while let [_, behind @ ..] = rest {
            if let Parse::Frame(frame, _) = Frame::parse(rest)
                && Effect::of_frame(&frame) == Effect::Starts
            {
                self.presume(frame.motor());
            }
            rest = behind;
        }
    }

    /// The drive has no such motor.
    pub(super) fn forget_motor(&mut self, motor: MotorNumber) {
        self.motors &= !bit(motor);
    }

    /// Says that the drive's current motor is not known.
    pub fn forget_current(&mut self) {
        (self.current, self.before_zero) = (None, None);
    }

    /// Whether no motor counts as started.
    pub fn is_empty(self) -> bool {
        self.motors == 0
    }

    /// The motors that count as started.
    pub fn motors(self) -> impl Iterator<Item = MotorNumber> {
        (1..=MotorNumber::MAX)
            .filter_map(MotorNumber::new)
            .filter(move |motor| self.motors & bit(*motor) != 0)
    }
}

/// Bit n: motor n + 1.
pub(super) const fn bit(motor: MotorNumber) -> u8 {
    1 << motor.index()
}
