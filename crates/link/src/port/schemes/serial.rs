//! UARTs, and ptys that emulate them. They are locked before they are configured.
//!
//! Eight data bits, no parity, one stop bit, no flow control. The default latency timer of an FTDI
//! adapter delays received bytes by 16 ms; it is set to 1 ms if this user has permission.
//! `ASYNC_LOW_LATENCY` would do the same for some other drivers. It is not set, because it needs an
//! unsafe call.

use std::iter;
use std::os::fd::{AsFd, OwnedFd};
use std::os::unix::ffi::OsStrExt;
use std::os::unix::fs::MetadataExt;
use std::path::{Path, PathBuf};

use rustix::fs::{Access, FlockOperation, Mode, OFlags, access, flock, open as open_fd};
use rustix::io::Errno;
use rustix::termios::{
    ControlModes, OptionalActions, QueueSelector, ioctl_tiocexcl, tcflush, tcgetattr, tcgetwinsize,
    tcsetattr, tcsetwinsize,
};

use super::super::carries::Carries;
use super::super::error::{PortError, owning_group, permission_hint};
use super::super::event::EventBytes;
use super::super::fd::FdLink;
use super::super::link::ByteLink;
use super::super::name::NameError;
use super::super::place::Place;
use super::super::queued::QueuedBytes;
use super::super::scheme::{Form, Given, LinePort, Port, PortInfo, PortName, Scheme};
use super::super::system;

/// Links that lead to each other have an end.
const MOST_LINKS: usize = 8;

/// Default baud rate of a serial line.
pub const DEFAULT_BAUD: u32 = 115_200;

/// `serial:/dev/ttyACM0?baud=115200`, or the bare path of a device.
pub(super) struct Serial;

impl Scheme for Serial {
    fn name(&self) -> &'static str {
        "serial"
    }

    fn forms(&self) -> &'static [Form] {
        const FORM: Form = Form { text: "", help: "a UART", carries: Carries::Bytes };
        &[
            Form { text: "/dev/ttyACM0", ..FORM },
            Form {
                text: "serial:/dev/ttyUSB0?baud=9600",
                help: "the same at another baud rate than 115200",
                ..FORM
            },
        ]
    }

    fn is_bare(&self, name: &str) -> bool {
        name.starts_with(['/', '.']) || (name.contains("tty") && !name.contains(':'))
    }

    fn parse(&self, rest: &str, given: &mut Given<'_>) -> Result<PortName, NameError> {
        let path = given.present(rest, "a device", "serial:/dev/ttyACM0")?;
        Device::at(path).with_options(given)
    }

    fn options(&self) -> &'static [&'static str] {
        &["baud"]
    }

    fn list(&self, root: &Path) -> Vec<PortInfo> {
        let ttys = system::names_in(&root.join("sys/class/tty"));
        ttys.iter().filter_map(|name| listed(root, name)).collect()
    }
}

/// A UART, or a pty that emulates one.
#[derive(Debug, Clone)]
pub(super) struct Device {
    path: PathBuf,
    baud: u32,
}

impl Device {
    /// The device at `path`. `ttyACM0` without a directory is in `/dev`.
    pub(super) fn at(path: &str) -> Self {
        let is_lone = path.starts_with("tty") && !path.contains('/');
        let path = if is_lone { Path::new("/dev").join(path) } else { PathBuf::from(path) };
        Device { path, baud: DEFAULT_BAUD }
    }

    pub(super) fn with_options(mut self, given: &mut Given<'_>) -> Result<PortName, NameError> {
        if let Some(value) = given.take("baud") {
            self.baud = value.parse().ok().filter(|&rate| rate > 0).ok_or_else(|| {
                let usable = "a number like 9600, 115200 or 1843200".to_owned();
                given.bad_option("baud", value, usable)
            })?;
        }
        Ok(PortName::new(self))
    }
}

impl Port for Device {
    fn body(&self) -> String {
        format!("serial:{}", self.path.display())
    }

    fn options(&self) -> Vec<String> {
        let is_other = self.baud != DEFAULT_BAUD;
        is_other.then(|| format!("baud={}", self.baud)).into_iter().collect()
    }

    fn as_line(&self) -> Option<&dyn LinePort> {
        Some(self)
    }

    fn is_device(&self) -> bool {
        // Other ptys are terminals of this user.
        marked_link(&self.path).is_some() || self.path.canonicalize().is_ok_and(|it| is_listed(&it))
    }

    /// Also its links: they stay when the device is away, or gets another number.
    fn place(&self) -> Place {
        let name = |path: PathBuf| format!("serial:{}", in_real_folder(&path).display());
        Place::new(links(&self.path).map(name).collect())
    }
}

impl LinePort for Device {
    fn open(&self) -> Result<Box<dyn ByteLink>, PortError> {
        Ok(Box::new(open(&self.path, self.baud)?))
    }

    fn open_event(&self) -> Result<Box<dyn EventBytes>, PortError> {
        Ok(Box::new(QueuedBytes::new(open(&self.path, self.baud)?)))
    }

    fn label(&self) -> String {
        self.path.display().to_string()
    }

    fn baud(&self) -> Option<u32> {
        Some(self.baud)
    }

    fn at_baud(&self, baud: u32) -> Option<PortName> {
        // A pty accepts each rate and has none.
        let is_pty = self.path.canonicalize().is_ok_and(|path| path.starts_with("/dev/pts"));
        if is_pty {
            return None;
        }
        Some(PortName::new(Device { baud, ..self.clone() }))
    }
}

/// Opens the device at `path` exclusively.
fn open(path: &Path, baud: u32) -> Result<FdLink, PortError> {
    let device = path.canonicalize().map_err(|error| PortError::at_open(path, error))?;
    let fd = open_device(&device).map_err(|errno| PortError::at_open(path, errno))?;
    if is_stale(path, &fd) {
        return Err(PortError::Stale(path.display().to_string()));
    }
    claim(&fd, &device).map_err(|errno| PortError::at_open(path, errno))?;
    let actual = configure(&fd, baud).map_err(|errno| PortError::at_open(path, errno))?;
    let port = path.display().to_string();
    // A divider rarely gives the exact rate; a UART tolerates 2 % on each side.
    if actual.abs_diff(baud) > baud / 25 {
        return Err(PortError::BaudRefused { port, baud });
    }
    shorten_latency(&device);
    FdLink::new(fd, port)
}

fn open_device(device: &Path) -> Result<OwnedFd, Errno> {
    // Without NONBLOCK, open would wait for a modem's carrier.
    let flags = OFlags::RDWR | OFlags::NOCTTY | OFlags::NONBLOCK | OFlags::CLOEXEC;
    open_fd(device, flags, Mode::empty())
}

/// Locks the device against other programs.
fn claim(fd: &OwnedFd, device: &Path) -> Result<(), Errno> {
    flock(fd, FlockOperation::NonBlockingLockExclusive)?;
    // The lock excludes programs that lock too. On a real device, exclusive mode excludes all
    // others. Not on a pty: its server keeps it open, so the mode would remain after this process.
    if !device.starts_with("/dev/pts") {
        ioctl_tiocexcl(fd)?;
    }
    Ok(())
}

/// Whether this computer lists the device.
fn is_listed(device: &Path) -> bool {
    let is_in_dev = device.parent() == Some(Path::new("/dev"));
    let name = device.file_name().and_then(|name| name.to_str()).filter(|_| is_in_dev);
    name.is_some_and(|name| listed(Path::new("/"), name).is_some())
}

/// The data of a tty for a list of ports.
fn listed(root: &Path, name: &str) -> Option<PortInfo> {
    let class = root.join("sys/class/tty").join(name);
    let device = class.join("device");
    // A console has no device. The kernel's unused UARTs have type 0.
    if !device.exists() || system::read(&class.join("type")).as_deref() == Some("0") {
        return None;
    }
    let path = root.join("dev").join(name);
    let problem = match access(&path, Access::READ_OK | Access::WRITE_OK) {
        Ok(()) => None,
        Err(rustix::io::Errno::NOENT) => Some("the device has no node in /dev".to_owned()),
        Err(_) => {
            let group = owning_group(&path, root);
            Some(format!("no permission: {}", permission_hint(group.as_deref())))
        }
    };
    Some(PortInfo {
        name: format!("/dev/{name}"),
        carries: Carries::Bytes,
        description: system::description(&device),
        stable_path: stable_path(root, name),
        problem,
    })
}

fn stable_path(root: &Path, name: &str) -> Option<PathBuf> {
    let links = root.join("dev/serial/by-id");
    let points_here = |link: &String| {
        std::fs::read_link(links.join(link)).is_ok_and(|target| target.ends_with(name))
    };
    let link = system::names_in(&links).into_iter().find(points_here)?;
    Some(Path::new("/dev/serial/by-id").join(link))
}

/// The beginning of the target of a link to a pty, if a server of ours made the link. For the
/// kernel it is the same as `/dev/pts/`. No other program writes it this way.
pub(crate) const MARKED_LINK: &str = "/dev/pts/./";

/// Marks the pty of a server as the one that `link` was made for. The mark is stored in two unused
/// sizes of the terminal's window. A later pty with the same number does not have it.
pub(crate) fn mark(pty: impl AsFd, link: &Path) -> std::io::Result<()> {
    let mut size = tcgetwinsize(&pty)?;
    (size.ws_xpixel, size.ws_ypixel) = mark_of(link.symlink_metadata()?.ino());
    Ok(tcsetwinsize(&pty, size)?)
}

/// Whether `path` is, or leads to, a link that a server of ours made for another pty.
fn is_stale(path: &Path, pty: &OwnedFd) -> bool {
    let Some(inode) = marked_link(path) else { return false };
    !tcgetwinsize(pty).is_ok_and(|size| (size.ws_xpixel, size.ws_ypixel) == mark_of(inode))
}

/// The inode of the link of a server of ours, if `path` is one or leads to one.
fn marked_link(path: &Path) -> Option<u64> {
    let is_marked =
        |target: PathBuf| target.as_os_str().as_bytes().starts_with(MARKED_LINK.as_bytes());
    let link = links(path).find(|link| link.read_link().is_ok_and(is_marked))?;
    Some(link.symlink_metadata().ok()?.ino())
}

/// A path, and each one that it leads to.
fn links(path: &Path) -> impl Iterator<Item = PathBuf> {
    let next = |link: &PathBuf| Some(link.parent()?.join(link.read_link().ok()?));
    iter::successors(Some(path.to_owned()), next).take(MOST_LINKS)
}

/// The path without links in its folder. The folder may exist when the device does not.
fn in_real_folder(path: &Path) -> PathBuf {
    let folder = path.parent().map(|folder| Path::new(".").join(folder).canonicalize());
    match (folder, path.file_name()) {
        (Some(Ok(folder)), Some(name)) => folder.join(name),
        _ => path.to_owned(),
    }
}

/// Never zero, which is the value of an unmarked pty.
fn mark_of(inode: u64) -> (u16, u16) {
    let mixed = inode.wrapping_mul(0x9E37_79B9_7F4A_7C15);
    ((mixed >> 48) as u16 | 1, (mixed >> 32) as u16)
}

/// Configures the line, drops earlier bytes, and returns the baud rate that the driver set.
fn configure(fd: &OwnedFd, baud: u32) -> Result<u32, Errno> {
    let mut settings = tcgetattr(fd)?;
    settings.make_raw();
    settings.control_modes |= ControlModes::CREAD | ControlModes::CLOCAL;
    settings.control_modes -= ControlModes::CSTOPB | ControlModes::CRTSCTS;
    settings.set_speed(baud)?;
    tcsetattr(fd, OptionalActions::Now, &settings)?;
    tcflush(fd, QueueSelector::IFlush)?;
    Ok(tcgetattr(fd)?.output_speed())
}

/// Best effort: only FTDI adapters have this file, and only some systems allow users to write it.
fn shorten_latency(device: &Path) {
    if let Some(name) = device.file_name() {
        let timer = Path::new("/sys/class/tty").join(name).join("device/latency_timer");
        let _ = std::fs::write(timer, "1");
    }
}
