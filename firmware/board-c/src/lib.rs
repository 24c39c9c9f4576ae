//! The library that `main.c` links: `motorlink.h` from motorlink-ffi, and the motors of `plant.h`.
//!
//! # Safety
//!
//! The contract of every function here is that of `plant.h`: a context is what [`plant_start`] or
//! [`plant_rmd`] gave, other pointers are what their types say, and no call comes while another one
//! is under way.
#![no_std]
#![allow(clippy::missing_safety_doc, reason = "one contract holds for all: that of the crate")]

mod rmd;
mod st;

use core::ffi::c_void;
use core::ptr;

use motorlink_ffi as _;
use motorlink_proto::time::Instant;
use panic_halt as _;
use plant::Plant;

/// The motors, powered on now; NULL the second time.
#[unsafe(no_mangle)]
pub extern "C" fn plant_start(now_us: u64) -> *mut Plant {
    let Ok(motors) = Plant::new(Instant(now_us)) else { return ptr::null_mut() };
    cortex_m::singleton!(: Plant = motors).map_or(ptr::null_mut(), ptr::from_mut)
}

/// Moves the motors on by a slice of time; whether they have reached `now_us`.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn plant_advance(motors: *mut Plant, now_us: u64) -> u8 {
    // SAFETY: the contract of the crate.
    let motors = unsafe { &mut *motors };
    motors.advance(Instant(now_us)).into()
}

/// An RMD motor; NULL beyond the last.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn plant_rmd(motors: *mut Plant, index: u8) -> *mut c_void {
    // SAFETY: the contract of the crate.
    let motors = unsafe { &mut *motors };
    let motor = motors.rmd.get_mut(usize::from(index));
    motor.map_or(ptr::null_mut(), |motor| ptr::from_mut(motor).cast())
}
