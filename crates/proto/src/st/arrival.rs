//! Following the motor of an ST drive to its target. Values of registers and times are arguments.

use core::fmt;

use super::code::{Flags, Status};
use super::message::PositionMove;
use super::register::RegisterId;
use crate::arrival::{self, Arrival, Criteria, Reason, Sampler, Verdict, Watch};
use crate::time::{Instant, Micros};

/// Maximum distance from the target of a motor that has arrived, if no other is given: 0.01 rad
/// (0.57°), some counts of an encoder of 1000 counts a turn.
pub const ARRIVAL_TOLERANCE_RAD: f64 = 0.01;
/// The time for a move beside its duration, if no timeout is given.
pub const ARRIVAL_SPARE_TIME: Micros = Micros::from_millis(10_000);
/// Maximum change of the position of a motor that is still, rad.
const STILL_RAD: f64 = 0.002;

/// Reads registers until a motor has arrived. The result is the position, rad. The motor has to be in
/// RUN or about to be. It cannot have arrived before the duration of the move is over.
pub type ArrivalWatch = Watch<ArrivalSampler>;
/// Why a motor did not arrive. Distances are in rad.
pub type NotArrived = arrival::NotArrived<AbortReason>;

/// Why a drive does not carry out a move.
#[derive(Debug, Clone, Copy, PartialEq)]
#[non_exhaustive]
pub enum AbortReason {
    /// The drive has faults.
    Faults(Flags),
    /// The motor is not in RUN, nor about to be.
    NotRunning(Status),
}

/// The requests and criteria of a move.
#[derive(Debug, Clone, PartialEq)]
pub struct ArrivalSampler {
    target: PositionMove,
    tolerance_rad: f64,
    timeout: Micros,
    /// When the wait ends. `None` before the command.
    until: Option<Instant>,
    /// Whether the motor was in RUN after the command: the move begins then.
    is_running: bool,
    register: RegisterId,
    status: Status,
    flags: Flags,
    position: f32,
}

impl ArrivalWatch {
    /// For a command that is not sent yet. Without `timeout` it is the duration of the move and
    /// [`ARRIVAL_SPARE_TIME`]. It begins with the command.
    pub fn new(target: PositionMove, tolerance_rad: f64, timeout: Option<Micros>) -> Self {
        let timeout = timeout.unwrap_or(seconds(target.duration_s) + ARRIVAL_SPARE_TIME);
        Watch::over(ArrivalSampler::new(target, tolerance_rad, timeout))
    }
}

impl ArrivalSampler {
    fn new(target: PositionMove, tolerance_rad: f64, timeout: Micros) -> Self {
        ArrivalSampler {
            target,
            tolerance_rad,
            timeout,
            until: None,
            is_running: false,
            register: RegisterId::STATUS,
            status: Status::Idle,
            flags: Flags::default(),
            position: f32::NAN,
        }
    }
}

impl Sampler for ArrivalSampler {
    type Request = RegisterId;
    type Reply = i32;
    type Arrived = f32;
    type Reason = AbortReason;
    const CONFIRMS_SAMPLES: bool = false;

    fn begin(&mut self, _now: Instant) {
        self.register = RegisterId::STATUS;
    }

    fn request(&self) -> RegisterId {
        self.register
    }

    fn replied(&mut self, _now: Instant, bits: &i32) -> bool {
        match self.register {
            RegisterId::STATUS => {
                self.status = Status::from(*bits as u8);
                self.register = match self.status {
                    Status::FaultNow | Status::FaultOver => RegisterId::FLAGS,
                    Status::Run if self.until.is_some() => RegisterId::CURRENT_POSITION,
                    _ => return true,
                };
                return false;
            }
            RegisterId::FLAGS => self.flags = Flags(*bits as u32),
            _ => self.position = f32::from_bits(*bits as u32),
        }
        true
    }

    fn prepare(&mut self) -> Result<(), AbortReason> {
        match self.status {
            Status::FaultNow | Status::FaultOver => Err(AbortReason::Faults(self.flags)),
            status if !can_move(status) => Err(AbortReason::NotRunning(status)),
            _ => Ok(()),
        }
    }

    fn commanded(&mut self, now: Instant) -> Arrival {
        let until = now + self.timeout;
        self.until = Some(until);
        self.arrival(now, until, until)
    }

    fn judge(&mut self, now: Instant, arrival: &mut Arrival) -> Result<Verdict, AbortReason> {
        self.prepare()?;
        if self.status != Status::Run {
            return Ok(arrival.sample(now, f64::NAN, false));
        }
        if !core::mem::replace(&mut self.is_running, true) {
            let until = now + self.timeout;
            let not_before = now + seconds(self.target.duration_s);
            *arrival = self.arrival(now, not_before, self.until.unwrap_or(until).max(until));
        }
        Ok(arrival.sample(now, self.remaining(), true))
    }

    fn remaining(&self) -> f64 {
        f64::from(self.target.angle_rad) - f64::from(self.position)
    }

    fn arrived(&self) -> f32 {
        self.position
    }
}

impl ArrivalSampler {
    fn arrival(&self, now: Instant, not_before: Instant, until: Instant) -> Arrival {
        let tolerance = self.tolerance_rad;
        Arrival::new(now, Criteria { tolerance, still: STILL_RAD, not_before, until })
    }
}

/// Whether a motor in this state carries out a move, now or when it reaches RUN.
fn can_move(status: Status) -> bool {
    use Status::*;
    !matches!(
        status,
        Idle | AnyStop | Stop | StopIdle | FaultNow | FaultOver | WaitStopMotor | IclWait
    )
}

fn seconds(span: f32) -> Micros {
    Micros((f64::from(span) * 1e6) as u64)
}

impl Reason for AbortReason {
    const UNIT: &'static str = " rad";
    const DECIMALS: usize = 4;

    fn state(&self) -> &'static str {
        "the drive carries out no move in this state"
    }
}

impl fmt::Display for AbortReason {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            AbortReason::Faults(flags) => {
                f.write_str("the drive has faults: ")?;
                let names = Flags::names(flags.occurred() | flags.present());
                for (index, name) in names.enumerate() {
                    write!(f, "{}{name}", if index == 0 { "" } else { ", " })?;
                }
                Ok(())
            }
            AbortReason::NotRunning(status) => {
                write!(f, "the motor is in {status}, not in RUN")
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_drive_with_faults_is_asked_for_them() {
        let target = PositionMove { angle_rad: 1.0, duration_s: 1.0 };
        let mut sampler = ArrivalSampler::new(target, ARRIVAL_TOLERANCE_RAD, ARRIVAL_SPARE_TIME);
        sampler.begin(Instant(0));
        assert_eq!(sampler.request(), RegisterId::STATUS);
        assert!(!sampler.replied(Instant(0), &i32::from(u8::from(Status::FaultNow))));
        assert_eq!(sampler.request(), RegisterId::FLAGS);
        assert!(sampler.replied(Instant(0), &0x40));
        assert_eq!(sampler.prepare(), Err(AbortReason::Faults(Flags(0x40))));
    }
}
