//! Calls the C interface as C does. Also runs in Miri.
#![allow(clippy::undocumented_unsafe_blocks, reason = "every call here is one of C's")]

mod misuse;
mod objects;
mod rmd;
mod st;

use std::ffi::c_void;
use std::mem::MaybeUninit;
use std::slice;

use motorlink_ffi::motorlink_error as Error;
use motorlink_ffi::*;

const OK: Error = Error::Ok;

/// Calls functions and checks the error that each returns.
macro_rules! gives {
    ($error:ident, $($call:expr),+ $(,)?) => { $( assert_eq!(unsafe { $call }, $crate::Error::$error); )+ };
}
use gives;

fn zeroed<T>() -> T {
    unsafe { MaybeUninit::zeroed().assume_init() }
}

fn bytes(bytes: &motorlink_bytes) -> Vec<u8> {
    unsafe { slice::from_raw_parts(bytes.data, bytes.size) }.to_vec()
}

/// The callbacks that are required.
extern "C" fn execute_nothing(_: *mut c_void, _: u8, _: u8) {}

extern "C" fn set_no_mode(
    _: *mut c_void,
    _: *const motorlink_ffi::rmd::drive::motorlink_rmd_motion,
) {
}
