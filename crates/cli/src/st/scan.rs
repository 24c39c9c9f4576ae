//! `motorlink st scan`

use std::time::Duration;

use motorlink::port::{Carries, PortName};
use motorlink::st::BAUD_RATES;
use motorlink_telemetry::share::message::{Finding, Protocol};
use motorlink_telemetry::share::scan::{Found, scan};

use crate::connection::Connection;
use crate::failure::Failure;
use crate::json::Line;
use crate::output::note;

pub fn run(
    connection: &Connection,
    port: &PortName,
    patience: Duration,
    rates: &[u32],
) -> Result<(), Failure> {
    if !port.carries(Carries::Bytes) || port.is_in_process() {
        return Err(Failure::usage(format!("`{port}` has no baud rate to scan")));
    }
    if connection.fault.is_some() {
        return Err(Failure::usage("a scan of baud rates cannot be used with --fault"));
    }
    let rates = if rates.is_empty() { &BAUD_RATES[..] } else { rates };
    let has_rate = port.at_baud(rates[0]).is_some();
    let rates = if has_rate { rates } else { &rates[..1] };
    if !has_rate {
        note(format!("note: {port} has no baud rate, so it is asked once"));
    }
    let output = connection.output();
    let bar = crate::output::progress(rates.len());
    let (mut is_found, mut echoes) = (false, false);
    for &rate in rates {
        let place = ScannedPort { port, rate: has_rate.then_some(rate) };
        if has_rate {
            bar.set_message(format!("{rate} baud"));
        }
        let at_rate = port.at_baud(rate).unwrap_or_else(|| port.clone());
        let found = scan(&at_rate, Protocol::St, Some(patience));
        let found = found.map_err(|error| Failure::from(&error))?;
        bar.inc(1);
        echoes |= found.finding == Finding::Echo;
        is_found |= matches!(found.finding, Finding::Drive | Finding::Refuses);
        bar.suspend(|| output.result(place.shown(&found.text), place.found(&found)))?;
    }
    bar.finish_and_clear();
    if is_found {
        return Ok(());
    }
    if echoes {
        return Err(Failure::link(format!(
            "no drive answered on {port}, and each sent byte is received again: the adapter or the wiring echoes"
        )));
    }
    Err(Failure::link(format!(
        "no drive answered on {port}; is it powered, are RX and TX crossed, does another program \
         hold the port?"
    )))
}

/// Where a drive is looked for.
struct ScannedPort<'a> {
    port: &'a PortName,
    /// `None` on a port without a baud rate.
    rate: Option<u32>,
}

impl ScannedPort<'_> {
    /// What was found, for people.
    fn shown(&self, text: &str) -> String {
        match self.rate {
            Some(rate) => format!("{rate:>8} baud  {text}"),
            None => text.to_owned(),
        }
    }

    /// What was found, for programs.
    fn found(&self, Found { finding, text, .. }: &Found) -> Line {
        let line = Line::about(&self.port.to_string(), None);
        let line = match self.rate {
            Some(rate) => line.with("baud", rate),
            None => line,
        };
        line.with("finding", finding.word()).with("text", text.as_str())
    }
}

#[cfg(test)]
mod tests {
    use serde_json::Value;

    use super::*;

    #[test]
    fn a_finding_has_its_rate_if_the_port_has_rates() {
        let port = "serial:/dev/ttyACM0".parse().unwrap();
        let at = |rate| ScannedPort { port: &port, rate };
        assert_eq!(at(Some(9600)).shown("silence"), "    9600 baud  silence");
        assert_eq!(at(None).shown("silence"), "silence");
        let silence =
            Found { finding: Finding::Silence, text: "silence".to_owned(), motors: vec![] };
        let baud = |rate| Value::from(at(rate).found(&silence)).get("baud").cloned();
        assert_eq!([baud(Some(9600)), baud(None)], [Some(9600.into()), None]);
    }
}
