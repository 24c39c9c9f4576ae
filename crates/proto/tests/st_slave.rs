//! The slave against the document's paragraphs, on a virtual clock.

use crate::common::{Memory, SlaveFixture, all_features, answer};
use motorlink_proto::st::register::{Access, Origin};
use motorlink_proto::st::*;
use motorlink_proto::time::{Instant, Micros};

const GET_STATUS: [u8; 4] = [0x02, 0x01, 0x02, 0x05];

fn spec() -> SlaveFixture {
    SlaveFixture::new(Profile::Spec, 2, Memory::usual())
}

fn mcsdk() -> SlaveFixture {
    SlaveFixture::new(Profile::Mcsdk54, 2, Memory::usual())
}

fn set(register: RegisterId, value: &[u8]) -> Request<'_> {
    Request::SetRegister { register, value }
}

#[test]
fn checks_come_in_order_checksum_motor_frame_code() {
    let mut bench = spec();
    assert_eq!(answer(&bench.bytes(&[0xFF, 0x00, 0x00])), Err(ErrorCode::BadCrc));
    assert_eq!(bench.raw(0x7F, &[]), Err(ErrorCode::BadMotorSelected));
    assert_eq!(bench.raw(0x1F, &[]), Err(ErrorCode::BadFrameId));
    assert_eq!(bench.raw(0x5F, &[]), Err(ErrorCode::BadFrameId));
    assert_eq!(
        bench.slave.current_motor().number(),
        2,
        "the motor is selected before the code is checked"
    );
}

#[test]
fn acknowledges_sent_as_commands_address_motor_7() {
    for header in [HEADER_ACK, HEADER_NACK] {
        assert_eq!(spec().raw(header, &[]), Err(ErrorCode::BadMotorSelected));
        let mut seven = SlaveFixture::new(Profile::Spec, 7, Memory::usual());
        assert_eq!(seven.raw(header, &[]), Err(ErrorCode::BadFrameId));
    }
}

#[test]
fn a_motor_number_stays_selected_until_another_is_addressed() {
    let mut bench = spec();
    bench.drive.set(1, RegisterId::STATUS, 6);
    bench.drive.set(2, RegisterId::STATUS, 10);
    let status = Request::GetRegister(RegisterId::STATUS);
    assert_eq!(bench.ask(0, status), Ok(vec![6]));
    assert_eq!(bench.ask(2, status), Ok(vec![10]));
    assert_eq!(bench.ask(0, status), Ok(vec![10]));
    assert_eq!(bench.ask(3, status), Err(ErrorCode::BadMotorSelected));
    assert_eq!(bench.ask(0, status), Ok(vec![10]));
}

#[test]
fn target_motor_counts_from_zero_and_refuses_missing_motors() {
    let mut bench = spec();
    let target = Request::GetRegister(RegisterId::TARGET_MOTOR);
    assert_eq!(bench.ask(0, target), Ok(vec![0]));
    assert_eq!(bench.ask(0, set(RegisterId::TARGET_MOTOR, &[1])), Ok(vec![]));
    assert_eq!(bench.ask(0, target), Ok(vec![1]));
    assert_eq!(bench.ask(0, set(RegisterId::TARGET_MOTOR, &[2])), Err(ErrorCode::WrongSet));
    assert_eq!(bench.ask(0, set(RegisterId::TARGET_MOTOR, &[0xFF])), Err(ErrorCode::WrongSet));
    assert_eq!(bench.slave.current_motor().number(), 2);
}

#[test]
fn a_frame_that_is_not_whole_after_25_ms_is_answered_with_timeout() {
    for cut in 1..GET_STATUS.len() {
        let mut bench = spec();
        assert_eq!(bench.bytes(&GET_STATUS[..cut]), [0_u8; 0]);
        let deadline = bench.slave.deadline().expect("a frame is under way");
        assert_eq!(deadline, Instant(25_000));
        assert_eq!(bench.slave.poll(Instant(24_999)), None);
        let reply = bench.slave.poll(deadline).expect("a NACK is due").to_vec();
        assert_eq!(answer(&reply), Err(ErrorCode::Timeout));
        assert_eq!((bench.slave.deadline(), bench.slave.is_receiving()), (None, false));
        bench.now = deadline;
        assert_eq!(answer(&bench.bytes(&GET_STATUS)), Ok(vec![0]));
    }
}

#[test]
fn a_byte_behind_the_deadline_begins_a_new_command() {
    let mut bench = spec();
    bench.bytes(&GET_STATUS[..2]);
    bench.now = Instant(30_000);
    let replies = bench.bytes(&GET_STATUS);
    assert_eq!(answer(&replies[..4]), Err(ErrorCode::Timeout));
    assert_eq!(answer(&replies[4..]), Ok(vec![0]));
}

#[test]
#[cfg_attr(miri, ignore = "an interpreter takes long")]
fn a_length_over_128_is_answered_with_timeout_after_25_ms_of_silence() {
    let mut bench = spec();
    for length in 129..=255u8 {
        assert_eq!(bench.bytes(&[0x02, length]), [0_u8; 0]);
        for _ in 0..20 {
            bench.now += Micros::from_millis(20);
            assert_eq!(
                bench.bytes(&GET_STATUS),
                [0_u8; 0],
                "the slave drops all bytes until silence"
            );
        }
        bench.now += Micros::from_millis(25);
        let reply = bench.slave.poll(bench.now).expect("a NACK is due").to_vec();
        assert_eq!(answer(&reply), Err(ErrorCode::Timeout));
    }
}

#[test]
fn a_payload_of_128_bytes_is_taken() {
    assert_eq!(spec().raw(0x06, &[0; 128]).map(|info| info.len()), Ok(32));
}

#[test]
fn shipped_firmware_never_times_out_and_drops_a_length_over_127() {
    let mut bench = mcsdk();
    bench.bytes(&GET_STATUS[..3]);
    bench.now += Micros::from_millis(60_000);
    assert_eq!((bench.slave.deadline(), bench.slave.is_receiving()), (None, true));
    assert_eq!(answer(&bench.bytes(&GET_STATUS[3..])), Ok(vec![0]));
    assert!(!bench.slave.is_receiving());
    assert_eq!(bench.bytes(&[0x02, 128]), [0_u8; 0]);
    assert!(!bench.slave.is_receiving());
    assert_eq!(answer(&bench.bytes(&GET_STATUS)), Ok(vec![0]), "the next byte is a header");
}

#[test]
fn a_line_stuck_at_0_sends_frames_of_code_0() {
    for mut bench in [spec(), mcsdk()] {
        assert_eq!(answer(&bench.bytes(&[0, 0, 0])), Err(ErrorCode::BadFrameId));
        assert!(bench.drive.registers.is_empty() && bench.drive.log.is_empty());
    }
}

#[test]
fn an_overrun_drops_the_frame_and_sends_a_nack() {
    let mut bench = spec();
    bench.bytes(&GET_STATUS[..2]);
    let reply = bench.slave.overrun().to_vec();
    assert_eq!(answer(&reply), Err(ErrorCode::Overrun));
    assert_eq!(answer(&bench.bytes(&GET_STATUS)), Ok(vec![0]));
}

#[test]
fn temperature_and_power_have_a_sign_in_shipped_firmware_only() {
    for register in [RegisterId::HEATS_TEMP, RegisterId::MOTOR_POWER] {
        for (profile, value, read) in [
            (Profile::Spec, 65_535, 65_535),
            (Profile::Spec, -10, 0),
            (Profile::Mcsdk54, 65_535, -1),
            (Profile::Mcsdk54, -10, -10),
        ] {
            let mut bench = SlaveFixture::new(profile, 1, Memory::with(all_features()));
            bench.drive.set(1, register, value);
            let payload = bench.ask(1, Request::GetRegister(register)).unwrap();
            assert_eq!(payload.len(), 2);
            assert_eq!(register.decode(profile, &payload), Some(read), "{register} {profile:?}");
        }
    }
}

#[test]
#[cfg_attr(miri, ignore = "an interpreter takes long")]
fn every_register_is_read_and_written_as_table_3_says() {
    for features in [Features::NONE, all_features()] {
        let mut bench = SlaveFixture::new(Profile::Spec, 1, Memory::with(features));
        for id in (0..=255).map(RegisterId) {
            let shape = id.shape().filter(|shape| shape.origin == Origin::Table3);
            let there = shape.filter(|shape| features.has(shape.feature));
            let access = there.map(|shape| shape.access);
            let size = there.map_or(0, |shape| usize::from(shape.ty(Profile::Spec).size()));

            let read = bench.ask(0, Request::GetRegister(id)).map(|value| value.len());
            let readable = matches!(access, Some(Access::ReadWrite | Access::ReadOnly));
            assert_eq!(read, readable.then_some(size).ok_or(ErrorCode::GetWriteOnly), "{id}");

            let value = if id.to_string().starts_with("DAC_OUT") { 0x27 } else { 0 };
            let write = bench.ask(0, set(id, &[value, 0, 0, 0][..size]));
            let writable = matches!(access, Some(Access::ReadWrite | Access::WriteOnly));
            assert_eq!(write, writable.then_some(vec![]).ok_or(ErrorCode::SetReadOnly), "{id}");
        }
    }
}

#[test]
fn shipped_firmware_refuses_a_missing_feature_with_3_and_5() {
    let mut bench = SlaveFixture::new(Profile::Mcsdk54, 1, Memory::with(Features::NONE));
    let kp = RegisterId::FLUXWK_KP;
    assert_eq!(bench.ask(0, Request::GetRegister(kp)), Err(ErrorCode::GetWriteOnly));
    assert_eq!(bench.ask(0, set(kp, &[1, 0])), Err(ErrorCode::WrongSet));
    let measured = RegisterId::FLUXWK_BUS_MEAS;
    assert_eq!(bench.ask(0, set(measured, &[1, 0])), Err(ErrorCode::SetReadOnly));
    assert_eq!(bench.ask(0, set(RegisterId::DAC_OUT1, &[0x27])), Ok(vec![]));
    assert_eq!(
        bench.ask(0, Request::GetRegister(RegisterId::DAC_OUT1)),
        Err(ErrorCode::GetWriteOnly)
    );
}

#[test]
fn shipped_firmware_differs_from_table_3_in_sizes_and_access() {
    let mut bench = SlaveFixture::new(Profile::Mcsdk54, 1, Memory::with(all_features()));
    let size =
        |bench: &mut SlaveFixture, id| bench.ask(0, Request::GetRegister(id)).map(|v| v.len());
    assert_eq!(size(&mut bench, RegisterId::CTRBID), Ok(2));
    assert_eq!(size(&mut bench, RegisterId::IQ_SPEEDMODE), Ok(2));
    assert_eq!(size(&mut bench, RegisterId::CURRENT_POSITION), Ok(4));
    for id in [0x3F, 0x40, 0x42, 0x45, 0x5C, 0x62, 0x71, 0x81, 0x89, 0xFF] {
        assert_eq!(size(&mut bench, RegisterId(id)), Err(ErrorCode::GetWriteOnly), "{id:#x}");
        assert_eq!(bench.ask(0, set(RegisterId(id), &[0; 4])), Err(ErrorCode::SetReadOnly));
    }
    let c1 = RegisterId::OBSERVER_C1;
    assert_eq!(bench.ask(0, set(c1, &[1, 0])), Err(ErrorCode::WrongSet), "4 bytes are required");
    assert_eq!(bench.ask(0, set(c1, &[0x34, 0x12, 0, 0])), Ok(vec![]));
    assert_eq!(bench.ask(0, Request::GetRegister(c1)), Ok(vec![0x34, 0x12]));
    assert_eq!(bench.ask(0, set(RegisterId::OBSERVER_CR_C1, &[0; 4])), Err(ErrorCode::SetReadOnly));
    assert_eq!(bench.ask(0, set(RegisterId::SC_STARTUP_SPEED, &[0; 4])), Err(ErrorCode::WrongSet));
}

#[test]
fn a_drive_with_every_feature_knows_the_commands_of_its_profile() {
    for profile in Profile::ALL {
        let mut bench = SlaveFixture::new(profile, 1, Memory::with(all_features()));
        for number in 0..=u8::MAX {
            let command = Command::from(number);
            let known = bench.ask(0, Request::ExecuteCommand(command)).is_ok();
            assert_eq!(known, command.is_in(profile), "{command:?}");
        }
    }
}

#[test]
fn a_longer_value_is_cut_and_a_shorter_one_keeps_the_rest() {
    let mut bench = spec();
    let kp = RegisterId::SPEED_KP;
    assert_eq!(bench.ask(1, set(kp, &[0x34, 0x12, 0xFF, 0xFF])), Ok(vec![]));
    assert_eq!(bench.drive.value(1, kp), 0x1234);
    assert_eq!(bench.ask(1, set(kp, &[0x78])), Ok(vec![]));
    assert_eq!(bench.drive.value(1, kp), 0x1278);
    assert_eq!(bench.ask(1, set(kp, &[])), Ok(vec![]));
    assert_eq!(bench.drive.value(1, kp), 0x1278);
    assert_eq!(mcsdk().ask(1, set(kp, &[0x78])), Err(ErrorCode::WrongSet));
}

#[test]
fn a_value_keeps_its_sign() {
    let mut bench = spec();
    bench.ask(1, set(RegisterId::SPEED_KP, &[0xFF, 0xFF])).unwrap();
    assert_eq!(bench.drive.value(1, RegisterId::SPEED_KP), -1);
    bench.ask(1, set(RegisterId::FLUXWK_BUS, &[98, 0])).unwrap();
    assert_eq!(bench.drive.value(1, RegisterId::FLUXWK_BUS), 980, "tenths inside the drive");
    assert_eq!(bench.ask(1, Request::GetRegister(RegisterId::FLUXWK_BUS)), Ok(vec![98, 0]));
}

#[test]
fn a_message_that_is_too_short_is_refused() {
    for mut bench in [spec(), mcsdk()] {
        assert_eq!(bench.raw(0x01, &[]), Err(ErrorCode::WrongSet));
        assert_eq!(bench.raw(0x02, &[]), Err(ErrorCode::GetWriteOnly));
        assert_eq!(bench.raw(0x03, &[]), Err(ErrorCode::WrongCmd));
        assert_eq!(bench.raw(0x07, &[0; 5]), Err(ErrorCode::WrongSet));
        assert_eq!(bench.raw(0x08, &[]), Err(ErrorCode::WrongSet));
        assert_eq!(bench.raw(0x09, &[0; 8]), Err(ErrorCode::WrongSet));
        assert_eq!(bench.raw(0x0A, &[0; 3]), Err(ErrorCode::WrongSet));
        assert!(bench.drive.log.is_empty(), "nothing may have happened: {:?}", bench.drive.log);
    }
}

#[test]
fn dac_channels_show_registers_of_access_d() {
    let mut bench = spec();
    assert_eq!(bench.ask(1, set(RegisterId::DAC_OUT2, &[0x25])), Ok(vec![]));
    assert_eq!(bench.ask(1, Request::GetRegister(RegisterId::DAC_OUT2)), Ok(vec![0x25]));
    assert_eq!(bench.ask(1, set(RegisterId::DAC_OUT2, &[0x05])), Err(ErrorCode::WrongSet));
    assert_eq!(bench.drive.value(1, RegisterId::DAC_OUT2), 0x25);
    assert_eq!(mcsdk().ask(1, set(RegisterId::DAC_OUT2, &[0x05])), Ok(vec![]));
}

#[test]
#[cfg_attr(miri, ignore = "an interpreter takes long")]
fn commands_are_acknowledged_as_table_4_says() {
    let log = |bench: &SlaveFixture| bench.drive.log.join(", ");
    for number in 0..=255u8 {
        let command = Command::from(number);
        let documented = matches!(number, 1..=3 | 6..=12);
        let mut bench = spec();
        let expected = if documented { Ok(vec![]) } else { Err(ErrorCode::WrongCmd) };
        assert_eq!(bench.ask(2, Request::ExecuteCommand(command)), expected, "{command}");
        assert_eq!(log(&bench), if documented { format!("{command} 2") } else { String::new() });

        let mut bench = mcsdk();
        let known = documented || matches!(number, 4 | 5 | 14);
        let expected = if known { Ok(vec![]) } else { Err(ErrorCode::WrongCmd) };
        assert_eq!(bench.ask(2, Request::ExecuteCommand(command)), expected, "{command}");
    }
    let mut bench = mcsdk();
    bench.ask(1, Request::ExecuteCommand(Command::ScStop)).unwrap();
    assert_eq!(log(&bench), "STOP_MOTOR 1");
}

#[test]
fn pfc_commands_fail_without_pfc() {
    let mut bench = SlaveFixture::new(Profile::Spec, 1, Memory::with(Features::NONE));
    for command in [Command::PfcEnable, Command::PfcDisable, Command::PfcFaultAck] {
        assert_eq!(bench.ask(0, Request::ExecuteCommand(command)), Err(ErrorCode::WrongCmd));
    }
}

#[test]
fn ramps_references_and_revup_reach_the_motor() {
    let mut bench = spec();
    bench.ask(2, Request::SetRamp(Ramp { speed_rpm: -605, duration_ms: 9 })).unwrap();
    let reference = CurrentReference { iq_s16a: 1000, id_s16a: -5 };
    bench.ask(0, Request::SetCurrentReference(reference)).unwrap();
    assert_eq!(bench.drive.log, ["ramp 2 -605 9", "current 2 1000 -5"]);
    let data = RevupPhase { speed_rpm: 1000, torque_s16a: -7, duration_ms: 300 };
    assert_eq!(bench.ask(1, Request::SetRevupData(4, data)), Ok(vec![]));
    assert_eq!(bench.ask(1, Request::GetRevupData(4)), Ok(data.to_bytes().to_vec()));
    assert_eq!(bench.ask(1, Request::GetRevupData(5)), Err(ErrorCode::WrongSet));
    assert_eq!(bench.ask(1, Request::SetRevupData(5, data)), Err(ErrorCode::WrongSet));
}

#[test]
fn shipped_firmware_keeps_speeds_in_tenths_of_a_hertz() {
    let mut bench = mcsdk();
    bench.ask(1, set(RegisterId::RAMP_FINAL_SPEED, &1000i32.to_le_bytes())).unwrap();
    assert_eq!(bench.drive.value(1, RegisterId::RAMP_FINAL_SPEED), 996);
    bench.ask(1, Request::SetRamp(Ramp { speed_rpm: -605, duration_ms: 9 })).unwrap();
    assert_eq!(bench.drive.log, ["ramp 1 -600 9"]);
    bench.drive.set(1, RegisterId::SPEED_MEAS, 2003);
    let read = bench.ask(1, Request::GetRegister(RegisterId::SPEED_MEAS)).unwrap();
    assert_eq!(read, 1998i32.to_le_bytes());
    bench.drive.set(1, RegisterId::FLUXWK_BUS_MEAS, 985);
    let read = bench.ask(1, Request::GetRegister(RegisterId::FLUXWK_BUS_MEAS)).unwrap();
    assert_eq!(read, 985u16.to_le_bytes());
}

#[test]
fn versions_come_as_integers_or_as_ascii() {
    let info = spec().ask(0, Request::GetBoardInfo).unwrap();
    assert_eq!((&info[..3], info.len()), (&[5, 4, 3][..], 32));
    let info = mcsdk().ask(0, Request::GetBoardInfo).unwrap();
    assert_eq!((&info[..12], info.len()), (&b"543ST MC SDK"[..], 32));
    let version = spec().ask(0, Request::GetFirmwareVersion).unwrap();
    assert_eq!(version, {
        let mut text = b"ST MC SDK\tVer.5.4.3".to_vec();
        text.resize(32, 0);
        text
    });
    assert_eq!(FirmwareVersion::decode(b"X\tVer..5.4.4\0").version, "Ver..5.4.4");
}

#[test]
fn a_data_segment_samples_its_registers_in_one_exchange() {
    let mut bench = spec();
    bench.drive.set(1, RegisterId::STATUS, 6);
    bench.drive.set(1, RegisterId::SPEED_MEAS, 1500);
    bench.drive.set(1, RegisterId::I_Q, -77);
    let choose = |registers| Request::ConfigureSegment { segment: 3, registers };
    assert_eq!(bench.ask(1, Request::GetSegment(3)), Ok(vec![]), "empty until it is configured");
    assert_eq!(bench.ask(1, choose(&[0x02, 0x1E, 0x27])), Ok(vec![]));
    let expected = vec![6, 0xDC, 0x05, 0, 0, 0xB3, 0xFF];
    assert_eq!(bench.ask(1, Request::GetSegment(3)), Ok(expected.clone()));
    for unfit in [&[0x02, 0x99][..], &[0x41], &[0x5C], &[0x02; 33]] {
        assert_eq!(bench.ask(1, choose(unfit)), Err(ErrorCode::WrongSet), "{unfit:?}");
        assert_eq!(
            bench.ask(1, Request::GetSegment(3)),
            Ok(expected.clone()),
            "the old segment stays"
        );
    }
    assert_eq!(bench.ask(1, choose(&[0x1E; 32])), Ok(vec![]));
    assert_eq!(bench.ask(1, Request::GetSegment(3)).map(|values| values.len()), Ok(128));
    assert_eq!(bench.ask(1, Request::GetSegment(4)), Err(ErrorCode::WrongSet));
}

#[test]
fn codes_of_the_other_profile_are_unknown_or_mean_something_else() {
    let mut bench = spec();
    assert_eq!(bench.raw(0x0B, &[0]), Err(ErrorCode::BadFrameId));
    assert_eq!(bench.raw(0x12, &[0; 8]), Err(ErrorCode::BadFrameId));
    let mut bench = mcsdk();
    assert_eq!(bench.raw(0x0E, &[0, 2]), Err(ErrorCode::BadFrameId));
    assert_eq!(bench.raw(0x04, &[]), Err(ErrorCode::BadFrameId));
    assert_eq!(bench.raw(0x0D, &[0x30, 0xF8, 0xFF, 0xFF, 100, 0]), Ok(vec![]));
    let target = PositionMove { angle_rad: 1.5, duration_s: 0.25 };
    assert_eq!(bench.ask(1, Request::SetPosition(target)), Ok(vec![]));
    assert_eq!(bench.drive.log, ["torque ramp 1 -2000 100", "position 1 1.5 0.25"]);
    bench.drive.features = Some(Features::NONE);
    assert_eq!(bench.ask(1, Request::SetPosition(target)), Err(ErrorCode::BadFrameId));
    assert_eq!(bench.raw(0x12, &[]), Err(ErrorCode::BadFrameId), "with any payload");
}

#[test]
fn profiler_information_needs_a_profiler() {
    assert_eq!(mcsdk().raw(0x0B, &[0, 1, 2]), Err(ErrorCode::MpNotEnabled));
    let mut bench = SlaveFixture::new(Profile::Mcsdk54, 1, Memory::with(all_features()));
    assert_eq!(bench.raw(0x0B, &[0, 1]), Ok(vec![0, 2, 0x66, 0x67]));
}
