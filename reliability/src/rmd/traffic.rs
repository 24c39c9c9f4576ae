//! The requests of a program to motors.

use motorlink_link::fault::Rng;
use motorlink_proto::rmd::*;
use motorlink_proto::units::{CentiDegrees, CentiDps, DpsPerSecond, IqCommand, SpeedLimit};

use super::motor::MOTORS;

/// The next request of the mix: two thirds read, the others move, set and stop.
pub fn next(rng: &mut Rng) -> [u8; 8] {
    let torque = IqCommand(rng.i16(-2_000..=2_000));
    let speed = CentiDps(rng.i32(-100_000..=100_000));
    let angle = CentiDegrees(rng.i32(-360_000..=360_000));
    let max_speed = SpeedLimit(rng.u16(..));
    match rng.u8(..100) {
        0..30 => ReadMotionStatus.encode(),
        30..40 => ReadStatus.encode(),
        40..45 => ReadPhaseCurrents.encode(),
        45..52 => ReadMultiTurnAngle.encode(),
        52..57 => ReadSingleTurnAngle.encode(),
        57..61 => ReadEncoder.encode(),
        61..64 => ReadPid.encode(),
        64..66 => ReadAcceleration.encode(),
        66..72 => SetTorque { iq: torque }.encode(),
        72..78 => SetSpeed { speed }.encode(),
        78..81 => SetPosition { angle }.encode(),
        81..84 => SetPositionLimited { max_speed, angle }.encode(),
        84..87 => Off.encode(),
        87..90 => Stop.encode(),
        90..93 => Run.encode(),
        93..95 => ClearErrors.encode(),
        95..97 => {
            let acceleration = DpsPerSecond(rng.i32(0..60_000));
            WriteAccelerationRam(Acceleration { acceleration }).encode()
        }
        97..99 => gains(rng, Code::WritePidRam),
        _ => gains(rng, Code::WritePidRom),
    }
}

fn gains(rng: &mut Rng, code: Code) -> [u8; 8] {
    let mut data = rng.u64(..).to_le_bytes();
    data[0] = code.into();
    data[1] = 0;
    data
}

pub fn torques(rng: &mut Rng) -> SetTorque4 {
    SetTorque4(std::array::from_fn(|_| IqCommand(rng.i16(-2_000..=2_000))))
}

/// One of the four motors.
pub fn motor(rng: &mut Rng) -> MotorId {
    MotorId::new(rng.u8(1..=MOTORS as u8)).expect("1 to 4")
}
