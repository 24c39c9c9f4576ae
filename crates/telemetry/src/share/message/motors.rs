//! Motors and signals of a share.

use serde::{Deserialize, Serialize};

use super::json::is_false;
use crate::signal::Signal;

/// In the answer to a stop: any motor of a line on which nothing has answered since it was opened.
pub const ANY_MOTOR: u8 = 0;

/// A motor of a share.
#[derive(Debug, Clone, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[cfg_attr(feature = "typescript", derive(ts_rs::TS))]
pub struct MotorName {
    /// The line.
    pub line: String,
    /// The motor's number or ID.
    pub motor: u8,
}

/// A signal of a share.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "typescript", derive(ts_rs::TS))]
pub struct SignalName {
    /// The line.
    pub line: String,
    /// The motor's number or ID.
    pub motor: u8,
    /// The name of the register or the quantity.
    pub name: String,
}

impl SignalName {
    /// The signal of a line with this name.
    pub fn of(line: &str, Signal { motor, source }: Signal) -> Self {
        SignalName { line: line.to_owned(), motor: motor.number(), name: source.to_string() }
    }
}

/// What becomes of the motors of a program that leaves.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
#[cfg_attr(feature = "typescript", derive(ts_rs::TS), ts(rename = "MotionEnding"))]
pub enum Ending {
    /// They are stopped.
    #[default]
    Stop,
    /// RMD motors are switched off, ST motors stopped.
    Off,
    /// They are left as they are, and belong to no program.
    Nothing,
}

/// What a full queue loses.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
#[cfg_attr(feature = "typescript", derive(ts_rs::TS))]
pub enum DropRule {
    /// The oldest: for what shows the present.
    Oldest,
    /// The newest: for what keeps everything up to then.
    Newest,
}

/// A signal with its unit.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "typescript", derive(ts_rs::TS))]
pub struct Column {
    /// The name of the register or the quantity.
    pub name: String,
    /// The symbol of the unit; empty without one.
    pub unit: String,
}

/// How a motor took a stop.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "typescript", derive(ts_rs::TS))]
pub struct StoppedMotor {
    /// The motor.
    #[serde(flatten)]
    pub motor: MotorName,
    /// Why the stop was not confirmed; without it the drive confirmed it. The motor may still be turning,
    /// unless `absent`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub failure: Option<String>,
    /// No motor was found there: the drive says that it has none, or nothing has ever answered and no
    /// program commanded it to move.
    #[serde(default, skip_serializing_if = "is_false")]
    pub absent: bool,
}

/// How often a signal is read.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "typescript", derive(ts_rs::TS))]
pub struct SignalRate {
    /// The signal.
    #[serde(flatten)]
    pub signal: SignalName,
    /// The shortest period that a program asked for, in seconds.
    pub asked: f64,
    /// The period that the line carries, in seconds.
    pub predicted: f64,
    /// Values in the last second.
    pub achieved: f64,
}

/// Signals that are read in one exchange.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "typescript", derive(ts_rs::TS))]
pub struct Group {
    /// Its number, which is never used again.
    pub group: u32,
    /// Whose it is.
    pub subscription: u32,
    /// The line.
    pub line: String,
    /// The motor.
    pub motor: u8,
    /// The signals, in the order of the columns after `t` and `span`.
    pub columns: Vec<Column>,
}
