//! Advice after errors of the library: a command or an option to try.

use motorlink::arrival::NotArrived;
use motorlink::port::{NameError, NotDone, PortError};
use motorlink::relay::RelayError;
use motorlink::st::{ErrorCode, Failure, Profile, Unverifiable};
use motorlink::{rmd, st};

use crate::help::WHOLE_PROGRAM;

/// After any error about a register's name.
pub const LIST_REGISTERS: &str = "`motorlink st registers` lists them";
/// After a stop that failed.
pub const STOP_AGAIN: &str = "repeat the stop; end other programs that use the port; if the motor \
                              still turns, use the emergency stop";
/// After a stop that a node did not answer, or did not confirm.
#[cfg(feature = "fleet")]
pub const STOP_NODES_AGAIN: &str =
    "repeat the stop; if a motor still turns, use the emergency stop";
/// After a raw STOP_MOTOR that failed.
pub const STOP_PADS: &str = "`motorlink st stop` repeats the stop and completes a cut-off frame";
/// After a motion command to an RMD motor that has an error.
pub const CLEAR_AND_REPEAT: &str =
    "remove the cause, then `motorlink rmd clear-errors`, and repeat the command";
const UNIX: &str = "unix:";
/// After a Unix socket where nothing answers like a drive.
const SHARE_SOCKET: &str =
    "if it is the socket of a share, write -p share:PATH/st0, or /rmd0 for RMD motors";
const TRY_RATES: &str = "`motorlink st scan` tries the usual rates";
const ACKNOWLEDGE: &str = "remove the cause, then `motorlink st fault-ack`";

pub fn port(error: &PortError) -> Option<&'static str> {
    match error {
        PortError::NotFound(..) | PortError::NoSuchInterface(..) => {
            Some("`motorlink ports` lists what is there")
        }
        PortError::NoHolder { port, .. } if is_of_node(port) => {
            Some("is `motorlink node` running there? `?via=` or MOTORLINK_NETWORK says where it is")
        }
        PortError::NoHolder { .. } => {
            Some("start it with `motorlink share`, and stop motors that still turn")
        }
        PortError::NotDone { kind: NotDone::Latched, port, .. } if is_of_node(port) => {
            Some("`motorlink fleet release --node NAME` releases the latch of this node")
        }
        PortError::NotDone { kind: NotDone::Latched, .. } => {
            Some("`motorlink share release --at unix:PATH` releases the latch of this share")
        }
        PortError::NotDone { kind: NotDone::Held, .. } => {
            Some("wait until it is free, or take it: add `?take` to the port")
        }
        PortError::Closed(port) if port.contains(UNIX) => Some(SHARE_SOCKET),
        PortError::NotSerial(..) => Some("`motorlink ports` lists those that are"),
        _ => None,
    }
}

/// Whether a port is a line of a node.
fn is_of_node(port: &str) -> bool {
    port.starts_with("zenoh:")
}

/// What to write instead of a port of the other kind, or besides the port.
pub fn port_kind(error: &PortError) -> Option<String> {
    if let PortError::HeldInProfile { profile, .. } = error {
        return Some(format!("add --profile {profile}"));
    }
    let PortError::WrongKind { port, wanted, .. } = error else { return None };
    if *wanted == "CAN bus" {
        let line = port.strip_prefix("serial:").unwrap_or(port);
        return Some(format!("for a CAN adapter on this line write -p slcan:{line}"));
    }
    Some(match port.strip_prefix("slcan:") {
        Some(line) => format!("for an ST drive on this line write -p {line}"),
        None => "for RMD motors on a CAN bus use `motorlink rmd`".to_owned(),
    })
}

/// A name that is not the name of a port.
pub fn port_name(error: &NameError) -> Option<String> {
    match error {
        NameError::UnknownForm { name, .. } if is_of_node(name) && !cfg!(feature = "fleet") => {
            Some(format!("this program was built without ports of nodes: {WHOLE_PROGRAM}"))
        }
        NameError::UnknownForm { .. } | NameError::Windows { .. } => {
            Some("`motorlink ports` lists what is connected".to_owned())
        }
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
        rmd::Error::Limit { exceeded: rmd::Exceeded::NoSpeed { .. }, .. } => {
            Some("add --max-speed to `position` or `single-turn-position`")
        }
        rmd::Error::NotArrived { why, .. } => not_arrived(why, |reason| match reason {
            rmd::AbortReason::Protection(_) => {
                Some("remove the cause, then `motorlink rmd clear-errors`")
            }
            rmd::AbortReason::LostTurns { .. } => {
                Some("check the supply, then read the angle with `motorlink rmd angle`")
            }
            _ => None,
        }),
        _ => None,
    }
}

pub fn st(error: &st::Error) -> Option<&'static str> {
    match error {
        st::Error::Port(error) => port(error),
        st::Error::Unconfirmed { why: Some(why), .. } => st(why),
        st::Error::Failed { port, failure: Failure::Timeout, .. } if port.contains(UNIX) => {
            Some(SHARE_SOCKET)
        }
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
        st::Error::Implausible { why, .. } => Some(match why.fits.profile {
            Profile::Mcsdk54 => {
                "if the drive has MCSDK firmware, add --profile mcsdk-5.4; --raw prints the digits"
            }
            Profile::Spec => {
                "if the drive follows the document, add --profile spec; --raw prints the digits"
            }
        }),
        st::Error::Refused { code: ErrorCode::BadMotorSelected, .. } => {
            Some("give another --motor")
        }
        st::Error::Refused { code: ErrorCode::BadFrameId, .. } => Some(
            "the drive is built without this function, or it speaks the other profile: try --profile \
             spec or --profile mcsdk-5.4",
        ),
        st::Error::NotArrived { why, .. } => not_arrived(why, |reason| match reason {
            st::AbortReason::Faults(_) => Some(ACKNOWLEDGE),
            st::AbortReason::NotRunning(_) => Some("start the motor first: `motorlink st start`"),
            _ => None,
        }),
        st::Error::NotStarted { why: st::NotStarted::Faults { .. }, .. } => Some(ACKNOWLEDGE),
        st::Error::Limit { exceeded: st::LimitError::NoRamp { .. }, .. } => {
            Some("give the ramp with the start: `motorlink st start --ramp RPM MS`")
        }
        st::Error::NotVerifiable { why: Unverifiable::NotReadable, .. } => {
            Some("`motorlink st registers` says what can")
        }
        _ => None,
    }
}

fn not_arrived<R>(
    why: &NotArrived<R>,
    after: impl FnOnce(&R) -> Option<&'static str>,
) -> Option<&'static str> {
    match why {
        NotArrived::NotReady(reason) | NotArrived::Aborted { reason, .. } => after(reason),
        NotArrived::TimedOut { is_still: false, .. } => Some("try a longer --wait-timeout"),
        NotArrived::TimedOut { .. } | NotArrived::Stalled { .. } => {
            Some("is the shaft blocked, or --wait-tolerance too small?")
        }
        _ => None,
    }
}
