//! What a command leaves the drive in: its control mode and its ramp.

use std::fmt::Write as _;

use motorlink::st::{
    ControlMode, Effect, Error, Flags, Frame, MAX_FRAME, NotStarted, Profile, Ramp, Reading,
    RegisterId, Status,
};
use motorlink_capture::st::Transcript;

use super::session::Session;
use crate::failure::Failure;

/// The final speed of a ramp that the drive holds.
#[derive(Debug, Default)]
pub struct HeldRamp {
    /// Its register, if it can be read.
    pub bits: Option<i32>,
    /// How it differs from the requested ramp.
    pub note: String,
}

/// Sets a ramp and reads it back: shipped firmware rounds speeds, and a drive has a highest speed.
pub fn set_ramp(session: &Session, ramp: Ramp) -> Result<HeldRamp, Failure> {
    let motor = session.motor()?;
    if !ramp.is_possible() {
        return Err(Failure::usage(format!(
            "{} rpm is more than a drive can hold; nothing was sent",
            ramp.speed_rpm
        ))
        .trying(format!("give -{0} to {0} rpm", Ramp::MAX_SPEED_RPM)));
    }
    motor.set_ramp(ramp)?;
    let mut held = HeldRamp::default();
    let wanted = ramp.speed_rpm;
    match readable(session, RegisterId::RAMP_FINAL_SPEED)? {
        Some(bits) => {
            if bits != wanted {
                held.note = format!("; the drive holds {bits} rpm");
            }
            held.bits = Some(bits);
        }
        None => held.note = "; the ramp that the drive holds cannot be read back".to_owned(),
    }
    // Shipped firmware cannot read it.
    let most = match session.client.profile() {
        Profile::Spec => readable(session, RegisterId::MAX_APP_SPEED)?,
        Profile::Mcsdk54 => None,
    };
    if let Some(most) = most.map(i32::cast_unsigned)
        && wanted.unsigned_abs() > most
    {
        write!(held.note, "; the drive's highest speed is {most} rpm (MAX_APP_SPEED)")
            .expect("text can be written");
    }
    Ok(held)
}

/// The bits of a register; `None` if the drive refuses to read it.
fn readable(session: &Session, register: RegisterId) -> Result<Option<i32>, Failure> {
    match session.motor()?.get_raw(register) {
        Ok(bits) => Ok(Some(bits)),
        Err(Error::Refused { .. }) => Ok(None),
        Err(error) => Err(error.into()),
    }
}

/// Why a start has no effect, with the values of STATUS and FLAGS.
pub struct Fault {
    pub why: NotStarted,
    pub readings: [Reading; 2],
}

/// The faults of the drive; `None` if it has none, or refuses to read the two registers.
pub fn fault(session: &Session) -> Result<Option<Fault>, Failure> {
    let Some(state) = readable(session, RegisterId::STATUS)? else { return Ok(None) };
    let status = Status::from(state as u8);
    if !matches!(status, Status::FaultNow | Status::FaultOver) {
        return Ok(None);
    }
    let Some(bits) = readable(session, RegisterId::FLAGS)? else { return Ok(None) };
    let readings = [(RegisterId::STATUS, state), (RegisterId::FLAGS, bits)]
        .map(|(id, bits)| session.reading(id, bits));
    Ok(Some(Fault { why: NotStarted::Faults { status, flags: Flags(bits as u32) }, readings }))
}

/// The control mode that a start acts in.
#[derive(Debug, Default)]
pub struct Mode {
    pub readings: Vec<Reading>,
    pub text: String,
}

/// Reads the control mode, and in TORQUE mode the current reference. A drive may refuse both.
pub fn read(session: &Session) -> Result<Mode, Failure> {
    let Some(bits) = readable(session, RegisterId::CONTROL_MODE)? else {
        return Ok(Mode::default());
    };
    let mode = ControlMode::from(bits as u8);
    let mut readings = vec![session.reading(RegisterId::CONTROL_MODE, bits)];
    let mut text = format!(", in {mode} mode");
    if mode == ControlMode::Torque {
        if let Some(bits) = readable(session, RegisterId::TORQUE_REF)? {
            let reference = session.reading(RegisterId::TORQUE_REF, bits);
            text += &format!(", Iq {}", session.text(&reference));
            readings.push(reference);
        }
        text += "; the load decides the speed. `ramp` returns to speed control";
    }
    Ok(Mode { readings, text })
}

impl Session {
    /// The effect of a torque command on the control mode.
    pub fn torque_control(&self) -> String {
        let limit = if self.has_speed_limit { "; --speed-limit does not apply" } else { "" };
        format!(
            "the drive is now in TORQUE mode: the load decides the speed{limit}. `ramp` returns to speed \
             control"
        )
    }
}

/// Whether a write of these bits leads to torque control.
pub fn is_torque_command(register: RegisterId, bits: i32) -> bool {
    match register {
        RegisterId::TORQUE_REF | RegisterId::FLUX_REF => true,
        RegisterId::CONTROL_MODE => ControlMode::from(bits as u8) == ControlMode::Torque,
        _ => false,
    }
}

/// What an acknowledged frame means, if it is not a read.
pub fn meaning(session: &Session, frame: &Frame<'_>) -> Option<String> {
    let profile = session.client.profile();
    let is_read = |profile| frame.request(profile).is_ok_and(|request| request.is_read());
    if Profile::ALL.into_iter().all(is_read) {
        return None;
    }
    let mut out = [0; MAX_FRAME];
    let bytes = frame.encode(&mut out)?;
    let mut text = format!("sent {}", Transcript::new(profile).note(None, true, bytes).trim());
    if Effect::of_frame(frame).motion().is_owned() {
        text += "; the motor may turn now";
    }
    Some(text)
}
