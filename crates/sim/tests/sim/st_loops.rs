//! Closed loops of the ST drive, on every preset motor.

use motorlink_proto::st::{
    Command, CurrentReference, Flags, Profile, Request, RevupPhase, Status, register::*,
};
use motorlink_sim::plant::{ChopperConfig, PlantConfig};
use motorlink_sim::st::{MotorConfig, Registers};

use crate::st_bench::NodeFixture;

fn line(config: MotorConfig) -> NodeFixture {
    NodeFixture::new(Profile::Spec, [config])
}

/// Every motor, with a speed in the middle of its range.
fn motors() -> impl Iterator<Item = (&'static str, MotorConfig, f64)> {
    MotorConfig::PRESETS.into_iter().map(|(name, preset)| {
        let config = preset();
        (name, config, f64::from(config.registers.max_app_speed / 2))
    })
}

/// A motor that has run at a speed for a while.
fn turning(config: MotorConfig, rpm: f64) -> NodeFixture {
    let mut line = line(config);
    line.ramp(rpm as i32, 500);
    line.run();
    line.wait(2000);
    line
}

/// Torque of the rated current, Nm.
fn rated_torque(config: &MotorConfig) -> f32 {
    config.plant.machine.torque_constant() * config.rated_current
}

#[test]
fn every_motor_is_tuned_within_the_range_of_its_registers() {
    for (name, config, _) in motors() {
        for period_us in [25, 50, 100] {
            let gains = Registers::tuned(&PlantConfig { period_us, ..config.plant });
            let Registers { torque_kp, torque_ki, flux_kp, flux_ki, speed_kp, speed_ki, .. } =
                gains;
            let Registers { observer_c1, observer_c2, pll_kp, pll_ki, .. } = gains;
            let Registers { fluxwk_kp, fluxwk_ki, .. } = gains;
            for gain in [
                [torque_kp, torque_ki, flux_kp, flux_ki],
                [speed_kp, speed_ki, -observer_c1, observer_c2],
                [pll_kp, pll_ki, fluxwk_kp, fluxwk_ki],
            ]
            .concat()
            {
                assert!((50..32_767).contains(&gain), "{name} at {period_us} µs: {gains:?}");
            }
        }
    }
}

#[test]
fn a_motor_runs_at_other_periods_too() {
    for (name, mut config, speed) in motors() {
        for period_us in [25, 100] {
            config.plant.period_us = period_us;
            let Registers { max_app_speed, min_app_speed, .. } = config.registers;
            config.registers =
                Registers { max_app_speed, min_app_speed, ..Registers::tuned(&config.plant) };
            let rpm = turning(config, speed).mean_rpm();
            assert!((rpm / speed - 1.0).abs() < 0.002, "{name} at {period_us} µs: {rpm} rpm");
        }
    }
}

#[test]
fn a_speed_step_leaves_no_error_and_exceeds_no_limit() {
    for (name, config, speed) in motors() {
        let mut line = turning(config, speed);
        let goal = 1.2 * speed;
        line.ramp(goal as i32, 0);
        let (mut fastest, mut strongest) = (0f32, 0f32);
        for _ in 0..1000 {
            line.wait(1);
            let truth = line.truth();
            fastest = fastest.max(truth.speed_rpm);
            let [a, b, c] = truth.plant.phase_currents.map(f32::abs);
            strongest = strongest.max(a).max(b).max(c);
        }
        let end = line.mean_rpm();
        assert_eq!(line.status(), Status::Run, "{name}");
        assert!((end / goal - 1.0).abs() < 0.002, "{name}: {end} rpm, not {goal}");
        let overshoot = (f64::from(fastest) - goal) / (goal - speed);
        assert!(overshoot < 0.5, "{name}: {overshoot} of the step too far");
        let rated = config.rated_current;
        assert!(strongest < 1.1 * rated, "{name}: {strongest} A in a phase, rated {rated} A");
    }
}

#[test]
fn a_load_step_is_recovered() {
    for (name, config, speed) in motors() {
        let mut line = turning(config, speed);
        line.brake(0.5 * rated_torque(&config));
        let slowest = (0..300).fold(f32::INFINITY, |slowest, _| {
            line.wait(1);
            slowest.min(line.truth().speed_rpm)
        });
        assert!(f64::from(slowest) < 0.98 * speed, "{name}: the load is felt, {slowest} rpm");
        line.wait(700);
        let end = line.mean_rpm();
        assert!((end / speed - 1.0).abs() < 0.002, "{name}: {end} rpm, not {speed}");
    }
}

#[test]
fn torque_is_what_was_commanded_within_2_percent() {
    for (name, mut config, speed) in motors() {
        // The alignment finds the positions of the rotor and of the encoder's zero.
        config.plant.angle_degrees = 123.0;
        config.plant.encoder.offset_degrees = 77.0;
        let mut line = turning(config, speed);
        let torque = 0.4 * rated_torque(&config);
        let speed = speed as f32 / 60.0 * std::f32::consts::TAU;
        line.plant().change_load(|load| load.viscous = torque / speed);
        line.wait(300);
        let full_scale = config.plant.sensing.full_scale;
        let iq_s16a = (0.4 * config.rated_current / full_scale * 32767.0) as i16;
        let reference = CurrentReference { iq_s16a, id_s16a: 0 };
        line.ask(0, Request::SetCurrentReference(reference)).unwrap();
        line.wait(1000);
        let mean: f64 =
            (0..20).map(|_| line.mean_of(|line| line.truth().plant.torque.into())).sum::<f64>()
                / 20.0;
        let off = mean / f64::from(torque) - 1.0;
        assert!(off.abs() < 0.02, "{name}: {mean} Nm, not {torque}");
    }
}

/// Speed at which the back-EMF equals the maximum voltage, rpm.
fn base_speed(config: &MotorConfig) -> f64 {
    let voltage = config.plant.supply.voltage / 3f32.sqrt();
    f64::from(voltage / config.plant.machine.back_emf_constant() * 60.0 / std::f32::consts::TAU)
}

#[test]
fn flux_weakening_reaches_1_3_times_base_speed() {
    for (name, mut config, _) in motors().filter(|(_, config, _)| config.build.flux_weakening) {
        let base = base_speed(&config);
        config.registers.max_app_speed = (1.5 * base) as i32;
        let reached = |weaken: bool| {
            let mut line = turning(config, 0.5 * base);
            if !weaken {
                line.set(FLUXWK_KP, 0);
                line.set(FLUXWK_KI, 0);
            }
            line.ramp((1.3 * base) as i32, 1500);
            line.wait(3000);
            assert_eq!(line.status(), Status::Run, "{name}: {}", line.flags());
            (line.mean_rpm() / base, line.truth().plant.id, line.get(FLUXWK_BUS_MEAS))
        };
        let (speed, id, share) = reached(true);
        assert!((speed - 1.3).abs() < 0.003, "{name}: {speed} of base speed");
        assert!(id < -0.2 * config.rated_current, "{name}: Id {id} A");
        assert!((96..=100).contains(&share), "{name}: {share} % of the bus");
        let (speed, ..) = reached(false);
        assert!(speed < 1.03, "{name}: {speed} of base speed with all flux");
    }
}

#[test]
fn a_rotor_starts_from_wherever_it_stands() {
    for (name, mut config, _) in motors() {
        for angle in (0..360).step_by(72) {
            config.plant.angle_degrees = angle as f32 / f32::from(config.plant.machine.pole_pairs);
            let mut line = line(config);
            line.execute(Command::StartMotor);
            line.until(Status::Run, 2000);
            line.wait(2000);
            let (speed, target) = (line.mean_rpm(), f64::from(config.target_speed_rpm));
            assert!((speed / target - 1.0).abs() < 0.002, "{name} from {angle}°: {speed} rpm");
        }
    }
}

#[test]
fn a_rev_up_that_is_too_weak_too_fast_or_too_slow_is_a_start_up_fault() {
    let weak = |phase: RevupPhase| RevupPhase { torque_s16a: phase.torque_s16a / 30, ..phase };
    let fast = |phase: RevupPhase| RevupPhase { duration_ms: phase.duration_ms / 25, ..phase };
    let slow = |phase: RevupPhase| RevupPhase { speed_rpm: phase.speed_rpm / 4, ..phase };
    let changes: [(&str, &dyn Fn(RevupPhase) -> RevupPhase); 3] =
        [("weak", &weak), ("fast", &fast), ("slow", &slow)];
    for (name, config, _) in motors().filter(|(_, config, _)| !config.build.position_sensor) {
        for (what, change) in changes {
            let mut line = line(config);
            line.change_revup(change);
            line.execute(Command::StartMotor);
            line.wait(2000);
            let now = (line.status(), line.flags().occurred());
            assert_eq!(now, (Status::FaultOver, Flags::START_UP), "{name}, too {what}");
        }
    }
}

#[test]
fn a_rev_up_to_any_speed_ends_in_a_fault() {
    for speed_rpm in [i32::MAX, i32::MIN] {
        let mut line = line(MotorConfig::mains());
        line.change_revup(|phase| RevupPhase { speed_rpm, ..phase });
        line.execute(Command::StartMotor);
        line.wait(2000);
        assert_eq!(line.status(), Status::FaultOver, "{speed_rpm} rpm");
    }
}

#[test]
fn regeneration_trips_over_voltage_without_the_brake_and_not_with_it() {
    let stopping = |chopper| {
        let mut config = MotorConfig::shinano();
        config.plant.supply.chopper = chopper;
        config.plant.load.inertia = 3e-5;
        config.registers = Registers { max_app_speed: 4000, ..Registers::tuned(&config.plant) };
        let mut line = turning(config, 3000.0);
        line.ramp(1000, 150);
        let highest = (0..1000).fold(0f32, |highest, _| {
            line.wait(1);
            highest.max(line.truth().plant.bus_voltage)
        });
        (line.status(), line.flags().occurred(), highest)
    };
    let (status, faults, bus) = stopping(None);
    assert_ne!(status, Status::Run);
    assert_eq!(faults, Flags::OVER_VOLT, "{bus} V");
    let chopper = ChopperConfig { resistance: 5.0, on_voltage: 28.0, off_voltage: 27.0 };
    let (status, faults, bus) = stopping(Some(chopper));
    assert_eq!((status, faults), (Status::Run, 0), "{bus} V");
    assert!((27.9..28.5).contains(&bus), "{bus} V");
}

#[test]
fn a_stop_beyond_base_speed_charges_the_bus_through_the_diodes() {
    let mut config = MotorConfig::shinano();
    let base = base_speed(&config);
    config.registers.max_app_speed = (1.5 * base) as i32;
    let mut line = turning(config, 1.3 * base);
    line.wait(1000);
    line.execute(Command::StopMotor);
    line.wait(20);
    let truth = line.truth();
    assert_eq!(truth.status, Status::WaitStopMotor);
    let bus = truth.plant.bus_voltage;
    assert!((25.5..32.0).contains(&bus), "{bus} V from a back-EMF above 24 V");
}

#[test]
fn current_gains_that_are_too_high_oscillate_and_trip() {
    // The bus drives 17 A through the windings of the drone in a period, and 2.5 A through the
    // other: its currents only buzz.
    for (config, speed, trips) in
        [(MotorConfig::drone(), 7500.0, true), (MotorConfig::shinano(), 2000.0, false)]
    {
        let ripple = |factor: i16| {
            let mut line = turning(config, speed);
            let kp = line.get(TORQUE_KP);
            line.set(TORQUE_KP, kp.saturating_mul(factor));
            let (mut most, mut least) = (f32::MIN, f32::MAX);
            for _ in 0..100 {
                line.wait(1);
                let iq = line.truth().plant.iq;
                (most, least) = (most.max(iq), least.min(iq));
            }
            (most - least, line.flags().occurred())
        };
        let (quiet, _) = ripple(1);
        let (loud, faults) = ripple(8);
        assert!(loud > 8.0 * quiet, "{loud} A, {quiet} A as shipped");
        assert_eq!(faults & Flags::BREAK_IN != 0, trips, "{faults:#x}");
    }
}

#[test]
fn a_speed_gain_that_is_too_high_oscillates() {
    let ripple = |factor: i16| {
        let mut line = turning(MotorConfig::shinano(), 2000.0);
        let kp = line.get(SPEED_KP);
        line.set(SPEED_KP, kp.saturating_mul(factor));
        line.wait(200);
        let (mut most, mut least) = (f32::MIN, f32::MAX);
        for _ in 0..200 {
            line.wait(1);
            let rpm = line.truth().speed_rpm;
            (most, least) = (most.max(rpm), least.min(rpm));
        }
        (most - least, line.status())
    };
    let (quiet, status) = ripple(1);
    assert_eq!(status, Status::Run);
    let (loud, status) = ripple(16);
    let tripped = status != Status::Run;
    assert!(tripped || loud > 10.0 * quiet, "{loud} rpm, {quiet} rpm as shipped");
}

#[test]
fn observer_gains_decide_whether_the_rotor_is_seen() {
    type Change = (&'static str, fn(&mut Registers));
    let changes: [Change; 4] = [
        ("C2 is nothing", |registers| registers.observer_c2 = 0),
        ("C1 has the wrong sign", |registers| registers.observer_c1 = 20_000),
        ("the PLL is slow", |registers| (registers.pll_kp, registers.pll_ki) = (2, 0)),
        ("the PLL runs away from the rotor", |registers| registers.pll_kp = -600),
    ];
    for (what, change) in changes {
        let mut badly = MotorConfig::mains();
        change(&mut badly.registers);
        let mut start = line(badly);
        start.execute(Command::StartMotor);
        start.wait(2000);
        assert_eq!(start.flags().occurred(), Flags::START_UP, "{what}");

        let mut run = turning(MotorConfig::mains(), 3000.0);
        run.set(OBSERVER_C1, badly.registers.observer_c1 as i16);
        run.set(OBSERVER_C2, badly.registers.observer_c2 as i16);
        run.set(PLL_KP, badly.registers.pll_kp as i16);
        run.set(PLL_KI, badly.registers.pll_ki as i16);
        // At a constant speed even a badly tuned observer may follow.
        run.ramp(2100, 300);
        run.wait(1000);
        assert_ne!(run.status(), Status::Run, "{what}, in RUN");
    }
}

#[test]
fn an_observer_beside_an_encoder_sees_the_same_rotor() {
    let mut line = turning(MotorConfig::servo(), 2000.0);
    use motorlink_proto::st::RegisterId as R;
    let motor = line.world();
    let off =
        (motor.read(R::OBS_CR_EL_ANGLE) as i16).wrapping_sub(motor.read(R::MEAS_EL_ANGLE) as i16);
    assert!(off.abs() < 1500, "{off} of 65536, 8 degrees");
    let speed = motor.read(R::OBS_CR_ROT_SPEED) * 6;
    assert!((speed - 2000).abs() < 30, "{speed} rpm");
    let level = (motor.read(R::OBS_CR_BEMF_LEVEL), motor.read(R::EST_CR_BEMF_LEVEL));
    assert!((f64::from(level.0) / f64::from(level.1) - 1.0).abs() < 0.15, "{level:?}");
    line.set(OBSERVER_CR_C2, 0);
    line.ramp(1000, 200);
    line.wait(1000);
    let speed = line.world().read(R::OBS_CR_ROT_SPEED) * 6;
    assert!((speed - 1000).abs() > 300, "{speed} rpm from a back-EMF that nothing corrects");
    assert_eq!(line.status(), Status::Run, "the drive has its encoder");
}

#[test]
fn a_current_beyond_the_trip_level_is_a_break_in_at_once() {
    let mut config = MotorConfig::servo();
    config.thresholds.over_current = 3.0;
    config.alignment_current = 2.0;
    let mut line = turning(config, 1000.0);
    let five_amperes = (5.0 / config.plant.sensing.full_scale * 32767.0) as i16;
    let reference = CurrentReference { iq_s16a: five_amperes, id_s16a: 0 };
    line.ask(0, Request::SetCurrentReference(reference)).unwrap();
    line.wait(2);
    assert_eq!(line.flags().occurred(), Flags::BREAK_IN);
    line.until(Status::FaultOver, 2);
    line.wait(1);
    let truth = line.truth().plant;
    assert_eq!((truth.iq, truth.id), (0.0, 0.0));
}

#[test]
fn offsets_of_the_current_sensors_are_calibrated_away() {
    let mut config = MotorConfig::servo();
    config.plant.sensing.offset = [0.8, -0.6];
    let mut line = turning(config, 1000.0);
    let (mut most, mut least) = (f32::MIN, f32::MAX);
    for _ in 0..100 {
        line.wait(1);
        let iq = line.truth().plant.iq;
        (most, least) = (most.max(iq), least.min(iq));
    }
    assert!(most - least < 0.3, "Iq between {least} A and {most} A");
}

#[test]
fn feed_forward_takes_over_from_the_regulators() {
    let mut line = turning(MotorConfig::mains(), 3000.0);
    let with = line.mean(FF_VQ_PIOUT);
    line.set(FF_2, 0);
    line.set(FF_1D, 0);
    line.set(FF_1Q, 0);
    line.wait(200);
    assert_eq!(line.get(FF_VQ), 0);
    let without = line.mean(FF_VQ_PIOUT);
    assert!(with.abs() < 1000.0 && without > 12_000.0, "{with} s16V with, {without} without");
    assert_eq!(line.status(), Status::Run);
}

#[test]
fn the_board_draws_its_power_from_the_source() {
    let mut line = line(MotorConfig::mains());
    line.wait(100);
    let truth = line.truth().plant;
    // 5 W at 325 V.
    assert!((truth.supply_current - 15.4e-3).abs() < 1e-4, "{truth:?}");
    assert!((truth.bus_voltage - (325.0 - 0.5 * 15.4e-3)).abs() < 1e-3, "{truth:?}");
}
