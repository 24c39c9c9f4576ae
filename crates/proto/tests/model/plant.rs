//! The drive behind the slave and its model: registers that store values, and a log of all calls.

use std::collections::BTreeMap;

use motorlink_proto::st::*;

/// A value that no register accepts.
const UNFIT: i32 = 0x0000_00BD;

#[derive(Debug, Clone, Default, PartialEq)]
pub struct Plant {
    registers: BTreeMap<(u8, u8), i32>,
    revup: BTreeMap<(u8, u8), RevupPhase>,
    pub log: Vec<String>,
}

impl Plant {
    /// Motor 1 has all features, motor 2 none, motor 3 those of usual firmware.
    pub fn has(motor: u8, feature: Feature) -> bool {
        let unusual = [Feature::Profiler, Feature::Hfi, Feature::PositionControl];
        match motor {
            2 => feature == Feature::Core,
            3 => !unusual.contains(&feature),
            _ => true,
        }
    }

    /// The written value; before a write, bits that differ from register to register.
    pub fn value(&self, motor: u8, id: u8) -> i32 {
        let pattern = u32::from(id).wrapping_mul(0x9E37_79B9) ^ u32::from(motor) << 11;
        let ty =
            RegisterId(id).shape().map_or(register::Type::U32, |shape| shape.ty(Profile::Spec));
        self.registers.get(&(motor, id)).copied().unwrap_or(ty.fit(pattern as i32))
    }

    pub fn set(&mut self, motor: u8, id: u8, value: i32) -> Result<(), ErrorCode> {
        self.log.push(format!("{motor} {id:#04x} = {value}"));
        if value == UNFIT {
            return Err(ErrorCode::WrongSet);
        }
        self.registers.insert((motor, id), value);
        Ok(())
    }

    pub fn phase(&self, motor: u8, phase: u8) -> RevupPhase {
        let pattern = i32::from(phase) * -12_345;
        let fresh = RevupPhase { speed_rpm: pattern, torque_s16a: -7, duration_ms: 0xA55A };
        self.revup.get(&(motor, phase)).copied().unwrap_or(fresh)
    }

    pub fn set_phase(&mut self, motor: u8, phase: u8, data: RevupPhase) {
        self.log.push(format!("{motor} phase {phase} = {data:?}"));
        self.revup.insert((motor, phase), data);
    }

    /// Registers of a step of the motor profiler: up to three.
    pub fn step(step: u8) -> &'static [u8] {
        &[0x66, 0x67, 0x6D][..usize::from(step % 4)]
    }

    pub fn note(&mut self, motor: u8, what: impl std::fmt::Debug) {
        self.log.push(format!("{motor} {what:?}"));
    }
}

impl MotorControl for Plant {
    fn features(&self, motor: MotorNumber) -> Features {
        let there = Feature::ALL.iter().filter(|feature| Plant::has(motor.number(), **feature));
        there.fold(Features::NONE, |set, &feature| set.with(feature))
    }
    fn version(&self) -> Version<'_> {
        Version { name: "ST MC SDK", major: 5, minor: 4, patch: 3, pre_release: "RC2" }
    }
    fn get_register(&mut self, motor: MotorNumber, register: RegisterId) -> i32 {
        self.value(motor.number(), register.0)
    }
    fn set_register(
        &mut self,
        motor: MotorNumber,
        register: RegisterId,
        value: i32,
    ) -> Result<(), ErrorCode> {
        self.set(motor.number(), register.0, value)
    }
    fn execute(&mut self, motor: MotorNumber, command: Command) {
        self.note(motor.number(), ("command", command.number()));
    }
    fn set_ramp(&mut self, motor: MotorNumber, ramp: Ramp) {
        self.note(motor.number(), ramp);
    }
    fn get_revup_data(&mut self, motor: MotorNumber, phase: u8) -> RevupPhase {
        self.phase(motor.number(), phase)
    }
    fn set_revup_data(&mut self, motor: MotorNumber, phase: u8, data: RevupPhase) {
        self.set_phase(motor.number(), phase, data);
    }
    fn set_current_reference(&mut self, motor: MotorNumber, reference: CurrentReference) {
        self.note(motor.number(), reference);
    }
    fn set_torque_ramp(&mut self, motor: MotorNumber, ramp: TorqueRamp) {
        self.note(motor.number(), ramp);
    }
    fn set_position(&mut self, motor: MotorNumber, target: PositionMove) {
        self.note(motor.number(), target);
    }
    fn profiler_step(&self, _: MotorNumber, step: u8) -> &[u8] {
        Plant::step(step)
    }
}
