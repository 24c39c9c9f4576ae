//! ST's protocol: a master and a slave, connected.

use std::ffi::c_void;
use std::ptr::null;

use motorlink_ffi::st::{master::*, message::*, request::*, slave::*, *};
use motorlink_ffi::*;

use crate::{Error, OK, bytes, execute_nothing, gives, zeroed};

#[derive(Default)]
struct Fan {
    rpm: i32,
    commands: Vec<u8>,
    /// Register and value.
    writes: Vec<(u8, i32)>,
    /// Motor and values: of a current reference, a torque ramp, a move.
    setpoints: Vec<(u8, f32, f32)>,
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

extern "C" fn write(context: *mut c_void, _: u8, register: u8, value: i32) -> u8 {
    fan(context).writes.push((register, value));
    if value == 13 { 0x05 } else { 0 }
}

extern "C" fn execute(context: *mut c_void, _: u8, command: u8) {
    fan(context).commands.push(command);
}

extern "C" fn ramp(context: *mut c_void, _: u8, speed_rpm: i32, _: u16) {
    fan(context).rpm = speed_rpm;
}

extern "C" fn current(context: *mut c_void, motor: u8, iq_s16a: i16, id_s16a: i16) {
    fan(context).setpoints.push((motor, iq_s16a.into(), id_s16a.into()));
}

extern "C" fn torque(context: *mut c_void, motor: u8, torque_s16a: i32, duration_ms: u16) {
    fan(context).setpoints.push((motor, torque_s16a as f32, duration_ms.into()));
}

extern "C" fn position(context: *mut c_void, motor: u8, angle_rad: f32, duration_s: f32) {
    fan(context).setpoints.push((motor, angle_rad, duration_s));
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

/// The bytes that the master sends next; `None` when the exchange is over.
fn sent(master: &mut motorlink_st_master, output: &mut motorlink_st_output) -> Option<Vec<u8>> {
    gives!(Ok, motorlink_st_master_poll(master, 0, output));
    let sent = match output.kind {
        motorlink_output::Done => return None,
        motorlink_output::Wait => panic!("the slave did not answer"),
        motorlink_output::Transmit => bytes(&output.bytes),
    };
    gives!(Ok, motorlink_st_master_poll(master, 0, output));
    Some(sent)
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
        while let Some(sent) = sent(master, &mut output) {
            for byte in sent {
                gives!(Ok, motorlink_st_slave_receive(slave, 0, byte, &mut reply));
                gives!(Ok, motorlink_st_master_receive(master, 0, reply.data, reply.size));
            }
        }
        (output, bytes(&output.bytes))
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
    drive.set_current_reference = Some(current);
    drive.set_torque_ramp = Some(torque);
    drive.set_position = Some(position);
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
    assert_eq!(exchange!(bench, motorlink_st_master_set_current_reference(1, -2)).0.result, OK);
    assert_eq!(exchange!(bench, motorlink_st_master_set_torque_ramp(-3, 4)).0.result, OK);
    assert_eq!(exchange!(bench, motorlink_st_master_set_position(-0.5, 0.25)).0.result, OK);

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
    assert_eq!((fan.commands, fan.writes), (vec![1], vec![(0x05, -2), (0x05, 13)]));
    assert_eq!(fan.setpoints, [(1, 1.0, -2.0), (1, -3.0, 4.0), (1, -0.5, 0.25)]);
}

#[test]
fn a_drive_with_the_required_callback_answers() {
    let nothing = motorlink_st_motor_control { execute: Some(execute_nothing), ..zeroed() };
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

fn confirm(bench: &mut StBench) -> (motorlink_st_output, Vec<u8>) {
    let begun = unsafe { motorlink_st_master_confirm(&mut bench.master) };
    bench.done(begun)
}

#[test]
fn replies_to_their_own_requests_are_confirmed() {
    let mut fan = Fan { rpm: 1500, ..Fan::default() };
    let drive = drive(&mut fan);
    let mut bench = StBench::new(0, &drive);
    assert_eq!(confirm(&mut bench).0.result, OK);
    for register in [0x1E, 0x02, 0x00] {
        assert_eq!(exchange!(bench, motorlink_st_master_get_register(register)).0.result, OK);
        let (output, payload) = confirm(&mut bench);
        assert_eq!((output.result, output.value, payload), (OK, 0, vec![]), "{register:#04x}");
    }
    assert_eq!(exchange!(bench, motorlink_st_master_execute(0x0A)).0.result, OK);
    assert_eq!(confirm(&mut bench).0.result, OK);
    assert_eq!(exchange!(bench, motorlink_st_master_get_register(0x1E)).0.value, 1500);
}

/// The drive sends the reply before, as after a reply that came twice.
fn shifted(bench: &mut StBench, before: &[u8]) -> motorlink_st_output {
    let (master, slave) = (&mut bench.master, &mut bench.slave);
    let (mut output, mut reply): (motorlink_st_output, motorlink_bytes) = (zeroed(), zeroed());
    let mut before = before.to_vec();
    while let Some(sent) = sent(master, &mut output) {
        for byte in sent {
            gives!(Ok, motorlink_st_slave_receive(slave, 0, byte, &mut reply));
        }
        gives!(Ok, motorlink_st_master_receive(master, 0, before.as_ptr(), before.len()));
        before = bytes(&reply);
    }
    output
}

#[test]
fn replies_that_belong_to_other_requests_are_not_confirmed() {
    let mut fan = Fan { rpm: 1500, ..Fan::default() };
    let drive = drive(&mut fan);
    let acknowledge = [0xF0, 0x00, 0xF0];
    let speed = [0xF0, 0x04, 0xDC, 0x05, 0x00, 0x00, 0xD6];
    let refusal = [0xFF, 0x01, 0x07, 0x08];
    for late in [&acknowledge[..], &speed, &refusal] {
        let mut bench = StBench::new(0, &drive);
        assert_eq!(exchange!(bench, motorlink_st_master_get_register(0x1E)).0.value, 1500);
        gives!(Ok, motorlink_st_master_confirm(&mut bench.master));
        let output = shifted(&mut bench, late);
        assert_eq!((output.result, output.error_code), (Error::Unconfirmed, 0), "{late:x?}");
        let mut lost = 0;
        gives!(Ok, motorlink_st_master_is_lost(&mut bench.master, &mut lost));
        assert_eq!(lost, 1, "{late:x?}");
    }
}

#[test]
fn a_refusal_of_the_last_request_is_confirmed_by_another_question() {
    let nothing = motorlink_st_motor_control { execute: Some(execute_nothing), ..zeroed() };
    let mut bench = StBench::new(0, &nothing);
    let (mut output, mut frames): (motorlink_st_output, _) = (zeroed(), Vec::new());
    gives!(Ok, motorlink_st_master_confirm(&mut bench.master));
    for reply in [&[0xFF, 0x01, 0x07, 0x08][..], &[0xF0, 0x01, 0x06, 0xF7]] {
        gives!(Ok, motorlink_st_master_poll(&mut bench.master, 0, &mut output));
        assert_eq!(output.kind, motorlink_output::Transmit);
        frames.push(bytes(&output.bytes));
        gives!(Ok, motorlink_st_master_receive(&mut bench.master, 0, reply.as_ptr(), reply.len()));
    }
    gives!(Ok, motorlink_st_master_poll(&mut bench.master, 0, &mut output));
    assert_eq!((output.kind, output.result), (motorlink_output::Done, OK));
    assert_eq!(frames, [[0x02, 0x01, 0x01, 0x04], [0x02, 0x01, 0x02, 0x05]]);
}

#[test]
fn an_abandoned_confirmation_does_not_affect_the_next_exchange() {
    let mut fan = Fan { rpm: 1500, ..Fan::default() };
    let drive = drive(&mut fan);
    let mut bench = StBench::new(0, &drive);
    let master: *mut motorlink_st_master = &mut bench.master;
    gives!(Ok, motorlink_st_master_confirm(master));
    gives!(Busy, motorlink_st_master_confirm(master));
    gives!(Ok, motorlink_st_master_abandon(master), motorlink_st_master_trust_line(master));
    assert_eq!(exchange!(bench, motorlink_st_master_get_register(0x1E)).0.value, 1500);
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
    let nothing = motorlink_st_motor_control { execute: Some(execute_nothing), ..zeroed() };
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
