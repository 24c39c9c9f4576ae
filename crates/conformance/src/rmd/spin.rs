//! Slow moves. They are monitored, and ended when they differ from the command.

use motorlink_proto::rmd::*;
use motorlink_proto::time::Micros;

use super::harness::Harness;
use super::settings::accelerate;
use crate::case::{ReadAs, Stop};
use crate::reading::R39;

/// Acceleration limit under which cases turn the motor, °/s².
pub(super) const GENTLE: i32 = 360;
/// Maximum speed of all moves of this kit, °/s.
const FAST: u16 = 500;
/// Interval between two samples of a move.
const EVERY: Micros = Micros::from_millis(10);

/// A sample of a move.
#[derive(Debug, Clone, Copy)]
pub(super) struct Seen {
    /// Torque current, digits.
    pub iq: i16,
    /// °/s.
    pub speed: i16,
    /// Multi-turn angle, 0.01°.
    pub angle: i64,
    /// Time since the start, ms. Never less than the real time.
    pub millis: u64,
}

impl Harness {
    /// Limits the acceleration, to protect the mechanics of the motor.
    pub(super) fn gently(&mut self) -> Result<(), Stop> {
        self.ready()?;
        accelerate(self, GENTLE)
    }

    /// Brings the motor into a state in which it accepts motion commands.
    pub(super) fn ready(&mut self) -> Result<(), Stop> {
        self.may_move();
        if self.needs_run {
            self.ask(Run.encode())?;
        }
        Ok(())
    }

    /// Sends a command that may turn the motor, and checks its reply.
    pub(super) fn command<C: Command<Reply = MotionStatus>>(
        &mut self,
        command: C,
    ) -> Result<MotionStatus, Stop> {
        self.may_move();
        let status = self.read(command)?;
        self.plausible(&status)?;
        Ok(status)
    }

    /// The multi-turn angle, 0.01°.
    pub(super) fn angle(&mut self) -> Result<i64, Stop> {
        Ok(self.read(ReadMultiTurnAngle)?.angle.0)
    }

    /// The multi-turn angle, if a position command with 32 bits can reach it.
    pub(super) fn angle_in_reach(&mut self) -> Result<i32, Stop> {
        const MARGIN: i32 = 100_000;
        let angle = i32::try_from(self.angle()?).unwrap_or(i32::MAX);
        if (-i32::MAX + MARGIN..i32::MAX - MARGIN).contains(&angle) {
            return Ok(angle);
        }
        Err(Stop::Skipped("the motor has turned beyond what a position command reaches".to_owned()))
    }

    /// Samples the motor until `done` or for `ms`. Returns whether `done` became true. A motor that
    /// exceeds the maximum speed of this kit is switched off, and the case ends: its acceleration
    /// is not limited (SPEC-NOTES R39).
    pub(super) fn watch(
        &mut self,
        ms: u64,
        mut done: impl FnMut(&Seen) -> bool,
    ) -> Result<bool, Stop> {
        let begun = self.millis();
        loop {
            self.go_on()?;
            let status = self.read(ReadMotionStatus)?;
            if status.speed.0.unsigned_abs() > FAST {
                let failed = self.failed(format!("no more than {FAST} °/s in any move"));
                self.ask(Off.encode())?;
                return Err(failed).read_as(R39);
            }
            let angle = self.angle()?;
            let millis = self.millis() - begun;
            let seen = Seen { iq: status.iq.0, speed: status.speed.0, angle, millis };
            if done(&seen) {
                return Ok(true);
            }
            if millis >= ms {
                return Ok(false);
            }
            self.pause(EVERY)?;
        }
    }

    /// Waits until the motor lost the speed that torque pulses gave it, and until its speed reading
    /// followed. Pulses have different lengths on a real line.
    pub(super) fn slows_down(&mut self) -> Result<(), Stop> {
        const FOLLOWS: Micros = Micros::from_millis(100);
        const PATIENCE_MS: u64 = 2_000;
        self.pause(FOLLOWS)?;
        let begun = self.millis();
        while self.read(ReadMotionStatus)?.speed.0.unsigned_abs() > FAST / 10
            && self.millis() - begun < PATIENCE_MS
        {
            self.pause(EVERY)?;
        }
        Ok(())
    }

    /// Samples until the motor is at a standstill.
    pub(super) fn comes_to_a_stand(&mut self, ms: u64) -> Result<bool, Stop> {
        self.watch(ms, |seen| seen.speed.abs() <= 5)
    }
}
