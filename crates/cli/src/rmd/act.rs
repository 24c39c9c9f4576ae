//! Commands that change something in a motor.

use motorlink::rmd::{
    Acceleration, Code, DpsPerSecond, EncoderOffset, Error, FullTurn, IqCommand, MotionStatus,
    MotorSet, Pid, Quantity, SetTorque4, SpeedLimit, SpinDirection, TurnCentiDegrees,
};

use super::args::{self, Act, MaxSpeed};
use super::session::Session;
use crate::failure::Failure;
use crate::output::{hex, parse_hex, report};

pub fn run(session: &Session, act: Act) -> Result<(), Failure> {
    let motor = session.motor()?;
    let id = motor.id();
    match act {
        Act::Pid { gains } => pid(session, &gains),
        Act::Acceleration { dps_per_second: None } => {
            let acceleration = motor.acceleration()?;
            session.show(&Acceleration { acceleration })
        }
        Act::Acceleration { dps_per_second: Some(limit) } => {
            let limit: DpsPerSecond = wanted(session, limit)?;
            motor.write_acceleration_ram(limit)?;
            session.done(format!("motor {id} accelerates with {limit} until power-off"))
        }
        Act::Encoder => session.show(&motor.encoder()?),
        Act::EncoderOffset { offset } => encoder_offset(session, offset),
        Act::Zero => {
            session.rom("setting the zero")?;
            let offset = motor.write_zero_rom()?;
            session.output.result(
                format!("motor {id} has its zero here (offset {offset}), effective after the next power cycle"),
                session.line(session.id).ok(true).values(&session.rows(&EncoderOffset { offset })),
            )
        }
        Act::Off => {
            motor.off()?;
            session.done(format!("motor {id} is off"))
        }
        Act::Stop => {
            motor.stop()?;
            session.done(format!("motor {id} is stopped; `run` resumes"))
        }
        Act::Run => {
            motor.run()?;
            session.done(format!("motor {id} resumes what `stop` stopped, if anything"))
        }
        Act::Torque { amps } => session.replied(&motor.set_torque(wanted(session, amps)?)?),
        Act::Speed { dps } => session.replied(&motor.set_speed(wanted(session, dps)?)?),
        Act::Position { degrees, most } => {
            let max_speed = max_speed(session, &most)?;
            session.replied(&motor.set_position(wanted(session, degrees)?, max_speed)?)
        }
        Act::SingleTurnPosition { degrees, direction, most, full_turn } => {
            let max_speed = max_speed(session, &most)?;
            session.replied(&turn(session, degrees, max_speed, direction, &full_turn)?)
        }
        Act::ClearErrors => {
            let status = motor.clear_errors()?;
            if status.errors.is_empty() {
                return session.replied(&status);
            }
            let failure = Failure::refused(format!(
                "motor {id} keeps its errors, their cause is still there: {}",
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

fn pid(session: &Session, gains: &[u8]) -> Result<(), Failure> {
    let motor = session.motor()?;
    if let &[position_kp, position_ki, speed_kp, speed_ki, torque_kp, torque_ki] = gains {
        let gains = Pid { position_kp, position_ki, speed_kp, speed_ki, torque_kp, torque_ki };
        if session.write_rom {
            motor.write_pid_rom(gains)?;
            return session.done(format!("motor {} has these gains for good", motor.id()));
        }
        motor.write_pid_ram(gains)?;
        return session.done(format!("motor {} has these gains until power-off", motor.id()));
    }
    session.show(&motor.pid()?)
}

fn encoder_offset(session: &Session, offset: u16) -> Result<(), Failure> {
    session.rom("setting the encoder offset")?;
    let motor = session.motor()?;
    let taken = motor.write_encoder_offset_rom(offset)?;
    if taken != offset {
        return Err(Failure::refused(format!(
            "motor {} took the offset {taken} instead of {offset}: its encoder is narrower",
            motor.id()
        )));
    }
    let text = format!("motor {} has the encoder offset {taken}", motor.id());
    let values = session.rows(&EncoderOffset { offset: taken });
    session.output.result(text, session.line(session.id).ok(true).values(&values))
}

fn max_speed(session: &Session, most: &MaxSpeed) -> Result<Option<SpeedLimit>, Failure> {
    most.max_speed.map(|speed| wanted(session, speed)).transpose()
}

fn turn(
    session: &Session,
    degrees: f64,
    max_speed: Option<SpeedLimit>,
    direction: SpinDirection,
    full_turn: &args::FullTurn,
) -> Result<MotionStatus, Failure> {
    let angle = wanted(session, degrees)?;
    let full_turn = match *full_turn {
        args::FullTurn { full_turn: true, .. } => FullTurn::Allowed,
        args::FullTurn { tolerance: None, .. } => FullTurn::default(),
        args::FullTurn { tolerance: Some(degrees), .. } => {
            FullTurn::Refused { tolerance: wanted(session, degrees)? }
        }
    };
    let moved = session.motor()?.set_single_turn_position(angle, direction, max_speed, full_turn);
    moved.map_err(|error| match error {
        Error::FullTurn { past: TurnCentiDegrees(0), .. } => {
            Failure::from(error).trying("`--full-turn` sends it all the same")
        }
        Error::FullTurn { .. } => Failure::from(error).trying(format!(
            "try `{}`, or `--full-turn` if it may be a full turn",
            direction.opposite()
        )),
        error => error.into(),
    })
}

fn set_torque4(session: &Session, amps: &[f64]) -> Result<(), Failure> {
    let mut torques = [IqCommand(0); 4];
    for (slot, &amps) in torques.iter_mut().zip(amps) {
        *slot = wanted(session, amps)?;
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
                let failure = Failure::from(error).about(&session.port, id);
                if session.output.json {
                    session.output.result("", object.failed(&failure))?;
                }
                failures.push(failure);
            }
            None => {}
        }
    }
    // A program has each in its results.
    while !session.output.json && failures.len() > 1 {
        report(&failures.remove(0));
    }
    failures.into_iter().next().map_or(Ok(()), Err)
}

fn raw(session: &Session, bytes: &[u8]) -> Result<(), Failure> {
    let mut request = [0; 8];
    let Some(room) = request.get_mut(..bytes.len()) else {
        return Err(Failure::usage(format!("a frame has 8 bytes, not {}", bytes.len())));
    };
    room.copy_from_slice(bytes);
    if Code::from(request[0]).info().is_some_and(|row| row.rom) {
        session.rom(&format!("{:#04x}", request[0]))?;
    }
    let reply = session.bus.raw(session.motor()?.id(), request)?;
    let data = hex(&reply);
    session.output.result(&data, session.line(session.id).ok(true).with("data", &*data))
}

/// A value in the physical unit, or with --raw in digits. What no frame of the protocol says is
/// refused, never cut.
fn wanted<Q: Quantity>(session: &Session, value: f64) -> Result<Q, Failure> {
    let wanted = if session.raw { Q::wanted_digits(value) } else { Q::wanted(value) };
    wanted.map_err(|error| Failure::usage(format!("{error}; nothing was sent")))
}
