//! The port `share:`: a line of a running share. Other schemes have lines of shares elsewhere.
//!
//! A request that the share did not carry out is [`PortError::NotDone`], which does not close the port: the
//! share would stop the motors of the client.

mod connection;
mod line_address;
mod pulse;

use std::any::Any;
use std::sync::Arc;
use std::time::Duration;

use motorlink::port::{
    self, Carries, Form, Given, HeldPort, Holder, NameError, Port, PortError, PortName, Scheme,
};

use super::address::{Address, Local};
use super::message::{LONGEST_DEADLINE, Protocol, SHORTEST_DEADLINE};
use connection::Connection;
pub use connection::own_name;
use line_address::{Deadlines, LineAddress};

/// Registers the port `share:` in this process.
pub fn register() {
    port::register(&Share);
}

/// Where the share is and the name of the line there, if the port is a line of a share.
pub fn place_of(port: &PortName) -> Option<(Arc<dyn Address>, String)> {
    let place: &LineAddress = port.as_held()?.as_any().downcast_ref()?;
    Some((Arc::clone(&place.at), place.line.clone()))
}

/// How long a program may be silent by default.
const SILENCE: Duration = Duration::from_secs(2);

/// The port of a line of the share at an address. `None`: no line can have this name.
pub fn line_port(at: Arc<dyn Address>, line: &str) -> Option<PortName> {
    named_port(at, (Deadlines::default(), String::new()), line)
}

fn named_port(
    at: Arc<dyn Address>,
    (deadlines, options): (Deadlines, String),
    line: &str,
) -> Option<PortName> {
    let protocol = [Protocol::St, Protocol::Rmd]
        .into_iter()
        .find(|protocol| line.starts_with(protocol.word()))?;
    let line = line.to_owned();
    Some(PortName::new(SharePort(LineAddress { at, deadlines, line, protocol, options })))
}

/// `share:PATH/LINE`.
struct Share;

impl Scheme for Share {
    fn name(&self) -> &'static str {
        "share"
    }

    fn forms(&self) -> &'static [Form] {
        &[Form {
            text: "share:PATH/LINE",
            help: "a line of a running share",
            carries: Carries::Both,
        }]
    }

    fn options(&self) -> &'static [&'static str] {
        &["deadline", "motion"]
    }

    fn parse(&self, rest: &str, given: &mut Given<'_>) -> Result<PortName, NameError> {
        const EXAMPLE: &str = "share:./share/st0";
        let (path, line) = rest.rsplit_once('/').unwrap_or((rest, ""));
        given.present(path, "the path of the share's socket", EXAMPLE)?;
        let [of_silence, of_motion] = ["deadline", "motion"].map(|option| given.take(option));
        let silence = match of_silence {
            None => Some(SILENCE),
            Some("none") => None,
            Some(text) => Some(deadline(given, "deadline", text)?),
        };
        let motion = of_motion.map(|text| deadline(given, "motion", text)).transpose()?;
        let said = [("deadline", of_silence), ("motion", of_motion)];
        let said =
            said.into_iter().filter_map(|(option, text)| Some(format!("{option}={}", text?)));
        let said: Vec<String> = said.collect();
        let mark = if said.is_empty() { "" } else { "?" };
        let options = format!("{mark}{}", said.join("&"));
        let at = Arc::new(Local(path.into()));
        named_port(at, (Deadlines { silence, motion }, options), line).ok_or_else(|| {
            NameError::Incomplete {
                name: given.name.to_owned(),
                what: "the line behind the path: st0, st1, .. or rmd0, rmd1, ..",
                example: EXAMPLE,
            }
        })
    }
}

/// A deadline of an option, such as `200ms`.
///
/// # Errors
/// It is none.
pub fn deadline_of(
    given: &mut Given<'_>,
    option: &'static str,
) -> Result<Option<Duration>, NameError> {
    given.take(option).map(|text| deadline(given, option, text)).transpose()
}

fn deadline(given: &Given<'_>, option: &'static str, text: &str) -> Result<Duration, NameError> {
    let seconds = match (text.strip_suffix("ms"), text.strip_suffix('s')) {
        (Some(number), _) => number.parse::<f64>().ok().map(|it| it / 1e3),
        (None, Some(number)) => number.parse().ok(),
        (None, None) => None,
    };
    match seconds.filter(|it| (SHORTEST_DEADLINE..=LONGEST_DEADLINE).contains(it)) {
        Some(seconds) => Ok(Duration::from_secs_f64(seconds)),
        None => {
            let what = format!("{} ms to {LONGEST_DEADLINE} s", SHORTEST_DEADLINE * 1e3);
            Err(given.bad_option(option, text, what))
        }
    }
}

/// A line of a share.
#[derive(Debug)]
struct SharePort(LineAddress);

impl Port for SharePort {
    fn body(&self) -> String {
        self.0.name()
    }

    fn as_held(&self) -> Option<&dyn HeldPort> {
        Some(self)
    }
}

impl HeldPort for SharePort {
    fn carries(&self) -> Carries {
        match self.0.protocol {
            Protocol::St => Carries::Bytes,
            Protocol::Rmd => Carries::Frames,
        }
    }

    fn open(&self) -> Result<Box<dyn Holder>, PortError> {
        Ok(Box::new(Connection::open(&self.0)?))
    }

    fn as_any(&self) -> &dyn Any {
        &self.0
    }
}
