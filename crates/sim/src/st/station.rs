//! A drive on its serial line.

use motorlink_proto::st::{Profile, Slave};
use motorlink_proto::time::Instant;

use super::{StDrive, StMotor};

/// A slave and its drive: bytes in, bytes out.
#[derive(Debug, Clone)]
pub struct StStation<M> {
    slave: Slave,
    drive: StDrive<M>,
}

impl<M: AsRef<[StMotor]> + AsMut<[StMotor]>> StStation<M> {
    /// Connects a slave of `profile` to the drive.
    pub fn new(profile: Profile, drive: StDrive<M>) -> Self {
        StStation { slave: Slave::new(profile, drive.last()), drive }
    }

    /// Takes bytes received at `now` and passes each reply to `reply`.
    pub fn receive(&mut self, now: Instant, bytes: &[u8], mut reply: impl FnMut(&[u8])) {
        self.drive.advance_to(now);
        for &byte in bytes {
            if let Some(bytes) = self.slave.receive(now, byte, &mut self.drive) {
                reply(bytes);
            }
        }
    }

    /// Simulates until `now`, and passes on the NACK for a command that was not complete in time.
    /// Call it at [`deadline`](Self::deadline).
    pub fn poll(&mut self, now: Instant, mut reply: impl FnMut(&[u8])) {
        self.drive.advance_to(now);
        if let Some(bytes) = self.slave.poll(now) {
            reply(bytes);
        }
    }

    /// When to call [`poll`](Self::poll); `None` between commands.
    pub fn deadline(&self) -> Option<Instant> {
        self.slave.deadline()
    }

    /// Simulates until `now` without traffic on the line.
    pub fn advance_to(&mut self, now: Instant) {
        self.drive.advance_to(now);
    }

    /// The profile that the slave follows.
    pub const fn profile(&self) -> Profile {
        self.slave.profile()
    }

    /// The drive.
    pub const fn drive(&self) -> &StDrive<M> {
        &self.drive
    }

    /// The drive, to change its environment.
    pub const fn drive_mut(&mut self) -> &mut StDrive<M> {
        &mut self.drive
    }

    /// Cycles the power of slave and drive; see [`StMotor::power_cycle`].
    pub fn power_cycle(&mut self) {
        self.slave = Slave::new(self.slave.profile(), self.drive.last());
        self.drive.power_cycle();
    }
}
