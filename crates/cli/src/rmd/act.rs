//! Commands that change something in a motor.

use motorlink::rmd::{
    CentiDegrees, CentiDps, Code, DpsPerSecond, Error, FullTurn, IqCommand, MotionStatus, MotorSet,
    Pid, SetTorque, SetTorque4, SpeedLimit, SpinDirection, TurnCentiDegrees, inward,
};
use serde_json::{Map, Value, json};

use super::args::{self, Act, Direction};
use super::read::{motion, status1, value};
use super::session::Session;
use crate::failure::Failure;
use crate::output::{hex, line, parse_hex};

pub fn run(session: &Session, act: Act) -> Result<(), Failure> {
    let motor = session.motor()?;
    let id = motor.id();
    let output = session.output;
    match act {
        Act::Pid { gains } => pid(session, &gains),
        Act::Accel { dps_per_second: None } => {
            let limit = motor.acceleration()?;
            session.confirmed()?.rows(&[value(
                session,
                "acceleration",
                limit.0.into(),
                limit.dps_per_second(),
                0,
                "°/s²",
            )])
        }
        Act::Accel { dps_per_second: Some(limit) } => {
            motor.write_acceleration_ram(DpsPerSecond(limit))?;
            output.done(format!("motor {id} accelerates with {limit} °/s² until power-off"))
        }
        Act::Encoder { offset } => encoder(session, offset),
        Act::Zero => {
            session.rom("setting the zero")?;
            let offset = motor.write_zero_rom()?;
            output.result(
                format!("motor {id} has its zero here from the next power-on on (offset {offset})"),
                json!({ "ok": true, "offset": offset }),
            )
        }
        Act::Off => {
            motor.off()?;
            output.done(format!("motor {id} is off"))
        }
        Act::Stop => {
            motor.stop()?;
            output.done(format!("motor {id} is stopped; `run` resumes"))
        }
        Act::Run => {
            motor.run()?;
            output.done(format!("motor {id} resumes what `stop` stopped, if anything"))
        }
        Act::Torque { amps } => {
            let torque = torque(session, amps)?;
            output.rows(&motion(session, &motor.set_torque(torque)?))
        }
        Act::Speed { dps } => {
            let speed = CentiDps(digits(session, dps, CentiDps::SCALE, "°/s")?);
            output.rows(&motion(session, &motor.set_speed(speed)?))
        }
        Act::Move { degrees, max_speed, direction: None, .. } => {
            let angle = CentiDegrees(digits(session, degrees, CentiDegrees::SCALE, "°")?);
            let status = motor.set_position(angle, greatest_speed(session, max_speed)?)?;
            output.rows(&motion(session, &status))
        }
        Act::Move { degrees, max_speed, direction: Some(direction), full_turn } => {
            let max_speed = greatest_speed(session, max_speed)?;
            let status = turn(session, degrees, max_speed, direction, &full_turn)?;
            output.rows(&motion(session, &status))
        }
        Act::ClearError => {
            let status = motor.clear_errors()?;
            output.rows(&status1(session, &status))?;
            if status.errors.is_empty() {
                return Ok(());
            }
            Err(Failure::Refused(format!(
                "motor {id} keeps its errors, their cause is still there: {}",
                status.errors
            )))
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
            return session.output.done(format!("motor {} has these gains for good", motor.id()));
        }
        motor.write_pid_ram(gains)?;
        return session
            .output
            .done(format!("motor {} has these gains until power-off", motor.id()));
    }
    let gains = motor.pid()?;
    let row = |name, gain: u8| (name, gain.to_string(), json!(gain));
    session.confirmed()?.rows(&[
        row("position_kp", gains.position_kp),
        row("position_ki", gains.position_ki),
        row("speed_kp", gains.speed_kp),
        row("speed_ki", gains.speed_ki),
        row("torque_kp", gains.torque_kp),
        row("torque_ki", gains.torque_ki),
    ])
}

fn encoder(session: &Session, offset: Option<u16>) -> Result<(), Failure> {
    let motor = session.motor()?;
    if let Some(offset) = offset {
        session.rom("setting the encoder offset")?;
        let taken = motor.write_encoder_offset_rom(offset)?;
        if taken != offset {
            return Err(Failure::Refused(format!(
                "motor {} took the offset {taken} instead of {offset}: its encoder is narrower",
                motor.id()
            )));
        }
        let text = format!("motor {} has the encoder offset {taken}", motor.id());
        return session.output.result(text, json!({ "ok": true, "offset": taken }));
    }
    let encoder = motor.encoder()?;
    let row = |name, counts: u16| (name, counts.to_string(), json!(counts));
    session.confirmed()?.rows(&[
        row("position", encoder.position),
        row("original", encoder.raw),
        row("offset", encoder.offset),
    ])
}

fn turn(
    session: &Session,
    degrees: f64,
    max_speed: Option<SpeedLimit>,
    direction: Direction,
    full_turn: &args::FullTurn,
) -> Result<MotionStatus, Failure> {
    let angle = TurnCentiDegrees(digits(session, degrees, TurnCentiDegrees::SCALE, "°")?);
    let (spin, other) = match direction {
        Direction::Cw => (SpinDirection::Clockwise, "ccw"),
        Direction::Ccw => (SpinDirection::Counterclockwise, "cw"),
    };
    let full_turn = match *full_turn {
        args::FullTurn { full_turn: true, .. } => FullTurn::Allowed,
        args::FullTurn { tolerance: None, .. } => FullTurn::default(),
        args::FullTurn { tolerance: Some(degrees), .. } => FullTurn::Refused {
            tolerance: TurnCentiDegrees(digits(session, degrees, TurnCentiDegrees::SCALE, "°")?),
        },
    };
    session.motor()?.set_single_turn_position(angle, spin, max_speed, full_turn).map_err(|error| {
        match error {
            Error::FullTurn { past: TurnCentiDegrees(0), .. } => {
                Failure::Usage(format!("{error}; `--full-turn` sends it all the same"))
            }
            Error::FullTurn { .. } => Failure::Usage(format!(
                "{error}; try `--direction {other}`, or `--full-turn` if it may be a full turn"
            )),
            error => error.into(),
        }
    })
}

fn set_torque4(session: &Session, amps: &[f64]) -> Result<(), Failure> {
    let mut torques = [IqCommand(0); 4];
    for (slot, &amps) in torques.iter_mut().zip(amps) {
        *slot = torque(session, amps)?;
    }
    let replies = session.bus.set_torque4(SetTorque4(torques), MotorSet::TORQUE4)?;
    let mut silent = None;
    for (reply, id) in replies.into_iter().zip(1..) {
        match reply {
            Some(Ok(status)) => {
                let rows = motion(session, &status);
                let values: Vec<&str> = rows.iter().map(|(_, text, _)| text.as_str()).collect();
                let fields =
                    rows.iter().map(|(name, _, value)| ((*name).to_owned(), value.clone()));
                let object: Map<String, Value> =
                    std::iter::once(("id".to_owned(), json!(id))).chain(fields).collect();
                session
                    .output
                    .result(format!("motor {id}  {}", values.join("   ")), Value::Object(object))?;
            }
            Some(Err(error)) => {
                silent.get_or_insert(error);
            }
            None => {}
        }
    }
    silent.map_or(Ok(()), |error| Err(error.into()))
}

fn raw(session: &Session, bytes: &[u8]) -> Result<(), Failure> {
    let mut request = [0; 8];
    let Some(room) = request.get_mut(..bytes.len()) else {
        return Err(Failure::Usage(format!("a frame has 8 bytes, not {}", bytes.len())));
    };
    room.copy_from_slice(bytes);
    if Code::from(request[0]).info().is_some_and(|row| row.rom) {
        session.rom(&format!("{:#04x}", request[0]))?;
    }
    let reply = session.bus.raw(session.motor()?.id(), request)?;
    if session.output.json {
        return session.output.result("", json!({ "ok": true, "data": hex(&reply) }));
    }
    line(&hex(&reply))
}

fn torque(session: &Session, amps: f64) -> Result<IqCommand, Failure> {
    let torque = IqCommand(digits(session, amps, IqCommand::SCALE, "A")?);
    if torque.0.unsigned_abs() <= SetTorque::MAX.0.unsigned_abs() {
        return Ok(torque);
    }
    let (most, unit) = match session.raw {
        true => (f64::from(SetTorque::MAX.0), "digits"),
        false => (SetTorque::MAX.amps(), "A"),
    };
    Err(Failure::Usage(format!("{amps} {unit} is beyond ±{most} {unit}; nothing was sent")))
}

/// A value in the physical unit, or with --raw in digits, as the wire's integer. What does not fit
/// is refused, never cut.
fn digits<T: TryFrom<i64>>(
    session: &Session,
    value: f64,
    scale: f64,
    unit: &str,
) -> Result<T, Failure> {
    let digits = if session.raw { value } else { value / scale };
    let nearest = digits.is_finite().then(|| digits.round() as i64);
    nearest.and_then(|n| T::try_from(n).ok()).ok_or_else(|| too_large(session, value, unit))
}

/// A greatest speed in °/s, or with --raw in digits, rounded towards 0. What would be 0 is refused:
/// to a drive it may mean any speed, or that the motor never moves.
fn greatest_speed(session: &Session, value: Option<f64>) -> Result<Option<SpeedLimit>, Failure> {
    let Some(value) = value else { return Ok(None) };
    let (scale, unit) = match session.raw {
        true => (1.0, "digits"),
        false => (SpeedLimit::SCALE, SpeedLimit::SYMBOL),
    };
    let digits = inward(value, scale);
    if digits < 1 {
        return Err(Failure::Usage(format!(
            "--max-speed of {value} {unit} is too small: give {scale} {unit} or more; nothing was \
             sent"
        )));
    }
    let fits = u16::try_from(digits).map(|digits| Some(SpeedLimit(digits)));
    fits.map_err(|_| too_large(session, value, SpeedLimit::SYMBOL))
}

fn too_large(session: &Session, value: f64, unit: &str) -> Failure {
    let unit = if session.raw { "digits" } else { unit };
    Failure::Usage(format!("{value} {unit} does not fit the frame; nothing was sent"))
}
