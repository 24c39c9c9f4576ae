//! Commands that change something in a motor.

use motorlink::rmd::{
    Code, EncoderOffset, Error, FullTurn, IqCommand, MotionStatus, MotorSet, SetTorque4,
    SpeedLimit, SpinDirection, Target, TurnCentiDegrees,
};

use super::args::{self, Act, MaxSpeed};
use super::arrival;
use super::session::Session;
use super::settings;
use crate::failure::Failure;
use crate::output::{hex, parse_hex};

pub fn run(session: &Session, act: Act) -> Result<(), Failure> {
    let motor = session.motor()?;
    let id = motor.id();
    match act {
        Act::Pid { gains } => settings::pid(session, &gains),
        Act::Acceleration { dps_per_second } => settings::acceleration(session, dps_per_second),
        Act::Encoder => session.show(&motor.encoder()?),
        Act::EncoderOffset { offset } => settings::encoder_offset(session, offset),
        Act::Zero => {
            session.rom("setting the zero")?;
            let offset = motor.write_zero_rom()?;
            session.output.result(
                format!("motor {id} has its zero here (offset {offset}), effective after the next power cycle"),
                session.line(session.id).ok(true).values(&session.rows(&EncoderOffset { offset })),
            )
        }
        Act::Off { .. } => {
            motor.off()?;
            session.done(format!("motor {id} is off"))
        }
        Act::Stop { .. } => {
            motor.stop()?;
            session.done(format!("motor {id} is stopped; `run` resumes"))
        }
        Act::Run => {
            motor.run()?;
            session.done(format!("motor {id} resumes what `stop` stopped, if anything"))
        }
        Act::Torque { amps } => session.replied(&motor.set_torque(session.wanted(amps)?)?),
        Act::Speed { dps } => session.replied(&motor.set_speed(session.wanted(dps)?)?),
        Act::Position { degrees, most, wait } => {
            let (angle, max_speed) = (session.wanted(degrees)?, max_speed(session, &most)?);
            let command = || Ok(motor.set_position(angle, max_speed)?);
            arrival::command(session, command, Target::MultiTurn(angle), max_speed, &wait)
        }
        Act::SingleTurnPosition { degrees, direction, most, full_turn, wait } => {
            let (angle, max_speed) = (session.wanted(degrees)?, max_speed(session, &most)?);
            let command = || turn(session, angle, max_speed, direction, &full_turn);
            arrival::command(session, command, Target::SingleTurn(angle), max_speed, &wait)
        }
        Act::ClearErrors => {
            let status = motor.clear_errors()?;
            if status.errors.is_empty() {
                return session.replied(&status);
            }
            let failure = Failure::refused(format!(
                "motor {id} still has errors, because their cause is present: {}",
                status.errors
            ))
            .about(&session.port, session.id);
            let object = session.line(session.id).failed(&failure);
            session.output.rows(object, &session.rows(&status))?;
            Err(failure)
        }
        Act::Torque4 { amps } => set_torque4(session, &amps),
        Act::Raw { bytes } => raw(session, &parse_hex(&bytes)?),
    }
}

fn max_speed(session: &Session, most: &MaxSpeed) -> Result<Option<SpeedLimit>, Failure> {
    most.max_speed.map(|speed| session.wanted(speed)).transpose()
}

fn turn(
    session: &Session,
    angle: TurnCentiDegrees,
    max_speed: Option<SpeedLimit>,
    direction: SpinDirection,
    full_turn: &args::FullTurn,
) -> Result<MotionStatus, Failure> {
    let full_turn = match *full_turn {
        args::FullTurn { full_turn: true, .. } => FullTurn::Allowed,
        args::FullTurn { tolerance: None, .. } => FullTurn::default(),
        args::FullTurn { tolerance: Some(degrees), .. } => {
            FullTurn::Refused { tolerance: session.wanted(degrees)? }
        }
    };
    let moved = session.motor()?.set_single_turn_position(angle, direction, max_speed, full_turn);
    moved.map_err(|error| match error {
        Error::FullTurn { past: TurnCentiDegrees(0), .. } => {
            Failure::from(error).trying("add `--full-turn` to allow the move")
        }
        Error::FullTurn { .. } => Failure::from(error).trying(format!(
            "try `{}`, or add `--full-turn` to allow nearly a full turn",
            direction.opposite()
        )),
        error => error.into(),
    })
}

fn set_torque4(session: &Session, amps: &[f64]) -> Result<(), Failure> {
    let mut torques = [IqCommand(0); 4];
    for (slot, &amps) in torques.iter_mut().zip(amps) {
        *slot = session.wanted(amps)?;
    }
    let replies = session.bus.set_torque4(SetTorque4(torques), MotorSet::TORQUE4)?;
    let mut failures = Vec::new();
    for (reply, id) in replies.into_iter().zip(1..) {
        let object = session.line(id);
        match reply {
            Some(Ok(status)) => {
                let rows = session.rows(&status);
                let texts: Vec<&str> = rows.iter().map(|row| row.text.as_str()).collect();
                let text = format!("motor {id}  {}", texts.join("   "));
                session.output.result(text, object.ok(true).values(&rows))?;
            }
            Some(Err(error)) => {
                let id = error.motor().unwrap_or(session.motor()?.id());
                session.failed(id, error.into(), &mut failures)?;
            }
            None => {}
        }
    }
    session.output.report_all(failures)
}

fn raw(session: &Session, bytes: &[u8]) -> Result<(), Failure> {
    let mut request = [0; 8];
    let Some(room) = request.get_mut(..bytes.len()) else {
        return Err(Failure::usage(format!(
            "a frame has at most 8 bytes, and {} were given",
            bytes.len()
        )));
    };
    room.copy_from_slice(bytes);
    if Code::from(request[0]).info().is_some_and(|row| row.rom) {
        session.rom(&format!("{:#04x}", request[0]))?;
    }
    let reply = session.bus.raw(session.motor()?.id(), request)?;
    let data = hex(&reply);
    session.output.result(&data, session.line(session.id).ok(true).with("data", &*data))
}
