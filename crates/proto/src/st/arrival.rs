//! Following the motor of an ST drive to its target. Values of registers and times are arguments.

use core::fmt;

use super::code::{Flags, Status};
use super::message::PositionMove;
use super::register::RegisterId;
use crate::arrival::{Arrival, Criteria, SAMPLE_TIME, Verdict};
use crate::time::{Instant, Micros};

/// Maximum distance from the target of a motor that has arrived, if no other is given: 0.01 rad
/// (0.57°), some counts of an encoder of 1000 counts a turn.
pub const ARRIVAL_TOLERANCE_RAD: f64 = 0.01;
/// The time for a move beside its duration, if no timeout is given.
pub const ARRIVAL_SPARE_TIME: Micros = Micros::from_millis(10_000);
/// Maximum change of the position of a motor that is still, rad.
const STILL_RAD: f64 = 0.002;

/// What to do next.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum ArrivalStep {
    /// Read this register. Then call [`replied`](ArrivalWatch::replied) or
    /// [`lost`](ArrivalWatch::lost).
    Read(RegisterId),
    /// Confirm that the replies went to their own requests. Then call
    /// [`confirmed`](ArrivalWatch::confirmed) or [`lost`](ArrivalWatch::lost).
    Confirm,
    /// Wait until this time.
    Wait(Instant),
    /// The move is over: the position, rad.
    Done(Result<f32, NotArrived>),
}

/// Why a motor did not arrive. Distances are in rad, and not a number if the position is not known.
#[derive(Debug, Clone, Copy, PartialEq)]
#[non_exhaustive]
pub enum NotArrived {
    /// The time is over.
    TimedOut {
        /// Distance to the target.
        remaining: f64,
        /// Whether the motor does not move.
        is_still: bool,
    },
    /// The motor stopped before its target.
    Stalled {
        /// Distance to the target.
        remaining: f64,
    },
    /// The drive has faults.
    Faults {
        /// The faults.
        flags: Flags,
        /// Distance to the target.
        remaining: f64,
    },
    /// The motor is not in RUN, nor about to be.
    NotRunning {
        /// The state.
        status: Status,
        /// Distance to the target.
        remaining: f64,
    },
    /// The drive does not answer.
    Silent {
        /// Distance to the target when the drive answered last.
        remaining: f64,
    },
}

/// Reads registers of a motor that was commanded to turn to a position, until it has arrived.
///
/// Begin after the acknowledge of the command. A motor has arrived if it is within the tolerance of its
/// target and still for [`SETTLE_TIME`](crate::arrival::SETTLE_TIME). It cannot have arrived before the
/// duration of the move is over.
#[derive(Debug, Clone, PartialEq)]
pub struct ArrivalWatch {
    target: PositionMove,
    tolerance: f64,
    timeout: Micros,
    /// From RUN on.
    arrival: Option<Arrival>,
    /// Judges silence until RUN.
    waiting: Arrival,
    until: Instant,
    stage: Stage,
    position: f32,
}

#[derive(Debug, Clone, Copy, PartialEq)]
enum Stage {
    Status,
    Flags,
    Position,
    Confirm,
    Wait(Instant),
    Done(Result<(), NotArrived>),
}

impl ArrivalWatch {
    /// Begins at `now`. Without `timeout` it is the duration of the move and [`ARRIVAL_SPARE_TIME`].
    pub fn new(
        now: Instant,
        target: PositionMove,
        tolerance_rad: f64,
        timeout: Option<Micros>,
    ) -> Self {
        let duration = seconds(target.duration_s);
        let timeout = timeout.unwrap_or(duration + ARRIVAL_SPARE_TIME);
        let until = now + timeout;
        let criteria =
            Criteria { tolerance: tolerance_rad, still: STILL_RAD, not_before: until, until };
        ArrivalWatch {
            target,
            tolerance: tolerance_rad,
            timeout,
            arrival: None,
            waiting: Arrival::new(now, criteria),
            until,
            stage: Stage::Status,
            position: f32::NAN,
        }
    }

    /// Whether a motor in this state carries a move out, now or when it reaches RUN.
    pub fn can_move(status: Status) -> bool {
        use Status::*;
        !matches!(
            status,
            Idle | AnyStop | Stop | StopIdle | FaultNow | FaultOver | WaitStopMotor | IclWait
        )
    }

    /// What to do next.
    pub fn next(&mut self, now: Instant) -> ArrivalStep {
        match self.stage {
            Stage::Wait(until) if now < until => ArrivalStep::Wait(until),
            Stage::Status | Stage::Wait(_) => {
                self.stage = Stage::Status;
                ArrivalStep::Read(RegisterId::STATUS)
            }
            Stage::Flags => ArrivalStep::Read(RegisterId::FLAGS),
            Stage::Position => ArrivalStep::Read(RegisterId::CURRENT_POSITION),
            Stage::Confirm => ArrivalStep::Confirm,
            Stage::Done(result) => ArrivalStep::Done(result.map(|()| self.position)),
        }
    }

    /// Takes the value of the register that was read.
    pub fn replied(&mut self, now: Instant, bits: i32) {
        let remaining = self.remaining_rad();
        match self.stage {
            Stage::Status => {
                let status = Status::from(bits as u8);
                self.stage = match status {
                    Status::FaultNow | Status::FaultOver => Stage::Flags,
                    Status::Run => Stage::Position,
                    status if !Self::can_move(status) => {
                        Stage::Done(Err(NotArrived::NotRunning { status, remaining }))
                    }
                    _ => {
                        let verdict = self.waiting.sample(now, f64::NAN, false);
                        self.after(now, verdict)
                    }
                };
            }
            Stage::Flags => {
                let flags = Flags(bits as u32);
                self.stage = Stage::Done(Err(NotArrived::Faults { flags, remaining }));
            }
            Stage::Position => {
                self.position = f32::from_bits(bits as u32);
                let remaining = self.remaining_rad();
                let verdict = self.running(now).sample(now, remaining, true);
                self.stage = self.after(now, verdict);
            }
            Stage::Confirm | Stage::Wait(_) | Stage::Done(_) => {}
        }
    }

    /// Takes note that the replies went to their own requests.
    pub fn confirmed(&mut self) {
        if self.stage == Stage::Confirm {
            self.stage = Stage::Done(Ok(()));
        }
    }

    /// Records a lost or untrusted reply. If it was to confirm the replies before, none of them
    /// counts.
    pub fn lost(&mut self, now: Instant) {
        let arrival = self.arrival.as_mut().unwrap_or(&mut self.waiting);
        if self.stage == Stage::Confirm {
            arrival.restart();
        }
        let verdict = arrival.lost(now);
        self.stage = self.after(now, verdict);
    }

    /// Distance to the target at the last sample, rad, with sign; not a number before the first one.
    pub fn remaining_rad(&self) -> f64 {
        f64::from(self.target.angle_rad) - f64::from(self.position)
    }

    fn after(&self, now: Instant, verdict: Verdict) -> Stage {
        let remaining = self.remaining_rad();
        Stage::Done(Err(match verdict {
            Verdict::Moving => return Stage::Wait(now + SAMPLE_TIME),
            Verdict::Arrived => return Stage::Confirm,
            Verdict::Stalled => NotArrived::Stalled { remaining },
            Verdict::TimedOut { is_still } => NotArrived::TimedOut { remaining, is_still },
            Verdict::Silent => NotArrived::Silent { remaining },
        }))
    }

    /// The move begins when the motor is in RUN.
    fn running(&mut self, now: Instant) -> &mut Arrival {
        let criteria = Criteria {
            tolerance: self.tolerance,
            still: STILL_RAD,
            not_before: now + seconds(self.target.duration_s),
            until: self.until.max(now + self.timeout),
        };
        self.arrival.get_or_insert_with(|| Arrival::new(now, criteria))
    }
}

fn seconds(span: f32) -> Micros {
    Micros((f64::from(span) * 1e6) as u64)
}

impl fmt::Display for NotArrived {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let (NotArrived::TimedOut { remaining, .. }
        | NotArrived::Stalled { remaining }
        | NotArrived::Faults { remaining, .. }
        | NotArrived::NotRunning { remaining, .. }
        | NotArrived::Silent { remaining }) = self;
        match self {
            NotArrived::TimedOut { is_still: true, .. } => {
                f.write_str("the time is over and the motor is still")?
            }
            NotArrived::TimedOut { .. } => {
                f.write_str("the time is over and the motor is moving")?
            }
            NotArrived::Stalled { .. } => f.write_str("the motor stopped before its target")?,
            NotArrived::Faults { flags, .. } => {
                f.write_str("the drive has faults: ")?;
                let names = Flags::names(flags.occurred() | flags.present());
                for (index, name) in names.enumerate() {
                    write!(f, "{}{name}", if index == 0 { "" } else { ", " })?;
                }
            }
            NotArrived::NotRunning { status, .. } => {
                write!(f, "the motor is in {status}, not in RUN")?
            }
            NotArrived::Silent { .. } => f.write_str("the drive does not answer")?,
        }
        match remaining.is_nan() {
            true => Ok(()),
            false => write!(f, ", {:.4} rad from its target", remaining.abs()),
        }
    }
}

impl core::error::Error for NotArrived {}
