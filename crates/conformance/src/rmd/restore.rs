//! Start and end of a case: the motor at rest, and all settings restored.

use motorlink_proto::can::CanFrame;
use motorlink_proto::rmd::{Stop as Halt, *};
use motorlink_proto::time::Micros;
use motorlink_proto::units::DpsPerSecond;

use super::harness::Harness;
use super::kept::Kept;
use crate::case::{Need, ReadAs, Stop, Subject};
use crate::finding::Finding;
use crate::reading::R8;
use crate::world::Unavailable;

/// A motor below this speed (°/s) is at rest.
const REST: u16 = 5;
/// A motor below this torque current (digits: half an ampere) is at rest.
const CURRENTLESS: u16 = 31;
/// A motor that accelerated by this speed (°/s) does not come to rest.
const FASTER: u16 = 30;
/// Number of attempts to restore a setting.
const ATTEMPTS: u32 = 3;
/// Timeout until the motor is at rest, ms.
const COASTING: u64 = 10_000;
/// The environment of a motor reacts more slowly than the bus.
const CHANGE: Micros = Micros::from_millis(100);
/// Timeout of the first answer after power-on, ms.
const STARTING: u64 = 5_000;

impl Subject for Harness {
    fn begin(&mut self) -> Result<(), Stop> {
        self.go_on()?;
        if let Some((dialect, id)) = self.foreign {
            return Err(Stop::Lost(format!(
                "motor {id} answers as {dialect} motors do: it does not use V1.62 and is not commanded"
            )));
        }
        if self.runaway {
            let id = self.id();
            return Err(Stop::Lost(format!(
                "motor {id} cannot be switched off: it is not commanded"
            )));
        }
        self.settle(Micros::from_millis(5))?;
        self.at_rest()?;
        self.forget();
        Ok(())
    }

    fn restore(&mut self) -> Result<(), Stop> {
        self.restore_settings()
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
    /// Waits until the motor is at rest. Otherwise it is not tested: the kit does not stop a motion
    /// that it did not start.
    pub(super) fn at_rest(&mut self) -> Result<(), Stop> {
        let MotionStatus { speed, iq, .. } = match self.comes_to_rest()? {
            Ok(()) => return Ok(()),
            Err(status) => status,
        };
        Err(Stop::Lost(format!(
            "motor {} is not at rest: it turns at {speed} with {:.1} A; switch it off first",
            self.id(),
            iq.amps()
        )))
    }

    /// Waits until the motor is at rest, or returns its status.
    fn comes_to_rest(&mut self) -> Result<Result<(), MotionStatus>, Stop> {
        let begun = self.millis();
        let mut slowest = u16::MAX;
        loop {
            let status = self.status_if_present()?;
            let (speed, iq) = (status.speed.0.unsigned_abs(), status.iq.0.unsigned_abs());
            if speed <= REST && iq <= CURRENTLESS {
                return Ok(Ok(()));
            }
            slowest = slowest.min(speed);
            if speed > slowest.saturating_add(FASTER) || self.millis() - begun > COASTING {
                return Ok(Err(status));
            }
            self.pause(Micros::from_millis(50))?;
        }
    }

    /// Status 2 of a motor that may be absent.
    fn status_if_present(&mut self) -> Result<MotionStatus, Stop> {
        let status = self.read(ReadMotionStatus);
        if self.heard || self.foreign.is_some() || self.answers_at_all()? {
            return status;
        }
        Err(Stop::Lost(format!(
            "motor {} does not answer; `motorlink rmd scan` lists the motors that answer",
            self.id()
        )))
    }

    fn answers_at_all(&mut self) -> Result<bool, Stop> {
        let replies = self.replies(&[self.frame(ReadStatus.encode())])?;
        Ok(replies.iter().any(|frame| self.is_own(frame)))
    }

    /// Reads the gains, and records them.
    pub(super) fn keep_gains(&mut self) -> Result<Pid, Stop> {
        let gains = self.read(ReadPid)?;
        self.kept.gains.get_or_insert(gains);
        Ok(gains)
    }

    /// Reads the acceleration limit, and records it.
    pub(super) fn keep_acceleration(&mut self) -> Result<DpsPerSecond, Stop> {
        let acceleration = self.read(ReadAcceleration)?.acceleration;
        self.kept.acceleration.get_or_insert(acceleration);
        Ok(acceleration)
    }

    /// Reads the gains in ROM: after a power cycle if possible, otherwise the gains in RAM. Records
    /// them.
    pub(super) fn keep_rom_gains(&mut self) -> Result<Pid, Stop> {
        self.keep_gains()?;
        if self.options.allowed.contains(&Need::PowerCycle) {
            self.power_cycle()?;
        }
        let gains = self.read(ReadPid)?;
        self.kept.rom_gains.get_or_insert(gains);
        Ok(gains)
    }

    /// Reads the encoder, and records its offset.
    pub(super) fn keep_offset(&mut self) -> Result<Encoder, Stop> {
        let encoder = self.read(ReadEncoder)?;
        self.kept.offset.get_or_insert(encoder.offset);
        Ok(encoder)
    }

    /// Records that the motor may turn now. It is switched off at the end.
    pub(super) fn may_move(&mut self) {
        self.kept.moved = true;
    }

    /// Records that these motors may move, too.
    pub(super) fn may_move_too(&mut self, motors: MotorSet) {
        self.kept.others = self.kept.others.union(motors);
    }

    /// Cycles the motor's power.
    pub(super) fn power_cycle(&mut self) -> Result<(), Stop> {
        self.keep_gains()?;
        self.keep_acceleration()?;
        self.cycle()
    }

    fn cycle(&mut self) -> Result<(), Stop> {
        self.world.power_cycle()?;
        let begun = self.millis();
        while !self.answers_at_all()? {
            self.require(self.millis() - begun < STARTING, "an answer within 5 s of power-on")?;
        }
        Ok(())
    }

    /// Starts or ends a fault condition.
    pub(super) fn fault(&mut self, present: bool) -> Result<(), Stop> {
        self.kept.fault = true;
        self.world.fault(present)?;
        self.pause(CHANGE)
    }

    /// Switches off the moved motors, ends a fault, and restores settings. Each step runs even if
    /// another one fails.
    fn restore_settings(&mut self) -> Result<(), Stop> {
        let kept = std::mem::take(&mut self.kept);
        if self.foreign.is_some() {
            let own = kept.moved.then(|| self.id());
            return self.off_unheard(own.into_iter().chain(kept.others));
        }
        let off = if kept.moved { self.switch_off() } else { Ok(()) };
        let others = self.switch_others_off(kept.others);
        let fault = if kept.fault { self.insist(Self::end_fault) } else { Ok(()) };
        let rom = self.insist(|harness| harness.put_back_rom(&kept));
        let gains = kept.gains.map_or(Ok(()), |gains| self.insist(|b| b.put_back_gains(gains)));
        let acceleration = kept
            .acceleration
            .map_or(Ok(()), |limit| self.insist(|b| b.put_back_acceleration(limit)));
        off.and(others).and(fault).and(rom).and(gains).and(acceleration)
    }

    /// Tries a few times: an occasional error on the bus must not leave a motor changed.
    fn insist(&mut self, act: impl Fn(&mut Self) -> Result<(), Stop>) -> Result<(), Stop> {
        let mut done = act(self);
        for _ in 1..ATTEMPTS {
            if let Err(Stop::Failed(_)) = done {
                done = act(self);
            }
        }
        done
    }

    /// Switches off, and checks it. If the motor keeps turning, sends a stop; it is not turned
    /// again.
    fn switch_off(&mut self) -> Result<(), Stop> {
        let result = self.insist(|harness| harness.ask(Off.encode()).map(|_| ()));
        if result.is_err() {
            self.off_unheard([self.id()])?;
        }
        if self.comes_to_rest()?.is_err() {
            let failed = self.failed("a motor at rest within 10 s of 0x80");
            self.runaway = true;
            self.ask(Halt.encode())?;
            return Err(failed);
        }
        result
    }

    fn switch_others_off(&mut self, motors: MotorSet) -> Result<(), Stop> {
        if motors.is_empty() {
            return Ok(());
        }
        let off = motors.map(|motor| CanFrame::new(motor.can_id(), Off.encode()));
        let result = self.replies(&off.collect::<Vec<_>>());
        if result.is_err() {
            self.off_unheard(motors)?;
        }
        result.map(|_| ())
    }

    fn end_fault(&mut self) -> Result<(), Stop> {
        self.world.fault(false).map_err(|Unavailable(why)| {
            self.failed(format!("the end of the fault; end it by hand ({why})"))
        })?;
        self.pause(CHANGE)?;
        self.read(ClearErrors).map(|_| ())
    }

    fn put_back_rom(&mut self, kept: &Kept) -> Result<(), Stop> {
        if kept.rom_gains.is_none() && kept.offset.is_none() {
            return Ok(());
        }
        if let Some(gains) = kept.rom_gains {
            self.ask(WritePidRom(gains).encode())?;
        }
        if let Some(offset) = kept.offset {
            self.read(WriteEncoderOffsetRom(EncoderOffset { offset }))?;
        }
        if self.options.allowed.contains(&Need::PowerCycle) {
            self.cycle()?;
        }
        if let Some(gains) = kept.rom_gains {
            let read = self.read(ReadPid)?;
            self.require(read == gains, format!("the gains in ROM as they were: {gains:?}"))?;
        }
        if let Some(offset) = kept.offset {
            let read = self.read(ReadEncoder)?.offset;
            let held = self.require(read == offset, format!("the offset as it was: {offset}"));
            held.read_as(R8)?;
        }
        Ok(())
    }

    fn put_back_gains(&mut self, gains: Pid) -> Result<(), Stop> {
        self.ask(WritePidRam(gains).encode())?;
        let read = self.read(ReadPid)?;
        self.require(read == gains, format!("the gains as they were: {gains:?}"))
    }

    fn put_back_acceleration(&mut self, acceleration: DpsPerSecond) -> Result<(), Stop> {
        self.ask(WriteAccelerationRam(Acceleration { acceleration }).encode())?;
        let read = self.read(ReadAcceleration)?.acceleration;
        self.require(read == acceleration, format!("the limit as it was: {acceleration}"))
    }
}
