//! Hosts that speak the RMD protocol V1.62.

mod motors;
mod scenarios;

/// How long a host waits for a reply unless it is said otherwise.
pub use motorlink_proto::rmd::DEFAULT_TIMEOUT as TIMEOUT;

pub use motors::{Scenario, ScriptedMotors};
pub use scenarios::scenarios;

/// What a digit of 0x92 is in what a host says: degrees.
pub const DIGIT: f64 = 0.01;
