//! Checks the requests of a master, and records their effects.

use super::started::bit;
use super::{
    Counters, Effect, Frame, LimitError, Limits, MAX_FRAME, MotorNumber, Request, Started,
};

/// The limits of a master's caller, with the motors that it started, the motors that have a
/// commanded speed, and the configured data segments.
///
/// Call [`check`](Self::check) or [`check_frame`](Self::check_frame) before a master takes a request,
/// [`sent`](Self::sent) after it took the request, and [`acknowledged`](Self::acknowledged) after the
/// drive acknowledged it.
#[derive(Debug, Clone, Copy, Default)]
pub struct Account {
    limits: Limits,
    started: Started,
    /// Motors whose last setpoint is an acknowledged speed ramp. Bit n: motor n + 1.
    ramped: u8,
    /// Data segments that were configured since the port was opened. Bit n: segment n.
    configured: u8,
    /// The numbers of line losses and of identifications at the start of the request. A drive sends
    /// an identification after a reset.
    history: (u32, u32),
    /// The effect of the open request, and its motor, if known.
    effect: Effect,
    addressed: Option<MotorNumber>,
}

impl Account {
    /// An account before the first request.
    pub fn new(limits: Limits) -> Self {
        Account { limits, ..Account::default() }
    }

    /// Sets limits, effective from the next request. Earlier ramps no longer count: they were
    /// checked against the former limits.
    pub fn set_limits(&mut self, limits: Limits) {
        self.limits = limits;
        self.ramped = 0;
        if self.effect == Effect::Ramps {
            self.effect = Effect::None;
        }
    }

    /// The motors that were started and not stopped.
    pub const fn started(&self) -> Started {
        self.started
    }

    /// Records these motors as started.
    pub const fn take_over(&mut self, started: Started) {
        self.started = started;
    }

    /// Checks a request for motor number `motor`, with the current counters of the line. Returns
    /// its effect. While a speed limit is set, a start without a ramp is refused. A read of a data
    /// segment that was not configured is refused in any case: shipped firmware reads its frame as a
    /// torque ramp (docs/SPEC-NOTES.md S7).
    ///
    /// # Errors
    /// The limit that the request exceeds.
    pub fn check(
        &mut self,
        seen: Counters,
        motor: u8,
        request: &Request<'_>,
    ) -> Result<Effect, LimitError> {
        self.limits.check(request)?;
        match *request {
            Request::GetSegment(segment) if self.configured & segment_bit(segment) == 0 => {
                return Err(LimitError::NotConfigured { segment });
            }
            _ => {}
        }
        self.check_start(seen, motor, Effect::of(request))
    }

    /// Like [`check`](Self::check), for any frame, in every profile.
    ///
    /// # Errors
    /// The limit that the frame exceeds.
    pub fn check_frame(&mut self, seen: Counters, frame: &Frame<'_>) -> Result<Effect, LimitError> {
        self.limits.check_frame(frame)?;
        self.check_start(seen, frame.motor(), Effect::of_frame(frame))
    }

    fn check_start(
        &mut self,
        seen: Counters,
        motor: u8,
        effect: Effect,
    ) -> Result<Effect, LimitError> {
        let history = (seen.losses, seen.identifications);
        if self.history != history {
            self.history = history;
            self.forget_setpoints();
        }
        let has_ramp =
            || self.started.addressed(motor).is_some_and(|motor| self.ramped & bit(motor) != 0);
        match self.limits.speed_rpm {
            Some(limit_rpm) if effect == Effect::Starts && !has_ramp() => {
                Err(LimitError::NoRamp { limit_rpm })
            }
            _ => Ok(effect),
        }
    }

    /// Records that a master took this request for motor number `motor`. Until the drive
    /// acknowledges a ramp, its setpoint is unknown.
    pub fn sent(&mut self, motor: u8, effect: Effect) {
        self.effect = effect;
        self.addressed = self.started.request_sent(motor, effect);
        match effect {
            Effect::Ramps | Effect::Supersedes => {
                self.ramped &= !self.addressed.map_or(u8::MAX, bit);
            }
            Effect::Resets => self.ramped = 0,
            _ => {}
        }
    }

    /// Like [`sent`](Self::sent), for any frame.
    pub fn sent_frame(&mut self, frame: &Frame<'_>, effect: Effect) {
        self.started.presume_within(frame.encode(&mut [0; MAX_FRAME]).unwrap_or(&[]));
        self.sent(frame.motor(), effect);
    }

    /// Records that the last sent request was acknowledged.
    pub fn acknowledged(&mut self) {
        self.started.acknowledged(self.addressed, self.effect);
        match self.effect {
            Effect::Ramps => self.ramped |= self.addressed.map_or(0, bit),
            Effect::Configures(segment) => self.configured |= segment_bit(segment),
            _ => {}
        }
    }

    /// Records that the port was opened again. The drive may be another one, or may have been
    /// reset: its setpoints, its data segments and its current motor are unknown.
    pub fn reopened(&mut self) {
        self.configured = 0;
        self.forget_setpoints();
    }

    fn forget_setpoints(&mut self) {
        self.ramped = 0;
        self.started.forget_current();
    }

    /// Records that the drive does not have this motor, which may have been recorded as started.
    pub fn forget_motor(&mut self, motor: MotorNumber) {
        self.started.forget_motor(motor);
    }
}

/// Bit n: segment n. No bit for a segment that cannot exist.
fn segment_bit(segment: u8) -> u8 {
    1u8.checked_shl(segment.into()).unwrap_or(0)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::st::{Command, ControlMode, CurrentReference, Ramp, RegisterId, TorqueRamp};

    const LIMITS: Limits = Limits { speed_rpm: Some(1000), current_s16a: None };
    const START: Request<'_> = Request::ExecuteCommand(Command::StartMotor);
    const RAMP: Request<'_> = Request::SetRamp(Ramp { speed_rpm: 1000, duration_ms: 0 });
    const NEW: Counters = Counters { unasked_bytes: 0, identifications: 0, losses: 0 };

    fn done(account: &mut Account, motor: u8, request: &Request<'_>) {
        let effect = account.check(NEW, motor, request).unwrap();
        account.sent(motor, effect);
        account.acknowledged();
    }

    fn starts(account: &mut Account, motor: u8) -> bool {
        match account.check(NEW, motor, &START) {
            Ok(effect) => effect == Effect::Starts,
            Err(why) => {
                assert_eq!(why, LimitError::NoRamp { limit_rpm: 1000 });
                false
            }
        }
    }

    #[test]
    fn a_start_needs_an_acknowledged_ramp_of_its_motor() {
        let mut account = Account::new(LIMITS);
        assert!(!starts(&mut account, 1));
        done(&mut account, 1, &RAMP);
        assert!(starts(&mut account, 1) && !starts(&mut account, 2));
        // The start addresses the motor of the last acknowledged request.
        assert!(starts(&mut account, 0));
        account.sent(1, Effect::Ramps);
        assert!(!starts(&mut account, 1), "the ramp was not acknowledged");
        done(&mut account, 1, &RAMP);
        done(&mut account, 1, &Request::ExecuteCommand(Command::StopMotor));
        assert!(starts(&mut account, 1));
        assert!(Account::default().check(NEW, 1, &START).is_ok());
    }

    #[test]
    fn a_ramp_does_not_count_behind_another_setpoint_or_a_reset() {
        let write = |register, value| Request::SetRegister { register, value };
        for later in [
            Request::SetCurrentReference(CurrentReference { iq_s16a: 1, id_s16a: 0 }),
            Request::SetTorqueRamp(TorqueRamp { torque_s16a: 1, duration_ms: 0 }),
            write(RegisterId::TORQUE_REF, &[1, 0]),
            write(RegisterId::CONTROL_MODE, &[u8::from(ControlMode::Torque)]),
            // Firmware makes this a ramp to a reference of its own.
            write(RegisterId::CONTROL_MODE, &[u8::from(ControlMode::Speed)]),
            Request::ExecuteCommand(Command::Reset),
        ] {
            let mut account = Account::new(LIMITS);
            done(&mut account, 1, &RAMP);
            done(&mut account, 1, &later);
            assert!(!starts(&mut account, 1), "{later:?}");
        }
    }

    #[test]
    fn a_ramp_does_not_count_on_another_line_or_for_another_drive() {
        for seen in [Counters { losses: 1, ..NEW }, Counters { identifications: 1, ..NEW }] {
            let mut account = Account::new(LIMITS);
            done(&mut account, 1, &RAMP);
            assert!(account.check(seen, 1, &START).is_err());
        }
        let mut account = Account::new(LIMITS);
        done(&mut account, 1, &RAMP);
        account.reopened();
        assert!(!starts(&mut account, 1));
    }

    #[test]
    fn a_ramp_does_not_count_under_limits_that_were_set_later() {
        let mut account = Account::new(Limits::default());
        let fast = Request::SetRamp(Ramp { speed_rpm: 5000, duration_ms: 0 });
        done(&mut account, 1, &fast);
        account.set_limits(LIMITS);
        assert!(!starts(&mut account, 1));

        account.set_limits(Limits::default());
        let effect = account.check(NEW, 1, &fast).unwrap();
        account.sent(1, effect);
        account.set_limits(LIMITS);
        account.acknowledged();
        assert!(!starts(&mut account, 1));
    }

    #[test]
    fn a_data_segment_is_read_only_after_it_was_configured() {
        let mut account = Account::default();
        let read =
            |account: &mut Account, segment| account.check(NEW, 1, &Request::GetSegment(segment));
        let refused = |segment| Err(LimitError::NotConfigured { segment });
        assert_eq!(read(&mut account, 2), refused(2));
        let configure = Request::ConfigureSegment { segment: 2, registers: &[0x02] };
        let effect = account.check(NEW, 1, &configure).unwrap();
        account.sent(1, effect);
        assert_eq!(read(&mut account, 2), refused(2), "not acknowledged");
        done(&mut account, 1, &configure);
        assert_eq!(read(&mut account, 2), Ok(Effect::None));
        assert_eq!(read(&mut account, 3), refused(3));
        assert_eq!(read(&mut account, 200), refused(200));
        let lost = Counters { losses: 1, ..NEW };
        assert_eq!(account.check(lost, 1, &Request::GetSegment(2)), Ok(Effect::None));
        account.reopened();
        assert_eq!(read(&mut account, 2), refused(2), "it may be another drive");
    }

    #[test]
    fn a_start_counts_until_its_stop_is_acknowledged() {
        let mut account = Account::default();
        let motors = |account: &Account| account.started().motors().count();
        account.sent(2, Effect::Starts);
        account.sent(2, Effect::Stops);
        assert_eq!(motors(&account), 1);
        account.acknowledged();
        assert_eq!(motors(&account), 0);
    }
}
