//! Which motors go to a speed that this client commanded when they are started.

use motorlink_proto::st::MotorNumber;

use super::started::{Effect, bit};

/// Motors whose last setpoint is a speed ramp that was acknowledged. Bit n: motor n + 1.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Ramped(u8);

impl Ramped {
    /// A request for `motor` leaves; `None` while that motor is not known. Unless the drive
    /// acknowledges a ramp, its setpoint may have changed or not.
    pub(super) fn request_sent(&mut self, motor: Option<MotorNumber>, effect: Effect) {
        match effect {
            Effect::Ramps | Effect::Supersedes => self.0 &= !motor.map_or(u8::MAX, bit),
            Effect::Resets => self.forget(),
            _ => {}
        }
    }

    /// The request that was [`asked`](Self::asked) last was acknowledged.
    pub(super) fn acknowledged(&mut self, motor: Option<MotorNumber>, effect: Effect) {
        if effect == Effect::Ramps {
            self.0 |= motor.map_or(0, bit);
        }
    }

    /// The drive may be another one, or have forgotten its setpoints.
    pub(super) fn forget(&mut self) {
        self.0 = 0;
    }

    /// Whether a start of `motor` goes to a speed that this client commanded.
    pub(super) fn has(self, motor: Option<MotorNumber>) -> bool {
        motor.is_some_and(|motor| self.0 & bit(motor) != 0)
    }
}
