//! Links every function of the C face without anything else: none of them can panic.
#![no_std]
#![no_main]

use core::hint::black_box;

use motorlink_ffi::rmd::{drive::*, host::*, message::*};
use motorlink_ffi::slcan::*;
use motorlink_ffi::st::{master::*, message::*, names::*, request::*, slave::*};
use motorlink_ffi::{motorlink_error_text, motorlink_version};

unsafe extern "C" {
    fn a_path_of_the_c_face_can_panic() -> !;
}

#[panic_handler]
fn panic(_: &core::panic::PanicInfo<'_>) -> ! {
    // SAFETY: never linked: the linker does not find the function.
    unsafe { a_path_of_the_c_face_can_panic() }
}

/// Keeps each function, for callers that the compiler does not know.
macro_rules! link {
    ($($function:ident)+) => { $( black_box($function as *const ()); )+ };
}

/// The entry point.
#[unsafe(no_mangle)]
pub extern "C" fn probe() -> ! {
    link! {
        motorlink_error_text
        motorlink_version
        motorlink_st_master_defaults
        motorlink_st_master_init
        motorlink_st_master_get_register
        motorlink_st_master_set_register
        motorlink_st_master_execute
        motorlink_st_master_set_ramp
        motorlink_st_master_set_current_reference
        motorlink_st_master_set_torque_ramp
        motorlink_st_master_set_position
        motorlink_st_master_get_revup_data
        motorlink_st_master_set_revup_data
        motorlink_st_master_get_board_info
        motorlink_st_master_get_firmware_version
        motorlink_st_master_configure_segment
        motorlink_st_master_get_segment
        motorlink_st_master_get_profiler_info
        motorlink_st_master_raw
        motorlink_st_master_poll
        motorlink_st_master_receive
        motorlink_st_master_abandon
        motorlink_st_master_lost
        motorlink_st_longest_transmission_us
        motorlink_st_decode_segment
        motorlink_st_reg_name
        motorlink_st_reg_unit
        motorlink_st_error_code_name
        motorlink_st_status_name
        motorlink_st_command_name
        motorlink_st_master_reopened
        motorlink_st_master_trust_line
        motorlink_st_master_is_lost
        motorlink_st_decode_board_info
        motorlink_st_decode_firmware_version
        motorlink_st_decode_revup_data
        motorlink_st_slave_init
        motorlink_st_slave_receive
        motorlink_st_slave_poll
        motorlink_st_slave_deadline
        motorlink_st_slave_overrun
        motorlink_rmd_read_pid
        motorlink_rmd_read_acceleration
        motorlink_rmd_read_encoder
        motorlink_rmd_write_zero_rom
        motorlink_rmd_read_multi_turn_angle
        motorlink_rmd_read_single_turn_angle
        motorlink_rmd_read_status
        motorlink_rmd_clear_errors
        motorlink_rmd_read_motion_status
        motorlink_rmd_read_phase_currents
        motorlink_rmd_off
        motorlink_rmd_stop
        motorlink_rmd_run
        motorlink_rmd_write_pid_ram
        motorlink_rmd_write_pid_rom
        motorlink_rmd_write_acceleration_ram
        motorlink_rmd_write_encoder_offset_rom
        motorlink_rmd_set_torque
        motorlink_rmd_set_speed
        motorlink_rmd_set_position
        motorlink_rmd_set_position_limited
        motorlink_rmd_set_single_turn_position
        motorlink_rmd_set_single_turn_position_limited
        motorlink_rmd_decode_pid
        motorlink_rmd_decode_acceleration
        motorlink_rmd_decode_encoder
        motorlink_rmd_decode_encoder_offset
        motorlink_rmd_decode_multi_turn_angle
        motorlink_rmd_decode_single_turn_angle
        motorlink_rmd_decode_status
        motorlink_rmd_decode_motion_status
        motorlink_rmd_decode_phase_currents
        motorlink_rmd_encoder_centidegrees
        motorlink_rmd_host_init
        motorlink_rmd_host_set_times
        motorlink_rmd_host_set_limits
        motorlink_rmd_host_request
        motorlink_rmd_host_set_torque4
        motorlink_rmd_host_retry
        motorlink_rmd_host_poll
        motorlink_rmd_host_receive
        motorlink_rmd_host_cancel
        motorlink_rmd_host_trust
        motorlink_rmd_host_reopened
        motorlink_rmd_host_busy
        motorlink_rmd_drive_init
        motorlink_rmd_drive_power_on
        motorlink_rmd_drive_receive
        motorlink_rmd_drive_poll
        motorlink_rmd_drive_deadline
        motorlink_rmd_drive_motion
        motorlink_rmd_drive_errors
        motorlink_rmd_drive_settings
        motorlink_slcan_host_init
        motorlink_slcan_host_receive
        motorlink_slcan_open
        motorlink_slcan_encode
        motorlink_slcan_device_init
        motorlink_slcan_device_receive
        motorlink_slcan_device_deliver
    }
    loop {
        core::hint::spin_loop();
    }
}
