//! Calls to everything that firmware calls of both protocols and slcan, with arguments and results
//! that the compiler cannot know: a program of them carries what firmware would carry. The panic
//! handler calls a function that does not exist, so if any path in them can panic it does not link.
#![no_std]

use core::hint::black_box;
use core::mem::size_of;

use motorlink_proto::can::CanFrame;
use motorlink_proto::rmd::{
    Drive as RmdDrive, DriveConfig as RmdConfig, Host, Mode, MotorControl as RmdMotor, MotorId,
    MotorSet, Output as RmdOutput, Sense, SetTorque4, Settings,
};
use motorlink_proto::st::{
    BoardInfo, Command, CurrentReference, ErrorCode, Features, FirmwareVersion, Master,
    MotorControl, MotorNumber, Output, PositionMove, Ramp, RegisterId, Request, RevupPhase, Slave,
    TorqueRamp, Version,
};
use motorlink_proto::time::Instant;
use motorlink_slcan::{AnswerParser, Bitrate, Device};

const _: () = assert!(size_of::<Master>() + size_of::<Slave>() < 800, "RAM of both ends of ST MCP");
const _: () = assert!(size_of::<Slave>() < 350, "RAM of an ST slave");
const _: () = assert!(size_of::<RmdDrive>() < 200, "RAM of an RMD drive");

unsafe extern "C" {
    fn a_path_of_the_core_can_panic() -> !;
}

#[panic_handler]
fn panic(_: &core::panic::PanicInfo<'_>) -> ! {
    // SAFETY: never linked: the linker does not find the function.
    unsafe { a_path_of_the_core_can_panic() }
}

/// What the outside world would give: nothing that the compiler can know.
fn unknown<T: Default>() -> T {
    black_box(T::default())
}

struct Plant;

impl MotorControl for Plant {
    fn features(&self, _: MotorNumber) -> Features {
        black_box(Features::NONE)
    }
    fn version(&self) -> Version<'_> {
        black_box(Version { name: "probe", major: 1, minor: 2, patch: 3, pre_release: "RC1" })
    }
    fn get_register(&mut self, _: MotorNumber, _: RegisterId) -> i32 {
        unknown()
    }
    fn set_register(&mut self, _: MotorNumber, _: RegisterId, _: i32) -> Result<(), ErrorCode> {
        black_box(Ok(()))
    }
    fn execute(&mut self, _: MotorNumber, _: Command) {}
    fn set_ramp(&mut self, _: MotorNumber, ramp: Ramp) {
        black_box(ramp);
    }
    fn get_revup_data(&mut self, _: MotorNumber, _: u8) -> RevupPhase {
        unknown()
    }
    fn set_revup_data(&mut self, _: MotorNumber, _: u8, data: RevupPhase) {
        black_box(data);
    }
    fn set_current_reference(&mut self, _: MotorNumber, reference: CurrentReference) {
        black_box(reference);
    }
    fn set_torque_ramp(&mut self, _: MotorNumber, ramp: TorqueRamp) {
        black_box(ramp);
    }
    fn set_position(&mut self, _: MotorNumber, target: PositionMove) {
        black_box(target);
    }
    fn profiler_step(&self, _: MotorNumber, _: u8) -> &[u8] {
        black_box(&[1, 2, 3])
    }
}

impl RmdMotor for Plant {
    fn set_mode(&mut self, mode: Mode) {
        black_box(mode);
    }
    fn configure(&mut self, settings: &Settings) {
        black_box(settings);
    }
    fn sense(&mut self) -> Sense {
        unknown()
    }
    fn save(&mut self, rom: &Settings) {
        black_box(rom);
    }
}

/// All that firmware calls of a slave.
pub fn st_slave(slave: &mut Slave) {
    let now = Instant(unknown());
    black_box(slave.receive(now, unknown(), &mut Plant));
    black_box(slave.poll(now));
    black_box(slave.deadline());
    if unknown() {
        black_box(slave.overrun());
    }
}

/// All that firmware calls of a master.
pub fn st_master(master: &mut Master) {
    let received: [u8; 64] = black_box([0; 64]);
    let now = Instant(unknown());
    let request = match unknown::<u8>() {
        0 => Request::GetRegister(RegisterId(unknown())),
        1 => Request::SetRegister { register: RegisterId(unknown()), value: black_box(&received) },
        2 => Request::ExecuteCommand(Command::from(unknown::<u8>())),
        3 => Request::SetRevupData(unknown(), unknown()),
        4 => Request::ConfigureSegment { segment: unknown(), registers: black_box(&received) },
        _ => Request::GetBoardInfo,
    };
    let _ = black_box(master.request(unknown(), &request));
    let _ = black_box(master.request_raw(unknown(), black_box(&received)));
    master.receive(now, black_box(received.get(..unknown::<usize>()).unwrap_or(&[])));
    if let Output::Done(Ok(payload)) = master.poll(now) {
        black_box(BoardInfo::decode(payload));
        black_box(FirmwareVersion::decode(payload));
        black_box(RegisterId(unknown()).decode(unknown(), payload));
    }
    if unknown() {
        master.abandon();
        master.reopened();
        master.trust_line();
    }
}

/// A drive that the compiler knows nothing of.
pub fn new_rmd_drive() -> RmdDrive {
    RmdDrive::new(black_box(RmdConfig::new(id(unknown()))), unknown())
}

/// All that firmware calls of an RMD drive.
pub fn rmd_drive(drive: &mut RmdDrive) {
    let now = Instant(unknown());
    if unknown() {
        drive.power_on(now, &mut Plant);
    }
    let frame = CanFrame::data_frame(unknown(), unknown(), black_box(&[0; 8]));
    black_box(drive.receive(now, &frame, &mut Plant));
    drive.poll(now, &mut Plant);
    black_box(drive.deadline());
}

/// All that firmware calls of an RMD host.
pub fn rmd_host(host: &mut Host) {
    let now = Instant(unknown());
    let frame = CanFrame::data_frame(unknown(), unknown(), black_box(&[0; 8]));
    host.receive(now, &frame);
    let _ = black_box(host.request(now, id(unknown()), unknown()));
    let _ = black_box(host.set_torque4(now, SetTorque4::default(), black_box(MotorSet::TORQUE4)));
    host.cancel(now, id(unknown()));
    host.reopened(now);
    host.trust(black_box(MotorSet::TORQUE4));
    if let RmdOutput::Done { id, result } = host.poll(now) {
        black_box((id, result.is_ok()));
    }
}

/// All that firmware calls of either end of slcan.
pub fn slcan((device, host): &mut (Device, AnswerParser)) {
    let _ = black_box(device.receive(unknown(), |answer| _ = black_box(answer.len())));
    let frame = CanFrame::data_frame(unknown(), unknown(), black_box(&[0; 8]));
    device.deliver(Instant(unknown()), &frame, |line| _ = black_box(line.len()));
    black_box(host.receive(unknown()));
    black_box(Bitrate::from_index(unknown()).map(Bitrate::command));
}

fn id(number: u8) -> MotorId {
    match MotorId::new(number) {
        Some(id) => id,
        None => loop {
            core::hint::spin_loop();
        },
    }
}

/// A program that makes its state once, in a static, and then calls for it again and again.
#[macro_export]
macro_rules! program {
    ($state:ty, $new:expr, $calls:expr) => {
        static mut STATE: core::mem::MaybeUninit<$state> = core::mem::MaybeUninit::uninit();

        /// The entry point.
        #[unsafe(no_mangle)]
        pub extern "C" fn probe() -> ! {
            // SAFETY: this is the whole program, and it takes the reference once.
            let state = unsafe { &mut *(&raw mut STATE) }.write($new);
            loop {
                $calls(state);
            }
        }
    };
}
