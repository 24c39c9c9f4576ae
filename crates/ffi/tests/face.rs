//! Calls the C face as C does: both ends connected, and wrong calls. Also runs in Miri.
#![allow(clippy::undocumented_unsafe_blocks, reason = "every call here is one of C's")]

use std::ffi::c_void;
use std::mem::MaybeUninit;
use std::ptr::{null, null_mut};
use std::slice;

use motorlink_ffi::motorlink_error as Error;
use motorlink_ffi::rmd::{drive::*, host::*, message::*, *};
use motorlink_ffi::slcan::*;
use motorlink_ffi::st::{master::*, message::*, request::*, slave::*, *};
use motorlink_ffi::*;

const OK: Error = Error::Ok;

macro_rules! gives {
    ($error:ident, $($call:expr),+ $(,)?) => { $( assert_eq!(unsafe { $call }, Error::$error); )+ };
}

fn zeroed<T>() -> T {
    unsafe { MaybeUninit::zeroed().assume_init() }
}

fn bytes(bytes: &motorlink_bytes) -> Vec<u8> {
    unsafe { slice::from_raw_parts(bytes.data, bytes.size) }.to_vec()
}

#[derive(Default)]
struct Fan {
    rpm: i32,
    commands: Vec<u8>,
    revup: Option<motorlink_st_revup_phase>,
    slave: Option<*mut motorlink_st_slave>,
}

fn fan<'a>(context: *mut c_void) -> &'a mut Fan {
    unsafe { &mut *context.cast() }
}

extern "C" fn read(context: *mut c_void, _: u8, _: u8) -> i32 {
    let fan = fan(context);
    if let Some(slave) = fan.slave {
        let (mut reply, mut at) = (zeroed(), 0);
        gives!(
            InUse,
            motorlink_st_slave_receive(slave, 0, 0, &mut reply),
            motorlink_st_slave_poll(slave, 0, &mut reply),
            motorlink_st_slave_overrun(slave, &mut reply),
            motorlink_st_slave_deadline(slave, &mut at),
        );
        gives!(WrongKind, motorlink_st_master_abandon(slave.cast()));
    }
    fan.rpm
}

extern "C" fn write(_: *mut c_void, _: u8, _: u8, value: i32) -> u8 {
    if value == 13 { 0x05 } else { 0 }
}

extern "C" fn execute(context: *mut c_void, _: u8, command: u8) {
    fan(context).commands.push(command);
}

extern "C" fn ramp(context: *mut c_void, _: u8, speed_rpm: i32, _: u16) {
    fan(context).rpm = speed_rpm;
}

extern "C" fn revup(context: *mut c_void, _: u8, _: u8, data: *mut motorlink_st_revup_phase) {
    if let Some(known) = fan(context).revup {
        unsafe { *data = known };
    }
}

extern "C" fn set_revup(context: *mut c_void, _: u8, _: u8, data: *const motorlink_st_revup_phase) {
    fan(context).revup = Some(unsafe { *data });
}

extern "C" fn features(_: *mut c_void, _: u8) -> u16 {
    0xFFFF
}

extern "C" fn profiler_step(_: *mut c_void, _: u8, step: u8, registers: *mut *const u8) -> u8 {
    static SHOWN: [u8; 2] = [0x66, 0x67];
    unsafe { *registers = if step == 1 { SHOWN.as_ptr() } else { null() } };
    // A step that claims registers and shows none has none.
    2
}

struct StBench {
    master: motorlink_st_master,
    slave: motorlink_st_slave,
}

impl StBench {
    fn new(profile: u8, drive: &motorlink_st_motor_control) -> Box<Self> {
        let mut bench = Box::new(StBench { master: zeroed(), slave: zeroed() });
        let config = motorlink_st_master_config { profile, ..motorlink_st_master_defaults() };
        let StBench { master, slave } = &mut *bench;
        gives!(Ok, motorlink_st_master_init(master, size_of_val(master), &config));
        gives!(Ok, motorlink_st_master_trust_line(master));
        gives!(Ok, motorlink_st_slave_init(slave, size_of_val(slave), profile, 1, drive));
        bench
    }

    /// Conducts the exchange that was begun; gives its result and the payload.
    fn done(&mut self, begun: Error) -> (motorlink_st_output, Vec<u8>) {
        assert_eq!(begun, OK);
        let StBench { master, slave } = self;
        let (mut output, mut reply): (motorlink_st_output, motorlink_bytes) = (zeroed(), zeroed());
        loop {
            gives!(Ok, motorlink_st_master_poll(master, 0, &mut output));
            match output.kind {
                motorlink_output::Done => return (output, bytes(&output.bytes)),
                motorlink_output::Wait => panic!("the slave did not answer"),
                motorlink_output::Transmit => {}
            }
            let sent = bytes(&output.bytes);
            gives!(Ok, motorlink_st_master_poll(master, 0, &mut output));
            for byte in sent {
                gives!(Ok, motorlink_st_slave_receive(slave, 0, byte, &mut reply));
                gives!(Ok, motorlink_st_master_receive(master, 0, reply.data, reply.size));
            }
        }
    }

    /// Brings the line in step and conducts the exchange that was begun; gives its result and the
    /// headers of the frames that were sent.
    ///
    /// A loop that hands in what came before it polls may have the answer before the poll that follows
    /// the question.
    fn done_in_time(&mut self) -> (Error, Vec<u8>) {
        let StBench { master, slave } = self;
        let (mut output, mut reply): (motorlink_st_output, motorlink_bytes) = (zeroed(), zeroed());
        let (mut now, mut headers) = (0, Vec::new());
        loop {
            gives!(Ok, motorlink_st_master_poll(master, now, &mut output));
            match output.kind {
                motorlink_output::Done => return (output.result, headers),
                motorlink_output::Wait => now = output.until_us,
                motorlink_output::Transmit => {
                    let sent = bytes(&output.bytes);
                    headers.push(sent[0]);
                    for byte in sent {
                        gives!(Ok, motorlink_st_slave_receive(slave, now, byte, &mut reply));
                    }
                    gives!(Ok, motorlink_st_master_receive(master, now, reply.data, reply.size));
                }
            }
        }
    }
}

fn drive(context: &mut Fan) -> motorlink_st_motor_control {
    let mut drive: motorlink_st_motor_control = zeroed();
    drive.context = std::ptr::from_mut(context).cast();
    drive.version.name = c"Fan".as_ptr();
    drive.version.major = 1;
    drive.features = Some(features);
    drive.get_register = Some(read);
    drive.set_register = Some(write);
    drive.execute = Some(execute);
    drive.set_ramp = Some(ramp);
    drive.get_revup_data = Some(revup);
    drive.set_revup_data = Some(set_revup);
    drive.profiler_step = Some(profiler_step);
    drive
}

macro_rules! exchange {
    ($bench:ident, $function:ident($($argument:expr),*)) => {{
        let begun = unsafe { $function(&mut $bench.master, 1, $($argument),*) };
        $bench.done(begun)
    }};
}

#[test]
fn a_master_and_a_slave_understand_each_other() {
    let mut fan = Fan::default();
    let drive = drive(&mut fan);
    let mut bench = StBench::new(1, &drive);
    assert_eq!(exchange!(bench, motorlink_st_master_set_ramp(1500, 100)).0.result, OK);
    assert_eq!(exchange!(bench, motorlink_st_master_get_register(0x1E)).0.value, 1500);
    assert_eq!(exchange!(bench, motorlink_st_master_execute(1)).0.result, OK);
    assert_eq!(exchange!(bench, motorlink_st_master_set_register(0x05, -2)).0.result, OK);
    let refused = exchange!(bench, motorlink_st_master_set_register(0x05, 13)).0;
    assert_eq!((refused.result, refused.error_code), (Error::Refused, 0x05));
    assert_eq!(exchange!(bench, motorlink_st_master_set_current_reference(1, 2)).0.result, OK);
    assert_eq!(exchange!(bench, motorlink_st_master_set_torque_ramp(1, 2)).0.result, OK);
    assert_eq!(exchange!(bench, motorlink_st_master_set_position(1.0, 2.0)).0.result, OK);

    let phase = motorlink_st_revup_phase { speed_rpm: 600, torque_s16a: -7, duration_ms: 9 };
    assert_eq!(exchange!(bench, motorlink_st_master_set_revup_data(0, &phase)).0.result, OK);
    let (_, payload) = exchange!(bench, motorlink_st_master_get_revup_data(0));
    let mut read: motorlink_st_revup_phase = zeroed();
    gives!(Ok, motorlink_st_decode_revup_data(payload.as_ptr(), payload.len(), &mut read));
    assert_eq!(read, phase);

    let (_, payload) = exchange!(bench, motorlink_st_master_get_board_info());
    let mut info: motorlink_st_board_info = zeroed();
    gives!(Ok, motorlink_st_decode_board_info(payload.as_ptr(), payload.len(), &mut info));
    assert_eq!((info.major, info.name[..4].to_vec()), (1, b"Fan\0".map(|b| b as _).to_vec()));
    let (_, payload) = exchange!(bench, motorlink_st_master_get_firmware_version());
    let mut version: motorlink_st_firmware_version = zeroed();
    gives!(Ok, motorlink_st_decode_firmware_version(payload.as_ptr(), payload.len(), &mut version));
    assert_eq!(version.version[..5], b"Ver.1".map(|b| b as _));

    let steps = [0, 1];
    let (_, payload) = exchange!(bench, motorlink_st_master_get_profiler_info(steps.as_ptr(), 2));
    assert_eq!(payload, [0, 2, 0x66, 0x67]);
    assert_eq!(fan.commands, [1]);
}

#[test]
fn the_version_is_a_text_of_c() {
    let version = unsafe { std::ffi::CStr::from_ptr(motorlink_version()) };
    assert_eq!(version.to_str(), Ok(env!("CARGO_PKG_VERSION")));
}

#[test]
fn a_drive_without_callbacks_answers() {
    let nothing: motorlink_st_motor_control = zeroed();
    let mut bench = StBench::new(0, &nothing);
    assert_eq!(exchange!(bench, motorlink_st_master_get_register(0x1E)).0.value, 0);
    assert_eq!(exchange!(bench, motorlink_st_master_set_register(0x05, 1)).0.error_code, 0x05);
    assert_eq!(exchange!(bench, motorlink_st_master_execute(1)).0.result, OK);
    assert_eq!(exchange!(bench, motorlink_st_master_set_ramp(1, 1)).0.result, OK);
    let registers = [0x02, 0x1E];
    let chosen = exchange!(bench, motorlink_st_master_configure_segment(0, registers.as_ptr(), 2));
    assert_eq!(chosen.0.result, OK);
    assert_eq!(exchange!(bench, motorlink_st_master_get_segment(0)).1, [0; 5]);
}

#[test]
fn a_request_that_is_refused_leaves_the_one_under_way_alone() {
    let mut fan = Fan { rpm: 1500, ..Fan::default() };
    let drive = drive(&mut fan);
    let mut bench = StBench::new(1, &drive);
    let master: *mut motorlink_st_master = &mut bench.master;
    let begun = unsafe { motorlink_st_master_get_register(master, 1, 0x1E) };
    gives!(
        Busy,
        motorlink_st_master_get_register(master, 1, 0x02),
        motorlink_st_master_set_register(master, 1, 0x05, 1),
        motorlink_st_master_execute(master, 1, 2),
        motorlink_st_master_raw(master, 0, 1, null(), 0),
    );
    assert_eq!(bench.done(begun).0.value, 1500);
}

#[test]
fn an_answer_that_comes_before_the_next_poll_recovers_the_line() {
    let nothing: motorlink_st_motor_control = zeroed();
    let mut bench = StBench::new(0, &nothing);
    let master: *mut motorlink_st_master = &mut bench.master;
    gives!(Ok, motorlink_st_master_lost(master), motorlink_st_master_get_register(master, 1, 2));
    assert_eq!(bench.done_in_time(), (OK, vec![0x06, 0x22]));
}

#[test]
fn three_questions_bring_a_just_opened_line_in_sync() {
    let nothing: motorlink_st_motor_control = zeroed();
    let mut bench = StBench::new(0, &nothing);
    let master: *mut motorlink_st_master = &mut bench.master;
    let mut lost = 0;
    gives!(
        Ok,
        motorlink_st_master_reopened(master),
        motorlink_st_master_is_lost(master, &mut lost),
        motorlink_st_master_get_register(master, 1, 2),
    );
    assert_eq!(lost, 1);
    assert_eq!(bench.done_in_time(), (OK, vec![0x06, 0x02, 0x02, 0x22]));
}

#[test]
fn a_stop_is_sent_at_once_to_a_drive_that_does_not_answer() {
    let mut master: motorlink_st_master = zeroed();
    let raw_stop = 2;
    for is_raw in [false, true] {
        let mut output: motorlink_st_output = zeroed();
        gives!(Ok, motorlink_st_master_init(&mut master, size_of_val(&master), null()));
        gives!(Ok, motorlink_st_master_trust_line(&mut master));
        gives!(Ok, motorlink_st_master_execute(&mut master, 1, 1));
        while output.kind != motorlink_output::Done {
            let now = output.until_us;
            gives!(Ok, motorlink_st_master_poll(&mut master, now, &mut output));
        }
        assert_eq!(output.result, Error::Timeout);
        if is_raw {
            gives!(Ok, motorlink_st_master_raw(&mut master, 1, 3, &raw_stop, 1));
        } else {
            gives!(Ok, motorlink_st_master_execute(&mut master, 1, 2));
        }
        gives!(Ok, motorlink_st_master_poll(&mut master, 2_000_000, &mut output));
        assert_eq!(bytes(&output.bytes), [0x23, 0x01, 0x02, 0x26]);
        gives!(Ok, motorlink_st_master_poll(&mut master, 2_000_000, &mut output));
        assert_eq!(output.kind, motorlink_output::Wait);
    }
}

#[test]
fn a_line_that_echoes_is_no_drive() {
    let nothing: motorlink_st_motor_control = zeroed();
    let mut bench = StBench::new(0, &nothing);
    let master: *mut motorlink_st_master = &mut bench.master;
    gives!(Ok, motorlink_st_master_lost(master), motorlink_st_master_execute(master, 1, 1));
    let (mut output, mut now): (motorlink_st_output, u64) = (zeroed(), 0);
    loop {
        gives!(Ok, motorlink_st_master_poll(master, now, &mut output));
        match output.kind {
            motorlink_output::Done => break,
            motorlink_output::Wait => now = output.until_us,
            motorlink_output::Transmit => {
                let sent = bytes(&output.bytes);
                gives!(Ok, motorlink_st_master_receive(master, now, sent.as_ptr(), sent.len()));
            }
        }
    }
    assert_eq!(output.result, Error::Echo);
}

#[test]
fn a_name_that_is_too_long_is_cut_between_characters() {
    let name = "a".repeat(31) + "°C";
    let payload = [&[5, 4, 4], name.as_bytes()].concat();
    let mut info: motorlink_st_board_info = zeroed();
    gives!(Ok, motorlink_st_decode_board_info(payload.as_ptr(), payload.len(), &mut info));
    let mut expected = [b'a'; 33];
    expected[31..].fill(0);
    assert_eq!(info.name.map(|letter| letter as u8), expected);
}

/// A reply with three bytes, or none, is an error and never the value 0.
#[test]
fn a_read_that_is_answered_with_no_value_says_so() {
    let nothing: motorlink_st_motor_control = zeroed();
    let mut output: motorlink_st_output = zeroed();
    for reply in [&[0xF0, 0x00, 0xF0][..], &[0xF0, 0x03, 1, 2, 3, 0xF9]] {
        let mut bench = StBench::new(0, &nothing);
        let master = &mut bench.master;
        gives!(Ok, motorlink_st_master_get_register(master, 1, 0x01));
        gives!(Ok, motorlink_st_master_poll(master, 0, &mut output));
        gives!(Ok, motorlink_st_master_receive(master, 0, reply.as_ptr(), reply.len()));
        gives!(Ok, motorlink_st_master_poll(master, 0, &mut output));
        assert_eq!((output.kind, output.result), (motorlink_output::Done, Error::WrongReply));
        assert_eq!(output.value, 0);
    }
}

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
    unsafe { *table = motorlink_st_motor_control { context: table.cast(), features, ..zeroed() } };
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
fn a_slave_that_is_called_from_its_callback_is_in_use() {
    let slave: *mut motorlink_st_slave = Box::into_raw(Box::new(zeroed()));
    let mut fan = Fan { rpm: 42, slave: Some(slave), ..Fan::default() };
    let drive = drive(&mut fan);
    let mut reply: motorlink_bytes = zeroed();
    gives!(Ok, motorlink_st_slave_init(slave, size_of::<motorlink_st_slave>(), 0, 1, &drive));
    for byte in [0x22, 0x01, 0x02, 0x25] {
        gives!(Ok, motorlink_st_slave_receive(slave, 0, byte, &mut reply));
    }
    assert_eq!(bytes(&reply), [0xF0, 0x01, 42, 0x1C]);
    drop(unsafe { Box::from_raw(slave) });
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

/// An adapter in between, so that a request is a frame, a line, a frame and back.
#[test]
fn a_host_commands_a_drive_through_an_adapter() {
    extern "C" fn sense(_: *mut c_void, sense: *mut motorlink_rmd_sense) {
        unsafe { (*sense).temperature_celsius = 25 };
    }
    let mut motor: motorlink_rmd_motor_control = zeroed();
    motor.sense = Some(sense);
    let config =
        motorlink_rmd_drive_config { shutdown_us: 0, id: 3, encoder_bits: 0, clear_reply_0x9b: 0 };
    let (mut host, mut drive): (motorlink_rmd_host, motorlink_rmd_drive) = (zeroed(), zeroed());
    let (mut adapter, mut codec): (motorlink_slcan_device, motorlink_slcan_host) =
        (zeroed(), zeroed());
    gives!(
        Ok,
        motorlink_rmd_host_init(&mut host, size_of_val(&host)),
        motorlink_rmd_host_trust(&mut host, 1 << 2),
        motorlink_rmd_drive_init(&mut drive, size_of_val(&drive), &config, null(), &motor),
        motorlink_rmd_drive_power_on(&mut drive, 0),
        motorlink_slcan_device_init(&mut adapter, size_of_val(&adapter)),
        motorlink_slcan_host_init(&mut codec, size_of_val(&codec)),
    );
    let (mut line, mut answer): (motorlink_slcan_line, motorlink_slcan_line) = (zeroed(), zeroed());
    let mut frame: motorlink_can_frame = zeroed();
    let (mut output, mut said): (motorlink_rmd_output, _) =
        (zeroed(), motorlink_slcan_answer::None);
    gives!(Ok, motorlink_slcan_open(1_000_000, &mut line));
    for byte in &line.bytes[..line.size.into()] {
        gives!(Ok, motorlink_slcan_device_receive(&mut adapter, *byte, &mut answer, &mut frame));
        assert_eq!(frame.id, MOTORLINK_NO_FRAME);
    }
    gives!(Ok, motorlink_rmd_host_request(&mut host, 0, 3, motorlink_rmd_set_torque(100)));
    gives!(Ok, motorlink_rmd_host_poll(&mut host, 0, &mut output));
    gives!(Ok, motorlink_slcan_encode(&output.frame, &mut line));
    let mut reply: motorlink_can_frame = zeroed();
    for byte in &line.bytes[..line.size.into()] {
        gives!(Ok, motorlink_slcan_device_receive(&mut adapter, *byte, &mut answer, &mut frame));
    }
    gives!(Ok, motorlink_rmd_drive_receive(&mut drive, 0, &frame, &mut reply));
    gives!(Ok, motorlink_slcan_device_deliver(&mut adapter, 0, &reply, &mut line));
    for byte in &line.bytes[..line.size.into()] {
        gives!(Ok, motorlink_slcan_host_receive(&mut codec, *byte, &mut said, &mut frame));
    }
    assert_eq!(said, motorlink_slcan_answer::Frame);
    gives!(Ok, motorlink_rmd_host_receive(&mut host, 0, &frame));
    gives!(Ok, motorlink_rmd_host_poll(&mut host, 0, &mut output));
    assert_eq!((output.kind, output.motor, output.result), (motorlink_output::Done, 3, OK));
    assert_eq!(motorlink_rmd_decode_motion_status(output.reply).temperature_celsius, 25);
    let mut motion: motorlink_rmd_motion = zeroed();
    gives!(Ok, motorlink_rmd_drive_motion(&mut drive, &mut motion));
    assert_eq!((motion.kind, motion.iq_16ma), (motorlink_rmd_mode::Torque, 100));
}

#[test]
fn a_motor_is_asked_for_its_status_first_unless_it_is_trusted() {
    let mut host: motorlink_rmd_host = zeroed();
    let mut output: motorlink_rmd_output = zeroed();
    let host: *mut motorlink_rmd_host = &mut host;
    gives!(Ok, motorlink_rmd_host_init(host, size_of::<motorlink_rmd_host>()));
    gives!(Ok, motorlink_rmd_host_trust(host, !(1 << 2)));
    for (motor, code) in [(1, 0xA1), (3, 0x9A), (32, 0xA1)] {
        gives!(Ok, motorlink_rmd_host_request(host, 0, motor, motorlink_rmd_set_torque(100)));
        gives!(Ok, motorlink_rmd_host_poll(host, 0, &mut output));
        assert_eq!((output.kind, output.frame.data[0]), (motorlink_output::Transmit, code));
    }
    gives!(Ok, motorlink_rmd_host_reopened(host, 0));
    gives!(Ok, motorlink_rmd_host_request(host, 0, 1, motorlink_rmd_set_torque(100)));
    gives!(Ok, motorlink_rmd_host_poll(host, 0, &mut output));
    assert_eq!((output.kind, output.frame.data[0]), (motorlink_output::Transmit, 0x9A));
    // The host receives its own frame.
    gives!(Ok, motorlink_rmd_host_receive(host, 0, &output.frame));
    gives!(Ok, motorlink_rmd_host_poll(host, 0, &mut output));
    assert_eq!((output.kind, output.result), (motorlink_output::Done, Error::Echo));
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
