//! What answers on a port that no line has.

use std::time::Duration;

use motorlink::port::{PortError, PortName};
use motorlink::rmd::{self, MotorSet};
use motorlink::st::{self, BAUD_RATES, SCAN_TIMEOUT};

use super::message::{Finding, Protocol};
use crate::line::LineError;

/// The rates that a port can choose, the most frequent of such drives first.
pub fn rates(port: &PortName, protocol: Protocol) -> Vec<u32> {
    match protocol {
        Protocol::St => {
            BAUD_RATES.into_iter().filter(|rate| port.at_baud(*rate).is_some()).collect()
        }
        Protocol::Rmd => port.as_can().map(|bus| bus.bitrates()).unwrap_or_default(),
    }
}

/// The rate of a port; `None` if it cannot choose one.
pub fn rate_of(port: &PortName, protocol: Protocol) -> Option<u32> {
    match protocol {
        Protocol::St => port.baud().filter(|rate| port.at_baud(*rate).is_some()),
        Protocol::Rmd => port.as_can()?.bitrate(),
    }
}

/// The port at another rate; `None` if it cannot choose this one.
pub fn at_rate(port: &PortName, protocol: Protocol, rate: u32) -> Option<PortName> {
    match protocol {
        Protocol::St => port.at_baud(rate),
        Protocol::Rmd => port.at_bitrate(rate),
    }
}

/// What answered on a port.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Found {
    /// One word.
    pub finding: Finding,
    /// The same in words.
    pub text: String,
    /// The IDs of the RMD motors that replied.
    pub motors: Vec<u8>,
}

impl Found {
    fn new(finding: Finding, text: impl ToString) -> Self {
        Found { finding, text: text.to_string(), motors: Vec::new() }
    }
}

impl From<&st::ScanResult> for Finding {
    fn from(result: &st::ScanResult) -> Self {
        match result {
            st::ScanResult::Drive(_) => Finding::Drive,
            st::ScanResult::Refuses(_) => Finding::Refuses,
            st::ScanResult::Garbage => Finding::Garbage,
            st::ScanResult::Echo => Finding::Echo,
            st::ScanResult::Silence => Finding::Silence,
        }
    }
}

/// Opens a port, asks what answers there at its rate, and closes it. Nothing that is sent moves a motor.
///
/// # Errors
/// What keeps the port from being opened.
pub fn scan(
    port: &PortName,
    protocol: Protocol,
    timeout: Option<Duration>,
) -> Result<Found, LineError> {
    match protocol {
        Protocol::St => scan_st(port, timeout.unwrap_or(SCAN_TIMEOUT)),
        Protocol::Rmd => scan_rmd(port, timeout),
    }
}

fn scan_st(port: &PortName, timeout: Duration) -> Result<Found, LineError> {
    match st::scan(port, timeout) {
        Ok(result) => Ok(Found::new((&result).into(), &result)),
        Err(st::Error::Port(error @ PortError::BaudRefused { .. })) => {
            Ok(Found::new(Finding::Impossible, error))
        }
        Err(error) => Err(error.into()),
    }
}

fn scan_rmd(port: &PortName, timeout: Option<Duration>) -> Result<Found, LineError> {
    let defaults = rmd::Options::default();
    let options = rmd::Options { timeout: timeout.unwrap_or(defaults.timeout), ..defaults };
    let bus = rmd::Client::open(port, options)?;
    let mut found = Vec::new();
    bus.scan(MotorSet::ALL, |motor| found.push(motor), |_| {})?;
    Ok(found_on_bus(&found, bus.trouble()))
}

/// What the motors of a bus are together.
fn found_on_bus(found: &[rmd::ScanResult], trouble: Option<&str>) -> Found {
    let (mut motors, mut others) = (Vec::new(), Vec::new());
    for one in found {
        match one {
            rmd::ScanResult::Motor(id, _) => motors.push(id.number()),
            rmd::ScanResult::Foreign(id, dialect) => {
                others.push(format!("motor {} speaks {dialect}", id.number()));
            }
            rmd::ScanResult::Shared(id) => {
                others.push(format!("motor {} answers another program, too", id.number()));
            }
            rmd::ScanResult::Echo(_) => {
                return Found::new(
                    Finding::Echo,
                    "each sent frame is received again; try the option echo=1 of the port",
                );
            }
        }
    }
    motors.sort_unstable();
    let ids = motors.iter().map(u8::to_string).collect::<Vec<_>>().join(", ");
    let own = match motors.as_slice() {
        [] => None,
        [_] => Some(format!("motor {ids}")),
        _ => Some(format!("motors {ids}")),
    };
    let finding = match (&own, others.is_empty()) {
        (Some(_), _) => Finding::Drive,
        (None, false) => Finding::Foreign,
        (None, true) => {
            let why = trouble.map(|trouble| format!("; {trouble}")).unwrap_or_default();
            return Found::new(Finding::Silence, format!("silence{why}"));
        }
    };
    let text = own.into_iter().chain(others).collect::<Vec<_>>().join("; ");
    Found { finding, text, motors }
}

#[cfg(test)]
mod tests {
    use motorlink::rmd::{Dialect, MotorId, ScanResult};

    use super::*;

    #[test]
    fn what_a_bus_has_is_one_finding() {
        let id = |id| MotorId::new(id).unwrap();
        let found = |all: &[ScanResult]| {
            let Found { finding, text, motors } = found_on_bus(all, None);
            (finding, text, motors)
        };
        assert_eq!(found(&[]), (Finding::Silence, "silence".to_owned(), vec![]));
        assert_eq!(found_on_bus(&[], Some("bus-off")).text, "silence; bus-off");
        let foreign = [ScanResult::Foreign(id(3), Dialect::V3), ScanResult::Shared(id(4))];
        let text = "motor 3 speaks V3/V4; motor 4 answers another program, too";
        assert_eq!(found(&foreign), (Finding::Foreign, text.to_owned(), vec![]));
        assert_eq!(found(&[ScanResult::Echo(id(1)), foreign[0]]).0, Finding::Echo);
    }
}
