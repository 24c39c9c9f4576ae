//! The tables of the protocols name every request that changes the motion of a simulated drive.

use motorlink_proto::Motion;
use motorlink_proto::rmd::Code;
use motorlink_proto::st::{
    Command, ControlMode, Effect, Frame, MAX_FRAME, Profile, RegisterId, Status, register,
};

use crate::{rmd_bench, st_bench};

/// What a drive does: its state, its mode, and the reference of this mode.
fn doing(line: &mut st_bench::NodeFixture) -> (Status, ControlMode, f32) {
    line.wait(20);
    let mode = ControlMode::from(line.get(register::CONTROL_MODE));
    let truth = line.truth();
    let reference = match mode {
        ControlMode::Speed => truth.speed_reference_rpm,
        _ => line.get(register::TORQUE_REF).into(),
    };
    (truth.status, mode, reference)
}

/// Every frame code with payloads of many lengths, every command, and values for every register.
fn frames() -> Vec<(u8, Vec<u8>)> {
    let mut frames = Vec::new();
    for code in 0..=0x1F {
        for size in [0, 1, 2, 4, 6, 8] {
            frames.extend([0, 1, 60].map(|byte| (code, vec![byte; size])));
        }
    }
    frames.extend(Command::ALL.iter().map(|command| (3, vec![command.number()])));
    for id in RegisterId::all() {
        for size in [2, 4] {
            for value in [0, 0x0140, i32::MAX] {
                frames.push((1, [&[id.0][..], &value.to_le_bytes()[..size]].concat()));
            }
        }
    }
    frames
}

#[test]
fn every_request_that_changes_the_motion_of_an_st_drive_is_known() {
    for profile in Profile::ALL {
        let mut resting = st_bench::NodeFixture::new(profile, [Default::default()]);
        resting.ramp(1000, 0);
        let mut running = resting.clone();
        running.run();
        let mut accelerating = running.clone();
        accelerating.ramp(3000, 5000);
        let mut in_torque_mode = running.clone();
        in_torque_mode.set(register::CONTROL_MODE, ControlMode::Torque.number());
        let mut changing = 0;
        for drive in [resting, running, accelerating, in_torque_mode] {
            let before = doing(&mut drive.clone());
            for (code, payload) in frames() {
                let frame = Frame { header: Frame::header(code, 1), payload: &payload };
                let effect = Effect::of_frame(&frame);
                let mut drive = drive.clone();
                let bytes = frame.encode(&mut [0; MAX_FRAME]).unwrap().to_vec();
                drive.station.receive(drive.now, &bytes, |_| {});
                let after = doing(&mut drive);
                // Wrong gains end in a fault, which stops the motor.
                if after == before || matches!(after.0, Status::FaultNow | Status::FaultOver) {
                    continue;
                }
                changing += usize::from(effect.motion().is_owned());
                assert!(
                    effect.motion() != Motion::Keeps || effect == Effect::Resets,
                    "{profile:?}: {code:#04x} {payload:02x?} ({effect:?}) {before:?} -> {after:?}"
                );
            }
        }
        assert!(changing > 20, "{changing}");
    }
}

#[test]
fn every_request_that_changes_the_motion_of_an_rmd_motor_is_known() {
    use motorlink_proto::rmd::SetSpeed;
    use motorlink_proto::units::CentiDps;

    let resting = rmd_bench::NodeFixture::one();
    let mut running = resting.clone();
    running.ask(SetSpeed { speed: CentiDps(36_000) });
    running.wait(500);
    let doing = |mut bus: rmd_bench::NodeFixture| {
        bus.wait(20);
        bus.truth().mode
    };
    let mut changing = 0;
    for bus in [resting, running] {
        let before = doing(bus.clone());
        for code in 0..=u8::MAX {
            for data in [[0; 7], [0, 0, 0, 16, 16, 0, 0], [16; 7]] {
                let mut bus = bus.clone();
                let [a, b, c, d, e, f, g] = data;
                let frame = motorlink_proto::can::CanFrame::new(0x141, [code, a, b, c, d, e, f, g]);
                bus.send(&frame);
                let after = doing(bus);
                let known = Code::from(code);
                if after != before {
                    changing += usize::from(known.motion().may_move());
                    assert!(
                        known.motion() != Motion::Keeps,
                        "{code:#04x} {data:02x?} {before:?} -> {after:?}"
                    );
                }
            }
        }
    }
    assert!(changing > 10, "{changing}");
}
