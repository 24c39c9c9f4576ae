//! An ST drive on a serial line, with requests as frames.

use motorlink_proto::st::register::{Register, Value};
use motorlink_proto::st::{
    Command, Flags, Frame, HEADER_ACK, MAX_FRAME, MotorNumber, Parse, Profile, REVUP_PHASES, Ramp,
    RegisterId, Request, RevupPhase, Status, register,
};
use motorlink_proto::time::{Instant, Micros};
use motorlink_sim::plant::Plant;
use motorlink_sim::st::{MotorConfig, StDrive, StMotor, StStation, Truth};

/// The code of a NACK.
pub type Nack = u8;

#[derive(Clone)]
pub struct NodeFixture {
    pub station: StStation<Vec<StMotor>>,
    pub now: Instant,
    /// All replies.
    pub log: Vec<u8>,
}

impl NodeFixture {
    pub fn new(profile: Profile, motors: impl IntoIterator<Item = MotorConfig>) -> Self {
        let motors = motors.into_iter().map(StMotor::new).collect();
        let drive = StDrive::new(Instant(0), motors).expect("1 to 7 motors");
        NodeFixture { station: StStation::new(profile, drive), now: Instant(0), log: Vec::new() }
    }

    /// The two motors of the demonstration.
    pub fn demo(profile: Profile) -> Self {
        Self::new(profile, MotorConfig::demo())
    }

    /// One motor without sensor.
    pub fn sensorless() -> Self {
        Self::new(Profile::Spec, [MotorConfig::default()])
    }

    /// One motor with encoder.
    pub fn servo() -> Self {
        Self::new(Profile::Mcsdk54, [MotorConfig::servo()])
    }

    pub fn wait(&mut self, ms: u32) {
        self.now += Micros::from_millis(ms);
        self.station.advance_to(self.now);
    }

    /// Sends a request to a motor (0 is the current one). Returns the ACK's payload, or the NACK's
    /// code.
    pub fn ask(&mut self, motor: u8, request: Request<'_>) -> Result<Vec<u8>, Nack> {
        let mut frame = [0; MAX_FRAME];
        let frame = Frame::command(motor, &request, &mut frame).expect("the request fits");
        let mut reply = Vec::new();
        self.station.receive(self.now, frame, |bytes| reply.extend_from_slice(bytes));
        self.log.extend_from_slice(&reply);
        let Parse::Frame(frame, size) = Frame::parse(&reply) else { panic!("reply {reply:02x?}") };
        assert_eq!(size, reply.len(), "one reply to a request");
        if frame.header == HEADER_ACK { Ok(frame.payload.to_vec()) } else { Err(frame.payload[0]) }
    }

    pub fn get_id(&mut self, motor: u8, id: RegisterId) -> Result<i32, Nack> {
        let payload = self.ask(motor, Request::GetRegister(id))?;
        Ok(id.decode(self.station.profile(), &payload).expect("1, 2 or 4 bytes"))
    }

    pub fn set_id(&mut self, motor: u8, register: RegisterId, value: &[u8]) -> Result<(), Nack> {
        self.ask(motor, Request::SetRegister { register, value }).map(|_| ())
    }

    /// A register of the current motor.
    pub fn get<T: Value, A: register::Readable>(&mut self, register: Register<T, A>) -> T {
        T::from_bits(self.get_id(0, register.id()).expect("the register can be read"))
    }

    pub fn set<T: Value, A: register::Writable>(&mut self, register: Register<T, A>, value: T) {
        let bytes = value.bits().to_le_bytes();
        let size = usize::from(T::TYPE.size());
        self.set_id(0, register.id(), &bytes[..size]).expect("the register can be written");
    }

    pub fn execute(&mut self, command: Command) {
        self.ask(0, Request::ExecuteCommand(command)).expect("the command is possible");
    }

    pub fn ramp(&mut self, speed_rpm: i32, duration_ms: u16) {
        self.ask(0, Request::SetRamp(Ramp { speed_rpm, duration_ms })).expect("a ramp never fails");
    }

    /// Changes the rev-up table of the current motor.
    pub fn change_revup(&mut self, change: impl Fn(RevupPhase) -> RevupPhase) {
        for phase in 0..REVUP_PHASES {
            let data = self.ask(0, Request::GetRevupData(phase)).expect("there are five phases");
            let data = change(RevupPhase::decode(&data).expect("a phase is 8 bytes"));
            self.ask(0, Request::SetRevupData(phase, data)).expect("a phase can be set");
        }
    }

    /// Sets the current of each phase of the rev-up, A.
    pub fn set_revup_current(&mut self, current: f32) {
        let full = self.world().config().plant.sensing.full_scale;
        let torque_s16a = (current / full * 32767.0) as i16;
        self.change_revup(|phase| RevupPhase { torque_s16a, ..phase });
    }

    pub fn status(&mut self) -> Status {
        Status::from(self.get(register::STATUS))
    }

    pub fn flags(&mut self) -> Flags {
        Flags(self.get(register::FLAGS))
    }

    /// Starts the current motor and waits until it runs.
    pub fn run(&mut self) {
        self.execute(Command::StartMotor);
        self.until(Status::Run, 5000);
    }

    /// Waits for a state. Returns the waiting time in ms.
    pub fn until(&mut self, status: Status, most_ms: u32) -> u32 {
        for waited in 0..=most_ms {
            if self.status() == status {
                return waited;
            }
            self.wait(1);
        }
        panic!("{} instead of {status} after {most_ms} ms", self.status());
    }

    /// The states after the present one, until one lasts for a second, with their durations in ms.
    pub fn states(&mut self) -> Vec<(Status, u32)> {
        let mut states: Vec<(Status, u32)> = vec![(self.status(), 0)];
        loop {
            self.wait(1);
            let now = self.status();
            let (last, lasted) = states.last_mut().expect("there is a first");
            *lasted += 1;
            match now {
                _ if now != *last => states.push((now, 0)),
                Status::Idle | Status::Run if *lasted >= 1000 => return states,
                _ => assert!(*lasted < 10_000, "{now} for 10 s"),
            }
        }
    }

    /// Mean of a register of the current motor over 50 readings, one per millisecond, because
    /// measured values have noise.
    pub fn mean<T: Value + Into<f64>, A: register::Readable>(
        &mut self,
        register: Register<T, A>,
    ) -> f64 {
        self.mean_of(|line| line.get(register).into())
    }

    /// Mean of something over 50 ms.
    pub fn mean_of(&mut self, mut read: impl FnMut(&mut Self) -> f64) -> f64 {
        let sum: f64 = (0..50)
            .map(|_| {
                self.wait(1);
                read(self)
            })
            .sum();
        sum / 50.0
    }

    /// True speed, rpm, over 50 ms.
    pub fn mean_rpm(&mut self) -> f64 {
        self.mean_of(|line| line.truth().speed_rpm.into())
    }

    /// Motor 1, to change its environment.
    pub fn world(&mut self) -> &mut StMotor {
        self.station.drive_mut().motor_mut(MotorNumber::FIRST).expect("motor 1 exists")
    }

    /// The environment of motor 1.
    pub fn plant(&mut self) -> &mut Plant {
        self.world().plant_mut()
    }

    /// Sets the braking torque of the load, Nm.
    pub fn brake(&mut self, torque: f32) {
        self.plant().change_load(|load| load.brake = torque);
    }

    pub fn truth(&self) -> Truth {
        self.station.drive().motors()[0].truth()
    }
}
