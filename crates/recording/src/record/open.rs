//! Opens ports with taps around them, and finds their motors.

use std::sync::Arc;
use std::time::Duration;

use motorlink::port::PortName;
use motorlink::rmd::MotorSet;
use motorlink::{rmd, st};
use motorlink_proto::st::{MotorNumber, Profile};
use motorlink_telemetry::acquisition::Acquisition;
use motorlink_telemetry::line::{LineError, RmdLine, StLine};
use motorlink_telemetry::runner::Runner;
use motorlink_telemetry::search;
use motorlink_telemetry::share::message::Protocol;
use motorlink_telemetry::share::words::Speaks;
use motorlink_telemetry::signal::Motor;

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
}

/// A line whose engine runs.
pub(super) struct Opened {
    pub(super) runner: Runner,
    pub(super) line: Line,
    pub(super) anchor: Anchor,
    pub(super) taps: Taps,
}

/// Opens all ports. A port of both kinds gives a serial line and a CAN bus.
pub(super) fn open(ports: &[Port], by: &Arc<str>) -> Result<Vec<Opened>, RecordError> {
    let mut lines = Vec::new();
    for port in ports {
        lines.extend(port.name.as_line().map(|_| (port, Protocol::St)));
        lines.extend(port.name.as_can().map(|_| (port, Protocol::Rmd)));
    }
    let names: Vec<String> = lines.iter().map(|(port, _)| port.name.to_string()).collect();
    let labels = name::labels(&names).into_iter().zip(lines);
    labels.map(|(label, (port, protocol))| line(label, port, protocol, by)).collect()
}

fn line(
    label: String,
    port: &Port,
    protocol: Protocol,
    by: &Arc<str>,
) -> Result<Opened, RecordError> {
    let taps = Taps::default();
    let around = taps.clone();
    let (acquisition, speaks, given): (_, _, Vec<Motor>) = match protocol {
        Protocol::St => {
            let mut options = st::Options { profile: port.profile, ..Default::default() };
            options.timeout = port.timeout.unwrap_or(options.timeout);
            let wrap = move |link| around.around_line(link);
            let client = st::EventClient::open_wrapped(&port.name, wrap, options);
            let line = StLine::new(client.map_err(LineError::from)?);
            let given = port.motors.iter().copied().map(Motor::St).collect();
            (Acquisition::new(Box::new(line)), Speaks::St(port.profile), given)
        }
        Protocol::Rmd => {
            let mut options = rmd::Options::default();
            options.timeout = port.timeout.unwrap_or(options.timeout);
            let wrap = move |link| around.around_bus(link);
            let client = rmd::EventClient::open_wrapped(&port.name, wrap, options);
            let line = RmdLine::new(client.map_err(LineError::from)?);
            (Acquisition::new(Box::new(line)), Speaks::Rmd, port.ids.map(Motor::Rmd).collect())
        }
    };
    let anchor = Anchor::now(acquisition.clock());
    let port = port.name.to_string();

    let runner = Runner::start(&label, acquisition).map_err(RecordError::Thread)?;
    let motors = match given.is_empty() {
        true => search::motors(runner.remote(), by, protocol).map_err(|why| {
            RecordError::NoMotor { port: port.clone(), protocol, why: Box::new(why) }
        })?,
        false => given,
    };
    Ok(Opened { runner, line: Line { label, port, speaks, motors }, anchor, taps })
}
