//! Calls with values that a program may pass by mistake.

use std::ptr::null;
use std::slice;

use motorlink_ffi::rmd::{drive::*, host::*, message::*, *};
use motorlink_ffi::st::{master::*, names::*, request::*, slave::*, *};
use motorlink_ffi::*;
use motorlink_proto::st::{Profile, Recovery, RegisterId};

use crate::{Error, execute_nothing, gives, set_no_mode, zeroed};

fn text(text: motorlink_bytes) -> &'static str {
    let bytes = unsafe { slice::from_raw_parts(text.data, text.size) };
    std::str::from_utf8(bytes).unwrap()
}

#[test]
fn a_config_of_zeros_has_the_defaults() {
    let (mut master, mut output): (motorlink_st_master, motorlink_st_output) = (zeroed(), zeroed());
    let config: motorlink_st_master_config = zeroed();
    assert_eq!(config.recovery, motorlink_st_master_defaults().recovery);
    gives!(
        Ok,
        motorlink_st_master_init(&mut master, size_of_val(&master), &config),
        motorlink_st_master_get_register(&mut master, 1, RegisterId::STATUS.0),
        motorlink_st_master_poll(&mut master, 0, &mut output),
    );
    assert_eq!((output.kind, output.until_us), (motorlink_output::Wait, 50_000));
    gives!(
        Ok,
        motorlink_st_master_trust_line(&mut master),
        motorlink_st_master_get_register(&mut master, 1, RegisterId::STATUS.0),
        motorlink_st_master_poll(&mut master, 0, &mut output),
        motorlink_st_master_poll(&mut master, 0, &mut output),
    );
    assert_eq!((output.kind, output.until_us), (motorlink_output::Wait, 1_000_000));
}

#[test]
fn times_of_an_rmd_host_are_not_zero() {
    let mut host: motorlink_rmd_host = zeroed();
    gives!(Ok, motorlink_rmd_host_init(&mut host, size_of_val(&host)));
    gives!(
        BadArgument,
        motorlink_rmd_host_set_times(&mut host, 0, 100_000),
        motorlink_rmd_host_set_times(&mut host, 50_000, 0),
    );
}

#[test]
fn a_register_is_not_written_with_a_value_outside_of_its_range() {
    let mut master: motorlink_st_master = zeroed();
    let config = motorlink_st_master_config {
        recovery: Recovery::None as u8,
        ..motorlink_st_master_defaults()
    };
    gives!(Ok, motorlink_st_master_init(&mut master, size_of_val(&master), &config));
    for (register, least, most) in [
        (RegisterId::TORQUE_REF, -32_768, 32_767),
        (RegisterId::FLUXWK_BUS, 0, 65_535),
        (RegisterId::DAC_OUT1, 0, 255),
    ] {
        let mut set =
            |value| unsafe { motorlink_st_master_set_register(&mut master, 1, register.0, value) };
        assert_eq!(set(least - 1), Error::BadArgument, "{register}");
        assert_eq!(set(most + 1), Error::BadArgument, "{register}");
        assert_eq!(set(least), Error::Ok, "{register}");
        gives!(Ok, motorlink_st_master_trust_line(&mut master));
    }
    for register in [RegisterId::RAMP_FINAL_SPEED, RegisterId(0xC0)] {
        for value in [i32::MIN, -1, i32::MAX] {
            gives!(
                Ok,
                motorlink_st_master_set_register(&mut master, 1, register.0, value),
                motorlink_st_master_trust_line(&mut master),
            );
        }
    }
}

#[test]
fn the_unit_of_a_register_is_that_of_the_profile() {
    let unit = |profile, register: RegisterId| text(motorlink_st_reg_unit(profile, register.0));
    let (spec, mcsdk) = (Profile::Spec as u8, Profile::Mcsdk54 as u8);
    assert_eq!(unit(spec, RegisterId::FLUXWK_BUS), "%");
    assert_eq!(unit(mcsdk, RegisterId::FLUXWK_BUS), "0.1 %");
    assert_eq!(unit(mcsdk, RegisterId::FLUXWK_BUS_MEAS), "0.1 %");
    assert_eq!(unit(mcsdk, RegisterId::SPEED_MEAS), "rpm");
    assert_eq!(unit(2, RegisterId::SPEED_MEAS), "");
}

#[test]
fn a_reply_is_decoded_only_by_the_function_for_its_code() {
    let motion = motorlink_rmd_data { bytes: [0x9C, 25, 1, 2, 3, 4, 5, 6] };
    let (mut status, mut decoded): (motorlink_rmd_status, motorlink_rmd_motion_status) =
        (zeroed(), zeroed());
    gives!(BadArgument, motorlink_rmd_decode_status(motion, &mut status));
    assert_eq!(status, zeroed());
    gives!(Ok, motorlink_rmd_decode_motion_status(motion, &mut decoded));
    assert_eq!(decoded.temperature_celsius, 25);
    let mut angle = 0;
    gives!(BadArgument, motorlink_rmd_decode_multi_turn_angle(motion, &mut angle));
    for code in [0x9A, 0x9B] {
        let reply = motorlink_rmd_data { bytes: [code, 25, 0, 0, 0, 0, 0, 0] };
        gives!(Ok, motorlink_rmd_decode_status(reply, &mut status));
    }
}

#[test]
fn a_drive_without_the_callback_that_stops_the_motor_is_refused() {
    let (mut slave, mut drive): (motorlink_st_slave, motorlink_rmd_drive) = (zeroed(), zeroed());
    let (mut st, mut rmd): (motorlink_st_motor_control, motorlink_rmd_motor_control) =
        (zeroed(), zeroed());
    let mut config: motorlink_rmd_drive_config = zeroed();
    config.id = 1;
    let size = (size_of_val(&slave), size_of_val(&drive));
    gives!(
        NullPointer,
        motorlink_st_slave_init(&mut slave, size.0, 0, 1, &st),
        motorlink_rmd_drive_init(&mut drive, size.1, &config, null(), &rmd),
    );
    st.execute = Some(execute_nothing);
    rmd.set_mode = Some(set_no_mode);
    gives!(
        Ok,
        motorlink_st_slave_init(&mut slave, size.0, 0, 1, &st),
        motorlink_rmd_drive_init(&mut drive, size.1, &config, null(), &rmd),
    );
}

#[test]
fn the_reply_of_a_drive_may_replace_the_frame() {
    let mut drive: motorlink_rmd_drive = zeroed();
    let mut motor: motorlink_rmd_motor_control = zeroed();
    motor.set_mode = Some(set_no_mode);
    let mut config: motorlink_rmd_drive_config = zeroed();
    config.id = 1;
    let size = size_of_val(&drive);
    let mut frame = motorlink_can_frame {
        id: 0x141,
        extended: 0,
        remote: 0,
        size: 8,
        data: motorlink_rmd_read_status().bytes,
    };
    let at = &raw mut frame;
    gives!(
        Ok,
        motorlink_rmd_drive_init(&mut drive, size, &config, null(), &motor),
        motorlink_rmd_drive_power_on(&mut drive, 0),
        motorlink_rmd_drive_receive(&mut drive, 0, at, at),
    );
    assert_eq!((frame.id, frame.data), (0x141, [0x9A, 0, 0, 0, 0, 0, 0, 0]));
}
