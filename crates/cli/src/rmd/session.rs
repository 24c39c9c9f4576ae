//! An open bus, for all commands.

use motorlink::port::{CanLink, FaultCan, PortName, Tap};
use motorlink::rmd::{
    Client, IDENTIFIERS, Limits, MotionStatus, Motor, MotorId, Options, Payload, Quantity,
};
use motorlink_link::fault::Faults;

use super::args::MotorArgs;
use crate::advice;
use crate::connection::Connection;
use crate::failure::Failure;
use crate::json::{Line, RmdUnits, Row};
use crate::output::Printer;
use crate::trace;

/// An open bus, the selected motor, and how its values are shown.
pub struct Session {
    pub bus: Client,
    pub id: u8,
    pub output: Printer,
    pub units: RmdUnits,
    pub write_rom: bool,
    pub port: String,
}

pub fn connect(
    connection: &Connection,
    motor: &MotorArgs,
    port: &PortName,
) -> Result<Session, Failure> {
    let units = units(connection, motor)?;
    let around = connection.around::<Box<dyn CanLink>>(
        Faults::on_can,
        |link, faults| Box::new(FaultCan::new(link, faults, IDENTIFIERS)),
        |link| Box::new(Tap::frames(link, trace::frames())),
    )?;
    let bus = Client::open_wrapped(port, around, options(motor, &units)?)?;
    let output = connection.output();
    let id = motor.ids().map(MotorId::number).next().unwrap_or(1);
    let (write_rom, port) = (motor.write_rom, port.to_string());
    Ok(Session { bus, id, output, units, write_rom, port })
}

/// The options of a client.
pub fn options(motor: &MotorArgs, units: &RmdUnits) -> Result<Options, Failure> {
    let limits = limits(motor, units)?;
    Ok(Options { timeout: motor.timeout, limits, ..Options::default() })
}

/// --raw and an option that converts values contradict each other.
pub fn units(connection: &Connection, motor: &MotorArgs) -> Result<RmdUnits, Failure> {
    let MotorArgs { gear_ratio: gear, encoder_bits, .. } = *motor;
    let option = match (gear, encoder_bits) {
        (Some(_), _) => "--gear-ratio",
        (None, Some(_)) => "--encoder-bits",
        (None, None) => return Ok(RmdUnits { raw: connection.raw, ..RmdUnits::default() }),
    };
    if connection.raw {
        return Err(Failure::usage(format!(
            "--raw has the values of the protocol, and {option} converts them; nothing was sent"
        ))
        .trying("leave one out"));
    }
    Ok(RmdUnits { raw: false, gear, encoder_bits })
}

fn limits(motor: &MotorArgs, units: &RmdUnits) -> Result<Limits, Failure> {
    Ok(Limits {
        speed: motor.speed_limit.map(|dps| limit(dps, units, "--speed-limit")).transpose()?,
        current: motor
            .current_limit
            .map(|amps| limit(amps, units, "--current-limit"))
            .transpose()?,
        angle: None,
    })
}

fn limit<Q: Quantity>(value: f64, units: &RmdUnits, option: &str) -> Result<Q, Failure> {
    units.wanted(value).map_err(|failure| failure.with_fact(option))
}

impl Session {
    /// Makes sure that replies came to their own requests.
    pub fn confirm(&self) -> Result<(), Failure> {
        Ok(self.bus.confirm(self.motor()?.id())?)
    }

    /// The first members of a JSON result.
    pub fn line(&self, id: u8) -> Line {
        Line::about(&self.port, Some(id))
    }

    /// Prints the result.
    pub fn done(&self, text: impl std::fmt::Display) -> Result<(), Failure> {
        self.output.result(text, self.line(self.id).ok(true))
    }

    /// Prints the result, with the values of the reply.
    pub fn replied<P: Payload>(&self, reply: &P) -> Result<(), Failure> {
        let rows =
            self.rows(reply).map_err(|failure| failure.then("the motor took the command"))?;
        self.output.rows(self.line(self.id).ok(true), &rows)
    }

    /// Fails if the motor has an error. With one it answers motion commands and is off (docs/SPEC-NOTES.md
    /// R18).
    pub fn check_errors(&self, id: MotorId) -> Result<(), Failure> {
        let status = self.bus.motor(id.number())?.status().map_err(|error| {
            Failure::from(error).with_fact("the motor took the command, and its errors are unknown")
        })?;
        if status.errors.is_empty() {
            return Ok(());
        }
        let (errors, volts) = (status.errors, self.units.shown(status.voltage));
        Err(Failure::refused(format!(
            "motor {id} answered and does not turn: it reports {errors} (supply {volts}, {})",
            self.units.shown(status.temperature)
        ))
        .trying(advice::CLEAR_AND_REPEAT))
    }

    /// Prints what the motor was commanded to do, and the state that it replied with. Fails as
    /// [`check_errors`](Self::check_errors).
    pub fn commanded(&self, what: String, status: &MotionStatus) -> Result<(), Failure> {
        self.check_errors(self.motor()?.id())?;
        if !self.output.json {
            let text = format!("motor {} {what}; its state at the reply:", self.id);
            self.output.result(text, self.line(self.id))?;
        }
        self.replied(status)
    }

    /// A failure of a motion command, if the command was sent.
    pub fn of_motion(&self, failure: Failure, id: u8) -> Failure {
        let is_sent = self.bus.moving().any(|moving| moving.number() == id);
        if !is_sent {
            return failure;
        }
        failure.of_motion(format_args!("motor {id}"), &format!("motorlink rmd --id {id} stop"))
    }

    /// Shows the values of a reply once it is confirmed.
    pub fn show<P: Payload>(&self, reply: &P) -> Result<(), Failure> {
        self.confirm()?;
        self.output.rows(self.line(self.id), &self.rows(reply)?)
    }

    /// The values of a message, as the command table has them, with the angle of encoder counts behind
    /// them.
    pub fn rows<P: Payload>(&self, message: &P) -> Result<Vec<Row>, Failure> {
        let data = message.encode_as(0);
        let mut rows = Vec::new();
        for field in P::FIELDS {
            rows.push(self.units.field(field, field.raw(&data)));
            rows.extend(self.units.encoder_angle(field, field.raw(&data))?);
        }
        Ok(rows)
    }

    /// Refuses an angle within the turn of the motor shaft: the output shaft has it several times.
    pub fn wants_no_gear(&self) -> Result<(), Failure> {
        match self.units.gear {
            Some(gear) if gear.ratio() != 1.0 => Err(Failure::usage(
                "the angle of this command is within one turn of the motor shaft, so the angle of the \
                 output shaft is not determined; nothing was sent",
            )
            .trying("use `position`; or leave out --gear-ratio and give the angle of the motor shaft")),
            _ => Ok(()),
        }
    }

    /// A failure of a motor. The library has angles and speeds of the motor shaft.
    pub fn at_motor_shaft(&self, failure: Failure) -> Failure {
        match self.units.gear {
            Some(gear) => failure.at_motor_shaft(gear.ratio()),
            None => failure,
        }
    }

    /// Keeps the failure of one of several motors; a program has it in its results.
    pub fn failed(
        &self,
        id: MotorId,
        failure: Failure,
        failures: &mut Vec<Failure>,
    ) -> Result<(), Failure> {
        let failure = self.at_motor_shaft(failure).about(&self.port, id.number());
        if self.output.json {
            self.output.result("", self.line(id.number()).failed(&failure))?;
        }
        failures.push(failure);
        Ok(())
    }

    pub fn motor(&self) -> Result<Motor<'_>, Failure> {
        Ok(self.bus.motor(self.id)?)
    }

    /// A write to the ROM needs --write-rom.
    pub fn rom(&self, what: &str) -> Result<(), Failure> {
        if self.write_rom {
            return Ok(());
        }
        Err(Failure::usage(format!(
            "{what} writes to the ROM of the motor, and each write wears the ROM"
        ))
        .trying("add --write-rom to allow it"))
    }
}
