//! Hosts that speak ST's Motor Control Protocol.

mod drive;
mod scenarios;

/// How long a host waits for a reply unless it is said otherwise.
pub use motorlink_proto::st::TIMEOUT;

pub use drive::{Scenario, ScriptedDrive};
pub use scenarios::scenarios;

/// What a digit of the register is in what a host says: rpm.
pub const DIGIT: f64 = 1.0;
