//! Errors of ports, with texts for the user.

use std::io;
use std::os::unix::fs::MetadataExt;
use std::path::Path;
use std::sync::Arc;
use std::time::Duration;

use rustix::io::Errno;

use super::interface::up_hint;

/// Why a port could not be opened, or failed.
#[derive(Debug, Clone, thiserror::Error)]
#[non_exhaustive]
pub enum PortError {
    /// No device has this name.
    #[error("there is no `{0}`: is it plugged in?")]
    NotFound(String),
    /// The device exists and this user may not open it.
    #[error("no permission to open `{port}`: {}", permission_hint(.group.as_deref()))]
    PermissionDenied {
        /// The port.
        port: String,
        /// The group that may open it, if the system knows one.
        group: Option<String>,
    },
    /// Another program holds the port.
    #[error("`{0}` is in use by another program: close that one first (`fuser -v {0}` names it)")]
    Busy(String),
    /// The path is a directory, a plain file or a device of another kind.
    #[error("`{0}` is not a serial device")]
    NotSerial(String),
    /// The device cannot run at this baud rate.
    #[error("`{port}` cannot run at {baud} baud: choose another rate, such as 115200")]
    BaudRefused {
        /// The port.
        port: String,
        /// The requested baud rate.
        baud: u32,
    },
    /// The port is of the other kind: a serial line instead of CAN, or the reverse.
    #[error("`{port}` cannot be used as a {wanted}: use {usable}")]
    WrongKind {
        /// The port.
        port: String,
        /// The required kind.
        wanted: &'static str,
        /// The forms that can be used instead.
        usable: String,
    },
    /// The host name is unknown.
    #[error("cannot find the host of `{port}`: check its name and the network ({source})")]
    UnknownHost {
        /// The port.
        port: String,
        /// The resolver's error.
        source: Arc<io::Error>,
    },
    /// The host exists, but no server listens.
    #[error("`{0}` refuses the connection: does a server listen there?")]
    Refused(String),
    /// The host did not answer.
    #[error("`{port}` cannot be reached: check the address and the network ({source})")]
    Unreachable {
        /// The port.
        port: String,
        /// The system's error.
        source: Arc<io::Error>,
    },
    /// The peer closed the connection, or the adapter was unplugged.
    #[error(
        "`{0}` was closed: the far end hung up or was unplugged; open it again when it is back"
    )]
    Closed(String),
    /// The port could not be opened again, and the next attempt is later. The text is the error of the
    /// last attempt.
    #[error("{0}")]
    Away(String),
    /// The port does not accept bytes or frames.
    #[error("`{port}` takes no more data: {hint}")]
    Stalled {
        /// The port.
        port: String,
        /// What to check.
        hint: &'static str,
    },
    /// The clock port of an emulated board does not answer.
    #[error(
        "`{port}`: the board's clock did not answer within {after:?}: does the emulator run, is this \
         its clock port, and is no other program connected to that?"
    )]
    ClockStopped {
        /// The clock port.
        port: String,
        /// The timeout of the answer.
        after: Duration,
    },
    /// The port runs on the time of an emulated board, but its user needs the machine's time.
    #[error(
        "`{0}` runs on the time of an emulated board, and event loops and guards need the \
         machine's time: leave out `clock=`, or use a blocking client"
    )]
    Emulated(String),
    /// This kernel has no CAN support.
    #[error(
        "this kernel has no CAN support: load it with `sudo modprobe can-raw`, or use an slcan adapter"
    )]
    NoCan,
    /// No CAN interface has this name.
    #[error("there is no CAN interface `{0}`")]
    NoSuchInterface(String),
    /// The CAN interface exists, but is not up.
    #[error("CAN interface `{port}` is down: {hint}")]
    InterfaceDown {
        /// The interface.
        port: String,
        /// How to bring it up.
        hint: String,
    },
    /// The CAN controller left the bus after too many errors.
    #[error(
        "`{0}` is bus-off after too many errors: check wiring, termination and bitrate, then \
         `sudo ip link set {0} down && sudo ip link set {0} up`"
    )]
    BusOff(String),
    /// The device does not use slcan.
    #[error(
        "`{port}` does not answer like an slcan adapter ({reason}): is this the right device and baud rate?"
    )]
    NotSlcan {
        /// The port.
        port: String,
        /// What it did instead.
        reason: &'static str,
    },
    /// The slcan adapter refuses this bitrate.
    #[error(
        "the adapter on `{port}` refuses {bitrate} bit/s: unplug it and plug it in again, or ask for another bitrate"
    )]
    BitrateRefused {
        /// The port.
        port: String,
        /// The requested bitrate.
        bitrate: u32,
    },
    /// The slcan adapter refuses frames.
    #[error(
        "the adapter on `{0}` refuses frames: was it reset, or is no other node on the bus? its \
         channel is opened again with the next call"
    )]
    AdapterRefuses(String),
    /// A served port would replace a file that no server created.
    #[error("`{port}` exists and is not a {wanted}: remove it or choose another path")]
    PathTaken {
        /// The path.
        port: String,
        /// The kind of file that may be replaced.
        wanted: &'static str,
    },
    /// The link to a served pty is left over from a killed server. The pty that it points to now
    /// belongs to another program.
    #[error(
        "`{0}` is stale: the server that made it is gone, and its pty now belongs to another \
         program. Nothing was sent; start the server again"
    )]
    Stale(String),
    /// The link of a served pty belongs to another server.
    #[error("`{0}` is served already: end that server or choose another path")]
    PathServed(String),
    /// The listening address is in use.
    #[error("`{0}` is taken by another program: choose another TCP port, or 0 for any free one")]
    AddressInUse(String),
    /// The thread that waited for an exchange used the port again, for example in a signal handler.
    #[error(
        "`{0}`: another call of the same thread, such as one in a signal handler, aborted this \
         exchange; what the drive did is unknown"
    )]
    Overtaken(String),
    /// The program is about to end: its client was retired.
    #[error("`{0}`: this program is about to end, and only stops motors; nothing was sent")]
    Retired(String),
    /// The program that holds the port did not get a reply, or did not send the request. The
    /// connection to it stays open.
    #[error("{why}")]
    NotDone {
        /// The port.
        port: String,
        /// The motor that the request was for.
        motor: u8,
        /// The kind of the reason.
        kind: NotDone,
        /// The reason.
        why: String,
    },
    /// The program that holds the port does not answer.
    #[error(
        "`{0}`: the program that holds this port does not answer: is it stopped or overloaded? it \
         is unknown whether the drive carried the request out"
    )]
    HolderSilent(String),
    /// The program that holds the port reads frames in another profile.
    #[error("the program that holds `{port}` reads frames in profile {profile}; nothing was sent")]
    HeldInProfile {
        /// The port.
        port: String,
        /// Its profile.
        profile: &'static str,
    },
    /// The program that holds the port is not there, or has ended.
    #[error("`{port}`: {why}")]
    NoHolder {
        /// The port.
        port: String,
        /// What is known of it.
        why: String,
    },
    /// The configuration of the port is invalid, or the program that holds it cannot be used.
    #[error("`{port}`: {why}")]
    Unusable {
        /// The port.
        port: String,
        /// The reason, and what to try.
        why: String,
    },
    /// Any other error of the system.
    #[error("`{port}` failed: {source}")]
    Io {
        /// The port.
        port: String,
        /// What the system said.
        source: Arc<io::Error>,
    },
}

/// Why a program that holds a port has no reply to a request.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum NotDone {
    /// It refuses the request now.
    Refused,
    /// Motion is refused until a latch is released.
    Latched,
    /// Another program may change the motor now.
    Held,
    /// The request is not possible.
    Usage,
    /// The motor does not answer.
    Silent,
    /// As `Silent`, and nothing shows that a motor is there.
    Unheard,
    /// It was not sent: it waited too long, or too much waits.
    Unsent,
    /// The drive answered, but replies before may have been those to other requests.
    Unconfirmed,
    /// The line failed.
    Line,
}

impl PortError {
    /// Whether the port stays open after this error.
    pub fn leaves_open(&self) -> bool {
        self.is_interruption()
            || matches!(self, PortError::NotDone { .. } | PortError::HolderSilent(..))
    }

    /// Whether nothing can be said about the drives, because the port failed.
    pub fn is_line_failure(&self) -> bool {
        use NotDone::{Held, Latched, Refused, Unsent, Usage};
        let is_answered = matches!(
            self,
            PortError::NotDone { kind: Refused | Latched | Held | Usage | Unsent, .. }
        );
        !self.is_interruption() && !is_answered
    }

    /// Whether the program that held the port has ended the session or is gone. The motors of this client do
    /// not go on as they were commanded.
    pub fn ends_session(&self) -> bool {
        matches!(self, PortError::NoHolder { .. })
    }

    /// Whether the drive did not get the request: the program that holds the port has not sent it.
    pub fn is_unsent(&self) -> bool {
        use NotDone::{Held, Latched, Unsent, Usage};
        matches!(self, PortError::NotDone { kind: Latched | Held | Usage | Unsent, .. })
    }

    /// Whether the program that holds the port says that another one has the motor now.
    pub fn is_of_another(&self) -> bool {
        matches!(self, PortError::NotDone { kind: NotDone::Held, .. })
    }

    /// Whether the program that holds the port has no reply of the drive. What stops a motor it has
    /// repeated before.
    pub fn is_given_up(&self) -> bool {
        use NotDone::{Line, Silent, Unheard};
        matches!(self, PortError::NotDone { kind: Silent | Unheard | Line, .. })
    }

    /// Whether a wait was ended because the caller wants to do something else. The port stays open,
    /// and the exchange is abandoned.
    pub fn is_interruption(&self) -> bool {
        match self {
            PortError::Overtaken(..) => true,
            PortError::Io { source, .. } => source.kind() == io::ErrorKind::Interrupted,
            _ => false,
        }
    }

    /// The meaning of an error of an open port.
    pub(crate) fn in_use(port: &str, error: impl Into<io::Error>) -> Self {
        let source = error.into();
        let port = port.to_owned();
        match Errno::from_io_error(&source) {
            Some(
                Errno::IO
                | Errno::NXIO
                | Errno::NODEV
                | Errno::PIPE
                | Errno::CONNRESET
                | Errno::CONNABORTED
                | Errno::NOTCONN
                | Errno::TIMEDOUT,
            ) => PortError::Closed(port),
            Some(Errno::NETDOWN) => Self::interface_down(port),
            Some(Errno::NOBUFS) => PortError::Stalled {
                port,
                hint: "no other node acknowledges the frames; check wiring, power and bitrate",
            },
            _ => PortError::Io { port, source: source.into() },
        }
    }

    pub(crate) fn interface_down(port: String) -> Self {
        PortError::InterfaceDown { hint: up_hint(&port, Path::new("/sys")), port }
    }

    /// The meaning of an error while the device at `path` is opened.
    pub(crate) fn at_open(path: &Path, error: impl Into<io::Error>) -> Self {
        let source = error.into();
        let port = path.display().to_string();
        match Errno::from_io_error(&source) {
            Some(Errno::NOENT | Errno::NODEV | Errno::NXIO) => PortError::NotFound(port),
            Some(Errno::ACCESS | Errno::PERM) => {
                PortError::PermissionDenied { port, group: owning_group(path, Path::new("/")) }
            }
            Some(Errno::BUSY | Errno::WOULDBLOCK) => PortError::Busy(port),
            Some(Errno::ISDIR | Errno::NOTTY | Errno::NOTDIR) => PortError::NotSerial(port),
            _ => PortError::Io { port, source: source.into() },
        }
    }
}

/// How to get permission to open a device that `group` owns.
pub(super) fn permission_hint(group: Option<&str>) -> String {
    match group {
        Some("root") | None => {
            "only root may; a udev rule with TAG+=\"uaccess\" lets other users".to_owned()
        }
        Some(group) => {
            format!("join the group: sudo usermod -aG {group} $USER, then log in again")
        }
    }
}

/// The name of the group that owns `path`, from the group file below `root`.
pub(super) fn owning_group(path: &Path, root: &Path) -> Option<String> {
    let gid = std::fs::metadata(path).ok()?.gid().to_string();
    let groups = std::fs::read_to_string(root.join("etc/group")).ok()?;
    groups.lines().find_map(|line| {
        let mut fields = line.split(':');
        let name = fields.next()?;
        (fields.nth(1)? == gid).then(|| name.to_owned())
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_denied_device_names_the_group_to_join() {
        let error = PortError::PermissionDenied {
            port: "/dev/ttyACM0".into(),
            group: Some("dialout".into()),
        };
        assert_eq!(
            error.to_string(),
            "no permission to open `/dev/ttyACM0`: join the group: \
             sudo usermod -aG dialout $USER, then log in again"
        );
        // For the group root the hint names a udev rule. A user must not join this group.
        assert!(permission_hint(Some("root")).contains("udev"));
        assert_eq!(owning_group(Path::new("/dev/null"), Path::new("/")).as_deref(), Some("root"));
    }

    #[test]
    fn a_lost_line_is_distinguished_from_other_failures() {
        for errno in [Errno::IO, Errno::NODEV, Errno::CONNRESET, Errno::PIPE] {
            assert!(matches!(PortError::in_use("p", errno), PortError::Closed(..)), "{errno}");
        }
        assert!(matches!(PortError::in_use("p", Errno::NOMEM), PortError::Io { .. }));
        assert_eq!(
            PortError::in_use("can1", Errno::NETDOWN).to_string(),
            "CAN interface `can1` is down: sudo ip link set can1 up type can bitrate 1000000"
        );
    }
}
