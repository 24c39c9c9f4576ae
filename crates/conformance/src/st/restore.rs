//! Start and end of a case: the drive at rest, the line in sync, and all settings restored.

use motorlink_proto::Hex;
use motorlink_proto::st::{
    Command, ErrorCode, Frame, FrameCode, HEADER_ACK, MotorNumber, RegisterId, Request, RevupPhase,
    Status,
};
use motorlink_proto::time::Micros;

use super::harness::{Harness, PATIENCE, Reply, frame};
use super::undo::{Setpoints, Undo};
use crate::case::{Need, ReadAs, Stop, Subject};
use crate::finding::Finding;
use crate::reading::S48;
use crate::world::Unavailable;

/// Silence of this length counts as a silent line: four times the reception timeout.
const SILENCE: Micros = Micros::from_millis(100);
/// Timeout until the drive is at rest.
const REST: Micros = Micros::from_millis(30_000);
/// Number of STOP_MOTORs to a motor whose state cannot be read.
const STOPS: u32 = 3;
/// Interval between two samples of a register.
const LOOK: Micros = Micros::from_millis(10);

impl Subject for Harness {
    fn begin(&mut self) -> Result<(), Stop> {
        self.forget();
        (self.moved, self.restoring, self.current) = (false, false, None);
        self.synchronise()?;
        let current = self.exchange(&current_motor())?;
        self.current = current.payload.first().filter(|_| current.header == HEADER_ACK).copied();
        let motor = self.options.motor;
        let question = self.encode(&Request::GetRegister(RegisterId::STATUS));
        let reply = self.exchange(&question)?;
        if reply.is_nack(ErrorCode::BadMotorSelected) {
            return Err(Stop::Lost(format!("the drive has no {motor}")));
        }
        let idle = self.found.idle;
        let settled = |status| status == idle || status == Status::Run || faulty(status);
        let status = self.wait_for(REST, settled)?;
        if !self.is_idle(status) && !self.rests_as(status)? {
            return Err(Stop::Lost(format!(
                "the motor is not at rest: STATUS is {status}, and the test starts in IDLE; stop the \
                 motor and acknowledge faults first (`motorlink st stop`, `motorlink st fault-ack`)"
            )));
        }
        Ok(())
    }

    fn restore(&mut self) -> Result<(), Stop> {
        self.restoring = true;
        let faulted = self.undo.iter().any(|undo| matches!(undo, Undo::Fault));
        // A failed step does not prevent the others.
        let mut outcome = Ok(());
        if faulted {
            outcome = self.world.fault(false).map_err(|Unavailable(why)| {
                self.failed(format!("the end of the fault; end it by hand ({why})"))
            });
        }
        let may_turn = self.moved || faulted;
        let mut rests = self.end_at_rest(may_turn);
        if let Err(Stop::Failed(_)) = rests {
            // Repeats it: an occasional error on the line must not leave a motor turning.
            self.out_of_sync = true;
            rests = self.end_at_rest(may_turn);
        }
        if rests.is_err() && may_turn {
            self.stop_unheard()?;
        }
        outcome = outcome.and(rests?);
        // Settings that could not be restored remain in the list for the end of the next case.
        for undo in std::mem::take(&mut self.undo).into_iter().rev() {
            let mut done = self.put_back(undo.clone());
            if done.is_err() {
                // Repeats it: an occasional error on the line must not leave a drive changed.
                self.out_of_sync = true;
                done = self.synchronise().and_then(|()| self.put_back(undo));
            }
            outcome = outcome.and(done);
        }
        outcome.and(self.restore_current())
    }

    fn allows(&self, need: Need) -> bool {
        self.options.allowed.contains(&need)
    }

    fn transcript(&self) -> Vec<String> {
        self.lines()
    }

    fn differences(&mut self) -> Vec<Finding> {
        self.differences.take()
    }
}

impl Harness {
    /// Records a register for restoring. Returns its bytes.
    pub(super) fn keep(&mut self, register: RegisterId) -> Result<Vec<u8>, Stop> {
        if is_setpoint(register) {
            self.keep_setpoints()?;
            return self.get(register);
        }
        let bytes = self.get(register)?;
        self.undo.push(Undo::Register(register, bytes.clone()));
        Ok(bytes)
    }

    /// Records mode and references for restoring. After that the next start goes to a speed.
    pub(super) fn keep_setpoints(&mut self) -> Result<(), Stop> {
        let mode = self.value(RegisterId::CONTROL_MODE)?;
        let speed = self.value(RegisterId::RAMP_FINAL_SPEED)?;
        let iq = self.value(RegisterId::TORQUE_REF)?;
        let id = self.value(RegisterId::FLUX_REF)?;
        self.set(RegisterId::RAMP_FINAL_SPEED, speed)?;
        let speed_mode_id = self.value(RegisterId::FLUX_REF)?;
        self.undo.push(Undo::Setpoints(Setpoints { mode, speed, iq, id, speed_mode_id }));
        Ok(())
    }

    /// Records a rev-up phase for restoring, and returns it.
    pub(super) fn keep_revup(&mut self, phase: u8) -> Result<RevupPhase, Stop> {
        let payload = self.acknowledged(&Request::GetRevupData(phase))?;
        let data = RevupPhase::decode(&payload);
        let data = data.ok_or_else(|| self.failed("ACK with 8 bytes: speed, torque, duration"))?;
        self.undo.push(Undo::Revup(phase, data));
        Ok(data)
    }

    /// Causes a fault condition until the end of the case.
    pub(super) fn fault(&mut self) -> Result<(), Stop> {
        self.undo.push(Undo::Fault);
        Ok(self.world.fault(true)?)
    }

    /// Cycles the drive's power, and waits until it is ready.
    pub(super) fn power_cycle(&mut self) -> Result<(), Stop> {
        self.world.power_cycle()?;
        self.drain(SILENCE)
    }

    /// Reads STATUS until it is as wanted, or until the time is over. Returns its last value.
    pub(super) fn wait_for(
        &mut self,
        patience: Micros,
        wanted: impl Fn(Status) -> bool,
    ) -> Result<Status, Stop> {
        let until = self.clock.now() + patience;
        loop {
            let status = self.status()?;
            if wanted(status) || self.clock.now() >= until {
                return Ok(status);
            }
            self.silence(LOOK)?;
        }
    }

    /// Whether a drive with another number for IDLE (SPEC-NOTES S14) is at rest: it has no fault
    /// and does not turn. The kit then uses this number.
    fn rests_as(&mut self, status: Status) -> Result<bool, Stop> {
        let known = status == Status::Run || faulty(status) || self.found.idle != Status::Idle;
        if known || self.value(RegisterId::FLAGS)? != 0 || self.value(RegisterId::SPEED_MEAS)? != 0
        {
            return Ok(false);
        }
        self.found.idle = status;
        Ok(true)
    }

    /// Stops the motor and waits until it is at rest and without a fault.
    pub(super) fn rest(&mut self) -> Result<(), Stop> {
        self.execute(Command::StopMotor)?;
        let idle = self.found.idle;
        let at_rest = |status| status == idle || status == Status::FaultOver;
        if self.wait_for(REST, at_rest)? == Status::FaultOver {
            self.execute(Command::FaultAck)?;
        }
        let status = self.wait_for(REST, |status| status == idle)?;
        if self.is_idle(status) {
            return Ok(());
        }
        Err(Stop::Lost(format!("the motor did not come to rest: STATUS is {status}")))
    }

    /// Stops a motor that is not at rest. Returns the failure if no sent frame could have started
    /// it.
    fn end_at_rest(&mut self, may_turn: bool) -> Result<Result<(), Stop>, Stop> {
        self.synchronise()?;
        let status = self.status()?;
        if self.is_idle(status) {
            return Ok(Ok(()));
        }
        let expected = "ACK 0: IDLE, because no sent frame starts a motor";
        let allowed = self.require(may_turn, expected);
        self.rest()?;
        Ok(allowed)
    }

    /// Sends STOP_MOTOR to a drive that may receive it although it does not answer.
    fn stop_unheard(&mut self) -> Result<(), Stop> {
        let stop = self.encode(&Request::ExecuteCommand(Command::StopMotor));
        for _ in 0..STOPS {
            self.drain(SILENCE)?;
            self.send_more(&stop)?;
        }
        (self.out_of_sync, self.reply_pending) = (true, true);
        Ok(())
    }

    /// Brings the line in sync, if needed.
    fn synchronise(&mut self) -> Result<(), Stop> {
        if !self.out_of_sync {
            return Ok(());
        }
        // A late reply must not be matched to the next request.
        let reply_pending = std::mem::take(&mut self.reply_pending);
        self.drain(if reply_pending { PATIENCE } else { SILENCE })?;
        let mut answered = self.probe()?;
        if answered.is_none() {
            // Completes any frame that a drive without reception timeout waits for (SPEC-NOTES
            // S16).
            let padding: Vec<u8> = [0xFF; 130].into_iter().chain([0x00, 0xFF]).collect();
            self.send(&padding)?;
            self.drain(SILENCE)?;
            answered = self.probe()?;
        }
        if answered.is_none() {
            return Err(Stop::Lost(
                "nothing answers; is the drive powered, and is the baud rate right \
                 (`motorlink st scan`)?"
                    .to_owned(),
            ));
        }
        self.out_of_sync = false;
        Ok(())
    }

    /// Reads the number of the current motor, which changes nothing.
    fn probe(&mut self) -> Result<Option<Reply>, Stop> {
        self.send(&current_motor())?;
        self.reply(PATIENCE)
    }

    fn put_back(&mut self, undo: Undo) -> Result<(), Stop> {
        match undo {
            Undo::Register(register, bytes) => self.put_back_register(register, &bytes),
            Undo::Setpoints(setpoints) => self.put_back_setpoints(setpoints).read_as(S48),
            Undo::Revup(phase, data) => {
                self.done(&Request::SetRevupData(phase, data))?;
                let now = self.acknowledged(&Request::GetRevupData(phase))?;
                let left = format!("phase {phase} restored to: {}", Hex(&data.to_bytes()));
                self.require(now == data.to_bytes(), left)
            }
            Undo::Segment(segment) => {
                self.done(&Request::ConfigureSegment { segment, registers: &[] })
            }
            Undo::Pfc => self.execute(Command::PfcDisable),
            Undo::Fault => Ok(()),
        }
    }

    fn put_back_register(&mut self, register: RegisterId, bytes: &[u8]) -> Result<(), Stop> {
        let Some(value) = register.decode(self.profile(), bytes) else { return Ok(()) };
        self.set(register, value)?;
        let now = self.get(register)?;
        self.require(now == bytes, format!("{register} restored to: {}", Hex(bytes)))
    }

    fn put_back_setpoints(&mut self, before: Setpoints) -> Result<(), Stop> {
        self.set(RegisterId::RAMP_FINAL_SPEED, before.speed)?;
        if self.value(RegisterId::FLUX_REF)? != before.speed_mode_id {
            self.set(RegisterId::IQ_SPEEDMODE, before.speed_mode_id)?;
        }
        let others = [
            (RegisterId::CONTROL_MODE, before.mode),
            (RegisterId::TORQUE_REF, before.iq),
            (RegisterId::FLUX_REF, before.id),
        ];
        for (register, value) in others {
            if self.value(register)? != value {
                self.set(register, value)?;
            }
        }
        for (register, value) in
            others.into_iter().chain([(RegisterId::RAMP_FINAL_SPEED, before.speed)])
        {
            let held = self.value(register)? == value;
            self.require(held, format!("{register} restored to: {value}"))?;
        }
        Ok(())
    }

    /// Any frame makes its motor the current one.
    fn restore_current(&mut self) -> Result<(), Stop> {
        let Some(index) = self.current else { return Ok(()) };
        let Some(motor) = MotorNumber::new(index.saturating_add(1)) else { return Ok(()) };
        let header = Frame::header(FrameCode::GetReg.number(), motor.number());
        self.exchange(&frame(header, &[RegisterId::STATUS.0])).map(drop)
    }
}

/// Whether writing a register changes the effect of the next start.
pub(super) fn is_setpoint(register: RegisterId) -> bool {
    register.effect().motion().is_owned() || register == RegisterId::IQ_SPEEDMODE
}

pub(super) fn faulty(status: Status) -> bool {
    matches!(status, Status::FaultNow | Status::FaultOver)
}

/// GET_REG TARGET_MOTOR of the current motor.
pub(super) fn current_motor() -> Vec<u8> {
    frame(FrameCode::GetReg.number(), &[RegisterId::TARGET_MOTOR.0])
}
