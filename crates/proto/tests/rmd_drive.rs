//! The replies, settings and modes of a drive.

use crate::rmd_bench::Node;
use motorlink_proto::can::CanFrame;
use motorlink_proto::rmd::*;
use motorlink_proto::time::{Instant, Micros};
use motorlink_proto::units::*;

const SHIPPED: Pid = Pid {
    position_kp: 100,
    position_ki: 100,
    speed_kp: 0,
    speed_ki: 0,
    torque_kp: 0,
    torque_ki: 0,
};
const OTHER: Pid =
    Pid { position_kp: 1, position_ki: 2, speed_kp: 3, speed_ki: 4, torque_kp: 5, torque_ki: 6 };

fn torque(digits: i16) -> SetTorque {
    SetTorque { iq: IqCommand(digits) }
}

fn circle(direction: SpinDirection, degrees: f64) -> SetSingleTurnPosition {
    SetSingleTurnPosition { direction, angle: TurnCentiDegrees::from_degrees(degrees) }
}

fn position(mode: Mode) -> i64 {
    let Mode::Position { target, .. } = mode else { panic!("{mode:?} is not a position") };
    target
}

/// A target of position command 1 or 2.
fn turn_to(target: i64, max_speed: Option<SpeedLimit>) -> Mode {
    Mode::Position { target, max_speed, within_max_angle: true }
}

#[test]
fn gains_in_ram_are_lost_at_power_off_and_those_in_rom_stay() {
    let mut node = Node::new(1);
    assert_eq!(node.ask(ReadPid), SHIPPED);
    assert_eq!(node.ask(WritePidRam(OTHER)), WritePidRam(OTHER));
    assert_eq!(node.motor.configured.gains, OTHER);
    assert_eq!(node.ask(ReadPid), OTHER);
    assert!(node.motor.saved.is_empty());
    node.power_cycle();
    assert_eq!(node.ask(ReadPid), SHIPPED);
    assert_eq!(node.motor.configured.gains, SHIPPED);

    node.ask(WritePidRom(OTHER));
    assert_eq!(node.ask(ReadPid), OTHER);
    assert_eq!(node.motor.configured.gains, OTHER, "at once");
    assert_eq!(node.motor.saved.last(), Some(node.drive.rom()));
    node.power_cycle();
    assert_eq!(node.ask(ReadPid), OTHER);
}

#[test]
fn acceleration_is_kept_in_ram_only_and_read_back_as_written() {
    let mut node = Node::new(1);
    for digits in [20_000, 0, -1] {
        let acceleration = Acceleration { acceleration: DpsPerSecond(digits) };
        node.ask(WriteAccelerationRam(acceleration));
        assert_eq!(node.ask(ReadAcceleration), acceleration);
        assert_eq!(node.motor.configured.acceleration, DpsPerSecond(digits));
    }
    node.ask(WritePidRom(OTHER));
    node.power_cycle();
    let acceleration = DpsPerSecond(1000);
    assert_eq!(node.ask(ReadAcceleration), Acceleration { acceleration });
}

#[test]
fn a_written_offset_holds_at_once_and_after_a_power_cycle() {
    let mut node = Node::new(1);
    node.motor.sense.encoder = 0x1000;
    let offset = EncoderOffset { offset: 0x1800 };
    assert_eq!(node.ask(WriteEncoderOffsetRom(offset)), offset);
    for _ in 0..2 {
        let encoder = Encoder { position: 0x3800, raw: 0x1000, offset: 0x1800 };
        assert_eq!(node.ask(ReadEncoder), encoder);
        assert_eq!(node.ask(ReadMotionStatus).encoder, 0x3800);
        assert_eq!(node.ask(ReadSingleTurnAngle).angle, TurnCentiDegrees(31_500));
        assert_eq!(node.ask(ReadMultiTurnAngle).angle, WideCentiDegrees(-4_500));
        node.power_cycle();
    }
}

#[test]
fn an_offset_beyond_the_encoder_is_cut_in_the_reply_too() {
    let mut node = Node::new(1);
    let offset = EncoderOffset { offset: 0xFFFF };
    assert_eq!(node.ask(WriteEncoderOffsetRom(offset)), EncoderOffset { offset: 0x3FFF });
}

#[test]
fn a_drive_does_not_answer_or_command_its_motor_before_power_on() {
    let mut node = Node::new(1);
    let before = node.motor.clone();
    node.drive = Drive::new(node.drive.config, *node.drive.rom());
    node.motor.sense.faults = Errors(0xFF);
    assert_eq!(node.raw(SetSpeed { speed: CentiDps(36000) }.encode()), None);
    assert_eq!(node.raw(Off.encode()), None);
    let torques = SetTorque4([IqCommand(100); 4]).encode();
    assert_eq!(node.receive(Instant(1), &CanFrame::new(TORQUE4_ID, torques)), None);
    node.drive.poll(Instant(1), &mut node.motor);
    assert_eq!(node.motor.modes_set, before.modes_set);
    node.motor.sense.faults = Errors::NONE;
    node.power_cycle();
    assert!(node.drive.errors().is_empty());
    assert!(node.raw(SetSpeed { speed: CentiDps(36000) }.encode()).is_some());
    assert_eq!(node.motor.mode, Mode::Speed(CentiDps(36000)));
}

#[test]
fn a_new_zero_is_in_the_reply_and_holds_from_the_next_power_on() {
    let mut node = Node::new(1);
    node.motor.sense.encoder = 0x1234;
    assert_eq!(node.ask(WriteZeroRom), EncoderOffset { offset: 0x1234 });
    let before = Encoder { position: 0x1234, raw: 0x1234, offset: 0 };
    assert_eq!(node.ask(ReadEncoder), before);
    assert_eq!(node.motor.saved.len(), 1);
    node.power_cycle();
    let after = Encoder { position: 0, raw: 0x1234, offset: 0x1234 };
    assert_eq!(node.ask(ReadEncoder), after);
    assert_eq!(node.ask(ReadMultiTurnAngle).angle, WideCentiDegrees(0));
}

#[test]
fn an_18_bit_encoder_sends_16_bits_and_an_exact_angle() {
    let mut node = Node::new(1);
    node.drive.config.encoder = EncoderBits::new(18).unwrap();
    node.motor.sense.encoder = 0x1_0003;
    let encoder = Encoder { position: 0x4000, raw: 0x4000, offset: 0 };
    assert_eq!(node.ask(ReadEncoder), encoder);
    node.motor.sense.encoder = (1 << 18) + 0x2_0000;
    assert_eq!(node.ask(ReadMultiTurnAngle).angle, WideCentiDegrees(54_000));
    node.ask(SetPosition { angle: CentiDegrees(-9_000) });
    assert_eq!(position(node.motor.mode), -0x1_0000);
}

#[test]
fn status_carries_what_the_sensors_read() {
    let mut node = Node::new(1);
    let phase_currents = PhaseCurrents { phase_a: PhaseCurrent(64), ..PhaseCurrents::default() };
    node.motor.sense = Sense {
        temperature: Celsius(-7),
        voltage: DeciVolts(240),
        iq: IqFeedback(-2048),
        speed: Dps(-360),
        encoder: 77,
        phase_currents,
        faults: Errors::NONE,
    };
    let status = Status { temperature: Celsius(-7), voltage: DeciVolts(240), errors: Errors::NONE };
    assert_eq!(node.ask(ReadStatus), status);
    let motion = MotionStatus {
        temperature: Celsius(-7),
        iq: IqFeedback(-2048),
        speed: Dps(-360),
        encoder: 77,
    };
    assert_eq!(node.ask(ReadMotionStatus), motion);
    assert_eq!(node.ask(torque(1)), motion);
    assert_eq!(node.ask(ReadPhaseCurrents), phase_currents);
}

#[test]
fn run_restores_what_stop_interrupted() {
    let mut node = Node::new(1);
    let speed = CentiDps(36_000);
    node.ask(SetSpeed { speed });
    node.ask(Stop);
    assert_eq!(node.motor.mode, Mode::Stopped);
    assert_eq!(node.drive.mode(), Mode::Stopped);
    node.ask(Stop);
    node.ask(Run);
    assert_eq!(node.motor.mode, Mode::Speed(speed));
    assert_eq!(node.drive.mode(), Mode::Speed(speed));
}

#[test]
fn run_without_a_stop_changes_nothing() {
    let mut node = Node::new(1);
    node.ask(torque(5));
    let set = node.motor.modes_set;
    node.ask(Run);
    assert_eq!(node.motor.modes_set, set);
}

#[test]
fn after_off_there_is_nothing_to_resume() {
    let mut node = Node::new(1);
    node.ask(torque(5));
    node.ask(Stop);
    node.ask(Off);
    assert_eq!(node.motor.mode, Mode::Off);
    node.ask(Run);
    assert_eq!(node.motor.mode, Mode::Off);
    node.ask(Stop);
    assert_eq!(node.motor.mode, Mode::Off, "stop does not change off");
}

#[test]
fn a_motion_command_ends_a_stop() {
    let mut node = Node::new(1);
    node.ask(torque(5));
    node.ask(Stop);
    node.ask(torque(6));
    assert_eq!(node.motor.mode, Mode::Torque(IqCommand(6)));
}

#[test]
fn torque_beyond_the_range_of_the_document_is_saturated() {
    let mut node = Node::new(1);
    for (asked, done) in [(2000, 2000), (2001, 2000), (i16::MAX, 2000), (i16::MIN, -2000)] {
        node.ask(torque(asked));
        assert_eq!(node.motor.mode, Mode::Torque(IqCommand(done)));
    }
}

#[test]
fn position_targets_are_counted_from_the_zero_point() {
    let mut node = Node::new(1);
    node.ask(WriteEncoderOffsetRom(EncoderOffset { offset: 100 }));
    node.ask(SetPosition { angle: CentiDegrees(-36_000) });
    assert_eq!(node.motor.mode, turn_to(100 - 16_384, None));
    let max_speed = SpeedLimit(0);
    node.ask(SetPositionLimited { angle: CentiDegrees(9_000), max_speed });
    let limited = turn_to(100 + 4_096, Some(max_speed));
    assert_eq!(node.motor.mode, limited, "a maximum speed of 0 is kept");
}

#[test]
fn a_target_does_not_move_with_the_zero_point() {
    let mut node = Node::new(1);
    node.ask(SetPosition { angle: CentiDegrees(9_000) });
    node.ask(WriteEncoderOffsetRom(EncoderOffset { offset: 1_000 }));
    assert_eq!(node.motor.mode, turn_to(4_096, None));
}

#[test]
fn a_single_turn_command_turns_in_its_direction() {
    let mut node = Node::new(1);
    node.motor.sense.encoder = 3 * 16_384 + 8_192;
    node.ask(circle(SpinDirection::Clockwise, 90.0));
    assert_eq!(position(node.motor.mode), 4 * 16_384 + 4_096);
    node.ask(circle(SpinDirection::Counterclockwise, 90.0));
    assert_eq!(position(node.motor.mode), 3 * 16_384 + 4_096);
    node.ask(circle(SpinDirection::Counterclockwise, 180.0));
    assert_eq!(position(node.motor.mode), 3 * 16_384 + 8_192, "the motor is already there");
}

#[test]
fn the_same_single_turn_command_again_does_not_start_another_turn() {
    let mut node = Node::new(1);
    let command = circle(SpinDirection::Clockwise, 90.0);
    node.ask(command);
    node.motor.sense.encoder = 4_097;
    node.ask(command);
    assert_eq!(position(node.motor.mode), 4_096, "an overshoot of one count does not start a turn");
    let SetSingleTurnPosition { direction, angle } = command;
    let max_speed = SpeedLimit(7);
    node.ask(SetSingleTurnPositionLimited { direction, max_speed, angle });
    assert_eq!(
        node.motor.mode,
        Mode::Position { target: 4_096, max_speed: Some(max_speed), within_max_angle: false }
    );
    node.ask(torque(0));
    node.ask(command);
    assert_eq!(position(node.motor.mode), 4_096 + 16_384, "after another command it is a new one");
}

#[test]
fn a_single_turn_command_outside_the_range_of_the_document_is_answered_and_not_carried_out() {
    let mut node = Node::new(1);
    let known = circle(SpinDirection::Clockwise, 90.0);
    node.ask(known);
    let set = node.motor.modes_set;
    for command in [
        SetSingleTurnPosition { angle: TurnCentiDegrees(36_000), ..known },
        SetSingleTurnPosition { direction: SpinDirection::Unknown(2), ..known },
    ] {
        for _ in 0..2 {
            assert!(node.raw(command.encode()).is_some());
            assert_eq!(node.motor.modes_set, set);
        }
    }
}

#[test]
fn an_error_stays_until_it_is_cleared_after_its_cause_is_gone() {
    let mut node = Node::new(1);
    node.motor.sense.faults = Errors::LOW_VOLTAGE;
    assert_eq!(node.ask(ReadStatus).errors, Errors::LOW_VOLTAGE);
    assert_eq!(node.ask(ClearErrors).errors, Errors::LOW_VOLTAGE, "the cause is still present");
    node.motor.sense.faults = Errors::OVER_TEMPERATURE;
    assert_eq!(node.ask(ClearErrors).errors, Errors::OVER_TEMPERATURE, "only one cause is gone");
    node.motor.sense.faults = Errors::NONE;
    assert_eq!(node.ask(ReadStatus).errors, Errors::OVER_TEMPERATURE);
    assert_eq!(node.ask(ClearErrors).errors, Errors::NONE);
}

#[test]
fn while_an_error_is_latched_the_motor_is_off_and_motion_commands_are_only_answered() {
    let mut node = Node::new(1);
    node.ask(torque(100));
    node.motor.sense.faults = Errors::OVER_TEMPERATURE;
    node.drive.poll(Instant(5), &mut node.motor);
    assert_eq!(node.motor.mode, Mode::Off);
    node.motor.sense.faults = Errors::NONE;
    node.ask(torque(100));
    node.ask(Run);
    assert!(node.receive(Instant(6), &CanFrame::new(0x280, [1; 8])).is_some());
    assert_eq!(node.motor.mode, Mode::Off);
    node.ask(ClearErrors);
    node.ask(Run);
    assert_eq!(node.motor.mode, Mode::Off, "the protection discarded the command");
    node.ask(torque(100));
    assert_eq!(node.motor.mode, Mode::Torque(IqCommand(100)));
}

#[test]
fn silence_for_the_shutdown_time_switches_the_motor_off() {
    let mut node = Node::new(1);
    assert_eq!(node.drive.deadline(), None);
    node.drive.config.shutdown = Some(Micros(1_000));
    assert_eq!(node.drive.deadline(), None, "an idle motor has no deadline");
    let send = |node: &mut Node, at, data| node.receive(Instant(at), &CanFrame::new(0x141, data));
    send(&mut node, 100, torque(5).encode());
    assert_eq!(node.drive.deadline(), Some(Instant(1_100)));
    send(&mut node, 900, ReadStatus.encode());
    assert_eq!(node.drive.deadline(), Some(Instant(1_900)), "any command counts");
    send(&mut node, 1_000, [0x60; 8]);
    assert_eq!(node.drive.deadline(), Some(Instant(1_900)), "an unknown code does not");
    node.drive.poll(Instant(1_899), &mut node.motor);
    assert_eq!(node.motor.mode, Mode::Torque(IqCommand(5)));
    node.drive.poll(Instant(1_900), &mut node.motor);
    assert_eq!(node.motor.mode, Mode::Off);
    send(&mut node, 1_950, Run.encode());
    assert_eq!(node.motor.mode, Mode::Off, "there is nothing to resume");

    send(&mut node, 2_000, torque(5).encode());
    send(&mut node, 3_000, Run.encode());
    assert_eq!(node.motor.mode, Mode::Off, "also without a poll in between");
}

#[test]
fn frames_that_a_drive_ignores_are_counted() {
    let mut node = Node::new(5);
    let data = torque(7).encode();
    for frame in [CanFrame::new(0x141, data), CanFrame::new(0x280, data)] {
        assert_eq!(node.receive(Instant(1), &frame), None);
    }
    assert_eq!(*node.drive.ignored(), Ignored::default());
    for frame in [
        CanFrame::data_frame(0x145, false, &data[..7]),
        CanFrame::data_frame(0x145, true, &data),
        CanFrame::remote_frame(0x145, false, 8),
    ] {
        assert_eq!(node.receive(Instant(1), &frame), None);
    }
    assert_eq!(node.raw([0x60, 0, 0, 0, 0, 0, 0, 0]), None);
    assert_eq!(*node.drive.ignored(), Ignored { malformed: 3, unknown: 1 });
}
