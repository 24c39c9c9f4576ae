//! Commands that read with `--every`.

use std::time::Duration;

use motorlink::port::{EventBytes, FaultBytes, PortName, Tap};
use motorlink::st::{Error, EventClient, Profile, RegisterId};
use motorlink_link::fault::Faults;
use motorlink_telemetry::line::{LineError, StLine};
use motorlink_telemetry::rows::Absent;
use motorlink_telemetry::sample::Sample;
use motorlink_telemetry::signal::{Motor, Signal, Source};

use super::args::DriveArgs;
use super::read::SEGMENTS;
use super::refusal;
use super::session::{View, options};
use crate::connection::{Connection, name_in_messages};
use crate::failure::Failure;
use crate::json::Cell;
use crate::repeat::{Repeat, Watch};
use crate::trace;

/// Reads registers of a drive again and again, with `segment` in this data segment.
pub fn watch(
    connection: &Connection,
    drive: &DriveArgs,
    port: &PortName,
    registers: &[RegisterId],
    segment: Option<u8>,
    (every, repeat): (Duration, &Repeat),
) -> Result<(), Failure> {
    let view = View::new(connection, drive, port)?;
    if segment.is_some() {
        view.wants(Profile::Spec, SEGMENTS)?;
    }
    let profile = drive.profile;
    let around = connection.around::<Box<dyn EventBytes>>(
        Faults::on_serial,
        |link, faults| Box::new(FaultBytes::new(link, faults)),
        move |link| Box::new(Tap::bytes(link, trace::bytes(profile))),
    )?;
    let line = StLine::new(EventClient::open_wrapped(port, around, options(drive))?);
    let line = match segment {
        Some(segment) => line.using_segments(&[segment]),
        None => line,
    };
    let motor = Motor::St(drive.motor);
    let signal = |&register| Signal { motor, source: Source::Register(register) };
    let watch = Watch {
        line: Box::new(line),
        signals: registers.iter().map(signal).collect(),
        output: view.output,
        object: view.line(),
        shown: |values: &[Result<Sample, Absent>]| {
            registers.iter().zip(values).map(|(it, value)| cell(&view, *it, value)).collect()
        },
        doubt: || Error::Unconfirmed { port: name_in_messages(&view.port), why: None }.into(),
    };
    watch.run(every, repeat)
}

fn cell(
    view: &View,
    register: RegisterId,
    value: &Result<Sample, Absent>,
) -> Result<Cell, Failure> {
    match value {
        // All registers have 32 bits at most.
        Ok(sample) => Ok(view.cell(register, sample.digits as i32)),
        Err(Absent::Implausible(why)) => Ok(view.cell(register, why.read.bits)),
        Err(Absent::Refused(why)) => match &**why {
            LineError::St(error) if refusal::is_about_register(error) => {
                let failure = refusal::of_read(error.clone(), register, view.profile);
                Ok(Cell { name: register.to_string(), read: Err(view.about(failure)) })
            }
            other => Err(other.into()),
        },
    }
}
