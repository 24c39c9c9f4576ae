//! The version of the library.

use core::ffi::c_char;

/// The version of the library that is linked, such as "0.1.0": NUL-terminated, constant. A header of
/// another version has another `MOTORLINK_VERSION`.
#[unsafe(no_mangle)]
pub extern "C" fn motorlink_version() -> *const c_char {
    concat!(env!("CARGO_PKG_VERSION"), "\0").as_ptr().cast()
}
