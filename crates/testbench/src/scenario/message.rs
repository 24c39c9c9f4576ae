//! Messages of a scenario, and their bytes and frames.

use motorlink_proto::can::CanFrame;
use motorlink_proto::rmd::{
    Acceleration, ClearErrors, Command as _, MotorId, Off, Pid, Run, SetPosition,
    SetPositionLimited, SetSingleTurnPosition, SetSingleTurnPositionLimited, SetSpeed, SetTorque,
    SpinDirection, Stop, WriteAccelerationRam, WritePidRam,
};
use motorlink_proto::st::{
    Command, CurrentReference, Frame, MAX_FRAME, MotorNumber, PositionMove, Profile, REVUP_PHASES,
    Ramp, Request, RevupPhase, TorqueRamp, find_register, parse_value,
};
use motorlink_proto::units::Quantity;
use serde::Deserialize;

/// A message to an ST motor.
#[derive(Debug, Clone, PartialEq, Deserialize)]
#[serde(tag = "send", rename_all = "kebab-case", deny_unknown_fields)]
pub(super) enum StMessage {
    Start {},
    Stop {},
    StartStop {},
    StopRamp {},
    FaultAck {},
    EncoderAlign {},
    IqdrefClear {},
    Ramp { speed_rpm: i32, duration_ms: u16 },
    TorqueRamp { torque_s16a: i32, duration_ms: u16 },
    CurrentReference { iq_s16a: i16, id_s16a: i16 },
    Set { register: String, value: toml::Value },
    RevupData { phase: u8, speed_rpm: i32, torque_s16a: i16, duration_ms: u16 },
    Position { angle_rad: f32, duration_s: f32 },
    Pfc { action: PfcAction },
}

#[derive(Debug, Clone, Copy, PartialEq, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub(super) enum PfcAction {
    Enable,
    Disable,
    FaultAck,
}

/// A message to an RMD motor.
#[derive(Debug, Clone, PartialEq, Deserialize)]
#[serde(tag = "send", rename_all = "kebab-case", deny_unknown_fields)]
pub(super) enum RmdMessage {
    Off {},
    Stop {},
    Run {},
    ClearErrors {},
    Torque {
        iq_amps: f64,
    },
    Speed {
        speed_dps: f64,
    },
    Position {
        angle_degrees: f64,
        max_speed_dps: Option<f64>,
    },
    SingleTurnPosition {
        angle_degrees: f64,
        direction: String,
        max_speed_dps: Option<f64>,
    },
    Pid {
        position_kp: u8,
        position_ki: u8,
        speed_kp: u8,
        speed_ki: u8,
        torque_kp: u8,
        torque_ki: u8,
    },
    Acceleration {
        acceleration_dps2: f64,
    },
}

impl StMessage {
    /// The frame to a motor of a drive that speaks `profile`.
    pub(super) fn encode(&self, motor: MotorNumber, profile: Profile) -> Result<Vec<u8>, String> {
        let bytes;
        let request = match *self {
            StMessage::Start {} => Request::ExecuteCommand(Command::StartMotor),
            StMessage::Stop {} => Request::ExecuteCommand(Command::StopMotor),
            StMessage::StartStop {} => Request::ExecuteCommand(Command::StartStop),
            StMessage::StopRamp {} => Request::ExecuteCommand(Command::StopRamp),
            StMessage::FaultAck {} => Request::ExecuteCommand(Command::FaultAck),
            StMessage::EncoderAlign {} => Request::ExecuteCommand(Command::EncoderAlign),
            StMessage::IqdrefClear {} => Request::ExecuteCommand(Command::IqdrefClear),
            StMessage::Pfc { action: PfcAction::Enable } => {
                Request::ExecuteCommand(Command::PfcEnable)
            }
            StMessage::Pfc { action: PfcAction::Disable } => {
                Request::ExecuteCommand(Command::PfcDisable)
            }
            StMessage::Pfc { action: PfcAction::FaultAck } => {
                Request::ExecuteCommand(Command::PfcFaultAck)
            }
            StMessage::Ramp { speed_rpm, duration_ms } => {
                Request::SetRamp(Ramp { speed_rpm, duration_ms })
            }
            StMessage::TorqueRamp { torque_s16a, duration_ms } => {
                Request::SetTorqueRamp(TorqueRamp { torque_s16a, duration_ms })
            }
            StMessage::CurrentReference { iq_s16a, id_s16a } => {
                Request::SetCurrentReference(CurrentReference { iq_s16a, id_s16a })
            }
            StMessage::RevupData { phase, .. } if phase >= REVUP_PHASES => {
                return Err(format!("phases of the rev-up are 0 to {}", REVUP_PHASES - 1));
            }
            StMessage::RevupData { phase, speed_rpm, torque_s16a, duration_ms } => {
                Request::SetRevupData(phase, RevupPhase { speed_rpm, torque_s16a, duration_ms })
            }
            StMessage::Position { angle_rad, duration_s } => {
                let position = PositionMove { angle_rad, duration_s };
                if !position.is_possible() {
                    return Err(format!("{angle_rad} rad in {duration_s} s is not possible"));
                }
                Request::SetPosition(position)
            }
            StMessage::Set { ref register, ref value } => {
                let register = find_register(register).map_err(|error| error.to_string())?;
                let bits = parse_value(register, &text(value), profile, false)
                    .map_err(|error| error.to_string())?;
                bytes = bits.to_le_bytes();
                let size = usize::from(register.write_size(profile));
                Request::SetRegister { register, value: &bytes[..size] }
            }
        };
        let mut frame = [0; MAX_FRAME];
        let sent = Frame::command(motor.number(), &request, &mut frame);
        sent.map(<[u8]>::to_vec).ok_or_else(|| "the message does not fit a frame".to_owned())
    }

    /// The message in a few words.
    pub(super) fn words(&self) -> String {
        match self {
            StMessage::Start {} => "start".to_owned(),
            StMessage::Stop {} => "stop".to_owned(),
            StMessage::StartStop {} => "start/stop".to_owned(),
            StMessage::StopRamp {} => "stop ramp".to_owned(),
            StMessage::FaultAck {} => "fault ack".to_owned(),
            StMessage::EncoderAlign {} => "align encoder".to_owned(),
            StMessage::IqdrefClear {} => "clear Iqd ref".to_owned(),
            StMessage::Ramp { speed_rpm, duration_ms: 0 } => format!("{speed_rpm} rpm"),
            StMessage::Ramp { speed_rpm, duration_ms } => {
                format!("{speed_rpm} rpm in {duration_ms} ms")
            }
            StMessage::TorqueRamp { torque_s16a, duration_ms } => {
                format!("Iq {torque_s16a} in {duration_ms} ms")
            }
            StMessage::CurrentReference { iq_s16a, id_s16a } => {
                format!("Iq {iq_s16a}, Id {id_s16a}")
            }
            StMessage::Set { register, value } => format!("{register} {}", text(value)),
            StMessage::RevupData { phase, .. } => format!("rev-up phase {phase}"),
            StMessage::Position { angle_rad, duration_s } => {
                format!("{angle_rad} rad in {duration_s} s")
            }
            StMessage::Pfc { action: PfcAction::Enable } => "PFC on".to_owned(),
            StMessage::Pfc { action: PfcAction::Disable } => "PFC off".to_owned(),
            StMessage::Pfc { action: PfcAction::FaultAck } => "PFC fault ack".to_owned(),
        }
    }
}

impl RmdMessage {
    /// The frame to a motor.
    pub(super) fn encode(&self, motor: MotorId) -> Result<CanFrame, String> {
        let data = match *self {
            RmdMessage::Off {} => Off.encode(),
            RmdMessage::Stop {} => Stop.encode(),
            RmdMessage::Run {} => Run.encode(),
            RmdMessage::ClearErrors {} => ClearErrors.encode(),
            RmdMessage::Torque { iq_amps } => SetTorque { iq: wanted(iq_amps)? }.encode(),
            RmdMessage::Speed { speed_dps } => SetSpeed { speed: wanted(speed_dps)? }.encode(),
            RmdMessage::Position { angle_degrees, max_speed_dps } => {
                let angle = wanted(angle_degrees)?;
                match max_speed_dps {
                    None => SetPosition { angle }.encode(),
                    Some(dps) => SetPositionLimited { max_speed: wanted(dps)?, angle }.encode(),
                }
            }
            RmdMessage::SingleTurnPosition { angle_degrees, ref direction, max_speed_dps } => {
                let direction = turned(direction)?;
                let angle = wanted(angle_degrees)?;
                match max_speed_dps {
                    None => SetSingleTurnPosition { direction, angle }.encode(),
                    Some(dps) => {
                        let max_speed = wanted(dps)?;
                        SetSingleTurnPositionLimited { direction, max_speed, angle }.encode()
                    }
                }
            }
            RmdMessage::Pid {
                position_kp,
                position_ki,
                speed_kp,
                speed_ki,
                torque_kp,
                torque_ki,
            } => WritePidRam(Pid {
                position_kp,
                position_ki,
                speed_kp,
                speed_ki,
                torque_kp,
                torque_ki,
            })
            .encode(),
            RmdMessage::Acceleration { acceleration_dps2 } => {
                WriteAccelerationRam(Acceleration { acceleration: wanted(acceleration_dps2)? })
                    .encode()
            }
        };
        Ok(CanFrame::new(motor.can_id(), data))
    }

    /// The message in a few words.
    pub(super) fn words(&self) -> String {
        match self {
            RmdMessage::Off {} => "off".to_owned(),
            RmdMessage::Stop {} => "stop".to_owned(),
            RmdMessage::Run {} => "run".to_owned(),
            RmdMessage::ClearErrors {} => "clear error".to_owned(),
            RmdMessage::Torque { iq_amps } => format!("{iq_amps} A"),
            RmdMessage::Speed { speed_dps } => format!("{speed_dps} °/s"),
            RmdMessage::Position { angle_degrees, max_speed_dps } => {
                format!("to {angle_degrees}°{}", most(*max_speed_dps))
            }
            RmdMessage::SingleTurnPosition { angle_degrees, direction, max_speed_dps } => {
                let way =
                    turned(direction).map_or_else(|_| direction.clone(), |way| way.to_string());
                format!("to {angle_degrees}° {way}{}", most(*max_speed_dps))
            }
            RmdMessage::Pid {
                position_kp,
                position_ki,
                speed_kp,
                speed_ki,
                torque_kp,
                torque_ki,
            } => format!(
                "PID {position_kp} {position_ki} {speed_kp} {speed_ki} {torque_kp} {torque_ki}"
            ),
            RmdMessage::Acceleration { acceleration_dps2 } => {
                format!("acceleration {acceleration_dps2} °/s²")
            }
        }
    }
}

/// A value as a person would give it to `motorlink st set`.
fn text(value: &toml::Value) -> String {
    match value {
        toml::Value::String(text) => text.clone(),
        other => other.to_string(),
    }
}

/// Text of a speed limit.
fn most(max_speed_dps: Option<f64>) -> String {
    max_speed_dps.map_or(String::new(), |dps| format!(", max {dps} °/s"))
}

fn turned(direction: &str) -> Result<SpinDirection, String> {
    let words = "`clockwise` (`cw`) or `counterclockwise` (`ccw`)";
    SpinDirection::named(direction)
        .ok_or_else(|| format!("direction is {words}, not `{direction}`"))
}

/// A physical value as the protocol's integer. A value out of range is an error, never clipped.
fn wanted<Q: Quantity>(value: f64) -> Result<Q, String> {
    Q::wanted(value).map_err(|error| error.to_string())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn st(text: &str) -> Result<Vec<u8>, String> {
        let message: StMessage = toml::from_str(text).map_err(|error| error.to_string())?;
        message.encode(MotorNumber::FIRST, Profile::Spec)
    }

    fn rmd(text: &str) -> Result<CanFrame, String> {
        let message: RmdMessage = toml::from_str(text).map_err(|error| error.to_string())?;
        message.encode(MotorId::new(2).unwrap())
    }

    const GAINS: &str = "position_kp = 1\nposition_ki = 2\nspeed_kp = 3\nspeed_ki = 4\ntorque_kp = 5\n\
                         torque_ki = 6";

    #[test]
    fn messages_are_the_bytes_of_the_documents() {
        assert_eq!(st("send = \"start\"").unwrap(), [0x23, 1, 1, 0x25]);
        let ramp = st("send = \"ramp\"\nspeed_rpm = 1500\nduration_ms = 1000").unwrap();
        assert_eq!(ramp, [0x27, 6, 0xDC, 5, 0, 0, 0xE8, 3, 0xFA]);
        // A register of two bytes, in its unit, and one whose values have names.
        let kp = st("send = \"set\"\nregister = \"SPEED_KP\"\nvalue = -2").unwrap();
        assert_eq!(kp[..5], [0x21, 3, 5, 0xFE, 0xFF]);
        let mode = st("send = \"set\"\nregister = \"CONTROL_MODE\"\nvalue = \"SPEED\"").unwrap();
        assert_eq!(mode[..4], [0x21, 2, 3, 1]);

        let frame = rmd("send = \"position\"\nangle_degrees = 90\nmax_speed_dps = 360").unwrap();
        assert_eq!(frame, CanFrame::new(0x142, [0xA4, 0, 0x68, 1, 0x28, 0x23, 0, 0]));
        let frame = rmd("send = \"single-turn-position\"\nangle_degrees = 90\ndirection = \"ccw\"")
            .unwrap();
        assert_eq!(frame, CanFrame::new(0x142, [0xA5, 1, 0, 0, 0x28, 0x23, 0, 0]));
        let frame = rmd(&format!("send = \"pid\"\n{GAINS}")).unwrap();
        assert_eq!(frame, CanFrame::new(0x142, [0x31, 0, 1, 2, 3, 4, 5, 6]));
        let frame = rmd("send = \"torque\"\niq_amps = -32").unwrap();
        assert_eq!(frame, CanFrame::new(0x142, [0xA1, 0, 0, 0, 0x30, 0xF8, 0, 0]));
    }

    #[test]
    fn values_out_of_range_are_refused() {
        assert!(st("send = \"fly\"").unwrap_err().contains("fly"));
        assert!(st("send = \"start\"\nrpm = 3").unwrap_err().contains("rpm"));
        assert!(st("send = \"ramp\"\nspeed_rpm = 1500\nduration_ms = 70000").is_err());
        assert!(
            st("send = \"revup-data\"\nphase = 5\nspeed_rpm = 0\ntorque_s16a = 0\nduration_ms = 0")
                .unwrap_err()
                .contains("0 to 4")
        );
        assert!(
            st("send = \"position\"\nangle_rad = nan\nduration_s = 1")
                .unwrap_err()
                .contains("NaN rad")
        );
        let why = st("send = \"set\"\nregister = \"SPEED_KPP\"\nvalue = 3").unwrap_err();
        assert!(why.contains("SPEED_KP"), "{why}");
        assert!(st("send = \"set\"\nregister = \"SPEED_KP\"\nvalue = 40000").is_err());
        assert!(rmd("send = \"torque\"\niq_amps = 32.1").unwrap_err().contains("±32"));
        assert!(rmd("send = \"speed\"\nspeed_dps = inf").unwrap_err().contains("outside"));
        let turn = |angle: f64, way: &str| {
            let members = format!("angle_degrees = {angle}\ndirection = \"{way}\"");
            rmd(&format!("send = \"single-turn-position\"\n{members}"))
        };
        assert_eq!(turn(359.99, "clockwise"), turn(359.99, "cw"));
        assert!(turn(360.0, "cw").unwrap_err().contains("0 to 359.99"));
        assert!(turn(1.0, "left").unwrap_err().contains("counterclockwise"));
        let slow = "send = \"position\"\nangle_degrees = 1\nmax_speed_dps = 0.9";
        assert!(rmd(slow).unwrap_err().contains("outside 1 to"));
        let back = "send = \"acceleration\"\nacceleration_dps2 = -1";
        assert!(rmd(back).unwrap_err().contains("negative"));
        assert!(rmd("send = \"pid\"\nspeed_kp = 3").unwrap_err().contains("position_kp"));
    }
}
