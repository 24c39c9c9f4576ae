//! The storage of objects and their callbacks, for both protocols.

use std::ffi::c_void;
use std::ptr::{null, null_mut};

use motorlink_ffi::rmd::{drive::*, host::*, *};
use motorlink_ffi::st::{master::*, slave::*, *};
use motorlink_ffi::*;

use crate::{OK, bytes, execute_nothing, gives, zeroed};

/// A callback may change the table that it is called from.
#[test]
fn callbacks_may_change_their_table() {
    extern "C" fn other(_: *mut c_void, _: u8, _: u8) -> i32 {
        7
    }
    extern "C" fn features_and_more(context: *mut c_void, _: u8) -> u16 {
        unsafe { (*context.cast::<motorlink_st_motor_control>()).get_register = Some(other) };
        0
    }
    let table: *mut motorlink_st_motor_control = Box::into_raw(Box::new(zeroed()));
    let features = Some(features_and_more as _);
    let (context, execute) = (table.cast(), Some(execute_nothing as _));
    unsafe { *table = motorlink_st_motor_control { context, features, execute, ..zeroed() } };
    let mut slave: motorlink_st_slave = zeroed();
    let mut reply: motorlink_bytes = zeroed();
    gives!(Ok, motorlink_st_slave_init(&mut slave, size_of_val(&slave), 0, 1, table));
    for byte in [0x22, 0x01, 0x02, 0x25] {
        gives!(Ok, motorlink_st_slave_receive(&mut slave, 0, byte, &mut reply));
    }
    assert_eq!(bytes(&reply), [0xF0, 0x01, 7, 0xF8]);
    drop(unsafe { Box::from_raw(table) });

    extern "C" fn once(context: *mut c_void, _: *const motorlink_rmd_motion) {
        unsafe { (*context.cast::<motorlink_rmd_motor_control>()).set_mode = None };
    }
    let table: *mut motorlink_rmd_motor_control = Box::into_raw(Box::new(zeroed()));
    let set_mode = Some(once as _);
    unsafe { *table = motorlink_rmd_motor_control { context: table.cast(), set_mode, ..zeroed() } };
    let config =
        motorlink_rmd_drive_config { shutdown_us: 0, id: 1, encoder_bits: 0, clear_reply_0x9b: 0 };
    let mut drive: motorlink_rmd_drive = zeroed();
    gives!(
        Ok,
        motorlink_rmd_drive_init(&mut drive, size_of_val(&drive), &config, null(), table),
        motorlink_rmd_drive_power_on(&mut drive, 0),
        motorlink_rmd_drive_poll(&mut drive, 0),
    );
    assert!(unsafe { (*table).set_mode }.is_none());
    drop(unsafe { Box::from_raw(table) });
}

#[test]
fn storage_that_is_not_one_is_refused() {
    let mut memory = [0u64; 400];
    let (size, at): (usize, *mut u64) = (size_of_val(&memory), memory.as_mut_ptr());
    let mut output: motorlink_st_output = zeroed();
    let mut deadline = 0;
    gives!(
        Uninitialised,
        motorlink_st_master_poll(at.cast(), 0, &mut output),
        motorlink_rmd_host_cancel(at.cast(), 0, 1),
    );
    gives!(NullPointer, motorlink_st_master_poll(null_mut(), 0, &mut output));
    gives!(Misaligned, motorlink_st_master_poll(at.byte_add(1).cast(), 0, &mut output));
    gives!(
        StorageTooSmall,
        motorlink_rmd_host_init(at.cast(), size_of::<motorlink_rmd_host>() - 1)
    );
    gives!(Ok, motorlink_rmd_host_init(at.cast(), size));
    gives!(
        WrongKind,
        motorlink_st_slave_deadline(at.cast(), &mut deadline),
        motorlink_rmd_drive_deadline(at.cast(), &mut deadline),
    );
    gives!(NullPointer, motorlink_rmd_host_retry(at.cast(), null_mut()));
    gives!(Ok, motorlink_rmd_host_retry(at.cast(), &mut deadline));
}

#[test]
fn two_threads_do_not_enter_one_object() {
    let mut host: Box<motorlink_rmd_host> = Box::new(zeroed());
    gives!(Ok, motorlink_rmd_host_init(&mut *host, size_of_val(&*host)));
    let address = std::ptr::from_mut(&mut *host).expose_provenance();
    let threads = [(); 2].map(|()| {
        std::thread::spawn(move || {
            let host = std::ptr::with_exposed_provenance_mut(address);
            let mut busy = 0;
            let calls = (0..200).map(|_| unsafe { motorlink_rmd_host_busy(host, &mut busy) });
            calls.filter(|result| *result == OK).count() > 0
        })
    });
    assert!(threads.map(|thread| thread.join().expect("it ends")).contains(&true));
    drop(host);
}
