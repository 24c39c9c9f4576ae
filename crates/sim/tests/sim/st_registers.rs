//! What registers show. That each can be read and written as the table says is shown by
//! crates/conformance/tests/st/suite.rs.

use motorlink_proto::st::{Command, Profile, RegisterId, Request, register::*};
use motorlink_sim::st::MotorConfig;

use crate::st_bench::NodeFixture;

#[test]
fn the_stages_of_the_revup_are_counted_in_every_state() {
    let mut line = NodeFixture::sensorless();
    let stages = line.get(RUC_STAGE_NBR);
    for phase in 0..stages {
        line.ask(0, Request::GetRevupData(phase)).unwrap();
    }
    line.ask(0, Request::GetRevupData(stages)).unwrap_err();
    line.execute(Command::StartMotor);
    for _ in 0..20 {
        line.wait(100);
        assert_eq!(line.get(RUC_STAGE_NBR), stages);
    }
}

/// Registers at one instant, from a data segment, including those of access D.
fn sample<const N: usize>(line: &mut NodeFixture, registers: [RegisterId; N]) -> [i32; N] {
    let ids = registers.map(|id| id.0);
    line.ask(0, Request::ConfigureSegment { segment: 0, registers: &ids }).unwrap();
    let payload = line.ask(0, Request::GetSegment(0)).unwrap();
    let mut rest = &payload[..];
    registers.map(|id| {
        let (value, tail) = rest.split_at(id.shape().unwrap().ty(Profile::Spec).size().into());
        rest = tail;
        id.decode(Profile::Spec, value).unwrap()
    })
}

#[test]
fn the_signals_of_a_running_motor_belong_together() {
    let mut line = NodeFixture::sensorless();
    line.run();
    line.wait(2000);
    line.brake(0.6);
    line.set(IQ_SPEEDMODE, -600);
    line.wait(2000);
    use RegisterId as R;
    let [a, b, alpha, beta, q, d] =
        sample(&mut line, [R::I_A, R::I_B, R::I_ALPHA, R::I_BETA, R::I_Q, R::I_D]);
    assert_eq!(a, alpha);
    let square = |x: i32, y: i32| f64::from(x * x + y * y).sqrt();
    assert!((square(alpha, beta) - square(q, d)).abs() < 2.0, "the amplitude stays");
    assert!((f64::from(a + 2 * b) / 3f64.sqrt() - f64::from(beta)).abs() < 2.0);
    let truth = line.truth().plant;
    let amperes = |digits: i32| f64::from(digits) * 20.0 / 32767.0;
    for (measured, truth) in [(amperes(q), truth.iq), (amperes(d), truth.id)] {
        assert!((measured - f64::from(truth)).abs() < 0.06, "{measured} A of {truth} A");
    }

    let [vq, vd, v_alpha, v_beta] = sample(&mut line, [R::V_Q, R::V_D, R::V_ALPHA, R::V_BETA]);
    assert!((square(vq, vd) - square(v_alpha, v_beta)).abs() < 2.0);
    let volts = |digits: f64| digits / 32767.0 * f64::from(truth.bus_voltage) / 3f64.sqrt();
    let applied = volts(square(vq, vd));
    let really = f64::from(truth.vd.hypot(truth.vq));
    assert!((applied - really).abs() < 1.5, "{applied} V, {really} V at the windings");
    let [emf_alpha, emf_beta] = sample(&mut line, [R::OBS_BEMF_ALPHA, R::OBS_BEMF_BETA]);
    let emf = volts(square(emf_alpha, emf_beta));
    assert!((emf - 38.7).abs() < 1.5, "{emf} V at 1500 rpm and 0.246 V s/rad");
    let [angle] = sample(&mut line, [R::OBS_EL_ANGLE]);
    let rotor = (truth.angle_degrees * 4.0 / 360.0 * 65536.0) as i64 as i16;
    let off = (angle as i16).wrapping_sub(rotor);
    assert!(off.abs() < 1100, "{off} of 65536 away from the rotor, 6 degrees");
    let power = line.mean(MOTOR_POWER);
    assert!(
        (100.0..112.0).contains(&power),
        "{power} W for 94 W at the shaft, 4 W of friction, 8 W of copper"
    );
    let [speed] = sample(&mut line, [R::OBS_ROT_SPEED]);
    assert!((speed - 250).abs() <= 1, "1500 rpm are 25.0 Hz, not {speed}");
    let [vq, ff, pi] = sample(&mut line, [R::V_Q, R::FF_VQ, R::FF_VQ_PIOUT]);
    assert_eq!(vq, ff + pi);
    assert!(i32::abs(pi) * 4 < ff, "the back-EMF comes from the feed-forward: {pi} beside {ff}");
    let (expected, observed) = (line.get(EST_BEMF_LEVEL), line.get(OBS_BEMF_LEVEL));
    let ratio = f64::from(observed) / f64::from(expected);
    assert!((0.9..1.1).contains(&ratio), "observed {observed}, expected {expected}");
}

#[test]
fn what_is_read_of_a_running_motor_has_no_offset() {
    for config in MotorConfig::demo() {
        let mut line = NodeFixture::new(Profile::Spec, [config]);
        line.ramp(1500, 500);
        line.run();
        line.brake(0.02);
        line.wait(2000);
        let amps = f64::from(config.plant.sensing.full_scale) / 32767.0;
        let (mut speed, mut current) = (0.0, 0.0);
        for _ in 0..10 {
            speed += line.mean_of(|line| {
                f64::from(line.get(SPEED_MEAS)) - f64::from(line.truth().speed_rpm)
            });
            current += line.mean_of(|line| {
                f64::from(line.get(TORQUE_MEAS)) * amps - f64::from(line.truth().plant.iq)
            });
        }
        assert!(speed.abs() / 10.0 < 3.0, "{speed} rpm in ten means");
        // A step of the converter is 16 digits.
        assert!(current.abs() / 10.0 < 16.0 * amps, "{current} A in ten means");
        let truth = line.truth();
        let volts = f32::from(line.get(BUS_VOLTAGE)) - truth.plant.bus_voltage;
        let celsius = line.get(HEATS_TEMP) as f32 - truth.temperature;
        assert!(volts.abs() <= 0.5 && celsius.abs() <= 0.5, "{volts} V, {celsius} °C");
    }
}

#[test]
fn a_dac_channel_shows_the_register_that_was_chosen() {
    let mut line = NodeFixture::sensorless();
    line.set(DAC_OUT1, RegisterId::I_Q.0);
    line.set(DAC_OUT2, RegisterId::DAC_USER2.0);
    line.run();
    line.wait(100);
    let iq = i32::from(line.get(TORQUE_MEAS));
    let motor = line.world();
    assert_eq!((motor.dac(1), motor.dac(2)), (iq, 0x2000));
    assert_ne!(iq, 0);
}

#[test]
fn a_power_cycle_brings_every_register_back() {
    let mut line = NodeFixture::sensorless();
    let shipped = line.get(SPEED_KP);
    line.set(SPEED_KP, 1);
    line.ramp(-3000, 7);
    line.station.power_cycle();
    assert_eq!((line.get(SPEED_KP), line.get(RAMP_FINAL_SPEED)), (shipped, 1500));
}
