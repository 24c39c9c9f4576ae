//! The motors that were set in motion and not stopped, according to requests and replies.

use super::{Command, Effect, Frame, FrameCode, MotorNumber, Parse, Profile, Request};

/// Every motor that a drive can have.
const ALL: u8 = 0x7F;

impl Effect {
    /// The effect of a request, according to the tables of frame codes, commands and registers.
    pub fn of(request: &Request<'_>) -> Self {
        match request {
            Request::ExecuteCommand(command) => command.effect(),
            Request::SetRegister { register, .. } => register.effect(),
            Request::ConfigureSegment { segment, .. } => Effect::Configures(*segment),
            request => request.code().effect(),
        }
    }

    /// Whether a raw frame stops a motor.
    pub(super) fn frame_stops(frame: &Frame<'_>) -> bool {
        match frame.payload {
            [command, ..] if frame.code() == FrameCode::ExecuteCmd.number() => {
                Command::from(*command).effect() == Effect::Stops
            }
            _ => false,
        }
    }

    /// The effect of a raw frame, in the profile in which it has one.
    pub fn of_frame(frame: &Frame<'_>) -> Self {
        let code = |profile| FrameCode::from_number(frame.code(), profile);
        let effects = Profile::ALL.map(|profile| match frame.request(profile) {
            // Shipped firmware reads an old byte as the command (docs/SPEC-NOTES.md S18).
            Err(_) if code(profile) == Some(FrameCode::ExecuteCmd) => Effect::Starts,
            Ok(request) => Effect::of(&request),
            Err(_) => Effect::None,
        });
        effects.into_iter().find(|effect| *effect != Effect::None).unwrap_or(Effect::None)
    }
}

/// The started motors. A motor counts as started as soon as a request is sent that starts or changes
/// its motion ([`Motion::is_owned`](crate::Motion::is_owned)): the reply may be lost, and another program may have started it before.
/// It counts until a STOP is acknowledged.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Started {
    /// Bit n: motor n + 1.
    motors: u8,
    /// The motor that motor number 0 addresses; `None` if unknown.
    current: Option<MotorNumber>,
    /// The motors that counted as started before a motion of motor number 0. `None` after motor
    /// number 0 may address another motor.
    before_zero: Option<u8>,
}

impl Started {
    /// Records a sent request for motor number `motor`. Returns the addressed motor, if known, for
    /// [`acknowledged`](Self::acknowledged).
    pub fn request_sent(&mut self, motor: u8, effect: Effect) -> Option<MotorNumber> {
        if motor != 0 || matches!(effect, Effect::Retargets | Effect::Resets) {
            self.before_zero = None;
        }
        if effect.motion().is_owned() {
            self.presume(motor);
        }
        let addressed = self.addressed(motor);
        // Until the drive acknowledges, its current motor is unknown.
        self.current = None;
        addressed
    }

    /// The motor that motor number `motor` addresses, if known.
    pub(super) fn addressed(&self, motor: u8) -> Option<MotorNumber> {
        MotorNumber::new(motor).or(self.current)
    }

    /// Records that the last [`sent`](Self::request_sent) request was acknowledged.
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

    /// Records motor number `motor` as started. Number 0 means every motor: after a short supply
    /// failure a drive has another current motor.
    pub fn presume(&mut self, motor: u8) {
        if let Some(motor) = MotorNumber::new(motor) {
            self.motors |= bit(motor);
        } else {
            self.before_zero.get_or_insert(self.motors);
            self.motors = ALL;
        }
    }

    /// Records the motors that a motion anywhere in `bytes` addresses as started. Shipped firmware
    /// reads the payload of the longest frame as frames (docs/SPEC-NOTES.md S10).
    pub(super) fn presume_within(&mut self, bytes: &[u8]) {
        let mut rest = bytes;
        while let [_, behind @ ..] = rest {
            if let Parse::Frame(frame, _) = Frame::parse(rest)
                && Effect::of_frame(&frame).motion().is_owned()
            {
                self.presume(frame.motor());
            }
            rest = behind;
        }
    }

    /// Records that the drive does not have this motor.
    pub(super) fn forget_motor(&mut self, motor: MotorNumber) {
        self.motors &= !bit(motor);
    }

    /// Records that the drive's current motor is unknown.
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
