//! Motorlink for C and C++: `include/motorlink.h` is its manual, written from these files.
//!
//! Both protocols of [`motorlink_proto`], both ends of each. Nothing is allocated and nothing is
//! printed; a caller owns the storage of every object, and hands in bytes or frames with the time
//! at which they came.
//!
//! # Safety
//!
//! What holds for every function: a pointer is NULL, or points to what its type says, that may be
//! read (`const`) or written by the call; NULL and misaligned pointers are answered with an error.
//! The storage of an object that was initialised is left alone until its last call, and the table
//! of callbacks that it was given lives as long. Callbacks do not unwind. `_init` is not called for
//! a storage from a callback of its own, or while another thread uses it.
#![no_std]
#![allow(non_camel_case_types, reason = "types have the names that they have in C")]
#![allow(clippy::missing_safety_doc, reason = "one contract holds for all: that of the crate")]

#[cfg(feature = "std")]
extern crate std;

mod bytes;
mod error;
mod frame;
mod number;
mod pointer;
pub mod rmd;
pub mod slcan;
pub mod st;
mod storage;
mod tag;
mod version;

pub use bytes::{MOTORLINK_NEVER, MOTORLINK_NO_LIMIT, motorlink_bytes, motorlink_output};
pub use error::{MOTORLINK_OK, motorlink_error, motorlink_error_text};
pub use frame::{MOTORLINK_NO_FRAME, motorlink_can_frame};
pub use number::{
    motorlink_rmd_spin_direction, motorlink_st_command, motorlink_st_error_code,
    motorlink_st_frame_code, motorlink_st_profile, motorlink_st_recovery, motorlink_st_reg,
    motorlink_st_status,
};
pub use version::motorlink_version;
