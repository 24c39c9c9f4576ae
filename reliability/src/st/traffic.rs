//! The requests of a program to a drive: reads, writes, commands, ramps, and frames of any kind.

use motorlink_link::fault::Rng;
use motorlink_proto::st::{
    Command, CurrentReference, Frame, MAX_FRAME, Profile, Ramp, RegisterId, Request, RevupPhase,
};

use super::drive::MOTORS;

/// One request, as its bytes.
#[derive(Debug, Clone, Copy)]
pub struct Ask {
    pub header: u8,
    payload: [u8; 127],
    size: u8,
}

impl Ask {
    pub fn of(motor: u8, request: &Request<'_>) -> Self {
        let mut out = [0; MAX_FRAME];
        let bytes =
            Frame::command(motor, request, &mut out).expect("requests of the mix fit a frame");
        Ask::raw(bytes[0], &bytes[2..bytes.len() - 1])
    }

    fn raw(header: u8, given: &[u8]) -> Self {
        let mut payload = [0; 127];
        payload[..given.len()].copy_from_slice(given);
        Ask { header, payload, size: given.len() as u8 }
    }

    pub fn payload(&self) -> &[u8] {
        &self.payload[..usize::from(self.size)]
    }

    /// The frame's bytes.
    pub fn frame<'o>(&self, out: &'o mut [u8; MAX_FRAME]) -> &'o [u8] {
        let frame = Frame { header: self.header, payload: self.payload() };
        frame.encode(out).expect("a payload of at most 127 bytes")
    }
}

/// Registers that programs read periodically, and settings that they write.
pub const WATCHED: [RegisterId; 8] = [
    RegisterId::SPEED_MEAS,
    RegisterId::SPEED_REF,
    RegisterId::STATUS,
    RegisterId::FLAGS,
    RegisterId::BUS_VOLTAGE,
    RegisterId::TORQUE_MEAS,
    RegisterId::SPEED_KP,
    RegisterId::UID,
];
pub const SETTINGS: [RegisterId; 8] = [
    RegisterId::SPEED_KP,
    RegisterId::SPEED_KI,
    RegisterId::TORQUE_KP,
    RegisterId::TORQUE_KI,
    RegisterId::FLUX_KP,
    RegisterId::FF_1Q,
    RegisterId::FF_2,
    RegisterId::PFC_I_KP,
];
const COMMANDS: [Command; 5] = [
    Command::StartMotor,
    Command::StopMotor,
    Command::StopRamp,
    Command::FaultAck,
    Command::StartStop,
];

/// The next request of the mix: half are reads, a fifth are register writes, a tenth are commands.
pub fn next(profile: Profile, rng: &mut Rng) -> Ask {
    let motor = rng.u8(1..=MOTORS);
    let request = match rng.u8(..100) {
        0..50 => Request::GetRegister(WATCHED[rng.usize(..WATCHED.len())]),
        50..70 => return write(motor, profile, SETTINGS[rng.usize(..SETTINGS.len())], rng.i32(..)),
        70..80 => Request::ExecuteCommand(COMMANDS[rng.usize(..COMMANDS.len())]),
        80..86 => {
            Request::SetRamp(Ramp { speed_rpm: rng.i32(-6_000..6_000), duration_ms: rng.u16(..) })
        }
        86..89 => Request::SetCurrentReference(CurrentReference {
            iq_s16a: rng.i16(..),
            id_s16a: rng.i16(..),
        }),
        89..91 => Request::GetBoardInfo,
        91..92 => Request::GetFirmwareVersion,
        92..94 => Request::GetRevupData(rng.u8(..5)),
        94..96 => {
            let speed_rpm = rng.i32(-6_000..6_000);
            let data = RevupPhase { speed_rpm, torque_s16a: rng.i16(..), duration_ms: rng.u16(..) };
            Request::SetRevupData(rng.u8(..5), data)
        }
        // Data segments in one profile; a torque ramp or unknown in the other.
        96..97 => return Ask::raw(Frame::header(0x0E, motor), &[0, 0x1E, 0x02, 0x19, 0x23]),
        97..98 => return Ask::raw(Frame::header(0x0D, motor), &[0, 1, 0, 0, 100, 0]),
        // A motor that does not exist, and unknown codes with a payload of any size.
        98..99 => return Ask::of(MOTORS + 1, &Request::GetRegister(RegisterId::STATUS)),
        _ => {
            let mut payload = [0; 127];
            rng.fill(&mut payload);
            return Ask::raw(Frame::header(0x1D, motor), &payload[..rng.usize(..=127)]);
        }
    };
    Ask::of(motor, &request)
}

pub fn write(motor: u8, profile: Profile, register: RegisterId, value: i32) -> Ask {
    let bytes = value.to_le_bytes();
    let value = &bytes[..usize::from(register.write_size(profile))];
    Ask::of(motor, &Request::SetRegister { register, value })
}
