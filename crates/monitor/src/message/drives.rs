//! What a page learns of drives.

use motorlink_telemetry::share::message::Protocol;
use serde::{Deserialize, Serialize};

pub use motorlink_telemetry::overview::Overview;
pub use motorlink_telemetry::share::drive_values::{Register, Value};

/// What the drives of a line have.
#[derive(Debug, Clone, PartialEq, Serialize)]
#[cfg_attr(feature = "typescript", derive(ts_rs::TS))]
pub struct Description {
    /// The line.
    pub line: String,
    /// What they speak.
    pub protocol: Protocol,
    /// The signals of the overview of a motor.
    pub overview: Overview,
    /// The registers, in the order of the table.
    pub registers: Vec<Register>,
    /// The commands.
    pub commands: Vec<Command>,
    /// What can be controlled.
    pub modes: Vec<Controlled>,
    /// The meaning of the signal `overview.state`.
    pub states: Vec<State>,
    /// The bits of the signal `overview.faults`.
    pub faults: Vec<Fault>,
}

/// A command of the protocol.
#[derive(Debug, Clone, PartialEq, Serialize)]
#[cfg_attr(feature = "typescript", derive(ts_rs::TS))]
pub struct Command {
    /// Its name in the table.
    pub name: String,
    /// What it does.
    pub doc: String,
    /// Its values.
    pub fields: Vec<Field>,
    /// Whether it may move the motor.
    pub moves: bool,
    /// Whether it wears the ROM of the motor.
    pub wears_rom: bool,
}

/// A value of a command.
#[derive(Debug, Clone, PartialEq, Serialize)]
#[cfg_attr(feature = "typescript", derive(ts_rs::TS))]
pub struct Field {
    /// Its name.
    pub name: String,
    /// Its meaning.
    pub doc: String,
    /// The symbol of the unit; empty without one.
    pub unit: String,
    /// The least and the most value, and the step between values; a step of 0 is any.
    pub range: [f64; 3],
    /// The names of the values 0, 1 and so on; empty for a number.
    pub words: Vec<String>,
}

/// What can be controlled of a motor.
#[derive(Debug, Clone, PartialEq, Serialize)]
#[cfg_attr(feature = "typescript", derive(ts_rs::TS))]
pub struct Controlled {
    /// What.
    pub mode: Mode,
    /// The symbol of the unit.
    pub unit: String,
    /// The signal that measures it.
    pub measured: String,
    /// What the protocol can carry, forwards and backwards.
    pub most: f64,
}

/// A state of an ST motor.
#[derive(Debug, Clone, PartialEq, Serialize)]
#[cfg_attr(feature = "typescript", derive(ts_rs::TS))]
pub struct State {
    /// The value of the signal.
    pub value: u32,
    /// Its name.
    pub name: String,
    /// Its meaning.
    pub doc: String,
}

/// A bit of the faults.
#[derive(Debug, Clone, PartialEq, Serialize)]
#[cfg_attr(feature = "typescript", derive(ts_rs::TS))]
pub struct Fault {
    /// The bit of the signal, from 0.
    pub bit: u32,
    /// Its name.
    pub name: String,
    /// Its meaning.
    pub doc: String,
    /// What to do.
    pub advice: String,
    /// Whether the cause is present. Otherwise it has occurred and is not acknowledged.
    pub present: bool,
}

/// A setting that differs between a motor and a file.
#[derive(Debug, Clone, PartialEq, Serialize)]
#[cfg_attr(feature = "typescript", derive(ts_rs::TS))]
pub struct Difference {
    /// Its name.
    pub name: String,
    /// The symbol of the unit; empty without one.
    pub unit: String,
    /// That of the motor.
    pub now: String,
    /// That of the file.
    pub file: String,
    /// Whether writing it wears the ROM of the motor.
    pub wears_rom: bool,
    /// Why it cannot be written; `null`: it can.
    pub fixed: Option<String>,
}

/// What is controlled.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
#[cfg_attr(feature = "typescript", derive(ts_rs::TS))]
pub enum Mode {
    /// The speed: rpm of an ST motor, °/s of an RMD motor.
    Speed,
    /// The current that makes torque: digits of an ST motor, A of an RMD motor.
    Torque,
    /// The angle of an RMD motor, in degrees from its zero.
    Position,
}
