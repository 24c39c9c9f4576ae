//! Callbacks of the ST drive. The slave has checked motors, registers and phases.

use core::ffi::c_void;

use motorlink_ffi::st::message::motorlink_st_revup_phase;
use motorlink_proto::st::register::Feature;
use motorlink_proto::st::{
    Command, CurrentReference, MotorControl, MotorNumber, PositionMove, Ramp, RegisterId,
    RevupPhase, TorqueRamp,
};
use motorlink_sim::st::{StDrive, StMotor};
use plant::Plant;

/// The drive behind a context, and the motor of this number.
unsafe fn drive<'a>(
    context: *mut c_void,
    motor: u8,
) -> (&'a mut StDrive<[StMotor; 2]>, MotorNumber) {
    // SAFETY: the contract of the crate, which the caller passes on.
    let plant = unsafe { &mut *context.cast::<Plant>() };
    (&mut plant.st, MotorNumber::new(motor).unwrap_or(MotorNumber::FIRST))
}

#[unsafe(no_mangle)]
unsafe extern "C" fn plant_st_features(context: *mut c_void, motor: u8) -> u16 {
    // SAFETY: the contract of the crate.
    let (drive, motor) = unsafe { drive(context, motor) };
    let features = drive.features(motor);
    let built = Feature::ALL.iter().filter(|&&feature| features.has(feature));
    built.fold(0, |sum, &feature| sum | 1 << feature as u16)
}

#[unsafe(no_mangle)]
unsafe extern "C" fn plant_st_get_register(context: *mut c_void, motor: u8, reg: u8) -> i32 {
    // SAFETY: the contract of the crate.
    let (drive, motor) = unsafe { drive(context, motor) };
    drive.get_register(motor, RegisterId(reg))
}

#[unsafe(no_mangle)]
unsafe extern "C" fn plant_st_set_register(
    context: *mut c_void,
    motor: u8,
    reg: u8,
    value: i32,
) -> u8 {
    // SAFETY: the contract of the crate.
    let (drive, motor) = unsafe { drive(context, motor) };
    drive.set_register(motor, RegisterId(reg), value).map_or_else(u8::from, |()| 0)
}

#[unsafe(no_mangle)]
unsafe extern "C" fn plant_st_execute(context: *mut c_void, motor: u8, command: u8) {
    // SAFETY: the contract of the crate.
    let (drive, motor) = unsafe { drive(context, motor) };
    drive.execute(motor, Command::from(command));
}

#[unsafe(no_mangle)]
unsafe extern "C" fn plant_st_set_ramp(context: *mut c_void, motor: u8, speed_rpm: i32, ms: u16) {
    // SAFETY: the contract of the crate.
    let (drive, motor) = unsafe { drive(context, motor) };
    drive.set_ramp(motor, Ramp { speed_rpm, duration_ms: ms });
}

#[unsafe(no_mangle)]
unsafe extern "C" fn plant_st_get_revup_data(
    context: *mut c_void,
    motor: u8,
    phase: u8,
    data: *mut motorlink_st_revup_phase,
) {
    // SAFETY: the contract of the crate.
    let (drive, motor) = unsafe { drive(context, motor) };
    let RevupPhase { speed_rpm, torque_s16a, duration_ms } = drive.get_revup_data(motor, phase);
    // SAFETY: the contract of the crate.
    unsafe { *data = motorlink_st_revup_phase { speed_rpm, torque_s16a, duration_ms } };
}

#[unsafe(no_mangle)]
unsafe extern "C" fn plant_st_set_revup_data(
    context: *mut c_void,
    motor: u8,
    phase: u8,
    data: *const motorlink_st_revup_phase,
) {
    // SAFETY: the contract of the crate.
    let (drive, motor) = unsafe { drive(context, motor) };
    // SAFETY: the contract of the crate.
    let motorlink_st_revup_phase { speed_rpm, torque_s16a, duration_ms } = unsafe { *data };
    drive.set_revup_data(motor, phase, RevupPhase { speed_rpm, torque_s16a, duration_ms });
}

#[unsafe(no_mangle)]
unsafe extern "C" fn plant_st_set_current_reference(
    context: *mut c_void,
    motor: u8,
    iq: i16,
    id: i16,
) {
    // SAFETY: the contract of the crate.
    let (drive, motor) = unsafe { drive(context, motor) };
    drive.set_current_reference(motor, CurrentReference { iq_s16a: iq, id_s16a: id });
}

#[unsafe(no_mangle)]
unsafe extern "C" fn plant_st_set_torque_ramp(
    context: *mut c_void,
    motor: u8,
    torque_s16a: i32,
    duration_ms: u16,
) {
    // SAFETY: the contract of the crate.
    let (drive, motor) = unsafe { drive(context, motor) };
    drive.set_torque_ramp(motor, TorqueRamp { torque_s16a, duration_ms });
}

#[unsafe(no_mangle)]
unsafe extern "C" fn plant_st_set_position(
    context: *mut c_void,
    motor: u8,
    angle_rad: f32,
    duration_s: f32,
) {
    // SAFETY: the contract of the crate.
    let (drive, motor) = unsafe { drive(context, motor) };
    drive.set_position(motor, PositionMove { angle_rad, duration_s });
}
