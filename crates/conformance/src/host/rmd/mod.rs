//! Hosts that speak the RMD protocol V1.62.

mod motors;
mod scenarios;

/// Default timeout of the host.
pub use motorlink_proto::rmd::DEFAULT_TIMEOUT as TIMEOUT;

pub use motors::{Scenario, ScriptedMotors};
pub use scenarios::scenarios;

/// The unit of a host's output, in degrees per digit of 0x92.
pub const DIGIT: f64 = 0.01;
