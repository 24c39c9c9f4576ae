//! Commands that change something in a motor.

use motorlink::rmd::{
    ArrivalOptions, CentiDps, Code, EncoderOffset, Error, FullTurn, IqCommand, MotionStatus,
    MotorId, MotorSet, SetTorque4, SpeedLimit, SpinDirection, StopAction, Target, TurnCentiDegrees,
};

use super::args::{self, Act, MaxSpeed, Wait};
use super::session::Session;
use super::{files, settings};
use crate::arrival;
use crate::failure::Failure;
use crate::interrupt;
use crate::json::Row;
use crate::output::{hex, parse_hex};
use crate::settings::Task;

pub fn run(session: &Session, act: Act) -> Result<(), Failure> {
    let (can_turn, is_stop) = (act.can_turn(), matches!(act, Act::Off { .. } | Act::Stop { .. }));
    let done = carry_out(session, act).map_err(|failure| session.at_motor_shaft(failure));
    done.map_err(|failure| match (can_turn, is_stop) {
        (true, _) => session.of_motion(failure, session.id),
        (_, true) => failure.of_stop(format!("motor {}", session.id)),
        _ => failure,
    })
}

fn carry_out(session: &Session, act: Act) -> Result<(), Failure> {
    let motor = session.motor()?;
    let id = motor.id();
    match act {
        Act::Pid { gains } => settings::pid(session, &gains),
        Act::Acceleration { dps_per_second } => settings::acceleration(session, dps_per_second),
        Act::Encoder => session.show(&motor.encoder()?),
        Act::EncoderOffset { offset } => settings::encoder_offset(session, offset),
        Act::Restore(args) => files::run(session, Task::Restore(&args)),
        Act::Zero => {
            session.rom("setting the zero")?;
            let offset = motor.write_zero_rom()?;
            let rows = session.rows(&EncoderOffset { offset });
            let rows = rows.map_err(|failure| failure.then("the zero is set"))?;
            session.output.result(
                format!("motor {id} has its zero here (offset {offset}), effective after the next power cycle"),
                session.line(session.id).ok(true).values(&rows),
            )
        }
        Act::Off { .. } => {
            stopped(motor.off_until_confirmed())?;
            session.done(halted(id, StopAction::Off))
        }
        Act::Stop { .. } => {
            stopped(motor.stop_until_confirmed())?;
            session.done(halted(id, StopAction::Stop))
        }
        Act::Run => {
            motor.run()?;
            session.check_errors(id)?;
            session.done(format!("motor {id} resumes what `stop` stopped, if anything"))
        }
        Act::Torque { amps } => {
            let current = session.units.wanted::<IqCommand>(amps)?;
            let status = motor.set_torque(current)?;
            session.commanded(format!("turns with {}", session.units.shown(current)), &status)
        }
        Act::Speed { dps } => {
            let speed = session.units.wanted::<CentiDps>(dps)?;
            let status = motor.set_speed(speed)?;
            session.commanded(format!("turns at {}", session.units.shown(speed)), &status)
        }
        Act::Position { degrees, most, wait } => {
            let (angle, max_speed) = (session.units.wanted(degrees)?, max_speed(session, &most)?);
            let command = || Ok(motor.set_position(angle, max_speed)?);
            move_to(session, command, Target::MultiTurn(angle), max_speed, &wait)
        }
        Act::SingleTurnPosition { degrees, direction, most, full_turn, wait } => {
            session.wants_no_gear()?;
            let (angle, max_speed) = (session.units.wanted(degrees)?, max_speed(session, &most)?);
            let command = || turn(session, angle, max_speed, direction, &full_turn);
            let target = Target::SingleTurn { angle, direction };
            move_to(session, command, target, max_speed, &wait)
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
            session.output.rows(object, &session.rows(&status)?)?;
            Err(failure)
        }
        Act::Torque4 { amps, expect } => {
            set_torque4(session, &amps, expect.into_iter().flatten().collect())
        }
        Act::Raw { bytes } => raw(session, &parse_hex(&bytes)?),
    }
}

fn stopped(outcome: Result<(), Error>) -> Result<(), Error> {
    interrupt::stop_is_complete();
    outcome
}

/// The result of a stop.
pub fn halted(id: MotorId, action: StopAction) -> String {
    match action {
        StopAction::Off => format!("motor {id} is off"),
        StopAction::Stop => format!("motor {id} is stopped; `run` resumes"),
    }
}

/// Sends a command to move. With `--wait` it returns when the move is over.
fn move_to(
    session: &Session,
    command: impl FnOnce() -> Result<MotionStatus, Failure>,
    target: Target,
    max_speed: Option<SpeedLimit>,
    wait: &Wait,
) -> Result<(), Failure> {
    if !wait.wait {
        let place = match target {
            Target::MultiTurn(angle) => session.units.shown(angle),
            Target::SingleTurn { angle, direction } => {
                format!("{} {direction}", session.units.shown(angle))
            }
        };
        return session.commanded(format!("turns to {place}"), &command()?);
    }
    let motor = session.motor()?;
    let tolerance = wait.wait_tolerance.map(|degrees| session.units.wanted(degrees)).transpose()?;
    let options = ArrivalOptions { tolerance, timeout: wait.wait_timeout };
    let arrived = arrival::move_and_wait(
        motor,
        || motor.prepare_move(target, max_speed, options),
        || command().map(drop),
        |_| {
            // Motors that were moved before this one are stopped, too.
            let stopped = session.bus.stop_on_drop().stop_now();
            stopped.into_iter().map(|one| (one.id.number(), one.result)).collect()
        },
        " and holds still",
    )?;
    let angle = session.rows(&arrived.angle)?.into_iter();
    let angle = angle.map(|row| Row { name: "multi_turn_angle".to_owned(), ..row });
    let rows: Vec<Row> = angle.chain(session.rows(&arrived.motion)?).collect();
    session.output.rows(session.line(session.id).ok(true), &rows)
}

fn max_speed(session: &Session, most: &MaxSpeed) -> Result<Option<SpeedLimit>, Failure> {
    most.max_speed.map(|speed| session.units.wanted(speed)).transpose()
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
            FullTurn::Refused { tolerance: session.units.wanted(degrees)? }
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

fn set_torque4(session: &Session, amps: &[f64], expect: MotorSet) -> Result<(), Failure> {
    let mut torques = [IqCommand(0); 4];
    for (slot, &amps) in torques.iter_mut().zip(amps) {
        *slot = session.units.wanted(amps)?;
    }
    let replies = session.bus.set_torque4(SetTorque4(torques), expect)?;
    let mut failures = Vec::new();
    for (reply, id) in replies.into_iter().zip(MotorSet::TORQUE4) {
        let Some(reply) = reply else { continue };
        let taken = reply.map_err(Failure::from);
        match taken.and_then(|status| session.check_errors(id).map(|()| status)) {
            Ok(status) => {
                let rows = session.rows(&status);
                let rows = rows.map_err(|failure| failure.then("the motors took the torques"))?;
                let texts: Vec<&str> = rows.iter().map(|row| row.text.as_str()).collect();
                let text = format!("motor {id}  {}", texts.join("   "));
                let object = session.line(id.number()).ok(true);
                session.output.result(text, object.values(&rows))?;
            }
            Err(failure) => {
                let failure = session.of_motion(failure, id.number());
                session.failed(id, failure, &mut failures)?;
            }
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
