//! CAN interfaces of Linux.

use std::path::Path;

use super::super::carries::Carries;
use super::super::error::PortError;
use super::super::event::EventCan;
use super::super::interface::{Interface, up_hint};
use super::super::link::CanLink;
use super::super::name::NameError;
use super::super::queued::QueuedCan;
use super::super::scheme::{CanPort, Form, Given, Port, PortInfo, PortName, Scheme};
use super::super::socketcan::SocketCanLink;
use super::super::system;
use crate::text::printable;

/// The kernel's hardware type of CAN interfaces.
const ARPHRD_CAN: &str = "280";

/// `socketcan:can0`.
pub(super) struct SocketCan;

impl Scheme for SocketCan {
    fn name(&self) -> &'static str {
        "socketcan"
    }

    fn forms(&self) -> &'static [Form] {
        const HELP: &str = "a CAN interface of Linux";
        &[Form { text: "socketcan:can0", help: HELP, carries: Carries::Frames }]
    }

    fn parse(&self, rest: &str, given: &mut Given<'_>) -> Result<PortName, NameError> {
        let interface = given.present(rest, "an interface", "socketcan:can0")?;
        Ok(PortName::new(CanInterface(interface.to_owned())))
    }

    fn list(&self, root: &Path) -> Vec<PortInfo> {
        let interfaces = system::names_in(&root.join("sys/class/net"));
        interfaces.iter().filter_map(|name| listed(root, name)).collect()
    }
}

/// A CAN interface by its name.
#[derive(Debug)]
struct CanInterface(String);

impl Port for CanInterface {
    fn body(&self) -> String {
        format!("socketcan:{}", self.0)
    }

    fn as_can(&self) -> Option<&dyn CanPort> {
        Some(self)
    }

    fn is_device(&self) -> bool {
        let root = Path::new("/");
        let is_there = system::names_in(&root.join("sys/class/net")).contains(&self.0);
        is_there && listed(root, &self.0).is_some()
    }
}

impl CanPort for CanInterface {
    fn open(&self) -> Result<Box<dyn CanLink>, PortError> {
        Ok(Box::new(SocketCanLink::open(&self.0)?))
    }

    fn open_event(&self) -> Result<Box<dyn EventCan>, PortError> {
        Ok(Box::new(QueuedCan::new(SocketCanLink::open(&self.0)?)))
    }

    fn is_paced(&self) -> bool {
        true
    }
}

/// The data of a network interface for a list of ports.
fn listed(root: &Path, name: &str) -> Option<PortInfo> {
    let class = root.join("sys/class/net").join(name);
    if system::read(&class.join("type"))? != ARPHRD_CAN {
        return None;
    }
    let sys = root.join("sys");
    let interface = Interface::read(name, &sys)?;
    let problem = match interface {
        Interface { is_up: false, .. } => Some(format!("down: {}", up_hint(name, &sys))),
        Interface { is_bus_off: true, .. } => Some(format!(
            "bus-off: check wiring, termination and bitrate, then \
             sudo ip link set {name} down && sudo ip link set {name} up"
        )),
        _ => None,
    };
    let device = class.join("device");
    let soft = (!interface.needs_bitrate).then(|| "virtual or serial CAN".to_owned());
    Some(PortInfo {
        name: printable(&format!("socketcan:{name}")),
        carries: Carries::Frames,
        description: system::description(&device).or(soft),
        stable_path: None,
        problem,
    })
}
