//! The same commands at the same times give the same bytes, for any division of the time.

use motorlink_proto::rmd::{
    Command as _, ReadEncoder, ReadMotionStatus, ReadPhaseCurrents, SetPosition, SetSpeed,
};
use motorlink_proto::st::{Command, Profile, RegisterId, Request};
use motorlink_proto::time::{Instant, Micros};
use motorlink_proto::units::{CentiDegrees, CentiDps};
use motorlink_sim::hash;
use motorlink_sim::rmd::RmdConfig;

use crate::{rmd_bench, st_bench};

/// Simulates `us` in pieces of at most `piece`.
fn cut(now: &mut Instant, us: u64, piece: u64, mut advance: impl FnMut(Instant)) {
    let end = *now + Micros(us);
    while *now < end {
        *now = Instant((now.0 + piece).min(end.0));
        advance(*now);
    }
}

/// All bytes that two ST motors send in a run, and their final state.
fn st_run(piece: u64) -> (Vec<u8>, u64) {
    let mut line = st_bench::NodeFixture::demo(Profile::Mcsdk54);
    for motor in [1, 2] {
        line.ask(motor, Request::ExecuteCommand(Command::StartMotor)).unwrap();
    }
    for round in 0..15 {
        let (mut now, station) = (line.now, &mut line.station);
        cut(&mut now, 77_777, piece, |now| station.advance_to(now));
        line.now = now;
        line.brake(0.01 * round as f32);
        for motor in [1, 2] {
            for id in RegisterId::all() {
                let _ = line.ask(motor, Request::GetRegister(id));
            }
        }
    }
    (line.log, hash::fingerprint(line.station.drive()))
}

/// All frames that two RMD motors send in a run, and the final state of motor 1.
fn rmd_run(piece: u64) -> (Vec<Vec<u8>>, String) {
    let short = RmdConfig { shutdown_ms: 90, ..RmdConfig::with_id(2) };
    let mut bench = rmd_bench::NodeFixture::new([RmdConfig::default(), short]);
    for round in 0..15 {
        let angle = CentiDegrees::from_degrees(f64::from(round * 37 % 100));
        bench.raw(SetPosition { angle }.encode());
        let spin = SetSpeed { speed: CentiDps(round * 1000) };
        bench.send(&motorlink_proto::can::CanFrame::new(0x142, spin.encode()));
        let (mut now, bus) = (bench.now, &mut bench.bus);
        cut(&mut now, 93_333, piece, |now| bus.advance_to(now));
        bench.now = now;
        for request in [ReadMotionStatus.encode(), ReadPhaseCurrents.encode(), ReadEncoder.encode()]
        {
            bench.raw(request);
            bench.send(&motorlink_proto::can::CanFrame::new(0x142, request));
        }
    }
    let end = format!("{:?} {:#x}", bench.truth(), hash::fingerprint(bench.bus.nodes()));
    (bench.log.iter().map(|frame| frame.data().to_vec()).collect(), end)
}

#[test]
fn an_st_drive_is_deterministic() {
    let once = st_run(u64::MAX / 2);
    assert_eq!(once, st_run(u64::MAX / 2));
    assert_eq!(once, st_run(313), "in pieces of 313 µs");
}

#[test]
fn an_rmd_bus_is_deterministic() {
    let once = rmd_run(u64::MAX / 2);
    assert_eq!(once, rmd_run(u64::MAX / 2));
    assert_eq!(once, rmd_run(101), "in pieces of 101 µs");
}

#[cfg(feature = "serde")]
#[test]
fn a_configuration_names_what_differs_from_the_default() {
    use motorlink_sim::st::MotorConfig;

    let motor: MotorConfig =
        toml::from_str("rated_current = 3\n[registers]\nspeed_kp = 5").unwrap();
    assert_eq!((motor.rated_current, motor.registers.speed_kp), (3.0, 5));
    assert_eq!(motor.registers.speed_ki, MotorConfig::default().registers.speed_ki);
    assert_eq!(motor.plant, MotorConfig::default().plant);
    assert!(toml::from_str::<MotorConfig>("rated_amps = 3").is_err());
    for (_, preset) in MotorConfig::PRESETS {
        let written = toml::to_string(&preset()).unwrap();
        assert_eq!(toml::from_str::<MotorConfig>(&written).unwrap(), preset());
    }
    let rmd: RmdConfig = toml::from_str("id = 9\ngains = [1, 2, 3, 4, 5, 6]").unwrap();
    assert_eq!((rmd.id, rmd.factory_rom().gains.torque_ki), (9, 6));
    let written = toml::to_string(&rmd).unwrap();
    assert_eq!(toml::from_str::<RmdConfig>(&written).unwrap(), rmd);
}
