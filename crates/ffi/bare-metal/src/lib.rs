//! What the library for a microcontroller has beside motorlink-ffi: the functions that the compiler
//! calls to copy, clear and compare memory, and the panic handler that it demands.
//!
//! Rust's own memory functions are built for speed and have 1.6 KB. Those of a C library replace
//! these or are replaced by them, depending on the order of the linker's arguments. So they have names
//! of their own here, and the names that the compiler calls are known in this object file only.
#![no_std]

use core::arch::global_asm;

use motorlink_ffi as _;

/// No call of the library gets here: `packaging/install` fails if a panic is linked.
#[panic_handler]
fn panic(_: &core::panic::PanicInfo<'_>) -> ! {
    loop {
        core::hint::spin_loop();
    }
}

#[cfg(target_arch = "arm")]
global_asm!(
    ".thumb_set __aeabi_memcpy, motorlink_memcpy",
    ".thumb_set __aeabi_memcpy4, motorlink_memcpy",
    ".thumb_set __aeabi_memcpy8, motorlink_memcpy",
    ".thumb_set __aeabi_memclr, motorlink_memclr",
    ".thumb_set __aeabi_memclr4, motorlink_memclr",
    ".thumb_set __aeabi_memclr8, motorlink_memclr",
    ".thumb_set memcmp, motorlink_memcmp",
);

#[cfg(target_arch = "riscv32")]
global_asm!(
    ".set memcpy, motorlink_memcpy",
    ".set memset, motorlink_memset",
    ".set memcmp, motorlink_memcmp",
);

// Volatile accesses: from a plain loop the compiler makes a call of the function that this is.

/// Copies `size` bytes.
///
/// # Safety
/// As that of C's `memcpy`.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn motorlink_memcpy(to: *mut u8, from: *const u8, size: usize) -> *mut u8 {
    for at in 0..size {
        // SAFETY: the caller promises that both have `size` bytes.
        unsafe { to.wrapping_add(at).write_volatile(from.wrapping_add(at).read_volatile()) };
    }
    to
}

/// Clears `size` bytes.
///
/// # Safety
/// As that of `__aeabi_memclr`.
#[cfg(target_arch = "arm")]
#[unsafe(no_mangle)]
pub unsafe extern "C" fn motorlink_memclr(to: *mut u8, size: usize) {
    for at in 0..size {
        // SAFETY: the caller promises that there are `size` bytes.
        unsafe { to.wrapping_add(at).write_volatile(0) };
    }
}

/// Sets `size` bytes.
///
/// # Safety
/// As that of C's `memset`.
#[cfg(target_arch = "riscv32")]
#[unsafe(no_mangle)]
pub unsafe extern "C" fn motorlink_memset(to: *mut u8, byte: i32, size: usize) -> *mut u8 {
    for at in 0..size {
        // SAFETY: the caller promises that there are `size` bytes.
        unsafe { to.wrapping_add(at).write_volatile(byte as u8) };
    }
    to
}

/// Compares `size` bytes.
///
/// # Safety
/// As that of C's `memcmp`.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn motorlink_memcmp(one: *const u8, other: *const u8, size: usize) -> i32 {
    for at in 0..size {
        // SAFETY: the caller promises that both have `size` bytes.
        let (one, other) = unsafe { (one.wrapping_add(at).read(), other.wrapping_add(at).read()) };
        if one != other {
            return i32::from(one) - i32::from(other);
        }
    }
    0
}
