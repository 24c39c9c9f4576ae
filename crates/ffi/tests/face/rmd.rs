//! The RMD protocol: a host and a drive.

use std::ffi::c_void;
use std::ptr::null;

use motorlink_ffi::rmd::{drive::*, host::*, message::*, *};
use motorlink_ffi::slcan::*;
use motorlink_ffi::*;

use crate::{Error, OK, gives, set_no_mode, zeroed};

#[test]
fn the_moment_to_ask_again_is_known_after_an_exchange_in_quarantine() {
    let mut host: motorlink_rmd_host = zeroed();
    let mut output: motorlink_rmd_output = zeroed();
    let mut retry = 0;
    let (now, quarantine) = (5_000, 20_000);
    gives!(Ok, motorlink_rmd_host_init(&mut host, size_of_val(&host)));
    gives!(Ok, motorlink_rmd_host_set_times(&mut host, 1_000_000, quarantine));
    let torque = motorlink_rmd_set_torque(100);
    gives!(Ok, motorlink_rmd_host_request(&mut host, 0, 1, torque));
    gives!(Ok, motorlink_rmd_host_poll(&mut host, 0, &mut output));
    while output.kind == motorlink_output::Transmit {
        let mut reply = output.frame;
        reply.data[1] = 25;
        gives!(Ok, motorlink_rmd_host_receive(&mut host, now, &reply));
        gives!(Ok, motorlink_rmd_host_poll(&mut host, now, &mut output));
    }
    assert_eq!((output.kind, output.result), (motorlink_output::Done, Error::Quarantined));
    gives!(Ok, motorlink_rmd_host_retry(&mut host, &mut retry));
    assert_eq!(retry, now + u64::from(quarantine));
    gives!(Quarantined, motorlink_rmd_host_request(&mut host, retry - 1, 1, torque));
    gives!(Ok, motorlink_rmd_host_request(&mut host, retry, 1, torque));
    gives!(Ok, motorlink_rmd_host_poll(&mut host, retry, &mut output));
    assert_eq!((output.kind, output.frame.data[0]), (motorlink_output::Transmit, 0xA1));
}

#[derive(Default)]
struct Told {
    motions: Vec<motorlink_rmd_motion>,
    settings: Vec<motorlink_rmd_settings>,
}

#[test]
fn a_motor_is_told_what_its_drive_is_commanded() {
    extern "C" fn set_mode(context: *mut c_void, motion: *const motorlink_rmd_motion) {
        let motion = unsafe { *motion };
        unsafe { (*context.cast::<Told>()).motions.push(motion) };
    }
    extern "C" fn keep(context: *mut c_void, settings: *const motorlink_rmd_settings) {
        let settings = unsafe { *settings };
        unsafe { (*context.cast::<Told>()).settings.push(settings) };
    }
    let told: *mut Told = Box::into_raw(Box::default());
    let motor = motorlink_rmd_motor_control {
        context: told.cast(),
        set_mode: Some(set_mode),
        configure: Some(keep),
        sense: None,
        save: Some(keep),
    };
    let config = motorlink_rmd_drive_config { id: 1, ..zeroed() };
    let rom = motorlink_rmd_settings { acceleration_dps2: 700, ..zeroed() };
    let pid = motorlink_rmd_pid { position_kp: 9, ..zeroed() };
    let mut drive: motorlink_rmd_drive = zeroed();
    let mut frame: motorlink_can_frame = zeroed();
    (frame.id, frame.size) = (0x141, 8);
    let mut reply = frame;
    gives!(Ok, motorlink_rmd_drive_init(&mut drive, size_of_val(&drive), &config, &rom, &motor));
    gives!(Ok, motorlink_rmd_drive_power_on(&mut drive, 0));
    for request in [
        motorlink_rmd_write_pid_rom(pid),
        motorlink_rmd_set_torque(-5),
        motorlink_rmd_set_speed(-36_000),
        motorlink_rmd_set_position(9_000),
        motorlink_rmd_set_position_limited(-9_000, 360),
        motorlink_rmd_set_single_turn_position(0, 9_000),
        motorlink_rmd_stop(),
    ] {
        frame.data = request.bytes;
        gives!(Ok, motorlink_rmd_drive_receive(&mut drive, 0, &frame, &mut reply));
        assert_eq!(reply.id, 0x141);
    }
    let motion = |kind| motorlink_rmd_motion { kind, ..zeroed() };
    let position = |target_counts, max_speed_dps, within_max_angle| motorlink_rmd_motion {
        target_counts,
        max_speed_dps,
        within_max_angle,
        ..motion(motorlink_rmd_mode::Position)
    };
    let Told { motions, settings } = *unsafe { Box::from_raw(told) };
    assert_eq!(
        motions,
        [
            motion(motorlink_rmd_mode::Off),
            motorlink_rmd_motion { iq_16ma: -5, ..motion(motorlink_rmd_mode::Torque) },
            motorlink_rmd_motion { speed_centidps: -36_000, ..motion(motorlink_rmd_mode::Speed) },
            position(4_096, -1, 1),
            position(-4_096, 360, 1),
            position(4_096, -1, 0),
            motion(motorlink_rmd_mode::Stopped),
        ]
    );
    let new = motorlink_rmd_settings { pid, ..rom };
    assert_eq!(settings, [rom, new, new], "power-on, and what is used and saved");
}

/// An adapter in between, so that a request is a frame, a line, a frame and back.
#[test]
fn a_host_commands_a_drive_through_an_adapter() {
    extern "C" fn sense(_: *mut c_void, sense: *mut motorlink_rmd_sense) {
        unsafe { (*sense).temperature_celsius = 25 };
    }
    let mut motor = motorlink_rmd_motor_control { set_mode: Some(set_no_mode), ..zeroed() };
    motor.sense = Some(sense);
    let config =
        motorlink_rmd_drive_config { shutdown_us: 0, id: 3, encoder_bits: 0, clear_reply_0x9b: 0 };
    let (mut host, mut drive): (motorlink_rmd_host, motorlink_rmd_drive) = (zeroed(), zeroed());
    let (mut adapter, mut codec): (motorlink_slcan_device, motorlink_slcan_host) =
        (zeroed(), zeroed());
    gives!(
        Ok,
        motorlink_rmd_host_init(&mut host, size_of_val(&host)),
        motorlink_rmd_host_trust(&mut host, 1 << 2),
        motorlink_rmd_drive_init(&mut drive, size_of_val(&drive), &config, null(), &motor),
        motorlink_rmd_drive_power_on(&mut drive, 0),
        motorlink_slcan_device_init(&mut adapter, size_of_val(&adapter)),
        motorlink_slcan_host_init(&mut codec, size_of_val(&codec)),
    );
    let (mut line, mut answer): (motorlink_slcan_line, motorlink_slcan_line) = (zeroed(), zeroed());
    let mut frame: motorlink_can_frame = zeroed();
    let (mut output, mut said): (motorlink_rmd_output, _) =
        (zeroed(), motorlink_slcan_answer::None);
    gives!(Ok, motorlink_slcan_open(1_000_000, &mut line));
    for byte in &line.bytes[..line.size.into()] {
        gives!(Ok, motorlink_slcan_device_receive(&mut adapter, *byte, &mut answer, &mut frame));
        assert_eq!(frame.id, MOTORLINK_NO_FRAME);
    }
    gives!(Ok, motorlink_rmd_host_request(&mut host, 0, 3, motorlink_rmd_set_torque(100)));
    gives!(Ok, motorlink_rmd_host_poll(&mut host, 0, &mut output));
    gives!(Ok, motorlink_slcan_encode(&output.frame, &mut line));
    let mut reply: motorlink_can_frame = zeroed();
    for byte in &line.bytes[..line.size.into()] {
        gives!(Ok, motorlink_slcan_device_receive(&mut adapter, *byte, &mut answer, &mut frame));
    }
    gives!(Ok, motorlink_rmd_drive_receive(&mut drive, 0, &frame, &mut reply));
    gives!(Ok, motorlink_slcan_device_deliver(&mut adapter, 0, &reply, &mut line));
    for byte in &line.bytes[..line.size.into()] {
        gives!(Ok, motorlink_slcan_host_receive(&mut codec, *byte, &mut said, &mut frame));
    }
    assert_eq!(said, motorlink_slcan_answer::Frame);
    gives!(Ok, motorlink_rmd_host_receive(&mut host, 0, &frame));
    gives!(Ok, motorlink_rmd_host_poll(&mut host, 0, &mut output));
    assert_eq!((output.kind, output.motor, output.result), (motorlink_output::Done, 3, OK));
    let mut status: motorlink_rmd_motion_status = zeroed();
    gives!(Ok, motorlink_rmd_decode_motion_status(output.reply, &mut status));
    assert_eq!(status.temperature_celsius, 25);
    let mut motion: motorlink_rmd_motion = zeroed();
    gives!(Ok, motorlink_rmd_drive_motion(&mut drive, &mut motion));
    assert_eq!((motion.kind, motion.iq_16ma), (motorlink_rmd_mode::Torque, 100));
}

#[test]
fn a_motor_is_asked_for_its_status_first_unless_it_is_trusted() {
    let mut host: motorlink_rmd_host = zeroed();
    let mut output: motorlink_rmd_output = zeroed();
    let host: *mut motorlink_rmd_host = &mut host;
    gives!(Ok, motorlink_rmd_host_init(host, size_of::<motorlink_rmd_host>()));
    gives!(Ok, motorlink_rmd_host_trust(host, !(1 << 2)));
    for (motor, code) in [(1, 0xA1), (3, 0x9A), (32, 0xA1)] {
        gives!(Ok, motorlink_rmd_host_request(host, 0, motor, motorlink_rmd_set_torque(100)));
        gives!(Ok, motorlink_rmd_host_poll(host, 0, &mut output));
        assert_eq!((output.kind, output.frame.data[0]), (motorlink_output::Transmit, code));
    }
    gives!(Ok, motorlink_rmd_host_reopened(host, 0));
    gives!(Ok, motorlink_rmd_host_request(host, 0, 1, motorlink_rmd_set_torque(100)));
    gives!(Ok, motorlink_rmd_host_poll(host, 0, &mut output));
    assert_eq!((output.kind, output.frame.data[0]), (motorlink_output::Transmit, 0x9A));
    // The host receives its own frame.
    gives!(Ok, motorlink_rmd_host_receive(host, 0, &output.frame));
    gives!(Ok, motorlink_rmd_host_poll(host, 0, &mut output));
    assert_eq!((output.kind, output.result), (motorlink_output::Done, Error::Echo));
}

/// Conducts the exchange that was begun. The motor sends each reply so many times.
fn done(host: &mut motorlink_rmd_host, times: usize) -> Error {
    let mut output: motorlink_rmd_output = zeroed();
    loop {
        gives!(Ok, motorlink_rmd_host_poll(host, 0, &mut output));
        match output.kind {
            motorlink_output::Done => return output.result,
            motorlink_output::Wait => panic!("the motor answers at once"),
            motorlink_output::Transmit => {}
        }
        let mut reply = output.frame;
        reply.data[1] = 25;
        for _ in 0..times {
            gives!(Ok, motorlink_rmd_host_receive(host, 0, &reply));
        }
    }
}

#[test]
fn a_motor_that_answers_once_is_confirmed_and_one_that_answers_twice_is_not() {
    let mut host: motorlink_rmd_host = zeroed();
    gives!(Ok, motorlink_rmd_host_init(&mut host, size_of_val(&host)));
    gives!(Ok, motorlink_rmd_host_trust(&mut host, u32::MAX));
    let reads = [
        motorlink_rmd_read_status(),
        motorlink_rmd_read_motion_status(),
        motorlink_rmd_read_multi_turn_angle(),
    ];
    for (times, result) in [(1, OK), (2, Error::Unconfirmed), (1, OK)] {
        for request in reads {
            gives!(Ok, motorlink_rmd_host_request(&mut host, 0, 1, request));
            assert_eq!(done(&mut host, times), OK);
            gives!(Ok, motorlink_rmd_host_confirm(&mut host, 0, 1));
            assert_eq!(done(&mut host, 1), result, "{times} {request:x?}");
        }
    }
    gives!(BadArgument, motorlink_rmd_host_confirm(&mut host, 0, 33));
}

#[test]
fn a_cancelled_confirmation_does_not_affect_the_next_exchange() {
    let mut host: motorlink_rmd_host = zeroed();
    gives!(Ok, motorlink_rmd_host_init(&mut host, size_of_val(&host)));
    gives!(Ok, motorlink_rmd_host_trust(&mut host, u32::MAX));
    let read = motorlink_rmd_read_multi_turn_angle();
    gives!(Ok, motorlink_rmd_host_request(&mut host, 0, 1, read));
    assert_eq!(done(&mut host, 2), OK);
    gives!(Ok, motorlink_rmd_host_confirm(&mut host, 0, 1));
    gives!(Busy, motorlink_rmd_host_confirm(&mut host, 0, 1));
    gives!(Ok, motorlink_rmd_host_cancel(&mut host, 0, 1));
    gives!(Ok, motorlink_rmd_host_request(&mut host, 0, 1, read));
    assert_eq!(done(&mut host, 1), OK);
}
