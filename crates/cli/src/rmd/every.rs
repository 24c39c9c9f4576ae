//! Commands that read with `--every`.

use std::time::Duration;

use motorlink::port::{EventCan, FaultCan, PortName, Tap};
use motorlink::rmd::{Code, Error, EventClient, IDENTIFIERS, MotorId};
use motorlink_link::fault::Faults;
use motorlink_telemetry::line::RmdLine;
use motorlink_telemetry::rows::Absent;
use motorlink_telemetry::sample::Sample;
use motorlink_telemetry::signal::{Motor, Quantity, Signal, Source};

use super::args::MotorArgs;
use super::session::{options, units};
use crate::connection::{Connection, name_in_messages};
use crate::failure::Failure;
use crate::json::{Cell, Line, RmdUnits, Row};
use crate::repeat::{Repeat, Watch};
use crate::trace;

/// The reads whose values `status` shows, in its order.
pub const STATUS: [Code; 5] = [
    Code::ReadStatus,
    Code::ReadMotionStatus,
    Code::ReadPhaseCurrents,
    Code::ReadMultiTurnAngle,
    Code::ReadSingleTurnAngle,
];
/// The reads whose values `angle` shows.
pub const ANGLE: [Code; 2] = [Code::ReadMultiTurnAngle, Code::ReadSingleTurnAngle];

/// Reads the values of these reads of a motor again and again.
pub fn watch(
    connection: &Connection,
    motor: &MotorArgs,
    port: &PortName,
    id: MotorId,
    reads: &[Code],
    (every, repeat): (Duration, &Repeat),
) -> Result<(), Failure> {
    let units = units(connection, motor)?;
    let around = connection.around::<Box<dyn EventCan>>(
        Faults::on_can,
        |link, faults| Box::new(FaultCan::new(link, faults, IDENTIFIERS)),
        |link| Box::new(Tap::frames(link, trace::frames())),
    )?;
    let client = EventClient::open_wrapped(port, around, options(motor, &units)?)?;
    let quantities = quantities(reads);
    let signal = |&quantity| Signal { motor: Motor::Rmd(id), source: Source::Quantity(quantity) };
    let port = port.to_string();
    let watch = Watch {
        line: Box::new(RmdLine::new(client)),
        signals: quantities.iter().map(signal).collect(),
        output: connection.output(),
        object: Line::about(&port, Some(id.number())),
        shown: |values: &[Result<Sample, Absent>]| cells(&units, &quantities, values),
        doubt: || Error::Unconfirmed { port: name_in_messages(&port), motor: id }.into(),
    };
    watch.run(every, repeat)
}

/// The quantities of these reads.
fn quantities(reads: &[Code]) -> Vec<Quantity> {
    let mut quantities: Vec<Quantity> = Vec::new();
    for quantity in reads.iter().flat_map(|read| Quantity::of_read(*read)) {
        if !quantities.contains(&quantity) {
            quantities.push(quantity);
        }
    }
    quantities
}

fn cells(
    units: &RmdUnits,
    quantities: &[Quantity],
    values: &[Result<Sample, Absent>],
) -> Result<Vec<Cell>, Failure> {
    let mut cells = Vec::new();
    for (quantity, value) in quantities.iter().zip(values) {
        let sample = value.as_ref().map_err(|absent| match absent {
            Absent::Refused(why) => Failure::from(&**why),
            Absent::Implausible(why) => Failure::refused(why.to_string()),
        })?;
        let ((_, field), name) = (quantity.read(), quantity.short_name());
        let row = units.field(field, sample.digits);
        cells.push(Row { name, ..row }.into());
        cells.extend(units.encoder_angle(field, sample.digits)?.map(Cell::from));
    }
    Ok(cells)
}
