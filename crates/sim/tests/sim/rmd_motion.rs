//! Torque, speed and position, and their limits.

use motorlink_proto::can::CanFrame;
use motorlink_proto::rmd::*;
use motorlink_proto::units::*;
use motorlink_sim::rmd::RmdConfig;

use crate::rmd_bench::{NodeFixture, with_bits};

fn position(degrees: f64) -> SetPosition {
    SetPosition { angle: CentiDegrees::from_degrees(degrees) }
}

fn speed(dps: f64) -> SetSpeed {
    SetSpeed { speed: CentiDps::from_dps(dps) }
}

#[test]
fn torque_is_the_torque_constant_times_the_current() {
    for config in [RmdConfig::default(), RmdConfig::x8()] {
        for amps in [0.5, -2.0, 5.0] {
            let mut bench = NodeFixture::new([config]);
            bench.world().plant_mut().lock(true);
            bench.ask(SetTorque { iq: IqCommand::from_amps(amps) });
            bench.wait(20);
            let (mut torque, mut read) = (0.0, 0.0);
            for _ in 0..100 {
                bench.wait(1);
                torque += f64::from(bench.truth().plant.torque) / 100.0;
                read += bench.ask(ReadMotionStatus).iq.amps() / 100.0;
            }
            let told = amps * f64::from(config.plant.machine.torque_constant());
            assert!((torque / told - 1.0).abs() < 0.02, "{torque} for {told} Nm");
            assert!((read / amps - 1.0).abs() < 0.02, "{read} for {amps} A");
        }
    }
}

#[test]
fn torque_is_not_limited_by_the_greatest_torque_current() {
    let (iq, none) = (IqCommand::from_amps(10.0), IqCommand(0));
    for is_of_four in [false, true] {
        let mut bench =
            NodeFixture::new([RmdConfig { max_torque_current: 2.0, ..RmdConfig::default() }]);
        bench.world().plant_mut().lock(true);
        if is_of_four {
            let torques = SetTorque4([iq, none, none, none]);
            bench.send(&CanFrame::new(TORQUE4_ID, torques.encode()));
        } else {
            bench.ask(SetTorque { iq });
        }
        let current = bench.watch(20).current;
        assert!((9.8..10.5).contains(&current), "{current} A");
        bench.ask(speed(-3000.0));
        bench.wait(20);
        let current = bench.watch(500).current;
        assert!((1.9..2.1).contains(&current), "{current} A");
    }
}

#[test]
fn a_speed_is_reached_without_error_and_held_against_a_load() {
    // A load of 1.2 A, at the output.
    for (config, brake) in [(RmdConfig::default(), 0.1), (RmdConfig::x8(), 2.1)] {
        let mut bench = NodeFixture::new([config]);
        bench.ask(speed(1234.5));
        let seen = bench.watch(300);
        assert!(seen.speed < 1234.5 * 1.05, "{} °/s on the way", seen.speed);
        let most = config.max_torque_current * 1.03;
        assert!(seen.current < most, "{} A of {most}", seen.current);
        assert!((bench.mean_speed(500) / 1234.5 - 1.0).abs() < 0.002);
        bench.brake(brake);
        let dip = bench.watch(30);
        assert!((1.1..2.2).contains(&dip.current), "{} A", dip.current);
        bench.wait(100);
        let loaded = bench.mean_speed(500);
        assert!((loaded / 1234.5 - 1.0).abs() < 0.002, "{loaded} °/s");
    }
}

#[test]
fn positive_torque_speed_and_angle_are_clockwise() {
    for (amps, dps, spin) in
        [(0.5, 360.0, SpinDirection::Clockwise), (-0.5, -360.0, SpinDirection::Counterclockwise)]
    {
        let mut bench = NodeFixture::one();
        let commands = [
            SetTorque { iq: IqCommand::from_amps(amps) }.encode(),
            speed(dps).encode(),
            position(bench.angle() + dps).encode(),
            SetSingleTurnPosition { direction: spin, angle: TurnCentiDegrees(18_000) }.encode(),
        ];
        for command in commands {
            bench.power_cycle();
            let before = bench.angle();
            bench.raw(command);
            bench.wait(50);
            let status = bench.ask(ReadMotionStatus);
            let turned = bench.angle() - before;
            for value in [turned, status.speed.dps()] {
                assert!(value * dps > 0.0, "{value} after {command:02x?}");
            }
        }
        bench.power_cycle();
        bench.world().plant_mut().lock(true);
        bench.ask(SetTorque { iq: IqCommand::from_amps(amps) });
        bench.wait(50);
        assert!(bench.ask(ReadMotionStatus).iq.amps() * amps > 0.0);
    }
}

#[test]
fn an_acceleration_of_0_or_less_is_no_limit() {
    let fastest = |digits| {
        let mut bench = NodeFixture::one();
        bench.ask(WriteAccelerationRam(Acceleration { acceleration: DpsPerSecond(digits) }));
        bench.ask(speed(1000.0));
        bench.watch(100).acceleration
    };
    let limited = fastest(1000);
    let free = fastest(0);
    assert!(free > 5.0 * limited, "{free} °/s², {limited} °/s² with a limit");
    assert_eq!(free, fastest(-1000));
}

#[test]
fn a_move_is_a_trapezoid_that_never_goes_back() {
    for (config, angle, acceleration) in
        [(RmdConfig::default(), 90.0, 3000), (RmdConfig::x8(), -720.0, 20_000)]
    {
        let mut bench = NodeFixture::new([config]);
        let acceleration = Acceleration { acceleration: DpsPerSecond(acceleration) };
        bench.ask(WriteAccelerationRam(acceleration));
        let max_speed = SpeedLimit(400);
        let target = CentiDegrees::from_degrees(angle);
        bench.ask(SetPositionLimited { max_speed, angle: target });
        let limit = acceleration.acceleration.0 as f32;
        let (mut last_speed, mut last, mut cruised) = (0.0, 0.0, 0);
        for _ in 0..300 {
            bench.wait(10);
            let truth = bench.truth();
            let way = truth.plant.angle_degrees * angle.signum();
            assert!(way >= last - 0.01, "from {last}° back to {way}°");
            let speed = truth.speed_dps * angle.signum() as f32;
            // Cogging and stiction at the start cause 50 °/s.
            assert!(speed < 450.0, "{speed} °/s");
            let change = (speed - last_speed).abs() - 50.0;
            assert!(change < limit * 0.01, "{change} °/s in 10 ms");
            cruised += i32::from((380.0..420.0).contains(&speed));
            (last, last_speed) = (way, speed);
        }
        assert!(cruised > 5, "{cruised}");
        let off = (bench.truth().plant.output_degrees
            - angle / f64::from(config.plant.machine.gear.ratio))
        .abs();
        assert!(off < 0.05, "{off}° at the output");
    }
}

#[test]
fn a_position_is_reached_within_a_tenth_of_a_degree_without_swinging() {
    for bits in [12, 14, 18] {
        for degrees in [0.5, 90.0, -3600.0, 36_000.0] {
            let config = with_bits(bits);
            let mut bench = NodeFixture::new([config]);
            bench.ask(position(degrees));
            let seen = bench.watch(5000);
            let end = bench.truth().plant.angle_degrees;
            let close = if bits < 14 { 0.2 } else { 0.1 };
            assert!((end - degrees).abs() < close, "{end}° for {degrees}° with {bits} bits");
            let over = (seen.greatest - degrees.max(0.0)).max(degrees.min(0.0) - seen.least);
            assert!(over < 0.2, "{over}° too far for {degrees}° with {bits} bits");
        }
    }
}

#[test]
fn the_drives_own_limits_hold_a_position_command() {
    let config = RmdConfig {
        max_speed_dps: 500.0,
        max_angle_degrees: 180.0,
        max_torque_current: 3.0,
        encoder_offset: 4096,
        ..RmdConfig::default()
    };
    let mut bench = NodeFixture::new([config]);
    assert!((bench.angle() + 90.0).abs() < 0.1, "the offset is a quarter of a turn");
    bench.ask(position(1000.0));
    let seen = bench.watch(2000);
    assert!(seen.speed < 540.0, "{} °/s", seen.speed);
    assert!(seen.current < 3.1, "{} A", seen.current);
    assert!((bench.angle() - 180.0).abs() < 0.1, "{}°", bench.angle());
    bench.ask(position(-1000.0));
    bench.wait(3000);
    assert!((bench.angle() + 180.0).abs() < 0.1, "{}°", bench.angle());
    let (direction, angle) =
        (SpinDirection::Counterclockwise, TurnCentiDegrees::from_degrees(90.0));
    bench.ask(SetSingleTurnPosition { direction, angle });
    bench.wait(3000);
    assert!((bench.angle() + 270.0).abs() < 0.1, "Max Angle is not for single-turn commands");
}

/// The response of a motor with these gains to a command, after `ms`.
fn follow(gains: Pid, ms: u32, command: impl FnOnce(&mut NodeFixture)) -> (f64, f32, f32) {
    let mut bench = NodeFixture::one();
    bench.ask(WritePidRam(gains));
    command(&mut bench);
    bench.wait(ms);
    let truth = bench.truth();
    (truth.plant.angle_degrees, truth.speed_dps, truth.plant.iq)
}

#[test]
fn each_gain_acts() {
    let shipped = RmdConfig::default().factory_rom().gains;
    let step = |gains| follow(gains, 60, |bench| _ = bench.ask(position(2.0))).0;
    assert!(step(Pid { position_kp: 20, ..shipped }) < 0.7 * step(shipped));

    let dip = |gains| {
        let (_, speed, _) = follow(gains, 8, |bench| {
            bench.ask(speed(1000.0));
            bench.wait(1000);
            bench.brake(0.015);
        });
        1000.0 - speed
    };
    assert!(dip(Pid { speed_kp: 25, ..shipped }) > 1.4 * dip(shipped));

    let torque = IqCommand::from_amps(5.0);
    let push = |gains| follow(gains, 1, |bench| _ = bench.ask(SetTorque { iq: torque })).2;
    assert!(push(Pid { torque_kp: 10, torque_ki: 10, ..shipped }) < 0.7 * push(shipped));

    let loaded = |gains| {
        follow(gains, 1000, |bench| {
            bench.brake(0.1);
            bench.ask(speed(2000.0));
        })
    };
    let (_, with, _) = loaded(shipped);
    let (_, without, _) = loaded(Pid { speed_ki: 0, ..shipped });
    assert!((with - 2000.0).abs() < 20.0 && without < 1700.0, "{with} and {without} °/s");

    let (.., current) = follow(Pid { torque_ki: 0, ..shipped }, 5, |bench| {
        bench.world().plant_mut().lock(true);
        bench.ask(SetTorque { iq: torque });
    });
    assert!(current < 4.5, "{current} A without Ki");

    let held = |position_ki| {
        let gains = Pid { position_ki, speed_kp: 255, speed_ki: 0, ..shipped };
        follow(gains, 20_000, |bench| _ = bench.ask(position(0.5))).0
    };
    assert!((held(255) - 0.5).abs() < (held(0) - 0.5).abs(), "{} and {}", held(255), held(0));

    let no_speed_loop = Pid { speed_kp: 0, speed_ki: 0, ..shipped };
    for dead in [Pid::default(), Pid { position_kp: 0, ..shipped }, no_speed_loop] {
        let (angle, ..) = follow(dead, 500, |bench| _ = bench.ask(position(90.0)));
        assert_eq!(angle, 0.0, "without gains nothing moves");
    }
}

#[test]
fn phase_currents_sum_to_zero_and_follow_the_electrical_angle() {
    let mut bench = NodeFixture::one();
    bench.world().plant_mut().lock(true);
    bench.ask(SetTorque { iq: IqCommand::from_amps(8.0) });
    bench.wait(50);
    let PhaseCurrents { phase_a, phase_b, phase_c } = bench.ask(ReadPhaseCurrents);
    assert_eq!(phase_a.0 + phase_b.0 + phase_c.0, 0);
    // Iq at an electrical angle of zero leaves phase A alone; half a count is 0.6° of it.
    assert!(phase_a.amps().abs() < 0.15, "{phase_a}");
    assert!((phase_b.amps() - 8.0 * 0.75f64.sqrt()).abs() < 0.15, "{phase_b}");

    bench.world().plant_mut().lock(false);
    bench.ask(speed(77.0));
    for _ in 0..100 {
        bench.wait(7);
        let PhaseCurrents { phase_a, phase_b, phase_c } = bench.ask(ReadPhaseCurrents);
        assert_eq!(phase_a.0 + phase_b.0 + phase_c.0, 0);
        let truth = bench.truth().plant;
        for (read, real) in [phase_a, phase_b, phase_c].iter().zip(truth.phase_currents) {
            assert!((read.amps() - f64::from(real)).abs() < 0.1, "{read} for {real} A");
        }
    }
}

/// What a held rotor does after `command`, Stop and its release: the current while it is held (A), and
/// how far it turns (°).
fn released_after_stop(command: impl FnOnce(&mut NodeFixture)) -> (f32, f64) {
    let mut bench = NodeFixture::new([RmdConfig::x8()]);
    bench.world().plant_mut().lock(true);
    command(&mut bench);
    bench.wait(1000);
    assert!(bench.truth().plant.iq > 5.0, "the rotor is held against the command");
    bench.ask(Stop);
    bench.wait(100);
    let (held, angle) = (bench.truth().plant.iq, bench.truth().plant.angle_degrees);
    bench.world().plant_mut().lock(false);
    let seen = bench.watch(500);
    (held, (seen.greatest - angle).max(angle - seen.least))
}

#[test]
fn a_held_rotor_does_not_turn_after_a_stop_when_it_is_released() {
    let after_speed = released_after_stop(|bench| _ = bench.ask(speed(360.0)));
    let after_position = released_after_stop(|bench| _ = bench.ask(position(90.0)));
    let after_torque = released_after_stop(|bench| {
        bench.ask(SetTorque { iq: IqCommand::from_amps(10.0) });
    });
    for (held, turned) in [after_speed, after_position, after_torque] {
        assert!(held.abs() < 0.3, "{held} A after the stop");
        assert!(turned < 0.5, "{turned}° after the release");
    }
}
