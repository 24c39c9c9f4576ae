//! Finds the motors and the features of a drive during the test.

use std::ops::RangeInclusive;

use motorlink_proto::st::register::{Feature, Features};
use motorlink_proto::st::{
    ErrorCode, Frame, FrameCode, HEADER_ACK, MotorNumber, Profile, RegisterId,
};

use super::harness::{Harness, frame};
use crate::case::Stop;

/// Maximum speed for a drive without MAX_APP_SPEED, rpm.
const MODERATE: i32 = 2_000;

impl Harness {
    /// The number of motors: the last number before the first refused one.
    pub(super) fn motors(&mut self) -> Result<u8, Stop> {
        if let Some(motors) = self.found.motors {
            return Ok(motors);
        }
        let mut motors = 0;
        for number in 1..=MotorNumber::MAX {
            let header = Frame::header(FrameCode::GetReg.number(), number);
            let reply = self.exchange(&frame(header, &[RegisterId::STATUS.0]))?;
            if reply.is_nack(ErrorCode::BadMotorSelected) {
                break;
            }
            motors = number;
        }
        self.found.motors = Some(motors);
        Ok(motors)
    }

    /// A motor number that the drive must refuse. Skips the case if the drive has seven motors.
    pub(super) fn missing_motor(&mut self) -> Result<u8, Stop> {
        match self.motors()? {
            MotorNumber::MAX => Err(Stop::Skipped("the drive has seven motors".to_owned())),
            motors => Ok(motors + 1),
        }
    }

    /// A motor other than the one under test.
    pub(super) fn other_motor(&mut self) -> Result<u8, Stop> {
        let tested = self.options.motor.number();
        match self.motors()? {
            1 => Err(Stop::Skipped("the drive has one motor".to_owned())),
            _ => Ok(if tested == 1 { 2 } else { 1 }),
        }
    }

    /// Whether the drive is built with a feature: whether one of its registers can be read. A
    /// feature without a readable register counts as missing.
    pub(super) fn has(&mut self, feature: Feature) -> Result<bool, Stop> {
        if let Some((_, there)) = self.found.features.iter().find(|(known, _)| *known == feature) {
            return Ok(*there);
        }
        let mut there = feature == Feature::Core;
        let profile = self.profile();
        let of = |id: RegisterId| id.shape().is_some_and(|shape| shape.feature == feature);
        for register in RegisterId::all().filter(|&id| of(id) && read_size(id, profile).is_some()) {
            if there {
                break;
            }
            let request = self.frame(FrameCode::GetReg.number(), &[register.0]);
            there = self.exchange(&request)?.header == HEADER_ACK;
        }
        self.found.features.push((feature, there));
        Ok(there)
    }

    /// Possible speeds of the motor, rpm, without sign: the range of the application, or moderate
    /// speeds.
    pub(super) fn speeds(&mut self) -> Result<RangeInclusive<i32>, Stop> {
        if let Some(speeds) = &self.found.speeds {
            return Ok(speeds.clone());
        }
        let mut bounds = [0, MODERATE];
        for (bound, register) in
            bounds.iter_mut().zip([RegisterId::MIN_APP_SPEED, RegisterId::MAX_APP_SPEED])
        {
            let request = self.frame(FrameCode::GetReg.number(), &[register.0]);
            let reply = self.exchange(&request)?;
            let value = register
                .decode(self.profile(), &reply.payload)
                .filter(|_| reply.header == HEADER_ACK);
            *bound = value.unwrap_or(*bound);
        }
        let speeds = bounds[0]..=bounds[1];
        self.found.speeds = Some(speeds.clone());
        Ok(speeds)
    }

    /// Skips the case unless the drive has a feature.
    pub(super) fn need(&mut self, feature: Feature) -> Result<(), Stop> {
        match self.has(feature)? {
            true => Ok(()),
            false => Err(Stop::Skipped(format!("not built in: {}", feature.name()))),
        }
    }

    /// Skips the case if the drive has a feature.
    pub(super) fn need_no(&mut self, feature: Feature) -> Result<(), Stop> {
        match self.has(feature)? {
            true => Err(Stop::Skipped(format!("built in: {}", feature.name()))),
            false => Ok(()),
        }
    }

    /// Whether a drive with the register's feature allows reads of the register.
    pub(super) fn readable(&self, register: RegisterId) -> bool {
        read_size(register, self.profile()).is_some()
    }
}

/// The size of a register in a reply of a drive with its feature; `None` if it refuses.
pub(super) fn read_size(register: RegisterId, profile: Profile) -> Option<u8> {
    let shape = register.shape()?;
    shape.read_size(profile, Features::NONE.with(shape.feature))
}
