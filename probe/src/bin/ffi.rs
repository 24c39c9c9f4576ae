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

/// The entry point.
#[unsafe(no_mangle)]
pub extern "C" fn probe() -> ! {
    // For callers that the compiler does not know.
    black_box(include!(concat!(env!("OUT_DIR"), "/functions.rs")));
    loop {
        core::hint::spin_loop();
    }
}
