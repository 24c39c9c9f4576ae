//! The known schemes, and the ports that their names open.

use std::str::FromStr;
use std::sync::{PoisonError, RwLock};

use super::carries::Carries;
use super::error::PortError;
use super::event::{EventBytes, EventCan};
use super::holder::HeldPort;
use super::link::{ByteLink, CanLink};
use super::name::{NameError, check_printable, unknown_form};
use super::scheme::{CanPort, Given, LinePort, PortName, Scheme, parse};
use super::schemes::BUILT_IN;

static REGISTERED: RwLock<Vec<&'static dyn Scheme>> = RwLock::new(Vec::new());

/// Registers a scheme in this process. It replaces a scheme of the same name, so it can be
/// registered twice.
pub fn register(scheme: &'static dyn Scheme) {
    let mut registered = REGISTERED.write().unwrap_or_else(PoisonError::into_inner);
    registered.retain(|other| other.name() != scheme.name());
    registered.push(scheme);
}

/// The known schemes.
pub fn schemes() -> Vec<&'static dyn Scheme> {
    let registered = REGISTERED.read().unwrap_or_else(PoisonError::into_inner);
    BUILT_IN.iter().chain(registered.iter()).copied().collect()
}

impl FromStr for PortName {
    type Err = NameError;

    fn from_str(name: &str) -> Result<Self, NameError> {
        check_printable(name)?;
        let schemes = schemes();
        let mut given = Given::new(name, &schemes);
        let body = given.body;
        match parse(body, &mut given) {
            Some((scheme, port)) => {
                let port = port?;
                given.refuse_others(scheme.options())?;
                Ok(port)
            }
            None if is_windows(name) => Err(NameError::Windows { name: name.to_owned() }),
            None => {
                let mut forms = format!("ports are {}", listed(&schemes, |_| true, "and"));
                if name.contains(':') && schemes.len() == BUILT_IN.len() {
                    forms += "; this program has registered no schemes of other crates, such as \
                        `sim:` of motorlink-testbench";
                }
                Err(unknown_form(name, nearest(name, &schemes), forms))
            }
        }
    }
}

impl PortName {
    /// Opens the port as a serial line.
    pub fn open_bytes(&self) -> Result<Box<dyn ByteLink>, PortError> {
        self.line()?.open()
    }

    /// Opens the port as a CAN bus.
    pub fn open_can(&self) -> Result<Box<dyn CanLink>, PortError> {
        self.can()?.open()
    }

    /// Opens the port as a serial line for an event loop. Opening itself may wait.
    pub fn open_event_bytes(&self) -> Result<Box<dyn EventBytes>, PortError> {
        self.line()?.open_event()
    }

    /// Opens the port as a CAN bus for an event loop. Opening itself may wait.
    pub fn open_event_can(&self) -> Result<Box<dyn EventCan>, PortError> {
        self.can()?.open_event()
    }

    /// The program that holds the port, if there is one.
    ///
    /// # Errors
    /// The port does not carry what is wanted.
    pub fn held(&self, wanted: Carries) -> Result<Option<&dyn HeldPort>, PortError> {
        match self.as_held() {
            Some(held) if !held.carries().serves(wanted) => Err(self.unusable(wanted)),
            held => Ok(held),
        }
    }

    fn line(&self) -> Result<&dyn LinePort, PortError> {
        self.as_line().ok_or_else(|| self.unusable(Carries::Bytes))
    }

    fn can(&self) -> Result<&dyn CanPort, PortError> {
        self.as_can().ok_or_else(|| self.unusable(Carries::Frames))
    }

    fn unusable(&self, carries: Carries) -> PortError {
        let usable = listed(&schemes(), |form| form.serves(carries), "or");
        let wanted = if carries == Carries::Bytes { "serial line" } else { "CAN bus" };
        PortError::WrongKind { port: self.to_string(), wanted, usable }
    }
}

/// The forms of all schemes that carry `wanted`.
fn listed(
    schemes: &[&'static dyn Scheme],
    is_wanted: impl Fn(Carries) -> bool,
    last: &str,
) -> String {
    let forms = schemes.iter().flat_map(|scheme| scheme.forms());
    let mut texts: Vec<&str> =
        forms.filter(|form| is_wanted(form.carries)).map(|form| form.text).collect();
    let end = texts.pop().unwrap_or_default();
    if texts.is_empty() { end.to_owned() } else { format!("{} {last} {end}", texts.join(", ")) }
}

/// Whether Windows names a serial port or a CAN adapter so.
fn is_windows(name: &str) -> bool {
    let name = name.to_ascii_uppercase();
    let number = name.strip_prefix("COM").map(|rest| rest.trim_end_matches(':'));
    number.is_some_and(|number| number.parse::<u8>().is_ok()) || name.starts_with("PCAN_")
}

/// The port whose name is most similar to `name`.
fn nearest(name: &str, schemes: &[&'static dyn Scheme]) -> Option<String> {
    let Some((scheme, rest)) = name.split_once(':') else {
        return (!name.is_empty()).then(|| match name {
            _ if schemes.iter().any(|scheme| scheme.name() == name) => format!("{name}:"),
            _ if name.contains("can") => format!("socketcan:{name}"),
            _ => format!("./{name}"),
        });
    };
    let meant = match scheme {
        "can" | "socket" => "socketcan",
        "sl" | "lawicel" | "slcand" | "slcan-pty" => "slcan",
        "tcp-listen" => "tcp",
        "unix-listen" => "unix",
        _ if rest.parse::<u16>().is_ok() => return Some(format!("tcp:{name}")),
        _ => "serial",
    };
    (!rest.is_empty()).then(|| format!("{meant}:{rest}"))
}

#[cfg(test)]
mod tests;
