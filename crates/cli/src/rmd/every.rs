//! Commands that read with `--every`.

use std::time::Duration;

use motorlink::port::{EventCan, FaultCan, PortName, TapCan};
use motorlink::rmd::{Code, Error, EventClient, IDENTIFIERS, MotorId};
use motorlink_link::fault::Faults;
use motorlink_telemetry::line::RmdLine;
use motorlink_telemetry::rows::Absent;
use motorlink_telemetry::sample::Sample;
use motorlink_telemetry::signal::{Derived, Motor, Quantity, Signal, Source};

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
        |link| Box::new(TapCan::new(link, trace::frames())),
    )?;
    let client = EventClient::open_wrapped(port, around, options(motor, &units)?)?;
    let sources = sources(reads, units.raw);
    let signal = |&source| Signal { motor: Motor::Rmd(id), source };
    let port = port.to_string();
    let watch = Watch {
        line: Box::new(RmdLine::new(client)),
        signals: sources.iter().map(signal).collect(),
        output: connection.output(),
        object: Line::about(&port, Some(id.number())),
        shown: |values: &[Result<Sample, Absent>]| cells(&units, &sources, values),
        doubt: || Error::Unconfirmed { port: name_in_messages(&port), motor: id }.into(),
    };
    watch.run(every, repeat)
}

/// The quantities of these reads, and what is computed from them. The latter has no digits on the wire.
fn sources(reads: &[Code], raw: bool) -> Vec<Source> {
    let mut quantities: Vec<Quantity> = Vec::new();
    for quantity in reads.iter().flat_map(|read| Quantity::of_read(*read)) {
        if !quantities.contains(&quantity) {
            quantities.push(quantity);
        }
    }
    let is_known = |derived: &Derived| derived.sources().iter().all(|it| quantities.contains(it));
    let derived = Derived::all().filter(|derived| !raw && is_known(derived));
    quantities.iter().copied().map(Source::Quantity).chain(derived.map(Source::Derived)).collect()
}

fn cells(
    units: &RmdUnits,
    sources: &[Source],
    values: &[Result<Sample, Absent>],
) -> Result<Vec<Cell>, Failure> {
    let mut cells = Vec::new();
    for (source, value) in sources.iter().zip(values) {
        let sample = value.as_ref().map_err(|absent| match absent {
            Absent::Refused(why) => Failure::from(&**why),
            Absent::Implausible(why) => Failure::refused(why.to_string()),
        })?;
        match source {
            Source::Quantity(quantity) => {
                let ((_, field), name) = (quantity.read(), quantity.short_name());
                let row = units.field(field, sample.digits);
                cells.push(Row { name, ..row }.into());
                cells.extend(units.encoder_angle(field, sample.digits)?.map(Cell::from));
            }
            Source::Derived(derived) => {
                cells.push(Row::derived(*derived, sample.value).into());
            }
            Source::Register(_) => {}
        }
    }
    Ok(cells)
}
