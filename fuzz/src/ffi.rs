//! The C library under any sequence of calls, on valid and invalid storage, with callbacks that
//! call the library.
#![allow(unsafe_code, reason = "the functions are C's")]

use std::cell::Cell;
use std::ffi::c_void;
use std::ptr::{null, null_mut};
use std::slice;

use motorlink_ffi::motorlink_error as Error;
use motorlink_ffi::rmd::{drive::*, host::*, message::*, *};
use motorlink_ffi::slcan::*;
use motorlink_ffi::st::{master::*, message::*, request::*, slave::*, *};
use motorlink_ffi::*;

use crate::input::Input;

const BLOCKS: usize = 4;
const WORDS: usize = size_of::<motorlink_rmd_host>() / 8;

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Kind {
    Nothing,
    Master,
    Slave,
    Host,
    Drive,
    Codec,
    Adapter,
}

const KINDS: [Kind; 6] =
    [Kind::Master, Kind::Slave, Kind::Host, Kind::Drive, Kind::Codec, Kind::Adapter];

/// The last output of an object, to be passed to the other end.
#[derive(Default)]
struct Heard {
    bytes: Vec<u8>,
    frame: Option<motorlink_can_frame>,
}

struct Objects {
    blocks: [*mut u64; BLOCKS],
    kinds: [Kind; BLOCKS],
    now: u64,
    heard: Heard,
    st: *const motorlink_st_motor_control,
    motor: *const motorlink_rmd_motor_control,
}

thread_local! {
    /// The storage of the current call, for its callbacks.
    static IN_CALL: Cell<*mut u64> = const { Cell::new(null_mut()) };
}

/// The first step of every callback: a call on the object that calls it.
fn call_back() {
    let storage = IN_CALL.get();
    let mut deadline = 0;
    // SAFETY: the storage is a block of the bench.
    let (slave, drive) = unsafe {
        (
            motorlink_st_slave_deadline(storage.cast(), &mut deadline),
            motorlink_rmd_drive_poll(storage.cast(), 0),
        )
    };
    let found = [slave, drive];
    assert!(found.contains(&Error::InUse) && found.contains(&Error::WrongKind), "{found:?}");
}

extern "C" fn features(_: *mut c_void, motor: u8) -> u16 {
    call_back();
    if motor == 1 { 0xFFFF } else { 0 }
}
extern "C" fn read(_: *mut c_void, _: u8, reg: u8) -> i32 {
    call_back();
    i32::from(reg) - 64
}
extern "C" fn write(_: *mut c_void, _: u8, _: u8, value: i32) -> u8 {
    call_back();
    value as u8 & 7
}
extern "C" fn execute(_: *mut c_void, _: u8, _: motorlink_st_command) {
    call_back();
}
extern "C" fn revup(_: *mut c_void, _: u8, phase: u8, data: *mut motorlink_st_revup_phase) {
    assert!(phase < 5);
    // SAFETY: it points to a phase.
    unsafe { (*data).speed_rpm = 7 };
}
extern "C" fn profiler_step(_: *mut c_void, _: u8, step: u8, registers: *mut *const u8) -> u8 {
    static SHOWN: [u8; 255] = [0x1E; 255];
    // SAFETY: it points to a pointer.
    unsafe { *registers = if step == 0 { null() } else { SHOWN.as_ptr() } };
    step
}
extern "C" fn set_mode(_: *mut c_void, motion: *const motorlink_rmd_motion) {
    call_back();
    // SAFETY: it points to a motion.
    assert!(unsafe { (*motion).kind } as u8 <= 4);
}
extern "C" fn sense(_: *mut c_void, sense: *mut motorlink_rmd_sense) {
    call_back();
    // SAFETY: it points to readings.
    unsafe { (*sense).encoder_counts = i64::MIN };
}

/// All members of C's structs are zero at first.
fn zeroed<T>() -> T {
    // SAFETY: used for structs of integers, pointers and optional functions, and for enums with 0.
    unsafe { std::mem::MaybeUninit::zeroed().assume_init() }
}

/// Any calls on any storage.
pub fn ffi(data: &[u8]) {
    let mut st: motorlink_st_motor_control = zeroed();
    (st.version.name, st.version.pre_release) = (c"fuzz\xFF".as_ptr(), c"".as_ptr());
    st.features = Some(features);
    st.get_register = Some(read);
    st.set_register = Some(write);
    st.execute = Some(execute);
    st.get_revup_data = Some(revup);
    st.profiler_step = Some(profiler_step);
    let mut motor: motorlink_rmd_motor_control = zeroed();
    motor.set_mode = Some(set_mode);
    motor.sense = Some(sense);
    let blocks = [(); BLOCKS].map(|()| Box::into_raw(vec![0u64; WORDS].into_boxed_slice()));
    let mut bench = Objects {
        blocks: blocks.map(|block| block.cast()),
        kinds: [Kind::Nothing; BLOCKS],
        now: 0,
        heard: Heard::default(),
        st: &raw const st,
        motor: &raw const motor,
    };
    let mut input = Input::new(data);
    while let Some(operation) = input.operation() {
        bench.operate(operation, &mut input);
    }
    for block in blocks {
        // SAFETY: it comes from a box.
        drop(unsafe { Box::from_raw(block) });
    }
}

impl Objects {
    fn operate(&mut self, operation: u8, input: &mut Input<'_>) {
        let at = usize::from(operation) % BLOCKS;
        let storage = self.blocks[at];
        IN_CALL.set(storage);
        match operation / 4 % 16 {
            0 | 1 => self.init(at, input),
            2 => {
                // SAFETY: a block has so many words. No tag has four equal bytes.
                unsafe { storage.write_bytes(input.byte(), WORDS) };
                self.kinds[at] = Kind::Nothing;
            }
            3 => {
                let from = usize::from(input.byte()) % BLOCKS;
                // SAFETY: blocks have as many words each.
                unsafe { storage.copy_from(self.blocks[from], WORDS) };
                self.kinds[at] = self.kinds[from];
            }
            4 => self.now = self.now.wrapping_add(u64::from(input.word()) << (input.byte() % 48)),
            _ => {
                let kind = KINDS[usize::from(input.byte()) % KINDS.len()];
                // Mostly calls that fit the object in the storage.
                let there = self.kinds[at];
                let kind =
                    if operation & 0x80 == 0 && there != Kind::Nothing { there } else { kind };
                let result = self.call(kind, storage, input);
                self.check(kind, there, result);
            }
        }
    }

    fn check(&self, kind: Kind, there: Kind, result: Error) {
        let early = matches!(result, Error::BadArgument);
        match there {
            Kind::Nothing => assert!(early || result == Error::Uninitialised, "{result:?}"),
            other if other != kind => assert!(early || result == Error::WrongKind, "{result:?}"),
            _ => assert!(
                matches!(
                    result,
                    Error::Ok
                        | Error::BadArgument
                        | Error::TooLong
                        | Error::Busy
                        | Error::Quarantined
                        | Error::Limit
                ),
                "{result:?}"
            ),
        }
    }

    fn init(&mut self, at: usize, input: &mut Input<'_>) {
        let storage = self.blocks[at];
        let kind = KINDS[usize::from(input.byte()) % KINDS.len()];
        let size = if input.byte() == 0 { 8 } else { WORDS * 8 };
        let (one, two) = (input.byte(), input.byte());
        let config = motorlink_st_master_config {
            timeout_us: u32::from(one) << 12,
            quiet_us: u32::from(two) << 8,
            baud: u32::from(two & 1) * 9600,
            profile: one & 3,
            recovery: two & 3,
        };
        let drive = motorlink_rmd_drive_config {
            shutdown_us: u64::from(two) << 16,
            id: one & 63,
            encoder_bits: two % 20,
            clear_reply_0x9b: one,
        };
        // SAFETY: the block is large enough, and the tables live as long as it.
        let result = unsafe {
            match kind {
                Kind::Master => motorlink_st_master_init(storage.cast(), size, &config),
                Kind::Slave => {
                    motorlink_st_slave_init(storage.cast(), size, one & 3, two & 15, self.st)
                }
                Kind::Host => motorlink_rmd_host_init(storage.cast(), size),
                Kind::Drive => {
                    let (storage, motor) = (storage.cast(), self.motor);
                    motorlink_rmd_drive_init(storage, size, &drive, null(), motor)
                }
                Kind::Codec => motorlink_slcan_host_init(storage.cast(), size),
                _ => motorlink_slcan_device_init(storage.cast(), size),
            }
        };
        match result {
            Error::Ok => self.kinds[at] = kind,
            Error::StorageTooSmall => assert_eq!(size, 8),
            error => assert_eq!(error, Error::BadArgument),
        }
    }

    /// Calls one of the functions of `kind` on a storage that may contain another kind.
    fn call(&mut self, kind: Kind, storage: *mut u64, input: &mut Input<'_>) -> Error {
        // SAFETY: the storage is a block, every other pointer is a reference, and sizes are theirs.
        unsafe {
            match kind {
                Kind::Master => self.master(storage.cast(), input),
                Kind::Slave => self.slave(storage.cast(), input),
                Kind::Host => self.host(storage.cast(), input),
                Kind::Drive => self.drive(storage.cast(), input),
                Kind::Codec => self.codec(storage.cast(), input),
                _ => self.adapter(storage.cast(), input),
            }
        }
    }

    unsafe fn master(&mut self, master: *mut motorlink_st_master, input: &mut Input<'_>) -> Error {
        let (which, motor, one) = (input.byte(), input.byte() & 15, input.byte());
        let (bytes, now) = (input.bytes(), self.now);
        let (list, size) = (bytes.as_ptr(), bytes.len());
        let (word, value) = (u16::from(one) << 5, i32::from(one) << 20);
        let phase =
            motorlink_st_revup_phase { speed_rpm: value, torque_s16a: -1, duration_ms: word };
        let limits = motorlink_st_limits { speed_rpm: value, current_s16a: i32::from(one) - 2 };
        let mut lost = 0;
        // SAFETY: the caller's.
        unsafe {
            match which % 24 {
                0 => motorlink_st_master_get_register(master, motor, one),
                1 => motorlink_st_master_set_register(master, motor, one, value),
                2 => motorlink_st_master_execute(master, motor, one),
                3 => motorlink_st_master_set_ramp(master, motor, value, word),
                4 => motorlink_st_master_set_current_reference(master, motor, -1, 1),
                5 => motorlink_st_master_set_torque_ramp(master, motor, value, word),
                6 => motorlink_st_master_set_position(
                    master,
                    motor,
                    f32::from_bits(value as u32),
                    1.0,
                ),
                7 => motorlink_st_master_get_revup_data(master, motor, one & 7),
                8 => motorlink_st_master_set_revup_data(master, motor, one & 7, &phase),
                9 => motorlink_st_master_get_board_info(master, motor),
                10 => motorlink_st_master_get_firmware_version(master, motor),
                11 => motorlink_st_master_configure_segment(master, motor, one, list, size),
                12 => motorlink_st_master_get_segment(master, motor, one),
                13 => motorlink_st_master_get_profiler_info(master, motor, list, size),
                14 => motorlink_st_master_raw(master, motor, one, list, size),
                15 => motorlink_st_master_receive(master, now, list, size),
                16 => motorlink_st_master_abandon(master),
                17 if one & 1 == 0 => motorlink_st_master_lost(master),
                17 if one & 2 == 0 => motorlink_st_master_reopened(master),
                17 => motorlink_st_master_trust_line(master),
                18 if one & 1 == 0 => motorlink_st_master_set_limits(master, &limits),
                18 if one & 2 == 0 => motorlink_st_master_is_lost(master, &mut lost),
                18 => motorlink_st_master_confirm(master),
                19 | 20 => {
                    let heard = &self.heard.bytes;
                    motorlink_st_master_receive(master, now, heard.as_ptr(), heard.len())
                }
                _ => self.poll_master(master),
            }
        }
    }

    unsafe fn poll_master(&mut self, master: *mut motorlink_st_master) -> Error {
        let mut output: motorlink_st_output = zeroed();
        // SAFETY: the caller's.
        let result = unsafe { motorlink_st_master_poll(master, self.now, &mut output) };
        if result == Error::Ok {
            self.hear(&output.bytes);
            let (at, size) = (output.bytes.data, output.bytes.size);
            let (mut info, mut version, mut phase) = (zeroed(), zeroed(), zeroed());
            // SAFETY: the bytes are there until the next call for the master.
            let read = unsafe {
                [
                    motorlink_st_decode_board_info(at, size, &mut info),
                    motorlink_st_decode_firmware_version(at, size, &mut version),
                    motorlink_st_decode_revup_data(at, size, &mut phase),
                ]
            };
            assert_eq!(read[1], Error::Ok);
            // The payload as the names of registers, and as their values.
            let mut values = vec![0; size];
            // SAFETY: as above, and there are as many values as registers.
            unsafe { motorlink_st_decode_segment(at, size, at, size, values.as_mut_ptr()) };
            for value in values {
                let checked = motorlink_st_check_value(value as u8, (value >> 8) as u8, value);
                assert!(matches!(checked, Error::Ok | Error::Implausible | Error::BadArgument));
            }
        }
        result
    }

    fn hear(&mut self, bytes: &motorlink_bytes) {
        assert!(bytes.size <= 132 && !bytes.data.is_null());
        // SAFETY: the bytes are there until the next call for what said them.
        self.heard.bytes = unsafe { slice::from_raw_parts(bytes.data, bytes.size) }.to_vec();
    }

    unsafe fn slave(&mut self, slave: *mut motorlink_st_slave, input: &mut Input<'_>) -> Error {
        let mut reply: motorlink_bytes = zeroed();
        let mut deadline = 0;
        let which = input.byte();
        // SAFETY: the caller's.
        let result = unsafe {
            match which % 8 {
                0 => motorlink_st_slave_poll(slave, self.now, &mut reply),
                1 => motorlink_st_slave_overrun(slave, &mut reply),
                2 => return motorlink_st_slave_deadline(slave, &mut deadline),
                3 | 4 => motorlink_st_slave_receive(slave, self.now, input.byte(), &mut reply),
                _ => {
                    let mut result = Error::BadArgument;
                    for byte in std::mem::take(&mut self.heard.bytes) {
                        result = motorlink_st_slave_receive(slave, self.now, byte, &mut reply);
                    }
                    result
                }
            }
        };
        if result == Error::Ok {
            self.hear(&reply);
        }
        result
    }

    fn frame(&self, input: &mut Input<'_>) -> motorlink_can_frame {
        let mut any: motorlink_can_frame = zeroed();
        any.id = 0x140 + u32::from(input.byte());
        (any.extended, any.remote, any.size) =
            (input.byte() & 1, input.byte() & 1, input.byte() % 10);
        any.data = input.array();
        self.heard.frame.filter(|_| input.byte() & 1 == 0).unwrap_or(any)
    }

    unsafe fn host(&mut self, host: *mut motorlink_rmd_host, input: &mut Input<'_>) -> Error {
        let (which, one) = (input.byte(), input.byte());
        let limits = motorlink_rmd_limits {
            current_16ma: i32::from(one) - 2,
            speed_dps: i32::from(one) << 9,
            angle_centidegrees: -1,
        };
        let (mut at, mut motors, now) = (0, 0, self.now);
        let mut output: motorlink_rmd_output = zeroed();
        // SAFETY: the caller's.
        unsafe {
            match which % 12 {
                0 => motorlink_rmd_host_set_times(host, u32::from(one) << 8, 1000),
                1 => motorlink_rmd_host_set_limits(host, one, &limits),
                2 | 3 => {
                    let bytes = input.array();
                    motorlink_rmd_host_request(host, now, one, motorlink_rmd_data { bytes })
                }
                4 => {
                    let torques = [input.word() as i16, 0, -1, 2000];
                    motorlink_rmd_host_set_torque4(host, now, torques.as_ptr(), one & 31)
                }
                5 if one & 3 == 1 => {
                    motorlink_rmd_host_trust(host, u32::from_le_bytes(input.array()))
                }
                5 if one & 3 == 2 => motorlink_rmd_host_reopened(host, now),
                5 if one & 3 == 3 => motorlink_rmd_host_confirm(host, now, one >> 2),
                5 => motorlink_rmd_host_retry(host, &mut at),
                6 => motorlink_rmd_host_cancel(host, now, one),
                7 => motorlink_rmd_host_busy(host, &mut motors),
                8 => motorlink_rmd_host_receive(host, now, &self.frame(input)),
                _ => {
                    let result = motorlink_rmd_host_poll(host, now, &mut output);
                    if output.kind == motorlink_output::Transmit {
                        self.heard.frame = Some(output.frame);
                    }
                    result
                }
            }
        }
    }

    unsafe fn drive(&mut self, drive: *mut motorlink_rmd_drive, input: &mut Input<'_>) -> Error {
        let (mut motion, mut settings) = (zeroed(), zeroed());
        let (mut deadline, mut errors, now) = (0, 0, self.now);
        // SAFETY: the caller's.
        unsafe {
            match input.byte() % 10 {
                0 => motorlink_rmd_drive_power_on(drive, now),
                1 => motorlink_rmd_drive_poll(drive, now),
                2 => motorlink_rmd_drive_deadline(drive, &mut deadline),
                3 => motorlink_rmd_drive_motion(drive, &mut motion),
                4 => motorlink_rmd_drive_errors(drive, &mut errors),
                5 => motorlink_rmd_drive_settings(drive, &mut settings),
                _ => {
                    let mut reply = zeroed();
                    let frame = self.frame(input);
                    let result = motorlink_rmd_drive_receive(drive, now, &frame, &mut reply);
                    self.heard.frame = Some(reply).filter(|_| result == Error::Ok);
                    result
                }
            }
        }
    }

    unsafe fn codec(&mut self, codec: *mut motorlink_slcan_host, input: &mut Input<'_>) -> Error {
        let (mut said, mut frame) = (motorlink_slcan_answer::None, zeroed());
        let mut line: motorlink_slcan_line = zeroed();
        // SAFETY: the caller's.
        unsafe {
            let encoded = motorlink_slcan_encode(&self.frame(input), &mut line);
            assert_eq!(encoded == Error::Ok, line.size > 0);
            let mut result = motorlink_slcan_host_receive(codec, b'\r', &mut said, &mut frame);
            for byte in &line.bytes[..line.size.into()] {
                result = motorlink_slcan_host_receive(codec, *byte, &mut said, &mut frame);
            }
            // Every sent line is a line that the host accepts.
            let frame_came = said == motorlink_slcan_answer::Frame;
            assert!(encoded != Error::Ok || frame_came == (result == Error::Ok));
            motorlink_slcan_host_receive(codec, input.byte(), &mut said, &mut frame)
        }
    }

    unsafe fn adapter(
        &mut self,
        adapter: *mut motorlink_slcan_device,
        input: &mut Input<'_>,
    ) -> Error {
        let (mut line, mut frame) = (zeroed(), zeroed());
        // SAFETY: the caller's.
        unsafe {
            if input.byte() & 3 == 0 {
                let sent = self.frame(input);
                return motorlink_slcan_device_deliver(adapter, self.now, &sent, &mut line);
            }
            let mut result = Error::BadArgument;
            for byte in input.bytes() {
                result = motorlink_slcan_device_receive(adapter, *byte, &mut line, &mut frame);
                assert!(line.size <= 31);
            }
            result
        }
    }
}
