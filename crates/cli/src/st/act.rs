//! Commands that change something in the drive.

use std::time::Duration;

use motorlink::st::{
    Command as Execute, CurrentReference, Flags, PositionMove, Profile, REVUP_PHASES, Ramp,
    RegisterId, Request, RevupPhase, Status, TorqueRamp, VERIFY_ATTEMPTS, register::Unit,
};
use motorlink::time;

use super::args::{Act, Pfc};
use super::arrival;
use super::read::explain;
use super::session::Session;
use super::set;
use crate::failure::Failure;
use crate::interrupt;
use crate::json::Row;
use crate::output::{hex, parse_hex};

pub fn run(session: &Session, act: Act) -> Result<(), Failure> {
    let motor = session.motor()?;
    match act {
        Act::Set { register, value, verify } => {
            let attempts = verify.map(|attempts| attempts.unwrap_or(VERIFY_ATTEMPTS));
            set::run(session, &register, &value, attempts)
        }
        Act::Start { ramp } => {
            if let [rpm, ms] = ramp[..] {
                set_ramp(session, rpm, ms)?;
            }
            start(session)
        }
        Act::Stop => execute(session, Execute::StopMotor),
        Act::StartStop => execute(session, Execute::StartStop),
        Act::StopRamp => execute(session, Execute::StopRamp),
        Act::FaultAck => acknowledge(session),
        Act::EncoderAlign => execute(session, Execute::EncoderAlign),
        Act::IqdrefClear => execute(session, Execute::IqdrefClear),
        Act::Pfc { action: Pfc::Enable } => execute(session, Execute::PfcEnable),
        Act::Pfc { action: Pfc::Disable } => execute(session, Execute::PfcDisable),
        Act::Pfc { action: Pfc::FaultAck } => execute(session, Execute::PfcFaultAck),
        Act::Ramp { rpm, ms } => {
            motor.set_ramp(Ramp { speed_rpm: rpm, duration_ms: ms })?;
            session.done(format!(
                "{}: ramp to {rpm} rpm in {ms} ms acknowledged; it executes while the motor runs",
                motor.number()
            ))
        }
        Act::TorqueRamp { iq, ms } => {
            session.wants(Profile::Mcsdk54, "torque ramps")?;
            motor.set_torque_ramp(TorqueRamp { torque_s16a: iq, duration_ms: ms })?;
            session.done(format!("{}: ramp to Iq {iq} in {ms} ms acknowledged", motor.number()))
        }
        Act::Position { rad, seconds, wait } => {
            session.wants(Profile::Mcsdk54, "moves")?;
            let position = PositionMove { angle_rad: rad, duration_s: seconds };
            if !position.is_possible() {
                return Err(Failure::usage(format!("{rad} rad in {seconds} s is not possible")));
            }
            session.client.check(session.motor, &Request::SetPosition(position))?;
            if wait.wait {
                return arrival::move_and_wait(session, position, &wait);
            }
            motor.set_position(position)?;
            session
                .done(format!("{}: move to {rad} rad in {seconds} s acknowledged", motor.number()))
        }
        Act::CurrentReference { iq, id } => {
            motor.set_current_reference(CurrentReference { iq_s16a: iq, id_s16a: id })?;
            session.done(format!("{}: references Iq {iq}, Id {id}", motor.number()))
        }
        Act::RevupData { phase: None, .. } => revup(session),
        Act::RevupData { phase: Some(phase), rpm, torque, ms } => {
            let data = RevupPhase {
                speed_rpm: rpm.unwrap_or_default(),
                torque_s16a: torque.unwrap_or_default(),
                duration_ms: ms.unwrap_or_default(),
            };
            motor.set_revup_data(phase, data)?;
            session.done(format!("{}: rev-up phase {phase} is set", motor.number()))
        }
        Act::Raw { bytes } => raw(session, &parse_hex(&bytes)?),
    }
}

fn execute(session: &Session, command: Execute) -> Result<(), Failure> {
    let motor = session.motor()?;
    motor.execute(command)?;
    session.done(format!("{}: {command} acknowledged", motor.number()))
}

/// The ramp that a start executes.
fn set_ramp(session: &Session, speed_rpm: i32, ms: i32) -> Result<(), Failure> {
    let duration_ms = u16::try_from(ms).map_err(|_| {
        Failure::usage(format!(
            "the duration of a ramp is 0 to {} ms, not {ms}; nothing was sent",
            u16::MAX
        ))
    })?;
    Ok(session.motor()?.set_ramp(Ramp { speed_rpm, duration_ms })?)
}

/// A drive also acknowledges a START that has no effect, so its state is read.
fn start(session: &Session) -> Result<(), Failure> {
    let motor = session.motor()?;
    motor.start()?;
    let status = motor.status()?;
    match status {
        Status::FaultNow | Status::FaultOver => {
            let faults = explain(motor.flags()?);
            Err(Failure::refused(format!(
                "{} did not start, its state is {status}: {faults}\nremove the cause, then run \
                 `motorlink st fault-ack`",
                motor.number()
            )))
        }
        Status::AnyStop | Status::Stop | Status::StopIdle | Status::WaitStopMotor => {
            Err(Failure::refused(format!(
                "{} did not start, it is still stopping ({status}); start it when it is IDLE",
                motor.number()
            )))
        }
        _ => {
            let text = format!("{} starts: {status}", motor.number());
            session.done_with(text, RegisterId::STATUS, u8::from(status).into())
        }
    }
}

/// How long the state machine may take to follow FAULT_ACK.
const ACKNOWLEDGED_WITHIN: time::Micros = time::Micros::from_millis(200);

/// As with START, an acknowledged FAULT_ACK may have had no effect. The state machine takes a
/// moment to follow.
fn acknowledge(session: &Session) -> Result<(), Failure> {
    let motor = session.motor()?;
    motor.fault_ack()?;
    let clock = session.client.clock();
    let give_up = clock.now() + ACKNOWLEDGED_WITHIN;
    loop {
        let faults = motor.flags()?;
        if faults == Flags::default() {
            let text = format!("{}: no faults", motor.number());
            return session.done_with(text, RegisterId::FLAGS, 0);
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
        let rows = values.map(|(name, value, unit)| match session.raw {
            true => Row::digits(name, value.into()),
            false => Row::quantity(name, value.into(), 0, unit.symbol()),
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
    let reply = session.client.raw(session.motor, code, payload)?;
    let text = if reply.is_empty() { "ACK".to_owned() } else { format!("ACK {}", hex(&reply)) };
    session.confirmed()?.result(text, session.line().ok(true).with("data", hex(&reply)))
}
