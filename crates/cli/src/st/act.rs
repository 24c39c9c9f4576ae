//! Commands that change something in the drive.

use std::time::Duration;

use motorlink::st::{
    ArrivalOptions, Command as Execute, CurrentReference, Effect, Error, ErrorCode, Flags, Frame,
    PositionMove, Profile, REVUP_PHASES, Ramp, Reading, RegisterId, Request, RevupPhase,
    TorqueRamp, VERIFY_ATTEMPTS, register::Unit,
};
use motorlink::time;

use super::args::{Act, Wait};
use super::read::explain;
use super::session::Session;
use super::{files, mode, set};
use crate::advice;
use crate::arrival;
use crate::failure::Failure;
use crate::interrupt;
use crate::json::Row;
use crate::output::{hex, kept_error, parse_hex};
use crate::settings::Task;
use crate::span::parse_milliseconds;

pub fn run(session: &Session, act: Act) -> Result<(), Failure> {
    let can_turn = act.can_turn();
    carry_out(session, act)
        .and_then(|()| kept_error())
        .map_err(|failure| if can_turn { session.of_motion(failure) } else { failure })
}

fn carry_out(session: &Session, act: Act) -> Result<(), Failure> {
    let motor = session.motor()?;
    match act {
        Act::Set { register, value, verify } => {
            let attempts = verify.map(|attempts| attempts.unwrap_or(VERIFY_ATTEMPTS));
            set::run(session, &register, &value, attempts)
        }
        Act::Start { ramp } => {
            let note = match &ramp[..] {
                [rpm, ms] => Some(set_ramp(session, rpm, ms)?),
                _ => None,
            };
            start(session, note)
        }
        Act::Stop => {
            let stopped = motor.stop_until_confirmed();
            interrupt::stop_is_complete();
            stopped.map_err(|error| match error {
                // What does not exist does not turn.
                Error::Refused { code: ErrorCode::BadMotorSelected, .. } => error.into(),
                error => Failure::from(error).of_stop(motor.number()),
            })?;
            session.acknowledged(format!("{}: {} acknowledged", motor.number(), Execute::StopMotor))
        }
        Act::StartStop => execute(session, Execute::StartStop),
        Act::StopRamp => execute(session, Execute::StopRamp),
        Act::FaultAck => acknowledge(session),
        Act::EncoderAlign => execute(session, Execute::EncoderAlign),
        Act::IqdrefClear => execute(session, Execute::IqdrefClear),
        Act::Pfc { action } => execute(session, action),
        Act::Ramp { rpm, ms } => {
            let held = mode::set_ramp(session, Ramp { speed_rpm: rpm, duration_ms: ms })?;
            let fault = mode::fault(session)?;
            let when = match &fault {
                None => "it executes while the motor runs".to_owned(),
                Some(fault) => format!(
                    "the motor does not start: {}; remove the cause, then `fault-ack`, then `start`",
                    fault.why
                ),
            };
            let text = format!(
                "{}: ramp to {rpm} rpm in {ms} ms acknowledged; {when}{}",
                motor.number(),
                held.note
            );
            let held = held.bits.map(|bits| session.reading(RegisterId::RAMP_FINAL_SPEED, bits));
            let fault = fault.into_iter().flat_map(|fault| fault.readings);
            let readings: Vec<Reading> = held.into_iter().chain(fault).collect();
            match readings.is_empty() {
                true => session.done(text),
                false => session.done_with(text, &readings),
            }
        }
        Act::TorqueRamp { iq, ms } => {
            session.wants(Profile::Mcsdk54, "torque ramps")?;
            let torque_s16a = session.current(iq)?;
            motor.set_torque_ramp(TorqueRamp { torque_s16a, duration_ms: ms })?;
            let iq = session.current_text(torque_s16a);
            session.done(format!(
                "{}: ramp to Iq {iq} in {ms} ms acknowledged; {}",
                motor.number(),
                session.torque_control()
            ))
        }
        Act::Position { rad, seconds, wait } => {
            session.wants(Profile::Mcsdk54, "moves")?;
            let position = PositionMove { angle_rad: rad as f32, duration_s: seconds };
            let angle = format!("{} rad ({:.1}°)", position.angle_rad, rad.to_degrees());
            if !position.is_possible() {
                return Err(Failure::usage(format!("{angle} is farther than a frame can carry")));
            }
            session.client.check(session.motor, &Request::SetPosition(position))?;
            if wait.wait {
                return move_and_wait(session, position, &wait);
            }
            motor.set_position(position)?;
            session.done(format!("{}: move to {angle} in {seconds} s acknowledged", motor.number()))
        }
        Act::CurrentReference { iq, id } => {
            let (iq_s16a, id_s16a) = (session.current(iq)?, session.current(id)?);
            motor.set_current_reference(CurrentReference { iq_s16a, id_s16a })?;
            let [iq, id] = [iq_s16a, id_s16a].map(|digits| session.current_text(digits));
            session.done(format!(
                "{}: references Iq {iq}, Id {id}; {}",
                motor.number(),
                session.torque_control()
            ))
        }
        Act::RevupData { phase: None, .. } => revup(session),
        Act::RevupData { phase: Some(phase), rpm, torque, ms } => {
            let data = RevupPhase {
                speed_rpm: rpm.unwrap_or_default(),
                torque_s16a: session.current(torque.unwrap_or_default())?,
                duration_ms: ms.unwrap_or_default(),
            };
            motor.set_revup_data(phase, data)?;
            session.done(format!("{}: rev-up phase {phase} is set", motor.number()))
        }
        Act::Restore(args) => files::run(session, Task::Restore(&args)),
        Act::Raw { bytes } => raw(session, &parse_hex(&bytes)?),
    }
}

/// Commands a move and waits for its end.
fn move_and_wait(session: &Session, target: PositionMove, wait: &Wait) -> Result<(), Failure> {
    let motor = session.motor()?;
    let options = ArrivalOptions { tolerance: wait.wait_tolerance, timeout: wait.wait_timeout };
    let position_rad = arrival::move_and_wait(
        motor,
        || motor.prepare_move(target, options),
        || Ok(motor.set_position(target)?),
        |is_sent| {
            let client = is_sent.then_some(&session.client);
            let stopped = client.map(|client| client.stop_on_drop().stop_now()).unwrap_or_default();
            stopped.into_iter().map(|one| (one.motor.number(), one.result)).collect()
        },
        " and holds no load",
    )?;
    let text = format!("{} arrived at {position_rad:.4} rad", motor.number());
    let position = session.reading(RegisterId::CURRENT_POSITION, position_rad.to_bits() as i32);
    session.done_with(text, &[position])
}

fn execute(session: &Session, command: Execute) -> Result<(), Failure> {
    let motor = session.motor()?;
    motor.execute(command)?;
    session.done(format!("{}: {command} acknowledged", motor.number()))
}

/// Sets the ramp that a start executes. Returns how it differs from the requested one.
fn set_ramp(session: &Session, rpm: &str, ms: &str) -> Result<String, Failure> {
    let not_sent = |why: String| Failure::usage(format!("--ramp: {why}; nothing was sent"));
    let speed_rpm = rpm.parse().map_err(|_| {
        not_sent(format!("`{rpm}` is not a speed: give a whole number of rpm without a unit"))
    })?;
    let duration_ms = parse_milliseconds(ms).map_err(|why| not_sent(format!("`{ms}`: {why}")))?;
    Ok(mode::set_ramp(session, Ramp { speed_rpm, duration_ms })?.note)
}

/// Starts the motor. The control mode decides what it does, so it is read first: while the motor starts,
/// TORQUE_REF has the reference of the rev-up.
fn start(session: &Session, note: Option<String>) -> Result<(), Failure> {
    let motor = session.motor()?;
    // Without a ramp, a start with a limit is refused and nothing is sent.
    let is_refused = session.has_speed_limit && note.is_none();
    let mode = if is_refused { mode::Mode::default() } else { mode::read(session)? };
    let note = note.unwrap_or_default();
    let status = motor.start()?;
    let state = session.reading(RegisterId::STATUS, u8::from(status).into());
    let rows: Vec<Row> =
        [state].iter().chain(&mode.readings).map(|reading| session.row(reading)).collect();
    session.confirmed()?.result(
        format!("{} starts: {status}{}{note}", motor.number(), mode.text),
        session.line().ok(true).values(&rows),
    )
}

/// How long the state machine may take to follow FAULT_ACK.
const ACKNOWLEDGED_WITHIN: time::Micros = time::Micros::from_millis(200);

/// As with START, an acknowledged FAULT_ACK may have had no effect. The state machine takes a
/// moment to follow.
fn acknowledge(session: &Session) -> Result<(), Failure> {
    let motor = session.motor()?;
    let before = motor.flags()?;
    motor.fault_ack()?;
    let clock = session.client.clock();
    let give_up = clock.now() + ACKNOWLEDGED_WITHIN;
    loop {
        let faults = motor.flags()?;
        if faults == Flags::default() {
            let text = match before == Flags::default() {
                true => format!("{}: there were no faults", motor.number()),
                false => format!("{}: {before} acknowledged, no faults left", motor.number()),
            };
            return session.done_with(text, &[session.reading(RegisterId::FLAGS, 0)]);
        }
        if clock.now() > give_up || !interrupt::wait_by(&clock, Duration::from_millis(10)) {
            let why = explain(faults);
            return Err(Failure::refused(format!("{} still has faults: {why}", motor.number())));
        }
    }
}

fn revup(session: &Session) -> Result<(), Failure> {
    let motor = session.motor()?;
    let mut phases = Vec::new();
    for phase in 0..REVUP_PHASES {
        phases.push(motor.revup_data(phase)?);
        session.client.confirm()?;
    }
    for (phase, RevupPhase { speed_rpm, torque_s16a, duration_ms }) in
        phases.into_iter().enumerate()
    {
        let values = [
            ("speed", speed_rpm, Unit::Rpm),
            ("torque", torque_s16a.into(), Unit::S16A),
            ("duration", duration_ms.into(), Unit::Millisecond),
        ];
        let rows = values.map(|(name, value, unit)| match unit {
            _ if session.raw => Row::digits(name, value.into()),
            Unit::S16A => Row::current(name, value.into(), session.full_scale),
            unit => Row::quantity(name, value.into(), 0, unit.symbol()),
        });
        let texts = rows.iter().map(|row| format!("  {:>11}", row.text));
        session.output.result(
            format!("phase {phase}{}", texts.collect::<String>()),
            session.line().with("phase", phase).values(&rows),
        )?;
    }
    Ok(())
}

fn raw(session: &Session, bytes: &[u8]) -> Result<(), Failure> {
    let (code, payload) = match bytes {
        [code @ 0..=0x1F, payload @ ..] => (*code, payload),
        _ => {
            return Err(Failure::usage(
                "the first byte must be a frame code, 00 to 1f; --motor selects the motor",
            ));
        }
    };
    let frame = Frame { header: Frame::header(code, session.motor), payload };
    send(session, &frame).map_err(|failure| match Effect::of_frame(&frame) {
        Effect::Stops => {
            failure.trying_also(advice::STOP_PADS).of_stop(format!("motor {}", session.motor))
        }
        _ => failure,
    })
}

/// Sends a raw frame and prints its reply.
fn send(session: &Session, frame: &Frame<'_>) -> Result<(), Failure> {
    let meaning = mode::meaning(session, frame);
    let reply = session.client.raw(session.motor, frame.code(), frame.payload)?;
    let acknowledge =
        if reply.is_empty() { "ACK".to_owned() } else { format!("ACK {}", hex(&reply)) };
    let text = match meaning {
        Some(meaning) => format!("{acknowledge}; {meaning}"),
        None => acknowledge,
    };
    session.confirmed()?.result(text, session.line().ok(true).with("data", hex(&reply)))
}
