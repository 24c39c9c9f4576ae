//! Faults: what causes them, how they latch, how they go.

use motorlink_proto::stmcp::{
    Command, CurrentReference, Flags, Request, RevupPhase, Status, register::*,
};
use motorlink_sim::st::{PfcState, pfc_fault};

use crate::st_bench::Line;

fn running() -> Line {
    let mut line = Line::sensorless();
    line.run();
    line.wait(2000);
    line
}

#[test]
fn a_fault_is_now_while_its_cause_is_there_and_over_until_acknowledged() {
    let mut line = running();
    line.world().set_bus_voltage(450.0);
    line.wait(1);
    assert_eq!(line.status(), Status::FaultNow);
    assert_eq!(line.flags(), Flags::new(Flags::OVER_VOLT, Flags::OVER_VOLT));
    assert_eq!(line.truth().iq, 0.0, "the torque is gone at once");
    assert!(line.truth().speed_rpm > 1400.0, "the rotor coasts");

    line.execute(Command::FaultAck);
    line.wait(5);
    assert_eq!(line.status(), Status::FaultNow, "the cause is present");

    line.world().set_bus_voltage(325.0);
    line.wait(1);
    assert_eq!(line.status(), Status::FaultOver);
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
    line.world().set_bus_voltage(150.0);
    line.wait(1);
    assert_eq!(line.flags().present(), Flags::UNDER_VOLT);
    line.world().set_bus_voltage(325.0);

    line.world().set_temperature(Some(101.0));
    line.wait(1);
    assert_eq!(line.flags().present(), Flags::OVER_TEMP);
    line.world().set_temperature(Some(95.0));
    line.wait(1);
    assert_eq!(line.flags().present(), Flags::OVER_TEMP, "10 K of hysteresis");
    line.world().set_temperature(None);
    line.wait(1);
    assert_eq!(line.flags(), Flags::new(Flags::UNDER_VOLT | Flags::OVER_TEMP, 0));
}

#[test]
fn the_heatsink_warms_up_slowly_under_load() {
    let mut line = running();
    let cold = line.get(HEATS_TEMP);
    line.world().set_load_torque(1.2);
    line.wait(20_000);
    let warm = line.get(HEATS_TEMP);
    assert!((2..15).contains(&(warm - cold)), "from {cold} °C to {warm} °C in 20 s at 4 A");
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
    line.wait(100);
    assert_eq!(line.status(), Status::FaultNow);
    assert_eq!(line.flags().present(), Flags::FOC_DURATION);
    line.world().hold_faults(0);
    line.wait(1);
    line.execute(Command::FaultAck);
    assert_eq!(line.flags(), Flags::default());
}

#[test]
fn a_load_beyond_the_rev_up_torque_is_a_start_up_fault() {
    let mut line = Line::sensorless();
    line.world().set_load_torque(0.7);
    line.execute(Command::StartMotor);
    line.until(Status::FaultNow, 2000);
    line.wait(1);
    assert_eq!(line.flags(), Flags::new(Flags::START_UP, 0));
    line.world().set_load_torque(0.3);
    line.execute(Command::FaultAck);
    line.until(Status::Idle, 10);
    line.run();
}

#[test]
fn a_rev_up_that_is_too_weak_or_too_slow_fails() {
    let weak = |phase: RevupPhase| RevupPhase { torque_s16a: 100, ..phase };
    let slow = |phase: RevupPhase| RevupPhase { speed_rpm: phase.speed_rpm / 4, ..phase };
    for change in [&weak as &dyn Fn(RevupPhase) -> RevupPhase, &slow] {
        let mut line = Line::sensorless();
        for phase in 0..5 {
            let data = line.ask(0, Request::RevupData(phase)).unwrap();
            let data = change(RevupPhase::decode(&data).unwrap());
            line.ask(0, Request::SetRevupData(phase, data)).unwrap();
        }
        line.execute(Command::StartMotor);
        line.until(Status::FaultOver, 2000);
        assert_eq!(line.flags().occurred(), Flags::START_UP);
    }
}

#[test]
fn a_rotor_that_is_locked_in_run_loses_its_feedback() {
    let mut line = running();
    line.world().lock_rotor(true);
    let faulted = line.until(Status::FaultOver, 2000);
    assert!((500..700).contains(&faulted), "{faulted} ms");
    assert_eq!(line.flags().occurred(), Flags::SPEED_FDBK);
}

#[test]
fn running_away_in_torque_mode_loses_the_feedback() {
    let mut line = running();
    let all = CurrentReference { iq_s16a: i16::MAX, id_s16a: 0 };
    line.ask(0, Request::CurrentReference(all)).unwrap();
    line.wait(20);
    assert!((line.truth().iq - 6.0).abs() < 0.1, "held to the rated current");
    line.until(Status::FaultNow, 2000);
    assert!(line.truth().speed_rpm > 7100.0);
    assert_eq!(line.flags().occurred(), Flags::SPEED_FDBK);
}

#[test]
fn the_pfc_raises_the_bus_voltage() {
    let mut line = Line::sensorless();
    line.set(PFC_STARTUP_DURATION, 100);
    line.set(PFC_DCBUS_REF, 385);
    assert_eq!((line.get(PFC_ENABLED), line.get(BUS_VOLTAGE)), (0, 325));
    assert_eq!((line.get(PFC_ACBUS_FREQ), line.get(PFC_ACBUS_RMS)), (500, 325));
    line.execute(Command::PfcEnable);
    line.wait(50);
    assert_eq!(line.get(PFC_STATUS), PfcState::StartUp as i8);
    assert_eq!(line.get(PFC_DCBUS_MEAS), 355, "halfway");
    line.wait(50);
    assert_eq!((line.get(PFC_STATUS), line.get(PFC_ENABLED)), (PfcState::Run as i8, 1));
    assert_eq!((line.get(PFC_DCBUS_MEAS), line.get(BUS_VOLTAGE)), (385, 385));
    line.execute(Command::PfcDisable);
    assert_eq!((line.get(PFC_STATUS), line.get(BUS_VOLTAGE)), (PfcState::Idle as i8, 325));
}

#[test]
fn the_pfc_faults_when_the_mains_fail_and_takes_an_acknowledge() {
    let mut line = Line::sensorless();
    line.execute(Command::PfcEnable);
    line.wait(500);
    line.world().set_bus_voltage(220.0);
    line.wait(2);
    assert_eq!(line.get(PFC_STATUS), PfcState::FaultNow as i8);
    let low = Flags::new(pfc_fault::MAINS_LOW, pfc_fault::MAINS_LOW);
    assert_eq!(Flags(line.get(PFC_FAULTS)), low);
    line.execute(Command::PfcFaultAck);
    line.execute(Command::PfcEnable);
    line.wait(2);
    assert_eq!(line.get(PFC_STATUS), PfcState::FaultNow as i8);
    line.world().set_bus_voltage(325.0);
    line.wait(2);
    assert_eq!(line.get(PFC_STATUS), PfcState::FaultOver as i8);
    line.execute(Command::PfcFaultAck);
    assert_eq!((line.get(PFC_STATUS), line.get(PFC_FAULTS)), (PfcState::Idle as i8, 0));
    assert_eq!(line.flags(), Flags::default(), "the motor never minded");
}

#[test]
fn a_pfc_that_is_told_too_much_trips_the_motor() {
    let mut line = running();
    line.set(PFC_DCBUS_REF, 440);
    line.execute(Command::PfcEnable);
    line.until(Status::FaultNow, 1000);
    assert_eq!(line.flags().present(), Flags::OVER_VOLT);
}
