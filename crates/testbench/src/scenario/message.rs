//! What a scenario sends: messages in words, and the bytes and frames that they become.

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
    Ramp { rpm: i32, ms: u16 },
    TorqueRamp { iq_s16a: i32, ms: u16 },
    Current { iq_s16a: i16, id_s16a: i16 },
    Set { register: String, value: toml::Value },
    Revup { phase: u8, rpm: i32, iq_s16a: i16, ms: u16 },
    Move { rad: f32, seconds: f32 },
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
    ClearError {},
    Torque { amps: f64 },
    Speed { dps: f64 },
    Move { degrees: f64, max_speed_dps: Option<f64>, direction: Option<Direction> },
    Gains { gains: [u8; 6] },
    Acceleration { dps2: f64 },
}

#[derive(Debug, Clone, Copy, PartialEq, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub(super) enum Direction {
    Cw,
    Ccw,
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
            StMessage::Ramp { rpm, ms } => {
                Request::SetRamp(Ramp { speed_rpm: rpm, duration_ms: ms })
            }
            StMessage::TorqueRamp { iq_s16a, ms } => {
                Request::SetTorqueRamp(TorqueRamp { torque_s16a: iq_s16a, duration_ms: ms })
            }
            StMessage::Current { iq_s16a, id_s16a } => {
                Request::SetCurrentReference(CurrentReference { iq_s16a, id_s16a })
            }
            StMessage::Revup { phase, .. } if phase >= REVUP_PHASES => {
                return Err(format!("phases of the rev-up are 0 to {}", REVUP_PHASES - 1));
            }
            StMessage::Revup { phase, rpm, iq_s16a, ms } => {
                let data = RevupPhase { speed_rpm: rpm, torque_s16a: iq_s16a, duration_ms: ms };
                Request::SetRevupData(phase, data)
            }
            StMessage::Move { rad, seconds } if !rad.is_finite() || !seconds.is_finite() => {
                return Err("a move has a finite angle and time".to_owned());
            }
            StMessage::Move { rad, seconds } => {
                Request::SetPosition(PositionMove { angle_rad: rad, duration_s: seconds })
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
            StMessage::Ramp { rpm, ms: 0 } => format!("{rpm} rpm"),
            StMessage::Ramp { rpm, ms } => format!("{rpm} rpm in {ms} ms"),
            StMessage::TorqueRamp { iq_s16a, ms } => format!("Iq {iq_s16a} in {ms} ms"),
            StMessage::Current { iq_s16a, id_s16a } => format!("Iq {iq_s16a}, Id {id_s16a}"),
            StMessage::Set { register, value } => format!("{register} {}", text(value)),
            StMessage::Revup { phase, .. } => format!("rev-up phase {phase}"),
            StMessage::Move { rad, seconds } => format!("{rad} rad in {seconds} s"),
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
            RmdMessage::ClearError {} => ClearErrors.encode(),
            RmdMessage::Torque { amps } => SetTorque { iq: wanted(amps)? }.encode(),
            RmdMessage::Speed { dps } => SetSpeed { speed: wanted(dps)? }.encode(),
            RmdMessage::Move { degrees, max_speed_dps, direction: None } => {
                let angle = wanted(degrees)?;
                match max_speed_dps {
                    None => SetPosition { angle }.encode(),
                    Some(dps) => SetPositionLimited { max_speed: wanted(dps)?, angle }.encode(),
                }
            }
            RmdMessage::Move { degrees, max_speed_dps, direction: Some(direction) } => {
                let direction = match direction {
                    Direction::Cw => SpinDirection::Clockwise,
                    Direction::Ccw => SpinDirection::Counterclockwise,
                };
                let angle = wanted(degrees)?;
                match max_speed_dps {
                    None => SetSingleTurnPosition { direction, angle }.encode(),
                    Some(dps) => {
                        let max_speed = wanted(dps)?;
                        SetSingleTurnPositionLimited { direction, max_speed, angle }.encode()
                    }
                }
            }
            RmdMessage::Gains { gains } => {
                let [position_kp, position_ki, speed_kp, speed_ki, torque_kp, torque_ki] = gains;
                WritePidRam(Pid {
                    position_kp,
                    position_ki,
                    speed_kp,
                    speed_ki,
                    torque_kp,
                    torque_ki,
                })
                .encode()
            }
            RmdMessage::Acceleration { dps2 } => {
                WriteAccelerationRam(Acceleration { acceleration: wanted(dps2)? }).encode()
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
            RmdMessage::ClearError {} => "clear error".to_owned(),
            RmdMessage::Torque { amps } => format!("{amps} A"),
            RmdMessage::Speed { dps } => format!("{dps} °/s"),
            RmdMessage::Move { degrees, max_speed_dps, direction } => {
                let way = match direction {
                    None => "",
                    Some(Direction::Cw) => " clockwise",
                    Some(Direction::Ccw) => " counterclockwise",
                };
                let most = max_speed_dps.map_or(String::new(), |dps| format!(", max {dps} °/s"));
                format!("to {degrees}°{way}{most}")
            }
            RmdMessage::Gains { gains } => format!("gains {gains:?}"),
            RmdMessage::Acceleration { dps2 } => format!("acceleration {dps2} °/s²"),
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

/// A physical value as the wire's integer. What no frame says is refused, never cut.
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

    #[test]
    fn messages_are_the_bytes_of_the_documents() {
        assert_eq!(st("send = \"start\"").unwrap(), [0x23, 1, 1, 0x25]);
        let ramp = st("send = \"ramp\"\nrpm = 1500\nms = 1000").unwrap();
        assert_eq!(ramp, [0x27, 6, 0xDC, 5, 0, 0, 0xE8, 3, 0xFA]);
        // A register of two bytes, in its unit, and one whose values have names.
        let kp = st("send = \"set\"\nregister = \"SPEED_KP\"\nvalue = -2").unwrap();
        assert_eq!(kp[..5], [0x21, 3, 5, 0xFE, 0xFF]);
        let mode = st("send = \"set\"\nregister = \"CONTROL_MODE\"\nvalue = \"SPEED\"").unwrap();
        assert_eq!(mode[..4], [0x21, 2, 3, 1]);

        let frame = rmd("send = \"move\"\ndegrees = 90\nmax_speed_dps = 360").unwrap();
        assert_eq!(frame, CanFrame::new(0x142, [0xA4, 0, 0x68, 1, 0x28, 0x23, 0, 0]));
        let frame = rmd("send = \"move\"\ndegrees = 90\ndirection = \"ccw\"").unwrap();
        assert_eq!(frame, CanFrame::new(0x142, [0xA5, 1, 0, 0, 0x28, 0x23, 0, 0]));
        let frame = rmd("send = \"gains\"\ngains = [1, 2, 3, 4, 5, 6]").unwrap();
        assert_eq!(frame, CanFrame::new(0x142, [0x31, 0, 1, 2, 3, 4, 5, 6]));
        let frame = rmd("send = \"torque\"\namps = -32").unwrap();
        assert_eq!(frame, CanFrame::new(0x142, [0xA1, 0, 0, 0, 0x30, 0xF8, 0, 0]));
    }

    #[test]
    fn what_no_frame_can_say_is_refused() {
        assert!(st("send = \"fly\"").unwrap_err().contains("fly"));
        assert!(st("send = \"start\"\nrpm = 3").unwrap_err().contains("rpm"));
        assert!(st("send = \"ramp\"\nrpm = 1500\nms = 70000").is_err());
        assert!(st("send = \"revup\"\nphase = 5\nrpm = 0\niq_s16a = 0\nms = 0").is_err());
        assert!(st("send = \"move\"\nrad = nan\nseconds = 1").is_err());
        let why = st("send = \"set\"\nregister = \"SPEED_KPP\"\nvalue = 3").unwrap_err();
        assert!(why.contains("SPEED_KP"), "{why}");
        assert!(st("send = \"set\"\nregister = \"SPEED_KP\"\nvalue = 40000").is_err());
        assert!(rmd("send = \"torque\"\namps = 32.1").unwrap_err().contains("±32"));
        assert!(rmd("send = \"speed\"\ndps = inf").is_err());
        assert!(rmd("send = \"move\"\ndegrees = 360\ndirection = \"cw\"").is_err());
        assert!(rmd("send = \"move\"\ndegrees = 1\nmax_speed_dps = -1").is_err());
        assert!(rmd("send = \"gains\"\ngains = [1, 2, 3]").is_err());
    }
}
