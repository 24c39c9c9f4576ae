//! Cases of 4.7 to 4.12 that leave the motor at rest.

use motorlink_proto::Hex;
use motorlink_proto::st::register::Feature;
use motorlink_proto::st::{
    CurrentReference, ErrorCode, FrameCode, HEADER_ACK, MAX_PAYLOAD, PositionMove, Profile,
    REVUP_PHASES, Ramp, RegisterId, Request, RevupPhase, TorqueRamp,
};

use super::harness::Harness;
use super::values::as_kept;
use crate::case::{Case, ReadAs, Stop};
use crate::reading::{S7, S13, S24, S26, S48, S51, S52};

pub(super) fn cases(profile: Profile) -> Vec<Case<Harness>> {
    let mut cases = vec![
        Case::new(
            "board_info_has_32_bytes",
            &["ST-4.7-02", "ST-4.7-03"],
            |harness: &mut Harness| {
                let payload = harness.acknowledged(&Request::GetBoardInfo)?;
                harness.require(payload.len() == 32, "ACK with 32 bytes")
            },
        ),
        Case::new("board_info_begins_with_the_version", &["ST-4.7-04"], board_version),
        Case::new("board_info_ends_in_a_name", &["ST-4.7-05"], |harness: &mut Harness| {
            let payload = harness.acknowledged(&Request::GetBoardInfo)?;
            let name = payload.get(3..).and_then(terminated);
            harness.require(name.is_some(), "printable characters and a NUL from byte 3 on")
        }),
        Case::new(
            "firmware_version_has_32_bytes",
            &["ST-4.12-02", "ST-4.12-03"],
            |harness: &mut Harness| {
                let payload = harness.acknowledged(&Request::GetFirmwareVersion)?;
                harness.require(payload.len() == 32, "ACK with 32 bytes")
            },
        ),
        Case::new("firmware_version_is_terminated", &["ST-4.12-04"], |harness: &mut Harness| {
            let payload = harness.acknowledged(&Request::GetFirmwareVersion)?;
            let text = terminated(&payload);
            harness.require(text.is_some(), "printable characters, a tab among them, and a NUL")
        }),
        Case::new(
            "firmware_version_follows_its_scheme",
            &["ST-4.12-05", "ST-4.12-06", "ST-4.12-07", "ST-4.12-08", "ST-4.12-09", "ST-4.12-10"],
            |harness: &mut Harness| version(harness).map(drop),
        ),
        Case::new(
            "a_ramp_at_rest_is_kept_and_starts_nothing",
            &["ST-4.8-02", "ST-4.8-04", "ST-4.8-07", "ST-4.8-09"],
            ramp_at_rest,
        ),
        Case::new(
            "current_references_at_rest_start_nothing",
            &["ST-4.11-02", "ST-4.11-04", "ST-4.11-06"],
            references_at_rest,
        ),
        Case::new(
            "revup_phases_beyond_4_are_refused",
            &["ST-4.9-02", "ST-4.10-03", "ST-4.3-09"],
            |harness: &mut Harness| {
                let data = RevupPhase { speed_rpm: 600, torque_s16a: 1_000, duration_ms: 100 };
                for phase in REVUP_PHASES..=255 {
                    harness.refused(&Request::GetRevupData(phase), ErrorCode::WrongSet)?;
                    harness.refused(&Request::SetRevupData(phase, data), ErrorCode::WrongSet)?;
                }
                Ok(())
            },
        )
        .reading(S24),
    ];
    for phase in 0..REVUP_PHASES {
        cases.push(Case::new(
            format!("a_revup_phase_is_read[{phase}]"),
            &["ST-4.9-06", "ST-4.9-02", "ST-4.9-07"],
            move |harness: &mut Harness| {
                let payload = harness.acknowledged(&Request::GetRevupData(phase))?;
                let size = RevupPhase::SIZE;
                harness.require(payload.len() == size, "ACK with 8 bytes: speed, torque, duration")
            },
        ));
        cases.push(Case::new(
            format!("a_revup_phase_is_written_and_read_back[{phase}]"),
            &[
                "ST-4.10-02",
                "ST-4.10-04",
                "ST-4.10-05",
                "ST-4.10-06",
                "ST-4.10-07",
                "ST-4.9-03",
                "ST-4.9-04",
                "ST-4.9-05",
            ],
            move |harness: &mut Harness| revup(harness, phase),
        ));
    }
    match profile {
        Profile::Spec => cases.extend(segments().into_iter().map(|case| case.reading(S7))),
        Profile::Mcsdk54 => cases.extend(firmware()),
    }
    cases
}

/// The printable text before the NUL; `None` if there is no NUL or the text is not printable.
fn terminated(bytes: &[u8]) -> Option<&str> {
    let end = bytes.iter().position(|&byte| byte == 0)?;
    let text = std::str::from_utf8(&bytes[..end]).ok()?;
    let printable = text.chars().all(|c| c == '\t' || !c.is_control());
    (printable && !text.is_empty()).then_some(text)
}

/// Major, minor and patch of the version string. Checks the scheme of 4.12.
fn version(harness: &mut Harness) -> Result<[u32; 3], Stop> {
    let payload = harness.acknowledged(&Request::GetFirmwareVersion)?;
    let scheme = "NAME<tab>Ver.MAJOR.MINOR.PATCH, or that and -A, -B or -RC with a number from 1, \
                  MAJOR from 1";
    let text = terminated(&payload);
    let numbers = text.and_then(parse).ok_or_else(|| harness.failed(scheme))?;
    // The printed scheme has one point too many between "Ver" and the numbers.
    let to_the_letter = text.is_some_and(|text| text.contains(&format!("\tVer.{}.", numbers[0])));
    let held = harness.require(to_the_letter, scheme);
    harness.note(S13, held)?;
    Ok(numbers)
}

/// The numbers after a name and a tab. "Ver" and points before them are optional.
fn parse(text: &str) -> Option<[u32; 3]> {
    let (name, version) = text.split_once('\t')?;
    let version = version.trim_start_matches("Ver").trim_start_matches('.').trim_start();
    let (numbers, pre_release) = match version.split_once('-') {
        Some((numbers, pre_release)) => (numbers, Some(pre_release)),
        None => (version, None),
    };
    let mut parts = numbers.split('.').map(number);
    let found = [parts.next()??, parts.next()??, parts.next()??];
    let whole = parts.next().is_none() && !name.is_empty() && found[0] >= 1;
    let pre_release_is_one = pre_release.is_none_or(|text| {
        let increment = ["RC", "A", "B"].iter().find_map(|kind| text.strip_prefix(kind));
        increment.and_then(number).is_some_and(|increment| increment >= 1)
    });
    (whole && pre_release_is_one).then_some(found)
}

fn number(text: &str) -> Option<u32> {
    text.bytes().all(|byte| byte.is_ascii_digit()).then(|| text.parse().ok())?
}

/// The version as integers, or in shipped firmware as ASCII digits (SPEC-NOTES S13). It must equal
/// the version string.
fn board_version(harness: &mut Harness) -> Result<(), Stop> {
    let numbers = version(harness)?;
    let payload = harness.acknowledged(&Request::GetBoardInfo)?;
    let wanted = numbers.map(|number| match harness.profile() {
        Profile::Spec => number as u8,
        Profile::Mcsdk54 => b'0' + (number % 10) as u8,
    });
    let hint = match (harness.profile(), payload.get(..3)) {
        (Profile::Spec, Some(digits)) if digits.iter().all(u8::is_ascii_digit) => {
            "; shipped firmware sends digits; use --profile mcsdk-5.4 for it"
        }
        _ => "",
    };
    let expected = format!("ACK that begins with {}, as in the version string{hint}", Hex(&wanted));
    match harness.profile() {
        Profile::Spec => harness.require(payload.starts_with(&wanted), expected).read_as(S51),
        Profile::Mcsdk54 => harness.require(payload.starts_with(&wanted), expected),
    }
}

fn ramp_at_rest(harness: &mut Harness) -> Result<(), Stop> {
    harness.keep_setpoints()?;
    // The duration cannot be read back, so the last write is a slow ramp.
    for speed_rpm in [0x0640, -1_002, 70_002] {
        harness.done(&Request::SetRamp(Ramp { speed_rpm, duration_ms: 2_000 }))?;
        let now = harness.value(RegisterId::RAMP_FINAL_SPEED)?;
        let shown = as_kept(harness.profile(), speed_rpm);
        let held =
            harness.require(now == shown, format!("ACK {shown} rpm, the final speed of the ramp"));
        harness.note(S26, held)?;
        nothing_started(harness)?;
    }
    Ok(())
}

fn references_at_rest(harness: &mut Harness) -> Result<(), Stop> {
    harness.keep_setpoints()?;
    const IQ: i16 = 0x0123;
    let reference = CurrentReference { iq_s16a: IQ, id_s16a: -0x0045 };
    harness.done(&Request::SetCurrentReference(reference))?;
    nothing_started(harness)?;
    let measured = harness.value(RegisterId::TORQUE_MEAS)?;
    let little = measured.abs() < i32::from(IQ / 2);
    harness.require(little, "ACK about 0 s16A, because no current flows at rest")
}

fn nothing_started(harness: &mut Harness) -> Result<(), Stop> {
    harness.require_idle("because nothing was started")?;
    let reference = harness.value(RegisterId::SPEED_REF)?;
    let waits =
        harness.require(reference == 0, "ACK 0 rpm, because a ramp waits until the motor runs");
    harness.note(S48, waits)
}

fn revup(harness: &mut Harness, phase: u8) -> Result<(), Stop> {
    harness.keep_revup(phase)?;
    let sensorless = harness.has(Feature::ObserverPll)? || harness.has(Feature::ObserverCordic)?;
    let samples = [
        // A speed of more than 16 bits, and negative values.
        RevupPhase { speed_rpm: 70_002, torque_s16a: 0x0123, duration_ms: 0x0234 },
        RevupPhase { speed_rpm: -798, torque_s16a: -0x0216, duration_ms: 0x8001 },
    ];
    for data in samples {
        harness.done(&Request::SetRevupData(phase, data))?;
        let payload = harness.acknowledged(&Request::GetRevupData(phase))?;
        let bytes = data.to_bytes();
        let held =
            harness.require(payload == bytes, format!("ACK {}, which was written", Hex(&bytes)));
        if sensorless { held? } else { held.read_as(S52)? }
    }
    // The other phases have other data.
    let data = samples[0];
    let other = (phase + 1) % REVUP_PHASES;
    let before = harness.acknowledged(&Request::GetRevupData(other))?;
    harness.done(&Request::SetRevupData(phase, data))?;
    let now = harness.acknowledged(&Request::GetRevupData(other))?;
    harness.require(now == before, format!("phase {other} as before: {}", Hex(&before)))
}

/// Data segments. The layout is ours, because the document does not contain it (SPEC-NOTES S7).
fn segments() -> Vec<Case<Harness>> {
    vec![
        Case::new(
            "a_data_segment_gives_the_values_of_its_registers",
            &["ST-3.1-10", "ST-3.1-11"],
            |harness: &mut Harness| {
                empty_segment(harness)?;
                let registers = [
                    RegisterId::STATUS.0,
                    RegisterId::SPEED_MEAS.0,
                    RegisterId::I_A.0,
                    RegisterId::BUS_VOLTAGE.0,
                ];
                harness.done(&Request::ConfigureSegment { segment: 0, registers: &registers })?;
                let payload = harness.acknowledged(&Request::GetSegment(0))?;
                harness.require(payload.len() == 9, "ACK with 1, 4, 2 and 2 bytes")?;
                harness.require(payload[..7] == [0; 7], "ACK with STATUS, speed and current 0")
            },
        ),
        Case::new(
            "invalid_registers_of_a_data_segment_are_refused",
            &["ST-3.1-11", "ST-4.3-09"],
            |harness: &mut Harness| {
                empty_segment(harness)?;
                let status = [RegisterId::STATUS.0];
                harness.done(&Request::ConfigureSegment { segment: 0, registers: &status })?;
                let many = [RegisterId::STATUS.0; 33];
                for registers in [&[0xEE][..], &many] {
                    let request = Request::ConfigureSegment { segment: 0, registers };
                    harness.refused(&request, ErrorCode::WrongSet)?;
                }
                let none = Request::ConfigureSegment { segment: 0xEE, registers: &status };
                harness.refused(&none, ErrorCode::WrongSet)?;
                harness.refused(&Request::GetSegment(0xEE), ErrorCode::WrongSet)?;
                let payload = harness.acknowledged(&Request::GetSegment(0))?;
                harness.require(payload.len() == 1, "ACK with the segment as before, 1 byte")
            },
        ),
        Case::new(
            "a_reply_may_have_128_bytes",
            &["ST-3-05", "ST-3.1-10"],
            |harness: &mut Harness| {
                empty_segment(harness)?;
                let registers = [RegisterId::SPEED_MEAS.0; 32];
                harness.done(&Request::ConfigureSegment { segment: 0, registers: &registers })?;
                let payload = harness.acknowledged(&Request::GetSegment(0))?;
                harness.require(payload.len() == MAX_PAYLOAD, "ACK with 128 bytes")
            },
        ),
    ]
}

/// Segment 0, which must be empty: its registers cannot be read, so it could not be restored.
pub(super) fn empty_segment(harness: &mut Harness) -> Result<(), Stop> {
    // Shipped firmware reads the request of a segment as a torque ramp (S7). It refuses this one.
    let absent = Request::ConfigureSegment { segment: 0xEE, registers: &[RegisterId::STATUS.0] };
    let bytes = harness.encode(&absent);
    if harness.exchange(&bytes)?.is_nack(ErrorCode::BadFrameId) {
        let why = "the drive has no data segments; the document does not describe them";
        return Err(Stop::Skipped(why.to_owned()));
    }
    let bytes = harness.encode(&Request::GetSegment(0));
    let reply = harness.exchange(&bytes)?;
    harness.require(reply.header == HEADER_ACK, "ACK")?;
    if !reply.payload.is_empty() {
        return Err(Stop::Skipped("data segment 0 is in use".to_owned()));
    }
    harness.undo.push(super::undo::Undo::Segment(0));
    Ok(())
}

/// Messages that only shipped firmware has.
fn firmware() -> Vec<Case<Harness>> {
    vec![
        Case::new(
            "profiler_information_needs_a_profiler",
            &["ST-4.3-15", "ST-3.1-16"],
            |harness: &mut Harness| {
                harness.need_no(Feature::Profiler)?;
                for steps in [&[][..], &[0, 1, 2]] {
                    harness.refused(&Request::GetProfilerInfo(steps), ErrorCode::MpNotEnabled)?;
                }
                Ok(())
            },
        ),
        Case::new(
            "a_torque_ramp_at_rest_starts_nothing",
            &["ST-3.1-10"],
            |harness: &mut Harness| {
                harness.keep_setpoints()?;
                let ramp = TorqueRamp { torque_s16a: 0x0123, duration_ms: 500 };
                harness.done(&Request::SetTorqueRamp(ramp))?;
                nothing_started(harness)
            },
        ),
        Case::new(
            "position_commands_need_position_control",
            &["ST-3.1-16", "ST-4.1-16"],
            |harness: &mut Harness| {
                harness.need_no(Feature::PositionControl)?;
                let target = PositionMove { angle_rad: 0.0, duration_s: 1.0 };
                harness.refused(&Request::SetPosition(target), ErrorCode::BadFrameId)
            },
        ),
        Case::new(
            "codes_that_firmware_lacks_are_refused",
            &["ST-3.1-11", "ST-4.1-16"],
            |harness: &mut Harness| {
                let code = FrameCode::ConfigDynStruct.number();
                let bytes = harness.frame(code, &[0, RegisterId::STATUS.0]);
                harness.refused_bytes(&bytes, ErrorCode::BadFrameId)
            },
        ),
    ]
}

#[cfg(test)]
mod tests {
    use super::parse;

    #[test]
    fn the_version_scheme_has_a_name_a_tab_and_numbers() {
        assert_eq!(parse("ST MC SDK\tVer.5.4.4"), Some([5, 4, 4]));
        assert_eq!(parse("Fan\tVer.1.0.12-RC2"), Some([1, 0, 12]));
        assert_eq!(parse("Fan\tVer..1.0.12"), Some([1, 0, 12]), "as printed in the document");
        for wrong in [
            "ST MC SDK Ver.5.4.4",
            "\tVer.5.4.4",
            "x\tVer.0.4.4",
            "x\tVer.5.4",
            "x\tVer.5.4.4.1",
            "x\tVer.5.4.+4",
            "x\tVer.5.4.4-RC",
            "x\tVer.5.4.4-RC0",
            "x\tVer.5.4.4-X1",
        ] {
            assert_eq!(parse(wrong), None, "{wrong}");
        }
    }
}
