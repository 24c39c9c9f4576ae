//! Opens ports with taps around them, and finds their motors.

use std::sync::Arc;
use std::time::Duration;

use motorlink::port::{Carries, PortName};
use motorlink::rmd::MotorSet;
use motorlink_proto::st::{FullScale, MotorNumber, Profile};
use motorlink_telemetry::runner::Runner;
use motorlink_telemetry::search;
use motorlink_telemetry::share::drive_protocol::DriveProtocol;
use motorlink_telemetry::share::message::Protocol;
use motorlink_telemetry::share::port::place_of;
use motorlink_telemetry::share::port_config::{Limits, PortConfig, protocols_of};
use motorlink_telemetry::signal::Motor;

use super::abort::Abort;
use super::client::{Client, Lent};
use super::followed::LineOfShare;
use super::frames::Taps;
use super::track::Line;
use super::wall::Anchor;
use crate::error::RecordError;
use crate::schema::name;

/// A port to record.
#[derive(Debug, Clone)]
pub struct Port {
    /// Its name.
    pub name: PortName,
    /// The profile of ST drives.
    pub profile: Profile,
    /// How long a reply may take; `None`: as long as the client says.
    pub timeout: Option<Duration>,
    /// Motors of an ST drive. Empty: those that the drive has.
    pub motors: Vec<MotorNumber>,
    /// RMD motors. Empty: those that answer.
    pub ids: MotorSet,
    /// The current of digit 32767 of an ST drive. Without it joint states have no current.
    pub full_scale: Option<FullScale>,
}

/// A line whose engine runs.
pub(super) struct Opened {
    pub(super) runner: Runner,
    pub(super) line: Line,
    pub(super) anchor: Anchor,
    pub(super) taps: Taps,
    /// The client, if it is not the recording's own.
    pub(super) lent: Option<Lent>,
    /// The path of the share that holds the port, and its name of the line.
    pub(super) share: Option<LineOfShare>,
}

/// Opens all ports, and takes the clients. A port of both kinds gives a serial line and a CAN bus.
pub(super) fn open(
    ports: &[Port],
    clients: &[Client],
    by: &Arc<str>,
    abort: &Abort,
) -> Result<Vec<Opened>, RecordError> {
    let mut lines = Vec::new();
    for port in ports {
        lines.extend(protocols_of(&port.name).map(|protocol| (port, protocol)));
    }
    for (protocol, is_named) in [
        (Protocol::St, ports.iter().any(|port| !port.motors.is_empty())),
        (Protocol::Rmd, ports.iter().any(|port| !port.ids.is_empty())),
    ] {
        let has_port = lines.iter().any(|(_, it)| *it == protocol);
        let has_client = clients.iter().any(|it| it.speaks().protocol() == protocol);
        if is_named && !has_port && !has_client {
            return Err(RecordError::NoLine { protocol });
        }
    }
    let name = |(port, protocol): &(&Port, Protocol)| {
        if port.name.carries(Carries::Both) {
            protocol.word().to_owned()
        } else {
            port.name.to_string()
        }
    };
    let names = lines.iter().map(name);
    let names: Vec<String> = names.chain(clients.iter().map(|it| it.port.clone())).collect();
    let mut labels = name::labels(&names).into_iter();
    let mut opened = Vec::new();
    for ((port, protocol), label) in lines.into_iter().zip(labels.by_ref()) {
        opened.push(of_port(label, port, protocol, by, abort)?);
    }
    for (client, label) in clients.iter().zip(labels) {
        opened.push(of_client(label, client, by, abort)?);
    }
    Ok(opened)
}

fn of_port(
    label: String,
    port: &Port,
    protocol: Protocol,
    by: &Arc<str>,
    abort: &Abort,
) -> Result<Opened, RecordError> {
    abort.check()?;
    let mut opened = unsearched(label, port, protocol)?;
    let given: Vec<Motor> = match protocol {
        Protocol::St => port.motors.iter().copied().map(Motor::St).collect(),
        Protocol::Rmd => port.ids.map(Motor::Rmd).collect(),
    };
    let Line { port, speaks, .. } = &opened.line;
    opened.line.motors = found(&opened.runner, port, *speaks, &given, by, abort)?;
    Ok(opened)
}

/// A line of which no motor is known yet.
pub(super) fn unsearched(
    label: String,
    port: &Port,
    protocol: Protocol,
) -> Result<Opened, RecordError> {
    let taps = Taps::default();
    let (line, bus) = (taps.clone(), taps.clone());
    let around = (move |link| line.around_line(link), move |link| bus.around_bus(link));
    let (name, profile, timeout) = (port.name.clone(), port.profile, port.timeout);
    let config = PortConfig { port: name, profile, timeout, limits: Limits::default() };
    let (speaks, acquisition) = config.open_around(protocol, around)?;
    let anchor = Anchor::now(acquisition.clock());
    let full_scale = port.full_scale.filter(|_| protocol == Protocol::St);
    let (share, port) = (place_of(&port.name), port.name.to_string());
    let runner = Runner::start(&label, acquisition).map_err(RecordError::Thread)?;
    let line = Line { label, port, speaks, motors: Vec::new(), full_scale };
    Ok(Opened { runner, line, anchor, taps, lent: None, share })
}

fn of_client(
    label: String,
    client: &Client,
    by: &Arc<str>,
    abort: &Abort,
) -> Result<Opened, RecordError> {
    abort.check()?;
    let (taps, (acquisition, carrier)) = (Taps::default(), client.engine());
    let anchor = Anchor::now(acquisition.clock());
    let runner = Runner::start(&label, acquisition).map_err(RecordError::Thread)?;
    let lent = carrier.start(client, client.outlet.plug(&taps), runner.remote().clone());
    let lent = Some(lent.map_err(RecordError::Thread)?);
    let (port, speaks) = (client.port.clone(), client.speaks());
    let motors = found(&runner, &port, speaks, &client.motors, by, abort)?;
    let line = Line { label, port, speaks, motors, full_scale: None };
    Ok(Opened { runner, line, anchor, taps, lent, share: None })
}

/// The motors that are given, or those that answer.
fn found(
    runner: &Runner,
    port: &str,
    speaks: DriveProtocol,
    given: &[Motor],
    by: &Arc<str>,
    abort: &Abort,
) -> Result<Vec<Motor>, RecordError> {
    abort.engine(runner.remote());
    if !given.is_empty() {
        return Ok(given.to_vec());
    }
    let protocol = speaks.protocol();
    let none = |why| RecordError::NoMotor { port: port.to_owned(), protocol, why: Box::new(why) };
    let found = search::motors(runner.remote(), by, protocol);
    abort.check()?;
    found.map_err(none)
}
