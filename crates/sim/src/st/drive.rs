//! The drive: the motors of one slave.

use motorlink_proto::st::{
    Command, CurrentReference, ErrorCode, Features, MotorControl, MotorNumber, PositionMove, Ramp,
    RegisterId, RevupPhase, TorqueRamp, Version,
};
use motorlink_proto::time::{Instant, Micros};

use super::{MotorConfig, StMotor};

/// An ST drive with its motors, stored in an array or a vector.
#[derive(Debug, Clone)]
pub struct StDrive<M> {
    motors: M,
    now: Instant,
    clock: Option<RegisterId>,
}

impl StDrive<[StMotor; 2]> {
    /// The motors of [`MotorConfig::demo`].
    pub fn demo(now: Instant) -> Self {
        let motors = MotorConfig::demo().map(StMotor::new);
        StDrive { motors, now, clock: None }
    }
}

impl<M: AsRef<[StMotor]> + AsMut<[StMotor]>> StDrive<M> {
    /// A drive that is powered on at `now`; `None` unless it has 1 to 7 motors.
    pub fn new(now: Instant, motors: M) -> Option<Self> {
        let count = motors.as_ref().len();
        let fits = (1..=usize::from(MotorNumber::MAX)).contains(&count);
        fits.then(|| StDrive { motors, now, clock: None })
    }

    /// Lets a register of all motors read the time of the drive in ms, to measure how old a value is
    /// that somebody sees.
    #[must_use]
    pub fn with_clock(self, register: RegisterId) -> Self {
        StDrive { clock: Some(register), ..self }
    }

    /// The last motor. Its number is the number of motors.
    pub fn last(&self) -> MotorNumber {
        let count = self.motors.as_ref().len();
        u8::try_from(count).ok().and_then(MotorNumber::new).expect("a drive has 1 to 7 motors")
    }

    /// The motors, motor 1 first.
    pub const fn motors(&self) -> &M {
        &self.motors
    }

    /// A motor, to change its environment; `None` if the drive does not have this number.
    pub fn motor_mut(&mut self, motor: MotorNumber) -> Option<&mut StMotor> {
        self.motors.as_mut().get_mut(motor.index())
    }

    /// Simulates until `now`.
    pub fn advance_to(&mut self, now: Instant) {
        let passed = now.since(self.now).0;
        self.now += Micros(passed);
        self.motors.as_mut().iter_mut().for_each(|motor| motor.advance(passed));
    }

    /// Cycles the drive's power; see [`StMotor::power_cycle`].
    pub fn power_cycle(&mut self) {
        self.motors.as_mut().iter_mut().for_each(StMotor::power_cycle);
    }

    fn motor(&mut self, motor: MotorNumber) -> &mut StMotor {
        self.motor_mut(motor).expect("the slave asks for motors that the drive has")
    }
}

impl<M: AsRef<[StMotor]> + AsMut<[StMotor]>> MotorControl for StDrive<M> {
    fn features(&self, motor: MotorNumber) -> Features {
        let motor = self.motors.as_ref().get(motor.index());
        motor.map_or(Features::NONE, |motor| motor.config().build.features())
    }

    fn version(&self) -> Version<'_> {
        Version { name: "ST MC SDK", major: 5, minor: 4, patch: 4, pre_release: "" }
    }

    fn get_register(&mut self, motor: MotorNumber, register: RegisterId) -> i32 {
        match self.clock == Some(register) {
            true => (self.now.0 / 1000) as i32,
            false => self.motor(motor).read(register),
        }
    }

    fn set_register(
        &mut self,
        motor: MotorNumber,
        register: RegisterId,
        value: i32,
    ) -> Result<(), ErrorCode> {
        self.motor(motor).write(register, value)
    }

    fn execute(&mut self, motor: MotorNumber, command: Command) {
        self.motor(motor).execute(command);
    }

    fn set_ramp(&mut self, motor: MotorNumber, ramp: Ramp) {
        self.motor(motor).ramp(ramp);
    }

    fn get_revup_data(&mut self, motor: MotorNumber, phase: u8) -> RevupPhase {
        let phases = &self.motor(motor).firmware.revup;
        phases.get(usize::from(phase)).copied().unwrap_or_default()
    }

    fn set_revup_data(&mut self, motor: MotorNumber, phase: u8, data: RevupPhase) {
        let phases = &mut self.motor(motor).firmware.revup;
        if let Some(slot) = phases.get_mut(usize::from(phase)) {
            *slot = data;
        }
    }

    fn set_current_reference(&mut self, motor: MotorNumber, reference: CurrentReference) {
        self.motor(motor).currents(reference);
    }

    fn set_torque_ramp(&mut self, motor: MotorNumber, ramp: TorqueRamp) {
        let motor = self.motor(motor);
        let id = motor.flux_reference() as i16;
        motor.torque(ramp, id);
    }

    fn set_position(&mut self, motor: MotorNumber, target: PositionMove) {
        self.motor(motor).position(target);
    }
}
