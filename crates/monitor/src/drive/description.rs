//! What the drives of a line have.

use motorlink_proto::rmd::Errors;
use motorlink_proto::st::{Flags, Ramp, Status};
use motorlink_proto::units::{CentiDegrees, CentiDps, IqCommand, Quantity as _};
use motorlink_telemetry::overview;
use motorlink_telemetry::share::drive_protocol::DriveProtocol;
use motorlink_telemetry::share::drive_values;
use motorlink_telemetry::signal::{Motor, Source};

use super::commands::Command;
use crate::message::{Controlled, Description, Fault, Mode, State};

pub(super) fn describe(line: &str, speaks: DriveProtocol) -> Description {
    let motor = speaks.motor(1).expect("a line can have motor 1");
    let main = overview::Overview::of(motor);
    Description {
        line: line.to_owned(),
        protocol: speaks.protocol(),
        overview: main,
        registers: drive_values::all(speaks),
        commands: Command::all(speaks).iter().map(|command| command.described(motor)).collect(),
        modes: modes(motor, &main),
        states: states(motor),
        faults: faults(motor),
    }
}

/// What can be controlled.
pub(super) fn modes(motor: Motor, main: &overview::Overview) -> Vec<Controlled> {
    let controlled = |mode, measured: Source, unit: &str, most: f64| Controlled {
        mode,
        unit: unit.to_owned(),
        measured: measured.to_string(),
        most,
    };
    let of = |mode, measured, scale: motorlink_proto::units::Scale| {
        controlled(mode, measured, scale.symbol, scale.value(scale.most))
    };
    match motor {
        Motor::St(_) => vec![
            controlled(Mode::Speed, main.speed, main.speed.unit(), Ramp::MAX_SPEED_RPM.into()),
            controlled(Mode::Torque, main.current, main.current.unit(), i16::MAX.into()),
        ],
        Motor::Rmd(_) => {
            let speed = of(Mode::Speed, main.speed, CentiDps::UNIT);
            let torque = of(Mode::Torque, main.current, IqCommand::UNIT);
            let angle = main.angle.map(|angle| of(Mode::Position, angle, CentiDegrees::UNIT));
            [Some(speed), Some(torque), angle].into_iter().flatten().collect()
        }
    }
}

fn states(motor: Motor) -> Vec<State> {
    let state = |status: &Status| State {
        value: status.number().into(),
        name: status.to_string(),
        doc: status.doc().to_owned(),
    };
    match motor {
        Motor::St(_) => Status::ALL.iter().map(state).collect(),
        Motor::Rmd(_) => Vec::new(),
    }
}

fn faults(motor: Motor) -> Vec<Fault> {
    let fault = |bit, name: &str, doc: &str, advice: Option<&str>, present| Fault {
        bit,
        name: name.to_owned(),
        doc: doc.to_owned(),
        advice: advice.unwrap_or_default().to_owned(),
        present,
    };
    match motor {
        Motor::St(_) => {
            let half = |present: bool| {
                Flags::NAMES.iter().map(move |&(mask, name, doc)| {
                    let (occurred, now) = if present { (0, mask) } else { (mask, 0) };
                    let bit = Flags::new(occurred, now).0.trailing_zeros();
                    fault(bit, name, doc, Flags::advice(mask), present)
                })
            };
            half(false).chain(half(true)).collect()
        }
        Motor::Rmd(_) => {
            let one = |&(error, name, doc): &(Errors, &str, &str)| {
                fault(error.0.trailing_zeros(), name, doc, error.advice(), true)
            };
            Errors::NAMES.iter().map(one).collect()
        }
    }
}
