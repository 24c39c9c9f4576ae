//! Hosts that speak ST's Motor Control Protocol.

mod drive;
mod scenarios;

/// Default timeout of the host.
pub use motorlink_proto::st::TIMEOUT;

pub use drive::{Scenario, ScriptedDrive};
pub use scenarios::scenarios;

/// The unit of a host's output, in rpm per digit of the register.
pub const DIGIT: f64 = 1.0;
