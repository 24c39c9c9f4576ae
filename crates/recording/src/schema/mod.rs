//! What a recording contains: message types, their encoding, topics and names.
//!
//! The types are those of ROS 2 where it has one. [`SignalsType`] is made for each motor.

mod cdr;
mod frame;
mod loss;
mod message;
pub mod name;
mod signals;

pub use cdr::Malformed;
pub use frame::{Direction, Frame, FrameResult};
pub use loss::Loss;
pub use message::{
    DiagnosticArray, DiagnosticStatus, JointState, Level, Log, Message, Severity, Time,
};
pub use name::snake_case;
pub use signals::{PACKAGE, SignalField, SignalsRow, SignalsType};

/// The profile of the file: robotics tools know how to read the messages.
pub const PROFILE: &str = "ros2";
/// The encoding of type definitions.
pub const SCHEMA_ENCODING: &str = "ros2msg";
/// The encoding of messages.
pub const MESSAGE_ENCODING: &str = "cdr";
/// The media type of settings.
pub const SETTINGS_TYPE: &str = "application/toml";

/// Keys of the metadata of a recording, which is named [`recording::NAME`].
pub mod recording {
    /// The name of the metadata record.
    pub const NAME: &str = "motorlink";
    /// The version of the program that recorded.
    pub const VERSION: &str = "version";
    /// The version of what this page describes.
    pub const FORMAT: &str = "format";
    /// The value of [`FORMAT`].
    pub const FORMAT_1: &str = "1";
    /// When it began, in the form of RFC 3339.
    pub const BEGAN: &str = "began";
    /// The command that recorded.
    pub const COMMAND: &str = "command";
    /// The title of the scenario, if the drives were simulated on virtual time.
    pub const SCENARIO: &str = "scenario";
    /// Counted from 0: which file of a recording in several files this is.
    pub const PART: &str = "part";
}

/// The metadata record with the motors that had no values for a time. It is written at the end of a
/// recording, if there are some. The keys are motors such as `st0/motor1`.
pub mod gaps {
    use std::time::Duration;

    /// The name of the metadata record.
    pub const NAME: &str = "gaps";

    /// How long a motor had no values, in seconds.
    pub fn text(gap: Duration) -> String {
        format!("{:.3}", gap.as_secs_f64())
    }
}

/// Keys of the metadata of a motor, which is named [`drive::NAME`]. Channels of
/// frames have some of them, too.
pub mod drive {
    /// The name of the metadata record.
    pub const NAME: &str = "drive";
    /// The label of the port in topics.
    pub const LABEL: &str = "label";
    /// The name of the port.
    pub const PORT: &str = "port";
    /// [`ST`] or [`RMD`].
    pub const PROTOCOL: &str = "protocol";
    /// The protocol of serial drives.
    pub const ST: &str = "st";
    /// The protocol of motors on a CAN bus.
    pub const RMD: &str = "rmd";
    /// The profile of an ST drive.
    pub const PROFILE: &str = "profile";
    /// The number or ID of the motor.
    pub const MOTOR: &str = "motor";
    /// What is known of the drive; one line of [`IDENTITY`] and a number each.
    pub const IDENTITY: &str = "identity";
    /// Why the frames of the line are not recorded.
    pub const NO_FRAMES: &str = "no_frames";
    /// The name of the attachment with the settings.
    pub const SETTINGS: &str = "settings";
}
