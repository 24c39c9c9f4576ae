//! ST messages.

use std::hint::black_box;

use motorlink_proto::st::{
    BoardInfo, Command, CurrentReference, FirmwareVersion, Frame, FrameCode, HEADER_ACK, MAX_FRAME,
    Parse, PositionMove, Profile, Ramp, RegisterId, Request, RevupPhase, TorqueRamp,
};

use super::kind::Kind;

const PHASE: RevupPhase = RevupPhase { speed_rpm: 1500, torque_s16a: 4000, duration_ms: 250 };
const NAME: &[u8; 32] = b"ST MC SDK\tVer.5.4.4\0\0\0\0\0\0\0\0\0\0\0\0\0";
const REGISTERS: &[u8] =
    &[RegisterId::SPEED_MEAS.0, RegisterId::TORQUE_MEAS.0, RegisterId::BUS_VOLTAGE.0];

/// Every kind of request with the payload of its positive acknowledge.
pub(super) fn kinds() -> Vec<Kind> {
    let register = RegisterId::SPEED_MEAS;
    let position = PositionMove { angle_rad: 1.5, duration_s: 0.5 };
    let torque_ramp = TorqueRamp { torque_s16a: 4000, duration_ms: 250 };
    let currents = CurrentReference { iq_s16a: 4000, id_s16a: -100 };
    vec![
        acknowledged(Request::SetRegister { register: RegisterId::SPEED_KP, value: &[0x10, 0x27] }),
        asked(Request::GetRegister(register), &[0xDC, 0x05, 0, 0], move |payload| {
            black_box(register.decode(Profile::Spec, payload));
        }),
        acknowledged(Request::ExecuteCommand(Command::StartMotor)),
        asked(Request::GetBoardInfo, NAME, |payload| {
            black_box(BoardInfo::decode(payload));
        }),
        acknowledged(Request::SetRamp(Ramp { speed_rpm: 1500, duration_ms: 250 })),
        asked(Request::GetRevupData(0), &PHASE.to_bytes(), |payload| {
            black_box(RevupPhase::decode(payload));
        }),
        acknowledged(Request::SetRevupData(0, PHASE)),
        acknowledged(Request::SetCurrentReference(currents)),
        asked(Request::GetProfilerInfo(&[1]), &[2, 0x66, 0x67], plain),
        asked(Request::GetFirmwareVersion, NAME, |payload| {
            black_box(FirmwareVersion::decode(payload));
        }),
        asked(Request::GetSegment(0), &[0; 8], plain),
        acknowledged(Request::SetTorqueRamp(torque_ramp)),
        acknowledged(Request::ConfigureSegment { segment: 0, registers: REGISTERS }),
        acknowledged(Request::SetPosition(position)),
    ]
}

/// A payload without decoding.
fn plain(payload: &[u8]) {
    black_box(payload);
}

/// A request that is acknowledged without a payload.
fn acknowledged(request: Request<'static>) -> Kind {
    asked(request, &[], plain)
}

fn asked(request: Request<'static>, payload: &[u8], decode: impl Fn(&[u8]) + 'static) -> Kind {
    let code = request.code();
    let profile = profile(code);
    let payload = payload.to_vec();
    let (mut sent, mut answered) = ([0; MAX_FRAME], [0; MAX_FRAME]);
    Kind::new(
        code.name().to_owned(),
        move || {
            if let Some(frame) = read(Frame::command(1, black_box(&request), &mut sent)) {
                let _ = black_box(frame.request(profile));
            }
        },
        move || {
            let reply = Frame { header: HEADER_ACK, payload: black_box(&payload) };
            if let Some(frame) = read(reply.encode(&mut answered)) {
                decode(frame.payload);
            }
        },
    )
}

/// Decodes the bytes as the peer does.
fn read(bytes: Option<&[u8]>) -> Option<Frame<'_>> {
    match Frame::parse(black_box(bytes?)) {
        Parse::Frame(frame, _) => Some(frame),
        _ => None,
    }
}

/// A profile that knows the code.
fn profile(code: FrameCode) -> Profile {
    match FrameCode::from_number(code.number(), Profile::Spec) {
        Some(known) if known == code => Profile::Spec,
        _ => Profile::Mcsdk54,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_frame_code_is_measured() {
        let measured = kinds().into_iter().map(|kind| kind.name);
        assert!(measured.eq(FrameCode::ALL.iter().map(|code| code.name())));
    }
}
