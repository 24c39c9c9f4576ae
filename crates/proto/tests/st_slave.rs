//! What the model (st_model.rs, st_exhaustive.rs) does not show of the slave: exact times, firmware's sizes, the
//! sign of registers without one, and full data segments.

use crate::common::{Memory, SlaveFixture, all_features, answer};
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
fn commands_are_acknowledged_as_table_4_says() {
    for profile in Profile::ALL {
        let mut bench = SlaveFixture::new(profile, 1, Memory::with(all_features()));
        for number in 0..=u8::MAX {
            let command = Command::from(number);
            let known = bench.ask(0, Request::ExecuteCommand(command)).is_ok();
            let shipped = profile == Profile::Mcsdk54 && matches!(number, 4 | 5 | 13 | 14);
            assert_eq!(known, shipped || matches!(number, 1..=3 | 6..=12), "{command:?}");
            assert_eq!(known, command.is_in(profile), "{command:?}");
        }
    }
}

#[test]
fn a_data_segment_samples_its_registers_in_one_exchange() {
    let mut bench = spec();
    bench.drive.set(1, RegisterId::SPEED_MEAS, 1500);
    let choose = |registers| Request::ConfigureSegment { segment: 3, registers };
    assert_eq!(bench.ask(1, Request::GetSegment(3)), Ok(vec![]), "empty until it is configured");
    assert_eq!(bench.ask(1, choose(&[0x1E; 32])), Ok(vec![]));
    let full = [0xDC, 0x05, 0, 0].repeat(32);
    for unfit in [&[0x02, 0x99][..], &[0x41], &[0x5C], &[0x02; 33]] {
        assert_eq!(bench.ask(1, Request::GetSegment(3)), Ok(full.clone()));
        assert_eq!(bench.ask(1, choose(unfit)), Err(ErrorCode::WrongSet), "{unfit:?}");
    }
    assert_eq!(bench.ask(1, Request::GetSegment(3)), Ok(full));
}

#[test]
fn versions_come_as_integers_or_as_ascii() {
    for (mut bench, numbers) in [(spec(), [5, 4, 3]), (mcsdk(), *b"543")] {
        assert_eq!(bench.ask(0, Request::GetBoardInfo).unwrap()[..3], numbers);
        let version = bench.ask(0, Request::GetFirmwareVersion).unwrap();
        assert_eq!(version[..20], *b"ST MC SDK\tVer.5.4.3\0", "no suffix");
    }
    assert_eq!(FirmwareVersion::decode(b"X\tVer..5.4.4\0").version, "Ver..5.4.4");
}
