//! The engines of the ports, and the search for motors.

use std::collections::BTreeSet;
use std::sync::Arc;

use motorlink::rmd::MotorSet;
use motorlink::st::MotorNumber;
use motorlink_telemetry::acquisition::Acquisition;
use motorlink_telemetry::label::{distinct, last_part};
use motorlink_telemetry::runner::Runner;
use motorlink_telemetry::search::motors;
use motorlink_telemetry::share::message::Protocol;
use motorlink_telemetry::share::port_config::{Limits, PortConfig, protocols_of};
use motorlink_telemetry::signal::Motor;

use super::args::Args;
use crate::failure::Failure;

/// A port, its engine and its motors.
pub struct Opened {
    pub runner: Runner,
    /// The argument of -p.
    pub name: String,
    pub protocol: Protocol,
    pub motors: Vec<Motor>,
}

/// Opens a port and finds its motors. A port of both kinds gives a serial line and a CAN bus.
pub fn open(args: &Args, text: &str, by: &Arc<str>) -> Result<Vec<Opened>, Failure> {
    let (profile, timeout, limits) = (args.profile, args.timeout, Limits::default());
    let config = PortConfig { port: text.parse()?, profile, timeout, limits };
    let open = |protocol| {
        let given = match protocol {
            Protocol::St => {
                let numbers: BTreeSet<MotorNumber> = args.motor.iter().copied().collect();
                numbers.into_iter().map(Motor::St).collect()
            }
            Protocol::Rmd => {
                let ids: MotorSet = args.id.iter().copied().flatten().collect();
                ids.map(Motor::Rmd).collect()
            }
        };
        let opened = config.open_around(protocol, (|line| line, |bus| bus));
        let (_, engine) = opened.map_err(|why| Failure::from(&why))?;
        Opened::new(text, engine, protocol, given, by)
    };
    protocols_of(&config.port).map(open).collect()
}

impl Opened {
    /// With the given motors; if there are none, with those that reply.
    fn new(
        name: &str,
        engine: Acquisition,
        protocol: Protocol,
        given: Vec<Motor>,
        by: &Arc<str>,
    ) -> Result<Self, Failure> {
        // The name of a thread must not contain a zero byte.
        let thread: String = name.chars().filter(|c| c.is_ascii_graphic()).collect();
        let runner = Runner::start(&thread, engine)?;
        let motors = match given.is_empty() {
            true => motors(runner.remote(), by, protocol).map_err(|why| {
                let option = match protocol {
                    Protocol::St => "--motor 1",
                    Protocol::Rmd => "--id 1",
                };
                Failure::link(format!("no motor answers at {name}: {why}"))
                    .trying(format!("to watch for a motor that is off now, name it: {option}"))
            })?,
            false => given,
        };
        Ok(Opened { runner, name: name.to_owned(), protocol, motors })
    }
}

/// A short name for each port: the last part of its name. If two are equal, a number is added.
pub fn labels(names: &[String]) -> Vec<String> {
    let short = |end: &str, most: usize| end.chars().take(most).collect::<String>();
    let labels = names.iter().map(|name| short(last_part(name), LABEL));
    distinct(labels, |label, number| format!("{}~{number}", short(label, LABEL - 2)))
}

/// The longest short name, in characters.
const LABEL: usize = 7;

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ports_have_short_names_of_their_own() {
        let names = ["/dev/ttyACM0", "slcan:/tmp/can0", "tcp:10.0.0.7:5000", "unix:/a/can0?x=1"];
        let labels = labels(&names.map(str::to_owned));
        assert_eq!(labels, ["ttyACM0", "can0", "5000", "can0~2"]);
    }
}
