//! What a kind of port is, and the name of one port.

use std::fmt;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use super::error::PortError;
use super::event::{EventBytes, EventCan};
use super::link::{ByteLink, CanLink};
use super::name::{Given, NameError};

/// One kind of port: how its names are written and what they mean. All that is known of the kind
/// is said here; [`register`](super::register) makes it known to every program part.
pub trait Scheme: Sync {
    /// What stands before the colon.
    fn name(&self) -> &'static str;

    /// How its names are written, for help and errors.
    fn forms(&self) -> &'static [Form];

    /// Whether it takes a name without a scheme, such as `/dev/ttyACM0`.
    fn is_bare(&self, _name: &str) -> bool {
        false
    }

    /// The systems that have it, as Rust calls them; empty: every one.
    fn systems(&self) -> &'static [&'static str] {
        &[]
    }

    /// The port of a name; `rest` is what stands between the colon and the options, which follow the
    /// last `?` and are taken from `given`. `all` is there for a scheme whose ports lie behind those of others.
    fn parse(
        &self,
        rest: &str,
        given: &mut Given<'_>,
        all: &[&'static dyn Scheme],
    ) -> Result<PortName, NameError>;

    /// The options of its names.
    fn options(&self) -> &'static [&'static str] {
        &[]
    }

    /// What of its kind this machine has; `root` is where its file system begins. Nothing is
    /// opened: that would reset some boards.
    fn list(&self, _root: &Path) -> Vec<PortInfo> {
        Vec::new()
    }
}

/// One way to write the names of a scheme.
#[derive(Debug, Clone, Copy)]
pub struct Form {
    /// The name, with capitals for what a user puts there.
    pub text: &'static str,
    /// What it is.
    pub help: &'static str,
    /// What its ports carry.
    pub carries: Carries,
}

/// What a port carries.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Carries {
    /// Bytes: it is a serial line.
    Bytes,
    /// CAN frames: it is a bus.
    Frames,
    /// Either.
    Both,
}

impl Carries {
    /// Whether a port that carries this serves who needs `wanted`.
    pub fn serves(self, wanted: Carries) -> bool {
        self == wanted || self == Carries::Both
    }
}

/// One port, which its scheme has parsed.
pub trait Port: fmt::Debug + Send + Sync {
    /// The name without its options.
    fn body(&self) -> String;

    /// The options that are not the default, as they are written.
    fn options(&self) -> Vec<String> {
        Vec::new()
    }

    /// The name as it would be written.
    fn name(&self) -> String {
        let (body, options) = (self.body(), self.options());
        // A `?` in the body would begin the options if none followed it.
        let has_end = !options.is_empty() || body.contains('?');
        if has_end { format!("{body}?{}", options.join("&")) } else { body }
    }

    /// The port as a serial line, if it is one.
    fn as_line(&self) -> Option<&dyn LinePort> {
        None
    }

    /// The port as a CAN bus, if it is one.
    fn as_can(&self) -> Option<&dyn CanPort> {
        None
    }

    /// Whether the drives are in this process, and end with it.
    fn is_in_process(&self) -> bool {
        false
    }
}

/// A port that carries bytes.
pub trait LinePort {
    /// Opens it, whatever its time is.
    fn open(&self) -> Result<Box<dyn ByteLink>, PortError>;

    /// Opens it for an event loop, whose time is the machine's.
    fn open_event(&self) -> Result<Box<dyn EventBytes>, PortError>;

    /// What messages call it.
    fn label(&self) -> String;

    /// Its baud rate, where it has one.
    fn baud(&self) -> Option<u32> {
        None
    }

    /// The same port at another baud rate: close the open one before it is opened. `None` where
    /// there is no baud rate.
    fn at_baud(&self, _baud: u32) -> Option<PortName> {
        None
    }
}

/// A port that carries CAN frames.
pub trait CanPort {
    /// Opens it, whatever its time is.
    fn open(&self) -> Result<Box<dyn CanLink>, PortError>;

    /// Opens it for an event loop, whose time is the machine's.
    fn open_event(&self) -> Result<Box<dyn EventCan>, PortError>;

    /// Whether it takes frames no faster than the bus carries them. Others swallow more.
    fn is_paced(&self) -> bool {
        false
    }
}

/// A port to open.
///
/// ```
/// use motorlink_link::port::PortName;
/// let port: PortName = "/dev/ttyACM0".parse()?;
/// assert_eq!(port.to_string(), "serial:/dev/ttyACM0");
/// # Ok::<(), motorlink_link::port::NameError>(())
/// ```
#[derive(Debug, Clone)]
pub struct PortName(Arc<dyn Port>);

impl PortName {
    /// The name of `port`.
    pub fn new(port: impl Port + 'static) -> Self {
        PortName(Arc::new(port))
    }

    /// As [`Port::as_line`].
    pub fn as_line(&self) -> Option<&dyn LinePort> {
        self.0.as_line()
    }

    /// As [`Port::as_can`].
    pub fn as_can(&self) -> Option<&dyn CanPort> {
        self.0.as_can()
    }

    /// As [`Port::is_in_process`].
    pub fn is_in_process(&self) -> bool {
        self.0.is_in_process()
    }

    /// As [`LinePort::baud`].
    pub fn baud(&self) -> Option<u32> {
        self.as_line()?.baud()
    }

    /// As [`LinePort::at_baud`].
    pub fn at_baud(&self, baud: u32) -> Option<PortName> {
        self.as_line()?.at_baud(baud)
    }

    /// As [`Port::body`].
    pub(super) fn body(&self) -> String {
        self.0.body()
    }

    /// As [`Port::options`].
    pub(super) fn options(&self) -> Vec<String> {
        self.0.options()
    }
}

/// As it would be written: options that have their default are left out.
impl fmt::Display for PortName {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.0.name())
    }
}

/// Ports are the same if they are written the same.
impl PartialEq for PortName {
    fn eq(&self, other: &Self) -> bool {
        self.to_string() == other.to_string()
    }
}

impl Eq for PortName {}

/// A port that this machine has.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct PortInfo {
    /// The port's name, as every command takes it.
    pub name: String,
    /// What it carries.
    pub carries: Carries,
    /// Manufacturer and product, or the kernel driver.
    pub description: Option<String>,
    /// A second path that stays the same when devices are plugged in in another order.
    pub stable_path: Option<PathBuf>,
    /// Why it cannot be used at once, and what to do.
    pub problem: Option<String>,
}

/// The scheme that `body` begins with, or the one that takes it without, and the port that it names
/// there.
pub(super) fn parse(
    body: &str,
    given: &mut Given<'_>,
    all: &[&'static dyn Scheme],
) -> Option<(&'static dyn Scheme, Result<PortName, NameError>)> {
    let of = |name: &str| all.iter().copied().find(|scheme| scheme.name() == name);
    let named = body.split_once(':').and_then(|(name, rest)| Some((of(name)?, rest)));
    let bare = || all.iter().copied().find(|scheme| scheme.is_bare(body)).map(|it| (it, body));
    let (scheme, rest) = named.or_else(bare)?;
    let systems = scheme.systems();
    if !systems.is_empty() && !systems.contains(&std::env::consts::OS) {
        let (name, systems) = (given.name.to_owned(), systems.join(", "));
        return Some((
            scheme,
            Err(NameError::OtherSystem { name, scheme: scheme.name(), systems }),
        ));
    }
    Some((scheme, scheme.parse(rest, given, all)))
}
