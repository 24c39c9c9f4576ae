//! One motor of a drive.

use std::sync::Arc;

use motorlink_proto::st::register::{Readable, Register, Value, Writable};
use motorlink_proto::st::{
    Command, CurrentReference, Flags, MotorNumber, PositionMove, Ramp, Reading, RegisterId,
    Request, RevupPhase, Starting, Status, TorqueRamp, VerifiedWrite, register, segment_values,
};

use super::{Client, Error, Target};

/// One motor of a drive. Every call is one exchange; its errors are those of
/// [`Client::exchange`].
#[derive(Clone, Copy)]
pub struct Motor<'a> {
    client: &'a Client,
    motor: MotorNumber,
}

impl Client {
    /// A motor of the drive, 1 to 7.
    pub fn motor(&self, number: u8) -> Result<Motor<'_>, Error> {
        let motor = MotorNumber::new(number).ok_or(Error::NoSuchMotor(number))?;
        Ok(Motor { client: self, motor })
    }
}

/// A method for each command of table 4.
macro_rules! commands {
    ($( $method:ident $command:ident, )+) => {$(
        #[doc = concat!("[`execute`](Self::execute)s [`Command::", stringify!($command), "`].")]
        pub fn $method(&self) -> Result<(), Error> {
            self.execute(Command::$command)
        }
    )+};
}

impl Motor<'_> {
    pub(crate) fn client(&self) -> &Client {
        self.client
    }

    /// The motor's number.
    pub fn number(&self) -> MotorNumber {
        self.motor
    }

    /// Reads a register (4.5), in the unit of table 3.
    ///
    /// # Errors
    /// [`Error::Implausible`] if the value is possible in the other profile only.
    /// [`get_raw`](Self::get_raw) returns its digits. Those of [`Client::exchange`].
    pub fn get<T: Value>(&self, register: Register<T, impl Readable>) -> Result<T, Error> {
        let bits = self.get_raw(register.id())?;
        self.reading(register.id(), bits).map(|reading| T::from_bits(reading.bits))
    }

    /// The value of raw digits, as [`get_raw`](Self::get_raw) and [`segment`](Self::segment) return
    /// them. Sends nothing.
    ///
    /// # Errors
    /// [`Error::Implausible`] if the value is possible in the other profile only.
    pub fn reading(&self, register: RegisterId, bits: i32) -> Result<Reading, Error> {
        let reading = Reading { register, bits, profile: self.client.profile() };
        reading.plausible().map_err(|why| Error::Implausible {
            port: Arc::clone(self.client.port()),
            motor: Target(self.motor.number()),
            why,
        })
    }

    /// Writes a register (4.4), in the unit of table 3.
    pub fn set<T: Value>(
        &self,
        register: Register<T, impl Writable>,
        value: T,
    ) -> Result<(), Error> {
        let size = register.id().write_size(self.client.profile());
        self.set_raw(register.id(), value.bits(), size)
    }

    /// Reads the raw digits of any register, known or not. The value's size is the reply's, its sign
    /// that of the register's type in the client's profile. Whether the profile may be right is not
    /// checked: see [`reading`](Self::reading).
    pub fn get_raw(&self, register: RegisterId) -> Result<i32, Error> {
        let profile = self.client.profile();
        self.ask(&Request::GetRegister(register), |payload| register.decode(profile, payload))
    }

    /// Writes the low `size` bytes (at most 4) of `value` to any register.
    pub fn set_raw(&self, register: RegisterId, value: i32, size: u8) -> Result<(), Error> {
        let bytes = value.to_le_bytes();
        let value = &bytes[..usize::from(size.min(4))];
        self.tell(&Request::SetRegister { register, value })
    }

    /// Writes a register, reads it back, and repeats both until it has the value, at most `attempts`
    /// times ([`VERIFY_ATTEMPTS`](super::VERIFY_ATTEMPTS) is a good number); gives the number of the
    /// attempt that did it. What the drive's profile rounds is compared rounded.
    ///
    /// # Errors
    /// [`Error::NotVerifiable`] for a register that cannot be read back, or whose write makes the
    /// motor do something; nothing is sent then. [`Error::Differs`]. Those of [`Client::exchange`],
    /// which say nothing about the register.
    pub fn set_verified<T: Value>(
        &self,
        register: Register<T, impl Readable + Writable>,
        value: T,
        attempts: u8,
    ) -> Result<u8, Error> {
        self.set_raw_verified(register.id(), value.bits(), attempts)
    }

    /// As [`set_verified`](Self::set_verified), for any register.
    pub fn set_raw_verified(
        &self,
        register: RegisterId,
        value: i32,
        attempts: u8,
    ) -> Result<u8, Error> {
        let exchange = |request: &Request<'_>| match request {
            Request::GetRegister(_) => self.get_raw(register).map(Some),
            _ => self.tell(request).map(|()| None),
        };
        VerifiedWrite::new(self.client.profile(), register, value)
            .and_then(|write| write.run(attempts, exchange, |error| !error.is_line_failure()))
            .map_err(|why| {
                Error::unverified(self.motor, register, why).unwrap_or_else(|exchange| exchange)
            })
    }

    /// The state of its state machine.
    pub fn status(&self) -> Result<Status, Error> {
        self.get(register::STATUS).map(Status::from)
    }

    /// Its faults.
    pub fn flags(&self) -> Result<Flags, Error> {
        self.get(register::FLAGS).map(Flags)
    }

    /// Executes a command (4.6). An acknowledge does not say that it had an effect: a START_MOTOR
    /// with a fault pending has none ([`start`](Self::start) detects this).
    pub fn execute(&self, command: Command) -> Result<(), Error> {
        self.tell(&Request::ExecuteCommand(command))
    }

    /// Starts the motor, then reads its state: a drive also acknowledges a START_MOTOR that has no
    /// effect. Returns the state.
    ///
    /// # Errors
    /// [`Error::NotStarted`] if a fault is pending or the motor is still stopping. Those of
    /// [`Client::exchange`]: the motor may have started.
    pub fn start(&self) -> Result<Status, Error> {
        let mut starting = Starting::default();
        loop {
            let bits = match starting.request() {
                Request::GetRegister(register) => self.get_raw(register)?,
                command => self.tell(&command).map(|()| 0)?,
            };
            if let Some(started) = starting.replied(bits) {
                return started
                    .map_err(|why| Error::NotStarted { motor: Target(self.motor.number()), why });
            }
        }
    }

    commands! {
        stop StopMotor, stop_ramp StopRamp, start_stop StartStop, fault_ack FaultAck,
        encoder_align EncoderAlign, iqdref_clear IqdrefClear, pfc_enable PfcEnable,
        pfc_disable PfcDisable, pfc_fault_ack PfcFaultAck,
    }

    /// Goes to a speed: at once in RUN, else when RUN is reached (4.8).
    pub fn set_ramp(&self, ramp: Ramp) -> Result<(), Error> {
        self.tell(&Request::SetRamp(ramp))
    }

    /// Sets the current references (4.11).
    pub fn set_current_reference(&self, reference: CurrentReference) -> Result<(), Error> {
        self.tell(&Request::SetCurrentReference(reference))
    }

    /// Goes to an Iq (profile `mcsdk-5.4` only).
    pub fn set_torque_ramp(&self, ramp: TorqueRamp) -> Result<(), Error> {
        self.tell(&Request::SetTorqueRamp(ramp))
    }

    /// Turns to an angle (profile `mcsdk-5.4` with position control only).
    pub fn set_position(&self, target: PositionMove) -> Result<(), Error> {
        self.tell(&Request::SetPosition(target))
    }

    /// A rev-up phase, 0 to 4 (4.9).
    pub fn revup_data(&self, phase: u8) -> Result<RevupPhase, Error> {
        self.ask(&Request::GetRevupData(phase), RevupPhase::decode)
    }

    /// Sets a rev-up phase, 0 to 4 (4.10).
    pub fn set_revup_data(&self, phase: u8, data: RevupPhase) -> Result<(), Error> {
        self.tell(&Request::SetRevupData(phase, data))
    }

    /// Chooses the registers of a data segment, 0 to 3, at most 32 of them (profile `spec` only).
    pub fn configure_segment(&self, segment: u8, registers: &[RegisterId]) -> Result<(), Error> {
        let mut ids = [0; 127];
        let count = registers.len().min(ids.len());
        ids.iter_mut().zip(registers).for_each(|(slot, register)| *slot = register.0);
        self.tell(&Request::ConfigureSegment { segment, registers: &ids[..count] })
    }

    /// Samples a data segment in one exchange. `registers` are those that it was configured with;
    /// `values` receives their raw digits, in this order, as many as fit
    /// ([`reading`](Self::reading) converts them).
    pub fn segment(
        &self,
        segment: u8,
        registers: &[RegisterId],
        values: &mut [i32],
    ) -> Result<(), Error> {
        self.ask(&Request::GetSegment(segment), |payload| {
            let read = segment_values(registers, payload)?;
            values.iter_mut().zip(read).for_each(|(value, bits)| *value = bits);
            Some(())
        })
    }

    fn ask<T>(
        &self,
        request: &Request<'_>,
        reply: impl FnOnce(&[u8]) -> Option<T>,
    ) -> Result<T, Error> {
        self.client.exchange(self.motor.number(), request, reply)
    }

    fn tell(&self, request: &Request<'_>) -> Result<(), Error> {
        self.ask(request, |_| Some(()))
    }
}
