//! A drive whose registers are memory. It counts its actions.

use motorlink_proto::st::{
    Command, CurrentReference, ErrorCode, Feature, Features, MotorControl, MotorNumber,
    PositionMove, REVUP_PHASES, Ramp, RegisterId, RevupPhase, TorqueRamp, Version,
};

pub const MOTORS: u8 = 2;

#[derive(Debug, Clone)]
pub struct Memory {
    /// The registers of each motor, by their ids.
    pub banks: [[i32; 256]; MOTORS as usize],
    revup: [RevupPhase; REVUP_PHASES as usize],
    /// Calls that changed something.
    pub acts: u64,
}

impl Memory {
    pub fn new() -> Self {
        let mut banks = [[0; 256]; MOTORS as usize];
        for (motor, bank) in banks.iter_mut().enumerate() {
            for (id, value) in bank.iter_mut().enumerate() {
                *value = (id as i32 + 1) * 0x0101 + motor as i32;
            }
        }
        Memory { banks, revup: [RevupPhase::default(); REVUP_PHASES as usize], acts: 0 }
    }

    fn slot(&mut self, motor: MotorNumber, register: RegisterId) -> &mut i32 {
        &mut self.banks[motor.index()][usize::from(register.0)]
    }
}

impl MotorControl for Memory {
    fn features(&self, _: MotorNumber) -> Features {
        let built = Feature::ALL.iter().filter(|feature| **feature != Feature::Profiler);
        built.fold(Features::NONE, |set, &feature| set.with(feature))
    }
    fn version(&self) -> Version<'_> {
        Version { name: "ST MC SDK", major: 5, minor: 4, patch: 3, pre_release: "" }
    }
    fn get_register(&mut self, motor: MotorNumber, register: RegisterId) -> i32 {
        *self.slot(motor, register)
    }
    fn set_register(
        &mut self,
        motor: MotorNumber,
        register: RegisterId,
        value: i32,
    ) -> Result<(), ErrorCode> {
        self.acts += 1;
        *self.slot(motor, register) = value;
        Ok(())
    }
    fn execute(&mut self, _: MotorNumber, _: Command) {
        self.acts += 1;
    }
    fn set_ramp(&mut self, _: MotorNumber, _: Ramp) {
        self.acts += 1;
    }
    fn get_revup_data(&mut self, _: MotorNumber, phase: u8) -> RevupPhase {
        self.revup[usize::from(phase)]
    }
    fn set_revup_data(&mut self, _: MotorNumber, phase: u8, data: RevupPhase) {
        self.acts += 1;
        self.revup[usize::from(phase)] = data;
    }
    fn set_current_reference(&mut self, _: MotorNumber, _: CurrentReference) {
        self.acts += 1;
    }
    fn set_torque_ramp(&mut self, _: MotorNumber, _: TorqueRamp) {
        self.acts += 1;
    }
    fn set_position(&mut self, _: MotorNumber, _: PositionMove) {
        self.acts += 1;
    }
}
