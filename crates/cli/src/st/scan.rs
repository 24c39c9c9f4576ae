//! `motorlink st scan`

use std::time::Duration;

use indicatif::ProgressBar;
use motorlink::port::{PortError, PortName};
use motorlink::st::{BAUD_RATES, Error, ScanResult, scan_baud};

use crate::connection::Connection;
use crate::failure::Failure;
use crate::json::Line;
use crate::output::{Printer, note};

pub fn run(
    connection: &Connection,
    port: &PortName,
    patience: Duration,
    rates: &[u32],
) -> Result<(), Failure> {
    if port.as_line().is_none() || port.is_in_process() {
        return Err(Failure::usage(format!("`{port}` has no baud rate to scan")));
    }
    if connection.fault.is_some() {
        return Err(Failure::usage("a scan of baud rates cannot be used with --fault"));
    }
    let rates = if rates.is_empty() { &BAUD_RATES[..] } else { rates };
    let rates = match port.at_baud(rates[0]) {
        Some(_) => rates,
        None => {
            note(format!("note: {port} has no baud rate, so it is asked once"));
            &rates[..1]
        }
    };
    let output = connection.output();
    let bar = crate::output::progress(rates.len());
    let (mut is_found, mut echoes) = (false, false);
    for &rate in rates {
        bar.set_message(format!("{rate} baud"));
        let finding = scan_baud(port, rate, patience);
        bar.inc(1);
        if let Err(Error::Port(error @ PortError::BaudRefused { .. })) = &finding {
            bar.suspend(|| {
                let text = format!("{rate:>8} baud  not possible on this port");
                output.result(text, found(port, rate, "impossible", &error.to_string()))
            })?;
            continue;
        }
        let finding = finding?;
        echoes |= matches!(finding, ScanResult::Echo);
        is_found |= matches!(finding, ScanResult::Drive(_) | ScanResult::Refuses(_));
        report(&bar, output, port, rate, &finding)?;
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

fn report(
    bar: &ProgressBar,
    output: Printer,
    port: &PortName,
    rate: u32,
    finding: &ScanResult,
) -> Result<(), Failure> {
    let (word, text) = match finding {
        ScanResult::Drive(info) => {
            let [major, minor, patch] = info.version;
            ("drive", format!("{} {major}.{minor}.{patch}", info.name))
        }
        ScanResult::Refuses(code) => ("refuses", format!("a drive that answers {code}")),
        ScanResult::Garbage => {
            ("garbage", "bytes that are no reply: is it another rate?".to_owned())
        }
        ScanResult::Echo => ("echo", "each sent byte is received again".to_owned()),
        ScanResult::Silence => ("silence", "silence".to_owned()),
    };
    bar.suspend(|| output.result(format!("{rate:>8} baud  {text}"), found(port, rate, word, &text)))
}

/// What was found at a rate, for programs.
fn found(port: &PortName, rate: u32, finding: &str, text: &str) -> Line {
    let line = Line::about(&port.to_string(), None).with("baud", rate);
    line.with("finding", finding).with("text", text)
}
