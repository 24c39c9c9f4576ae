//! Persistent, volatile and refused settings.

use motorlink_proto::can::CanFrame;
use motorlink_proto::rmd::*;
use motorlink_proto::time::Instant;
use motorlink_proto::units::*;
use motorlink_sim::rmd::{RmdBus, RmdConfig, RmdNode};

use crate::rmd_bench::NodeFixture;

#[test]
fn turns_are_counted_until_power_off() {
    let mut bench = NodeFixture::one();
    bench.ask(SetPosition { angle: CentiDegrees::from_degrees(-2000.0) });
    bench.wait(3000);
    assert!((bench.angle() + 2000.0).abs() < 0.1);
    bench.power_cycle();
    assert!((bench.angle() - 160.0).abs() < 0.1, "-2000° are 160° in the turn");
}

#[test]
fn protections_switch_off_and_remain_while_the_cause_is_present() {
    let mut bench = NodeFixture::one();
    bench.ask(SetSpeed { speed: CentiDps::from_dps(500.0) });
    bench.wait(300);
    bench.world().plant_mut().set_source(6.9);
    bench.wait(1);
    assert!(bench.ask(ReadStatus).errors.is_empty(), "the capacitor holds for a while");
    bench.wait(300);
    bench.world().plant_mut().set_source(24.0);
    bench.wait(1);
    assert_eq!(bench.ask(ReadStatus).errors, Errors::LOW_VOLTAGE);
    assert_eq!(bench.truth().mode, Mode::Off);

    bench.world().plant_mut().force_temperature(Some(101.0));
    bench.wait(1);
    assert_eq!(bench.ask(ClearErrors).errors, Errors::OVER_TEMPERATURE);
    bench.ask(SetSpeed { speed: CentiDps::from_dps(500.0) });
    assert_eq!(bench.truth().mode, Mode::Off);
    bench.world().plant_mut().force_temperature(Some(60.0));
    bench.wait(300);
    let status = bench.ask(ClearErrors);
    assert_eq!((status.errors, status.temperature), (Errors::NONE, Celsius(60)));
    assert_eq!(status.voltage.volts(), 24.0);
    bench.ask(SetSpeed { speed: CentiDps::from_dps(500.0) });
    assert_ne!(bench.truth().mode, Mode::Off);
}

#[test]
fn injected_faults_happen_once_or_last() {
    let mut bench = NodeFixture::one();
    bench.world().inject(Errors::OVER_TEMPERATURE);
    bench.wait(1);
    assert_eq!(bench.ask(ReadStatus).errors, Errors::OVER_TEMPERATURE);
    assert_eq!(bench.ask(ClearErrors).errors, Errors::NONE);
    bench.world().hold_faults(Errors::LOW_VOLTAGE);
    bench.world().hold_faults(Errors::OVER_TEMPERATURE);
    bench.wait(1);
    let both = Errors::LOW_VOLTAGE.union(Errors::OVER_TEMPERATURE);
    assert_eq!(bench.ask(ClearErrors).errors, both);
    bench.world().release_faults(Errors::OVER_TEMPERATURE);
    assert_eq!(bench.ask(ClearErrors).errors, Errors::LOW_VOLTAGE);
    bench.world().release_faults(Errors::LOW_VOLTAGE);
    assert_eq!(bench.ask(ClearErrors).errors, Errors::NONE);
}

#[test]
fn silence_for_the_shutdown_time_switches_off() {
    let mut bench = NodeFixture::new([RmdConfig { shutdown_ms: 200, ..RmdConfig::default() }]);
    bench.ask(SetSpeed { speed: CentiDps::from_dps(500.0) });
    for _ in 0..5 {
        bench.wait(150);
        bench.ask(ReadMotionStatus);
    }
    assert_ne!(bench.truth().mode, Mode::Off);
    bench.wait(200);
    assert_eq!(bench.truth().mode, Mode::Off);
}

#[test]
fn four_torques_are_answered_lowest_id_first() {
    let mut bench = NodeFixture::new([4, 2, 7, 1, 3].map(RmdConfig::with_id));
    for id in (1..=4).filter_map(MotorId::new) {
        bench.bus.node_mut(id).unwrap().motor_mut().plant_mut().lock(true);
    }
    let torques = SetTorque4([100, -100, 200, -200].map(IqCommand));
    bench.send(&CanFrame::new(0x280, torques.encode()));
    bench.wait(50);
    let replies = bench.send(&CanFrame::new(0x280, torques.encode()));
    let ids: Vec<u32> = replies.iter().map(CanFrame::id).collect();
    assert_eq!(ids, [0x141, 0x142, 0x143, 0x144]);
    for (reply, torque) in replies.iter().zip(torques.0) {
        assert_eq!(reply.data()[0], 0xA1);
        let status = MotionStatus::decode(reply.data().try_into().unwrap());
        assert!((status.iq.amps() - torque.amps()).abs() < 0.05, "{} {torque}", status.iq);
    }
}

#[test]
fn an_odd_configuration_is_refused() {
    let rom = RmdConfig::default().factory_rom();
    let odd = [
        RmdConfig { id: 0, ..RmdConfig::default() },
        RmdConfig { id: 33, ..RmdConfig::default() },
        RmdConfig { max_speed_dps: f32::NAN, ..RmdConfig::default() },
    ];
    assert!(odd.into_iter().all(|config| RmdNode::new(Instant(0), config, rom).is_none()));
    let twins = [3, 3].map(|id| RmdNode::new(Instant(0), RmdConfig::with_id(id), rom).unwrap());
    assert!(RmdBus::new(twins).is_none());
}
