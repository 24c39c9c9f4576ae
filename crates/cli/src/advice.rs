//! Advice after errors of the library: a command or an option to try.

use motorlink::port::PortError;
use motorlink::relay::RelayError;
use motorlink::st::{ErrorCode, Failure, Profile, Unverifiable};
use motorlink::{rmd, st};

/// After any error about a register's name.
pub const LIST_REGISTERS: &str = "`motorlink st registers` lists them";
const TRY_RATES: &str = "`motorlink st scan` tries the usual rates";

pub fn port(error: &PortError) -> Option<&'static str> {
    match error {
        PortError::NotFound { .. } | PortError::NoSuchInterface { .. } => {
            Some("`motorlink ports` lists what is there")
        }
        PortError::NotSerial { .. } => Some("`motorlink ports` lists those that are"),
        _ => None,
    }
}

pub fn relay(error: &RelayError) -> Option<&'static str> {
    match error {
        RelayError::Simulated(_) => Some("serve them with `motorlink sim` and guard that port"),
        _ => None,
    }
}

pub fn rmd(error: &rmd::Error) -> Option<&'static str> {
    match error {
        rmd::Error::Port(error) => port(error),
        rmd::Error::Timeout { .. } => Some("`motorlink rmd scan` lists the motors that answer"),
        rmd::Error::NotArrived { why, .. } => match why {
            rmd::NotArrived::Protection { .. } => {
                Some("remove the cause, then `motorlink rmd clear-errors`")
            }
            rmd::NotArrived::TimedOut { is_still: false, .. } => {
                Some("try a longer --wait-timeout")
            }
            rmd::NotArrived::TimedOut { .. } | rmd::NotArrived::Stalled { .. } => {
                Some("is the shaft blocked, or --wait-tolerance too small?")
            }
            _ => None,
        },
        _ => None,
    }
}

pub fn st(error: &st::Error) -> Option<&'static str> {
    match error {
        st::Error::Port(error) => port(error),
        st::Error::Unconfirmed { why: Some(why), .. } => st(why),
        st::Error::Failed { failure, .. } => match failure {
            Failure::Timeout | Failure::Header(_) | Failure::Damaged(_) => Some(TRY_RATES),
            Failure::Size { fits: Some(Profile::Mcsdk54), .. } => {
                Some("if the drive has MCSDK firmware, add --profile mcsdk-5.4")
            }
            Failure::Size { fits: Some(Profile::Spec), .. } => {
                Some("if the drive follows the document, add --profile spec")
            }
            _ => None,
        },
        st::Error::Refused { code: ErrorCode::BadMotorSelected, .. } => {
            Some("give another --motor")
        }
        st::Error::NotArrived { why, .. } => match why {
            st::NotArrived::Faults { .. } => {
                Some("remove the cause, then `motorlink st fault-ack`")
            }
            st::NotArrived::NotRunning { .. } => {
                Some("start the motor first: `motorlink st start`")
            }
            st::NotArrived::TimedOut { is_still: false, .. } => Some("try a longer --wait-timeout"),
            st::NotArrived::TimedOut { .. } | st::NotArrived::Stalled { .. } => {
                Some("is the shaft blocked, or --wait-tolerance too small?")
            }
            _ => None,
        },
        st::Error::Limit { exceeded: st::LimitError::NoRamp { .. }, .. } => {
            Some("give the ramp with the start: `motorlink st start --ramp RPM MS`")
        }
        st::Error::NotVerifiable { why: Unverifiable::NotReadable, .. } => {
            Some("`motorlink st registers` says what can")
        }
        _ => None,
    }
}
