//! The port `share:`: a line of a running share. Other schemes have lines of shares elsewhere.

mod bus;
mod connection;
mod place;
mod serial;

use std::any::Any;
use std::sync::Arc;

use motorlink::port::{
    self, ByteLink, CanLink, CanPort, Carries, EventBytes, EventCan, Form, Given, LinePort,
    NameError, Port, PortError, PortName, Scheme,
};

use super::address::{Address, Local};
use super::message::Protocol;
use bus::ShareBus;
use place::Place;
use serial::ShareLine;

/// Registers the port `share:` in this process.
pub fn register() {
    port::register(&Share);
}

/// Where the share is and the name of the line there, if the port is a line of a share.
pub fn place_of(port: &PortName) -> Option<(Arc<dyn Address>, String)> {
    let place: &Place = port.holder()?.downcast_ref()?;
    Some((Arc::clone(&place.at), place.line.clone()))
}

/// The port of a line of the share at an address. `None`: no line can have this name.
pub fn line_port(at: Arc<dyn Address>, line: &str) -> Option<PortName> {
    let protocol = [Protocol::St, Protocol::Rmd]
        .into_iter()
        .find(|protocol| line.starts_with(protocol.word()))?;
    Some(PortName::new(SharePort(Place { at, line: line.to_owned(), protocol })))
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

    fn parse(
        &self,
        rest: &str,
        given: &mut Given<'_>,
        _: &[&'static dyn Scheme],
    ) -> Result<PortName, NameError> {
        const EXAMPLE: &str = "share:./share/st0";
        let (path, line) = rest.rsplit_once('/').unwrap_or((rest, ""));
        given.present(path, "the path of the share's socket", EXAMPLE)?;
        line_port(Arc::new(Local(path.into())), line).ok_or_else(|| NameError::Incomplete {
            name: given.name.to_owned(),
            what: "the line behind the path: st0, st1, .. or rmd0, rmd1, ..",
            example: EXAMPLE,
        })
    }
}

/// A line of a share.
#[derive(Debug)]
struct SharePort(Place);

impl Port for SharePort {
    fn body(&self) -> String {
        self.0.name()
    }

    fn as_line(&self) -> Option<&dyn LinePort> {
        (self.0.protocol == Protocol::St).then_some(self)
    }

    fn as_can(&self) -> Option<&dyn CanPort> {
        (self.0.protocol == Protocol::Rmd).then_some(self)
    }

    fn holder(&self) -> Option<&dyn Any> {
        Some(&self.0)
    }
}

impl LinePort for SharePort {
    fn open(&self) -> Result<Box<dyn ByteLink>, PortError> {
        Ok(Box::new(ShareLine::open(&self.0)?))
    }

    fn open_event(&self) -> Result<Box<dyn EventBytes>, PortError> {
        Ok(Box::new(ShareLine::open(&self.0)?))
    }

    fn label(&self) -> String {
        self.name()
    }
}

impl CanPort for SharePort {
    fn open(&self) -> Result<Box<dyn CanLink>, PortError> {
        Ok(Box::new(ShareBus::open(&self.0)?))
    }

    fn open_event(&self) -> Result<Box<dyn EventCan>, PortError> {
        Ok(Box::new(ShareBus::open(&self.0)?))
    }

    fn is_paced(&self) -> bool {
        true
    }
}
