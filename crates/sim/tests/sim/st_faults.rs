//! Faults: causes, latching and acknowledgement.

use motorlink_proto::st::{
    Command, CurrentReference, Flags, Profile, Request, Status, register::*,
};
use motorlink_sim::st::{MotorConfig, PfcState, pfc_fault};

use crate::st_bench::NodeFixture;

fn running() -> NodeFixture {
    let mut line = NodeFixture::sensorless();
    line.run();
    line.wait(2000);
    line
}

#[test]
fn a_fault_is_now_while_its_cause_is_present_and_over_until_acknowledged() {
    let mut line = running();
    line.plant().set_source(450.0);
    line.until(Status::FaultNow, 2);
    assert_eq!(line.flags(), Flags::new(Flags::OVER_VOLT, Flags::OVER_VOLT));
    line.wait(1);
    assert_eq!(line.truth().plant.iq, 0.0, "the torque is gone at once");
    assert!(line.truth().speed_rpm > 1400.0, "the rotor coasts");

    line.execute(Command::FaultAck);
    line.wait(5);
    assert_eq!(line.status(), Status::FaultNow, "the cause is present");

    line.plant().set_source(325.0);
    line.until(Status::FaultOver, 10);
    assert_eq!(line.flags(), Flags::new(Flags::OVER_VOLT, 0));
    for command in [Command::StartMotor, Command::StartStop, Command::StopMotor] {
        line.execute(command);
        line.wait(5);
        assert_eq!(line.status(), Status::FaultOver, "{command} has no effect");
    }

    line.execute(Command::FaultAck);
    assert_eq!(line.status(), Status::StopIdle);
    line.wait(1);
    assert_eq!(line.status(), Status::Idle);
    assert_eq!(line.flags(), Flags::default());
}

#[test]
fn voltage_and_temperature_have_thresholds() {
    let mut line = running();
    line.plant().set_source(150.0);
    line.until(Status::FaultNow, 5000);
    assert_eq!(line.flags().present(), Flags::UNDER_VOLT, "the motor has emptied the capacitor");
    line.plant().set_source(325.0);
    line.until(Status::FaultOver, 2);

    line.plant().force_temperature(Some(101.0));
    line.wait(1);
    assert_eq!(line.flags().present(), Flags::OVER_TEMP);
    line.plant().force_temperature(Some(95.0));
    line.wait(1);
    assert_eq!(line.flags().present(), Flags::OVER_TEMP, "10 K of hysteresis");
    line.plant().force_temperature(None);
    line.wait(1);
    assert_eq!(line.flags(), Flags::new(Flags::UNDER_VOLT | Flags::OVER_TEMP, 0));
}

#[test]
fn injected_faults_happen_once_or_last() {
    let mut line = running();
    line.world().inject(Flags::BREAK_IN | Flags::SW_ERROR);
    line.wait(1);
    assert_eq!(line.status(), Status::FaultNow);
    line.wait(1);
    assert_eq!(line.status(), Status::FaultOver);
    assert_eq!(line.flags(), Flags::new(Flags::BREAK_IN | Flags::SW_ERROR, 0));

    line.world().hold_faults(Flags::FOC_DURATION);
    line.world().hold_faults(Flags::OVER_TEMP);
    line.wait(100);
    assert_eq!(line.status(), Status::FaultNow);
    assert_eq!(line.flags().present(), Flags::FOC_DURATION | Flags::OVER_TEMP);
    line.world().release_faults(Flags::OVER_TEMP);
    line.wait(1);
    assert_eq!(line.flags().present(), Flags::FOC_DURATION);
    line.world().release_faults(Flags::FOC_DURATION);
    line.wait(1);
    line.execute(Command::FaultAck);
    assert_eq!(line.flags(), Flags::default());
}

#[test]
fn a_rotor_that_is_locked_in_run_loses_its_feedback() {
    let mut line = running();
    line.plant().lock(true);
    let faulted = line.until(Status::FaultOver, 2000);
    assert!(faulted < 100, "{faulted} ms until there is no back-EMF to be found");
    assert_eq!(line.flags().occurred(), Flags::SPEED_FDBK);

    let mut line = NodeFixture::servo();
    line.run();
    line.wait(2000);
    line.plant().lock(true);
    let faulted = line.until(Status::FaultOver, 2000);
    assert!((500..700).contains(&faulted), "{faulted} ms with an encoder, which sees it stand");
    assert_eq!(line.flags().occurred(), Flags::SPEED_FDBK);
}

#[test]
fn running_away_in_torque_mode_loses_the_feedback() {
    let mut line = running();
    let all = CurrentReference { iq_s16a: i16::MAX, id_s16a: 0 };
    line.ask(0, Request::SetCurrentReference(all)).unwrap();
    line.wait(5);
    let iq = line.truth().plant.iq;
    assert!((5.0..5.8).contains(&iq), "{iq} A: held to the rated current");
    line.until(Status::FaultNow, 2000);
    assert!(line.truth().speed_rpm > 7100.0);
    assert_eq!(line.flags().occurred(), Flags::SPEED_FDBK);
}

#[test]
fn the_pfc_raises_the_bus_voltage() {
    let mut line = NodeFixture::sensorless();
    line.set(PFC_STARTUP_DURATION, 100);
    line.set(PFC_DCBUS_REF, 385);
    assert_eq!((line.get(PFC_ENABLED), line.get(BUS_VOLTAGE)), (0, 325));
    assert_eq!((line.get(PFC_ACBUS_FREQ), line.get(PFC_ACBUS_RMS)), (500, 325));
    line.execute(Command::PfcEnable);
    line.wait(50);
    assert_eq!(line.get(PFC_STATUS), PfcState::StartUp as i8);
    let halfway = line.get(PFC_DCBUS_MEAS);
    assert!((340..370).contains(&halfway), "{halfway} V halfway");
    line.wait(50);
    assert_eq!((line.get(PFC_STATUS), line.get(PFC_ENABLED)), (PfcState::Run as i8, 1));
    line.wait(2000);
    assert_eq!((line.get(PFC_DCBUS_MEAS), line.get(BUS_VOLTAGE)), (385, 385));
    line.execute(Command::PfcDisable);
    assert_eq!((line.get(PFC_STATUS), line.get(PFC_ENABLED)), (PfcState::Idle as i8, 0));
    line.run();
    line.brake(0.5);
    line.wait(3000);
    assert!((323..=325).contains(&line.get(BUS_VOLTAGE)), "the motor has taken the rest");
}

#[test]
fn a_load_makes_the_bus_of_a_pfc_dip_and_it_comes_back() {
    let mut line = running();
    line.execute(Command::PfcEnable);
    line.wait(2000);
    line.ramp(3000, 500);
    line.wait(1000);
    line.brake(1.5);
    let lowest = (0..200).fold(f32::INFINITY, |least, _| {
        line.wait(1);
        least.min(line.truth().plant.bus_voltage)
    });
    assert!((340.0..397.0).contains(&lowest), "{lowest} V");
    line.wait(1000);
    let bus = line.truth().plant.bus_voltage;
    assert!((bus - 400.0).abs() < 1.0, "{bus} V with about 480 W");
}

#[test]
fn the_pfc_faults_when_the_mains_fail_and_takes_an_acknowledge() {
    let mut line = NodeFixture::sensorless();
    line.execute(Command::PfcEnable);
    line.wait(500);
    line.plant().set_source(220.0);
    line.wait(2);
    assert_eq!(line.get(PFC_STATUS), PfcState::FaultNow as i8);
    let low = Flags::new(pfc_fault::MAINS_LOW, pfc_fault::MAINS_LOW);
    assert_eq!(Flags(line.get(PFC_FAULTS)), low);
    line.execute(Command::PfcFaultAck);
    line.execute(Command::PfcEnable);
    line.wait(2);
    assert_eq!(line.get(PFC_STATUS), PfcState::FaultNow as i8);
    line.plant().set_source(325.0);
    line.wait(2);
    assert_eq!(line.get(PFC_STATUS), PfcState::FaultOver as i8);
    line.execute(Command::PfcFaultAck);
    assert_eq!((line.get(PFC_STATUS), line.get(PFC_FAULTS)), (PfcState::Idle as i8, 0));
    assert_eq!(line.flags(), Flags::default(), "the motor never minded");
}

#[test]
fn a_pfc_whose_gains_run_away_switches_itself_off() {
    let mut line = NodeFixture::sensorless();
    line.execute(Command::PfcEnable);
    line.wait(500);
    assert_eq!(line.get(PFC_STATUS), PfcState::Run as i8);
    line.set(PFC_I_KD, -30_000);
    line.wait(1000);
    assert_eq!(line.get(PFC_ENABLED), 0);
    let faults = Flags(line.get(PFC_FAULTS)).occurred();
    assert_ne!(faults & (pfc_fault::OVER_CURRENT | pfc_fault::BUS_HIGH), 0, "{faults:#x}");
    assert!(line.truth().plant.bus_voltage < 500.0, "{} V", line.truth().plant.bus_voltage);
}

#[test]
fn a_highest_speed_has_no_direction() {
    let mut config = MotorConfig::shinano();
    config.registers.max_app_speed = -4000;
    let mut line = NodeFixture::new(Profile::Spec, [config]);
    line.run();
    line.wait(2000);
    assert_eq!((line.status(), line.get(SPEED_REF)), (Status::Run, 1500));
}
