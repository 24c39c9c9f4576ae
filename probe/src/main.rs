//! Links masters and slaves of both protocols, and slcan, without anything else. The panic handler calls a
//! function that does not exist, so if any path in them can panic this does not link.
#![no_std]
#![no_main]

use core::hint::black_box;
use core::mem::size_of;

use motorlink_proto::rmd::{
    CanFrame, Config as RmdConfig, Drive as RmdDrive, Host, Mode, Motor as RmdMotor, MotorId,
    MotorSet, Output as RmdOutput, Sense, Settings, Torque4,
};
use motorlink_proto::stmcp::{
    BoardInfo, Command, Config, CurrentReference, Drive, ErrorCode, Features, FirmwareVersion,
    Master, Motor, Output, PositionMove, Profile, Ramp, RegisterId, Request, RevupPhase, Slave,
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

impl Drive for Plant {
    fn features(&self, _: Motor) -> Features {
        black_box(Features::NONE)
    }
    fn version(&self) -> Version<'_> {
        black_box(Version { name: "probe", major: 1, minor: 2, patch: 3, pre_release: "RC1" })
    }
    fn read(&mut self, _: Motor, _: RegisterId) -> i32 {
        unknown()
    }
    fn write(&mut self, _: Motor, _: RegisterId, _: i32) -> Result<(), ErrorCode> {
        black_box(Ok(()))
    }
    fn execute(&mut self, _: Motor, _: Command) {}
    fn ramp(&mut self, _: Motor, ramp: Ramp) {
        black_box(ramp);
    }
    fn revup(&mut self, _: Motor, _: u8) -> RevupPhase {
        unknown()
    }
    fn set_revup(&mut self, _: Motor, _: u8, data: RevupPhase) {
        black_box(data);
    }
    fn current_reference(&mut self, _: Motor, reference: CurrentReference) {
        black_box(reference);
    }
    fn torque_ramp(&mut self, _: Motor, ramp: TorqueRamp) {
        black_box(ramp);
    }
    fn position(&mut self, _: Motor, target: PositionMove) {
        black_box(target);
    }
    fn profiler_step(&self, _: Motor, _: u8) -> &[u8] {
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

fn slave(profile: Profile) {
    let mut slave = Slave::new(profile, black_box(Motor::FIRST));
    loop {
        let now = Instant(unknown());
        black_box(slave.receive(now, unknown(), &mut Plant));
        black_box(slave.poll(now));
        if unknown() {
            black_box(slave.overrun());
        }
        if unknown() {
            return;
        }
    }
}

fn master() {
    let mut master = Master::new(black_box(Config::default()));
    let received: [u8; 64] = black_box([0; 64]);
    loop {
        let now = Instant(unknown());
        let request = match unknown::<u8>() {
            0 => Request::GetRegister(RegisterId(unknown())),
            1 => Request::SetRegister {
                register: RegisterId(unknown()),
                value: black_box(&received),
            },
            2 => Request::Execute(Command::from(unknown::<u8>())),
            3 => Request::SetRevupData(unknown(), unknown()),
            4 => Request::ConfigDynStruct { segment: unknown(), registers: black_box(&received) },
            _ => Request::BoardInfo,
        };
        let _ = black_box(master.request(unknown(), &request));
        let _ = black_box(master.request_raw(unknown(), black_box(&received)));
        master.receive(now, black_box(received.get(..unknown::<usize>()).unwrap_or(&[])));
        if let Output::Done(Ok(payload)) = master.poll(now) {
            black_box(BoardInfo::decode(payload));
            black_box(FirmwareVersion::decode(payload));
            black_box(RegisterId(unknown()).decode(payload));
        }
        if unknown() {
            master.abandon();
            master.reopened();
            return;
        }
    }
}

fn rmd() {
    let config = black_box(RmdConfig::new(id(unknown())));
    let mut drive = RmdDrive::new(config, unknown());
    let mut host = Host::new();
    drive.power_on(Instant(unknown()), &mut Plant);
    loop {
        let now = Instant(unknown());
        let frame = CanFrame::data_frame(unknown(), unknown(), black_box(&[0; 8]));
        black_box(drive.receive(now, &frame, &mut Plant));
        drive.poll(now, &mut Plant);
        host.receive(now, &frame);
        let _ = black_box(host.request(now, id(unknown()), unknown()));
        let _ = black_box(host.torque4(now, Torque4::default(), black_box(MotorSet::TORQUE4)));
        host.cancel(now, id(unknown()));
        if let RmdOutput::Done { id, result } = host.poll(now) {
            black_box((id, result.is_ok()));
        }
        if unknown() {
            return;
        }
    }
}

fn slcan() {
    let mut device = Device::default();
    let mut host = AnswerParser::default();
    loop {
        let _ = black_box(device.receive(unknown(), |answer| _ = black_box(answer.len())));
        let frame = CanFrame::data_frame(unknown(), unknown(), black_box(&[0; 8]));
        device.deliver(Instant(unknown()), &frame, |line| _ = black_box(line.len()));
        black_box(host.receive(unknown()));
        black_box(Bitrate::from_index(unknown()).map(Bitrate::command));
        if unknown() {
            return;
        }
    }
}

fn id(number: u8) -> MotorId {
    match MotorId::new(number) {
        Some(id) => id,
        None => rest(),
    }
}

fn rest() -> ! {
    loop {
        core::hint::spin_loop();
    }
}

/// The entry point.
#[unsafe(no_mangle)]
pub extern "C" fn probe() -> ! {
    slave(Profile::Spec);
    slave(black_box(Profile::Mcsdk54));
    master();
    rmd();
    slcan();
    rest()
}
