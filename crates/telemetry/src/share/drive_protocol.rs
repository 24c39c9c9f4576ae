//! What the drives of a line speak.

use motorlink_proto::rmd::MotorId;
use motorlink_proto::st::{MotorNumber, Profile};

use super::message::{Line, Protocol};
use crate::signal::Motor;

/// What the drives of a line speak.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum DriveProtocol {
    /// ST's protocol, in this profile.
    St(Profile),
    /// The RMD protocol.
    Rmd,
}

impl DriveProtocol {
    /// What the drives of a line speak. `None`: in a profile that is not known here.
    pub fn of(line: &Line) -> Option<Self> {
        match line.protocol {
            Protocol::Rmd => Some(DriveProtocol::Rmd),
            Protocol::St => Some(DriveProtocol::St(line.profile.as_ref()?.parse().ok()?)),
        }
    }

    /// The protocol, without a profile.
    pub fn protocol(self) -> Protocol {
        match self {
            DriveProtocol::St(_) => Protocol::St,
            DriveProtocol::Rmd => Protocol::Rmd,
        }
    }

    /// The profile of ST drives.
    pub fn profile(self) -> Option<Profile> {
        match self {
            DriveProtocol::St(profile) => Some(profile),
            DriveProtocol::Rmd => None,
        }
    }

    /// The motor with this number or ID. `None`: no motor can have it.
    pub fn motor(self, number: u8) -> Option<Motor> {
        match self {
            DriveProtocol::St(_) => MotorNumber::new(number).map(Motor::St),
            DriveProtocol::Rmd => MotorId::new(number).map(Motor::Rmd),
        }
    }
}
