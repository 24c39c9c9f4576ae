//! A kind of port, and the name of a port.

use std::fmt;
use std::ops::Deref;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use super::carries::Carries;
use super::error::PortError;
use super::event::{EventBytes, EventCan};
use super::holder::HeldPort;
use super::link::{ByteLink, CanLink};
use super::name::{NameError, present};
use super::place::Place;

/// One kind of port: the syntax and the meaning of its names. Everything about the kind is defined
/// in its implementation. [`register`](super::register) makes it known to the whole program.
pub trait Scheme: Sync {
    /// The part before the colon.
    fn name(&self) -> &'static str;

    /// The forms of its names, for help and errors.
    fn forms(&self) -> &'static [Form];

    /// Whether it accepts a name without a scheme, such as `/dev/ttyACM0`.
    fn is_bare(&self, _name: &str) -> bool {
        false
    }

    /// Parses a name. `rest` is the part between the colon and the options. The options follow the
    /// last `?`; take them from `given`.
    fn parse(&self, rest: &str, given: &mut Given<'_>) -> Result<PortName, NameError>;

    /// The options of its names.
    fn options(&self) -> &'static [&'static str] {
        &[]
    }

    /// The ports of this kind on this machine. `root` is the root of its file system. No port is
    /// opened, because that would reset some boards.
    fn list(&self, _root: &Path) -> Vec<PortInfo> {
        Vec::new()
    }
}

/// A given name while a scheme parses it.
pub struct Given<'a> {
    /// The whole name, for messages.
    pub name: &'a str,
    /// The part before the options. The options follow the last `?`, so a path may contain a `?`.
    pub body: &'a str,
    /// The known schemes, for a scheme whose ports wrap those of others.
    pub schemes: &'a [&'static dyn Scheme],
    options: Vec<(&'a str, &'a str)>,
}

impl<'a> Given<'a> {
    pub(super) fn new(name: &'a str, schemes: &'a [&'static dyn Scheme]) -> Self {
        let (body, query) = name.rsplit_once('?').unwrap_or((name, ""));
        let options = query.split('&').filter(|option| !option.is_empty());
        let options = options.map(|option| option.split_once('=').unwrap_or((option, "")));
        Given { name, body, schemes, options: options.collect() }
    }

    /// Takes the value of an option, if it was given.
    pub fn take(&mut self, key: &str) -> Option<&'a str> {
        let place = self.options.iter().position(|(given, _)| *given == key)?;
        Some(self.options.remove(place).1)
    }

    /// Refuses options that were not taken. `known` are the valid options.
    pub fn refuse_others(&self, known: &[&str]) -> Result<(), NameError> {
        let Some((key, _)) = self.options.first() else { return Ok(()) };
        if known.contains(key) {
            let (name, key) = (self.name.to_owned(), (*key).to_owned());
            return Err(NameError::OptionTwice { name, key });
        }
        let known = if known.is_empty() { "none".to_owned() } else { known.join(", ") };
        Err(NameError::UnknownOption { name: self.name.to_owned(), key: (*key).to_owned(), known })
    }

    /// Checks that a part is not empty. `example` is a valid name for the error.
    pub fn present<'p>(
        &self,
        part: &'p str,
        what: &'static str,
        example: &'static str,
    ) -> Result<&'p str, NameError> {
        present(self.name, part, what, example)
    }

    /// The error for an option with an invalid value.
    pub fn bad_option(&self, key: &'static str, value: &str, usable: String) -> NameError {
        let (name, value) = (self.name.to_owned(), value.to_owned());
        NameError::BadOption { name, key, value, usable }
    }
}

/// One form of the names of a scheme.
#[derive(Debug, Clone, Copy)]
pub struct Form {
    /// The name, with capitals for the parts that a user replaces.
    pub text: &'static str,
    /// A description.
    pub help: &'static str,
    /// What its ports carry.
    pub carries: Carries,
}

/// A parsed port.
pub trait Port: fmt::Debug + Send + Sync {
    /// The name without its options.
    fn body(&self) -> String;

    /// The options that differ from the default, as text.
    fn options(&self) -> Vec<String> {
        Vec::new()
    }

    /// The whole name.
    fn name(&self) -> String {
        let (body, options) = (self.body(), self.options());
        // Without another `?`, a `?` in the body would start the options.
        let has_end = !options.is_empty() || body.contains('?');
        if has_end { format!("{body}?{}", options.join("&")) } else { body }
    }

    /// The port as a serial line; `None` if it is not one.
    fn as_line(&self) -> Option<&dyn LinePort> {
        None
    }

    /// The port as a CAN bus; `None` if it is not one.
    fn as_can(&self) -> Option<&dyn CanPort> {
        None
    }

    /// Whether the drives are in this process, and end with it.
    fn is_in_process(&self) -> bool {
        false
    }

    /// The port as one that another program holds; `None` if it is none. It opens as nothing else.
    fn as_held(&self) -> Option<&dyn HeldPort> {
        None
    }

    /// Whether it is a device that this computer lists now, a drive that this program serves, or an
    /// address in a network. Other names lead to files, terminals and sockets of other programs.
    fn is_device(&self) -> bool {
        false
    }

    /// Whether it leads to an address in a network.
    fn is_address(&self) -> bool {
        false
    }

    /// What it occupies: the same for all options of a device.
    fn place(&self) -> Place {
        Place::new(vec![self.body()])
    }
}

/// A port that carries bytes.
pub trait LinePort: Port {
    /// Opens the port, on any clock.
    fn open(&self) -> Result<Box<dyn ByteLink>, PortError>;

    /// Opens the port for an event loop, on the machine's clock.
    fn open_event(&self) -> Result<Box<dyn EventBytes>, PortError>;

    /// The name of the port in messages.
    fn label(&self) -> String {
        self.name()
    }

    /// The baud rate; `None` if the port has none.
    fn baud(&self) -> Option<u32> {
        None
    }

    /// The same port at another baud rate; `None` if the port has none. Close the open one before
    /// this is opened.
    fn at_baud(&self, _baud: u32) -> Option<PortName> {
        None
    }
}

/// A port that carries CAN frames.
pub trait CanPort {
    /// Opens the port, on any clock.
    fn open(&self) -> Result<Box<dyn CanLink>, PortError>;

    /// Opens the port for an event loop, on the machine's clock.
    fn open_event(&self) -> Result<Box<dyn EventCan>, PortError>;

    /// The bit rate in bit/s; `None` if the port cannot choose it.
    fn bitrate(&self) -> Option<u32> {
        None
    }

    /// The bit rates that the port can choose, in bit/s, the highest first.
    fn bitrates(&self) -> Vec<u32> {
        Vec::new()
    }

    /// The same port at another of its [bit rates](Self::bitrates). Close the open one before this is
    /// opened.
    fn at_bitrate(&self, _bitrate: u32) -> Option<PortName> {
        None
    }

    /// Whether it accepts frames no faster than the bus transmits them. Other ports buffer more.
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

    /// Whether it is a serial line, a CAN bus, or either, also one that another program holds.
    pub fn carries(&self, wanted: Carries) -> bool {
        let own = match wanted {
            Carries::Bytes => self.as_line().is_some(),
            Carries::Frames => self.as_can().is_some(),
            Carries::Both => self.carries(Carries::Bytes) && self.carries(Carries::Frames),
        };
        own || self.as_held().is_some_and(|held| held.carries().serves(wanted))
    }

    /// Whether another program holds the port, and stops the motors of its clients.
    pub fn is_held(&self) -> bool {
        self.as_held().is_some()
    }

    /// As [`LinePort::baud`].
    pub fn baud(&self) -> Option<u32> {
        self.as_line()?.baud()
    }

    /// As [`LinePort::at_baud`].
    pub fn at_baud(&self, baud: u32) -> Option<PortName> {
        self.as_line()?.at_baud(baud)
    }

    /// As [`CanPort::at_bitrate`].
    pub fn at_bitrate(&self, bitrate: u32) -> Option<PortName> {
        self.as_can()?.at_bitrate(bitrate)
    }
}

impl Deref for PortName {
    type Target = dyn Port;

    fn deref(&self) -> &Self::Target {
        &*self.0
    }
}

/// The whole name. Options with their default value are omitted.
impl fmt::Display for PortName {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.name())
    }
}

/// Two ports are equal if their names are equal.
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
    /// Bytes or frames.
    pub carries: Carries,
    /// Manufacturer and product, or the kernel driver.
    pub description: Option<String>,
    /// A second path that does not depend on the order in which devices are plugged in.
    pub stable_path: Option<PathBuf>,
    /// Why it cannot be used now, and what to do.
    pub problem: Option<String>,
}

/// Parses `body` with the scheme at its beginning, or with the scheme that accepts it without one.
pub(super) fn parse(
    body: &str,
    given: &mut Given<'_>,
) -> Option<(&'static dyn Scheme, Result<PortName, NameError>)> {
    let all = given.schemes;
    let of = |name: &str| all.iter().copied().find(|scheme| scheme.name() == name);
    let named = body.split_once(':').and_then(|(name, rest)| Some((of(name)?, rest)));
    let bare = || all.iter().copied().find(|scheme| scheme.is_bare(body)).map(|it| (it, body));
    let (scheme, rest) = named.or_else(bare)?;
    Some((scheme, scheme.parse(rest, given)))
}
