//! An ST exchange in user space: master and slave, without a line between them.

use std::hint::black_box;

use motorlink_proto::st::{
    Command, CurrentReference, ErrorCode, Features, Master, MasterConfig, MotorControl,
    MotorNumber, Output, PositionMove, Profile, Ramp, RegisterId, Request, RevupPhase, Slave,
    TorqueRamp, Version,
};
use motorlink_proto::time::{Instant, Micros};
use motorlink_sim::st::StDrive;

use crate::kernel::Kernel;

/// Time between two exchanges, for the simulated drive.
const PERIOD: Micros = Micros(100);

/// With a drive that only stores registers, and with a simulated one.
pub fn kernels() -> [Kernel; 2] {
    let (mut master, mut slave) = (master(), slave(MotorNumber::FIRST));
    let mut memory = Memory { registers: [1_500; 256] };
    let with_memory = Kernel::new("exchange with memory", move || {
        black_box(exchange(Instant(0), &mut master, &mut slave, &mut memory).expect("a value"));
    });

    let mut simulated = StDrive::demo(Instant(0));
    simulated.execute(MotorNumber::FIRST, Command::StartMotor);
    let (mut master, mut slave) = (self::master(), self::slave(simulated.last()));
    let mut now = Instant(0);
    let with_simulation = Kernel::new("exchange with simulation", move || {
        now += PERIOD;
        simulated.advance_to(now);
        black_box(exchange(now, &mut master, &mut slave, &mut simulated).expect("a value"));
    });
    [with_memory, with_simulation]
}

/// A master on a line without former masters.
fn master() -> Master {
    let mut master = Master::new(MasterConfig::default());
    master.trust_line();
    master
}

/// A slave of a drive with motors 1 to `last`.
pub fn slave(last: MotorNumber) -> Slave {
    Slave::new(Profile::Spec, last)
}

/// Reads SPEED_MEAS.
fn exchange(
    now: Instant,
    master: &mut Master,
    slave: &mut Slave,
    drive: &mut impl MotorControl,
) -> Option<i32> {
    let register = RegisterId::SPEED_MEAS;
    master.request(1, &Request::GetRegister(register)).ok()?;
    let mut reply: &[u8] = &[];
    loop {
        match master.poll(now) {
            Output::Transmit(bytes) => {
                for &byte in bytes {
                    reply = slave.receive(now, byte, drive).unwrap_or(&[]);
                }
            }
            Output::Wait(_) => master.receive(now, reply),
            Output::Done(result) => return register.decode(Profile::Spec, result.ok()?),
        }
    }
}

/// A drive that only stores registers.
pub struct Memory {
    /// The registers by their numbers.
    pub registers: [i32; 256],
}

impl MotorControl for Memory {
    fn features(&self, _: MotorNumber) -> Features {
        Features::NONE
    }
    fn version(&self) -> Version<'_> {
        Version { name: "memory", major: 0, minor: 0, patch: 0, pre_release: "" }
    }
    fn get_register(&mut self, _: MotorNumber, register: RegisterId) -> i32 {
        self.registers[usize::from(register.0)]
    }
    fn set_register(
        &mut self,
        _: MotorNumber,
        register: RegisterId,
        value: i32,
    ) -> Result<(), ErrorCode> {
        self.registers[usize::from(register.0)] = value;
        Ok(())
    }
    fn execute(&mut self, _: MotorNumber, _: Command) {}
    fn set_ramp(&mut self, _: MotorNumber, _: Ramp) {}
    fn get_revup_data(&mut self, _: MotorNumber, _: u8) -> RevupPhase {
        RevupPhase::default()
    }
    fn set_revup_data(&mut self, _: MotorNumber, _: u8, _: RevupPhase) {}
    fn set_current_reference(&mut self, _: MotorNumber, _: CurrentReference) {}
    fn set_torque_ramp(&mut self, _: MotorNumber, _: TorqueRamp) {}
    fn set_position(&mut self, _: MotorNumber, _: PositionMove) {}
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_exchange_reads_the_register_again_and_again() {
        let (mut master, mut slave) = (master(), slave(MotorNumber::FIRST));
        let mut memory = Memory { registers: [0; 256] };
        for value in [-1, 0, 1_500] {
            memory.registers[usize::from(RegisterId::SPEED_MEAS.0)] = value;
            let read = exchange(Instant(0), &mut master, &mut slave, &mut memory);
            assert_eq!(read, Some(value));
        }
    }
}
