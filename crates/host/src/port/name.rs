//! The one string that names a port, everywhere.

use std::fmt;
use std::path::{Path, PathBuf};
use std::str::FromStr;

use crate::slcan::Bitrate;

/// The baud rate of a serial line whose name gives none.
pub const DEFAULT_BAUD: u32 = 115_200;

/// A port to open.
///
/// ```
/// use motorlink::port::PortName;
/// let port: PortName = "/dev/ttyACM0".parse()?;
/// assert_eq!(port.to_string(), "serial:/dev/ttyACM0");
/// # Ok::<(), motorlink::port::NameError>(())
/// ```
#[derive(Debug, Clone, PartialEq, Eq, Hash)]
pub enum PortName {
    /// `serial:/dev/ttyACM0?baud=115200`, a bare device path, `tcp:host:port`, `unix:path`, or
    /// `tcp:host:port?clock=host:port` on the time of an emulated board.
    Line(LineName),
    /// `slcan:/dev/ttyACM0?bitrate=1000000`, `slcan:tcp:host:port` or `slcan:unix:path`.
    Slcan {
        /// Where the adapter is attached.
        line: LineName,
        /// The bitrate of the CAN bus.
        bitrate: Bitrate,
        /// Whether the adapter sends back what it transmits (`echo=1`).
        echo: bool,
    },
    /// `socketcan:can0`.
    SocketCan(String),
    /// `sim:` or `sim:bench.toml`: simulated drives inside the process.
    Sim(Option<PathBuf>),
}

/// A line that carries bytes.
#[derive(Debug, Clone, PartialEq, Eq, Hash)]
pub enum LineName {
    /// A UART, or a pty that stands for one.
    Serial {
        /// The device.
        path: PathBuf,
        /// Its baud rate.
        baud: u32,
    },
    /// A serial line behind a TCP server.
    Tcp {
        /// Where it listens.
        address: TcpAddress,
        /// The clock port of the emulated board behind it, whose time is then the line's (`clock=`).
        clock: Option<TcpAddress>,
    },
    /// A serial line behind a Unix socket.
    Unix(PathBuf),
}

/// A host and a TCP port of it.
#[derive(Debug, Clone, PartialEq, Eq, Hash)]
pub struct TcpAddress {
    /// Name or address; an IPv6 address stands in brackets.
    pub host: String,
    /// The TCP port.
    pub port: u16,
}

impl fmt::Display for TcpAddress {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}:{}", self.host, self.port)
    }
}

/// A port that the simulator serves.
#[derive(Debug, Clone, PartialEq, Eq, Hash)]
pub enum ServeName {
    /// `pty:PATH`: a serial line; PATH becomes a link to the pty.
    Pty(PathBuf),
    /// `slcan-pty:PATH`: a CAN adapter that speaks slcan on a pty.
    SlcanPty(PathBuf),
    /// `tcp-listen:ADDR:PORT`: the same behind a TCP server; port 0 takes any free one.
    TcpListen {
        /// The address to listen on.
        host: String,
        /// The TCP port.
        port: u16,
    },
    /// `unix-listen:PATH`: the same behind a Unix socket, for the user who serves it.
    UnixListen(PathBuf),
    /// `socketcan:can1`: a CAN interface of this machine, for a bus of motors.
    SocketCan(String),
}

/// Why a string names no port.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum NameError {
    /// No form starts like this.
    #[error("`{name}` names no port; did you mean `{nearest}`? {forms}")]
    UnknownForm {
        /// What was given.
        name: String,
        /// The form that it is most like.
        nearest: String,
        /// The forms there are.
        forms: &'static str,
    },
    /// The part after the scheme is missing.
    #[error("`{name}` lacks {what}; write it like {example}")]
    Incomplete {
        /// What was given.
        name: String,
        /// What is missing.
        what: &'static str,
        /// How it is done.
        example: &'static str,
    },
    /// An option that this form does not have.
    #[error("`{name}` has the unknown option `{key}`; there is {known}")]
    UnknownOption {
        /// What was given.
        name: String,
        /// The option.
        key: String,
        /// The options there are.
        known: &'static str,
    },
    /// An option with a value that it cannot have.
    #[error("`{name}`: {key} cannot be `{value}`; use {usable}")]
    BadOption {
        /// What was given.
        name: String,
        /// The option.
        key: &'static str,
        /// Its value.
        value: String,
        /// The values it can have.
        usable: String,
    },
}

const PORT_FORMS: &str = "ports are /dev/ttyACM0, serial:/dev/ttyACM0?baud=115200, tcp:HOST:PORT, \
    unix:PATH, slcan:/dev/ttyACM0?bitrate=1000000, slcan:tcp:HOST:PORT, slcan:unix:PATH, \
    socketcan:can0, sim: and sim:FILE.toml";
const SLCAN_OPTIONS: &str = "bitrate, echo, on a device baud, and behind TCP clock";
const SERVE_FORMS: &str = "served ports are pty:PATH, slcan-pty:PATH, unix-listen:PATH, \
    tcp-listen:ADDR:PORT and socketcan:INTERFACE";

impl FromStr for PortName {
    type Err = NameError;

    fn from_str(name: &str) -> Result<Self, NameError> {
        if let Some(rest) = name.strip_prefix("slcan:") {
            return parse_slcan(name, rest);
        }
        if let Some(interface) = parse_socketcan(name)? {
            return Ok(PortName::SocketCan(interface));
        }
        if let Some(file) = name.strip_prefix("sim:") {
            return Ok(PortName::Sim((!file.is_empty()).then(|| file.into())));
        }
        let (body, query) = split_query(name);
        let mut line =
            parse_line(name, body)?.ok_or_else(|| unknown_form(name, nearest(name), PORT_FORMS))?;
        for (key, value) in options(query) {
            if !line.set_option(name, key, value)? {
                return Err(unknown_option(name, key, line.options()));
            }
        }
        Ok(PortName::Line(line))
    }
}

/// The CAN interface that `name` stands for, or nothing when it is of another form.
fn parse_socketcan(name: &str) -> Result<Option<String>, NameError> {
    let Some(interface) = name.strip_prefix("socketcan:") else { return Ok(None) };
    Ok(Some(present(name, interface, "an interface", "socketcan:can0")?.to_owned()))
}

fn parse_slcan(name: &str, rest: &str) -> Result<PortName, NameError> {
    let (body, query) = split_query(rest);
    let body = present(name, body, "a device", "slcan:/dev/ttyACM0")?;
    let mut line = match parse_line(name, body)? {
        Some(line) => line,
        None => LineName::serial(body),
    };
    let (mut bitrate, mut echo) = (Bitrate::DEFAULT, false);
    for (key, value) in options(query) {
        match (key, value) {
            ("bitrate", _) => {
                let parsed = value.parse().ok().and_then(Bitrate::from_bits_per_second);
                bitrate = parsed.ok_or_else(|| bad_option(name, "bitrate", value, bitrates()))?;
            }
            ("echo", "0" | "1") => echo = value == "1",
            ("echo", _) => return Err(bad_option(name, "echo", value, "0 or 1".to_owned())),
            _ if line.set_option(name, key, value)? => {}
            _ => return Err(unknown_option(name, key, SLCAN_OPTIONS)),
        }
    }
    Ok(PortName::Slcan { line, bitrate, echo })
}

fn bitrates() -> String {
    Bitrate::ALL.map(|rate| rate.bits_per_second().to_string()).join(", ")
}

/// The line that `body` names, or nothing when it looks like none. `name` is for messages.
fn parse_line(name: &str, body: &str) -> Result<Option<LineName>, NameError> {
    if let Some(path) = body.strip_prefix("serial:") {
        let path = present(name, path, "a device", "serial:/dev/ttyACM0")?;
        return Ok(Some(LineName::serial(path)));
    }
    if let Some(address) = body.strip_prefix("tcp:") {
        let address = tcp_address(name, address, "tcp:192.168.1.5:4000")?;
        return Ok(Some(LineName::Tcp { address, clock: None }));
    }
    if let Some(path) = body.strip_prefix("unix:") {
        let path = present(name, path, "a path", "unix:./drive")?;
        return Ok(Some(LineName::Unix(path.into())));
    }
    let bare = body.starts_with(['/', '.']) || (body.contains("tty") && !body.contains(':'));
    Ok(bare.then(|| LineName::serial(body)))
}

impl LineName {
    /// The device at `path`; a lone `ttyACM0` is the one in `/dev`.
    fn serial(path: &str) -> Self {
        let lone = path.starts_with("tty") && !path.contains('/');
        let path = if lone { Path::new("/dev").join(path) } else { PathBuf::from(path) };
        LineName::Serial { path, baud: DEFAULT_BAUD }
    }

    /// Takes an option; false when there is none of that name.
    fn set_option(&mut self, name: &str, key: &str, value: &str) -> Result<bool, NameError> {
        match (self, key) {
            (LineName::Serial { baud, .. }, "baud") => {
                *baud = value.parse().ok().filter(|&rate| rate > 0).ok_or_else(|| {
                    let usable = "a number like 9600, 115200 or 1843200".to_owned();
                    bad_option(name, "baud", value, usable)
                })?;
            }
            (LineName::Tcp { clock, .. }, "clock") => {
                *clock = Some(tcp_address(name, value, "tcp:127.0.0.1:4000?clock=127.0.0.1:4002")?);
            }
            _ => return Ok(false),
        }
        Ok(true)
    }

    /// The name without its options.
    fn to_body(&self) -> String {
        match self {
            LineName::Serial { path, .. } => format!("serial:{}", path.display()),
            LineName::Tcp { address, .. } => format!("tcp:{address}"),
            LineName::Unix(path) => format!("unix:{}", path.display()),
        }
    }

    /// The option that is not the default.
    fn option(&self) -> Option<String> {
        match self {
            LineName::Serial { baud, .. } if *baud != DEFAULT_BAUD => Some(format!("baud={baud}")),
            LineName::Tcp { clock: Some(clock), .. } => Some(format!("clock={clock}")),
            _ => None,
        }
    }

    fn options(&self) -> &'static str {
        match self {
            LineName::Serial { .. } => "baud",
            LineName::Tcp { .. } => "clock",
            LineName::Unix(_) => "none",
        }
    }
}

impl FromStr for ServeName {
    type Err = NameError;

    fn from_str(name: &str) -> Result<Self, NameError> {
        if let Some(path) = name.strip_prefix("pty:") {
            return Ok(ServeName::Pty(present(name, path, "a path", "pty:./st0")?.into()));
        }
        if let Some(path) = name.strip_prefix("slcan-pty:") {
            return Ok(ServeName::SlcanPty(
                present(name, path, "a path", "slcan-pty:./can0")?.into(),
            ));
        }
        if let Some(path) = name.strip_prefix("unix-listen:") {
            let path = present(name, path, "a path", "unix-listen:./drive")?;
            return Ok(ServeName::UnixListen(path.into()));
        }
        if let Some(address) = name.strip_prefix("tcp-listen:") {
            let (host, port) = host_and_port(name, address, "tcp-listen:127.0.0.1:4000")?;
            return Ok(ServeName::TcpListen { host, port });
        }
        if let Some(interface) = parse_socketcan(name)? {
            return Ok(ServeName::SocketCan(interface));
        }
        let path = name.rsplit(':').next().filter(|path| !path.is_empty()).unwrap_or("./st0");
        Err(unknown_form(name, format!("pty:{path}"), SERVE_FORMS))
    }
}

/// As it would be written: options that have their default are left out.
impl fmt::Display for PortName {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            PortName::Line(line) => line.fmt(f),
            PortName::Slcan { line, bitrate, echo } => {
                let mut options = Vec::new();
                if *bitrate != Bitrate::DEFAULT {
                    options.push(format!("bitrate={}", bitrate.bits_per_second()));
                }
                options.extend(line.option());
                options.extend(echo.then(|| "echo=1".to_owned()));
                let written = line.to_body();
                let bare = written.strip_prefix("serial:").filter(|path| {
                    // Such a path needs its scheme.
                    !["serial:", "tcp:", "unix:"].iter().any(|scheme| path.starts_with(scheme))
                });
                f.write_str("slcan:")?;
                write_with_options(f, bare.unwrap_or(&written), &options)
            }
            PortName::SocketCan(interface) => write!(f, "socketcan:{interface}"),
            PortName::Sim(None) => f.write_str("sim:"),
            PortName::Sim(Some(file)) => write!(f, "sim:{}", file.display()),
        }
    }
}

impl fmt::Display for LineName {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write_with_options(f, &self.to_body(), &Vec::from_iter(self.option()))
    }
}

/// A `?` in `body` would begin the options if none followed it.
fn write_with_options(f: &mut fmt::Formatter<'_>, body: &str, options: &[String]) -> fmt::Result {
    f.write_str(body)?;
    if options.is_empty() && !body.contains('?') {
        return Ok(());
    }
    write!(f, "?{}", options.join("&"))
}

impl fmt::Display for ServeName {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            ServeName::Pty(path) => write!(f, "pty:{}", path.display()),
            ServeName::SlcanPty(path) => write!(f, "slcan-pty:{}", path.display()),
            ServeName::UnixListen(path) => write!(f, "unix-listen:{}", path.display()),
            ServeName::TcpListen { host, port } => write!(f, "tcp-listen:{host}:{port}"),
            ServeName::SocketCan(interface) => write!(f, "socketcan:{interface}"),
        }
    }
}

/// The port that someone who wrote `name` may have meant.
fn nearest(name: &str) -> String {
    let Some((scheme, rest)) = name.split_once(':') else {
        return match name {
            "sim" => "sim:".to_owned(),
            _ if name.contains("can") => format!("socketcan:{name}"),
            _ => format!("./{name}"),
        };
    };
    match scheme {
        "can" | "socket" => format!("socketcan:{rest}"),
        "sl" | "lawicel" | "slcand" | "slcan-pty" => format!("slcan:{rest}"),
        "tcp-listen" => format!("tcp:{rest}"),
        "unix-listen" => format!("unix:{rest}"),
        _ if rest.parse::<u16>().is_ok() => format!("tcp:{name}"),
        _ => format!("serial:{rest}"),
    }
}

fn unknown_form(name: &str, nearest: String, forms: &'static str) -> NameError {
    NameError::UnknownForm { name: name.to_owned(), nearest, forms }
}

fn present<'a>(
    name: &str,
    part: &'a str,
    what: &'static str,
    example: &'static str,
) -> Result<&'a str, NameError> {
    if part.is_empty() {
        return Err(NameError::Incomplete { name: name.to_owned(), what, example });
    }
    Ok(part)
}

fn host_and_port(
    name: &str,
    address: &str,
    example: &'static str,
) -> Result<(String, u16), NameError> {
    let lacks = |what| NameError::Incomplete { name: name.to_owned(), what, example };
    let (host, port) = address.rsplit_once(':').ok_or_else(|| lacks("a TCP port"))?;
    if host.contains(':') && !(host.starts_with('[') && host.ends_with(']')) {
        return Err(lacks("the brackets around its IPv6 address"));
    }
    let host = present(name, host, "a host", example)?;
    let port = port.parse().map_err(|_| lacks("a TCP port from 0 to 65535"))?;
    Ok((host.to_owned(), port))
}

fn tcp_address(name: &str, address: &str, example: &'static str) -> Result<TcpAddress, NameError> {
    let (host, port) = host_and_port(name, address, example)?;
    if port == 0 {
        return Err(bad_option(name, "the port", "0", "1 to 65535".to_owned()));
    }
    Ok(TcpAddress { host, port })
}

/// The options follow the last `?`, so that a path may contain one.
fn split_query(name: &str) -> (&str, &str) {
    name.rsplit_once('?').unwrap_or((name, ""))
}

fn options(query: &str) -> impl Iterator<Item = (&str, &str)> {
    query
        .split('&')
        .filter(|option| !option.is_empty())
        .map(|option| option.split_once('=').unwrap_or((option, "")))
}

fn unknown_option(name: &str, key: &str, known: &'static str) -> NameError {
    NameError::UnknownOption { name: name.to_owned(), key: key.to_owned(), known }
}

fn bad_option(name: &str, key: &'static str, value: &str, usable: String) -> NameError {
    NameError::BadOption { name: name.to_owned(), key, value: value.to_owned(), usable }
}

#[cfg(test)]
mod tests;
