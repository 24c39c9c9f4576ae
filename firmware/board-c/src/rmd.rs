//! Callbacks of an RMD drive.

use core::ffi::c_void;

use motorlink_ffi::rmd::drive::{
    motorlink_rmd_mode as mode, motorlink_rmd_motion, motorlink_rmd_sense, motorlink_rmd_settings,
};
use motorlink_proto::rmd::{Mode, MotorControl, Settings};
use motorlink_proto::units::{CentiDps, DpsPerSecond, IqCommand, SpeedLimit};
use motorlink_sim::rmd::RmdMotor;
use plant::Plant;

/// The motor behind a context.
unsafe fn motor<'a>(context: *mut c_void) -> &'a mut RmdMotor {
    // SAFETY: the contract of the crate, which the caller passes on.
    unsafe { &mut *context.cast() }
}

#[unsafe(no_mangle)]
unsafe extern "C" fn plant_rmd_rom(rom: *mut motorlink_rmd_settings) {
    let Settings { gains, acceleration, encoder_offset } = Plant::rmd_rom();
    let settings = motorlink_rmd_settings {
        acceleration_dps2: acceleration.0,
        encoder_offset,
        pid: gains.into(),
    };
    // SAFETY: the contract of the crate.
    unsafe { *rom = settings };
}

#[unsafe(no_mangle)]
unsafe extern "C" fn plant_rmd_set_mode(context: *mut c_void, motion: *const motorlink_rmd_motion) {
    // SAFETY: the contract of the crate.
    let (motor, motion) = unsafe { (motor(context), *motion) };
    motor.set_mode(match motion.kind {
        mode::Torque => Mode::Torque(IqCommand(motion.iq_16ma)),
        mode::Speed => Mode::Speed(CentiDps(motion.speed_centidps)),
        mode::Position => Mode::Position {
            target: motion.target_counts,
            // -1 is no limit.
            max_speed: u16::try_from(motion.max_speed_dps).ok().map(SpeedLimit),
            within_max_angle: motion.within_max_angle != 0,
        },
        mode::Stopped => Mode::Stopped,
        mode::Off => Mode::Off,
    });
}

#[unsafe(no_mangle)]
unsafe extern "C" fn plant_rmd_configure(
    context: *mut c_void,
    settings: *const motorlink_rmd_settings,
) {
    // SAFETY: the contract of the crate.
    let (motor, settings) = unsafe { (motor(context), *settings) };
    motor.configure(&from_c(&settings));
}

#[unsafe(no_mangle)]
unsafe extern "C" fn plant_rmd_sense(context: *mut c_void, sense: *mut motorlink_rmd_sense) {
    // SAFETY: the contract of the crate.
    let seen = unsafe { motor(context) }.sense();
    let currents = seen.phase_currents;
    let told = motorlink_rmd_sense {
        encoder_counts: seen.encoder,
        iq_digits: seen.iq.0,
        speed_dps: seen.speed.0,
        voltage_decivolts: seen.voltage.0,
        phase_digits: [currents.phase_a, currents.phase_b, currents.phase_c].map(|phase| phase.0),
        temperature_celsius: seen.temperature.0,
        faults: seen.faults.0,
    };
    // SAFETY: the contract of the crate.
    unsafe { *sense = told };
}

#[unsafe(no_mangle)]
unsafe extern "C" fn plant_rmd_save(context: *mut c_void, rom: *const motorlink_rmd_settings) {
    // SAFETY: the contract of the crate.
    let (motor, rom) = unsafe { (motor(context), *rom) };
    motor.save(&from_c(&rom));
}

fn from_c(settings: &motorlink_rmd_settings) -> Settings {
    let motorlink_rmd_settings { acceleration_dps2, encoder_offset, pid } = *settings;
    Settings { gains: pid.into(), acceleration: DpsPerSecond(acceleration_dps2), encoder_offset }
}
