//! A drive on its serial line.

use motorlink_proto::st::{Profile, Slave};
use motorlink_proto::time::Instant;

use super::{StDrive, StMotor};

/// A slave and the drive behind it: bytes in, bytes out.
#[derive(Debug, Clone)]
pub struct StStation<M> {
    slave: Slave,
    drive: StDrive<M>,
}

impl<M: AsRef<[StMotor]> + AsMut<[StMotor]>> StStation<M> {
    /// Puts a slave of `profile` before the drive.
    pub fn new(profile: Profile, drive: StDrive<M>) -> Self {
        StStation { slave: Slave::new(profile, drive.last()), drive }
    }

    /// Takes bytes that came at `now` and hands each reply to `reply`.
    pub fn receive(&mut self, now: Instant, bytes: &[u8], mut reply: impl FnMut(&[u8])) {
        self.drive.advance_to(now);
        for &byte in bytes {
            if let Some(bytes) = self.slave.receive(now, byte, &mut self.drive) {
                reply(bytes);
            }
        }
    }

    /// Lets time pass until `now` and hands over what a command owes that did not come whole. Call
    /// it at [`deadline`](Self::deadline).
    pub fn poll(&mut self, now: Instant, mut reply: impl FnMut(&[u8])) {
        self.drive.advance_to(now);
        if let Some(bytes) = self.slave.poll(now) {
            reply(bytes);
        }
    }

    /// When [`poll`](Self::poll) has to be called; `None` while no command is under way.
    pub fn deadline(&self) -> Option<Instant> {
        self.slave.deadline()
    }

    /// Lets time pass until `now` without a word on the line.
    pub fn advance_to(&mut self, now: Instant) {
        self.drive.advance_to(now);
    }

    /// The profile that the slave follows.
    pub const fn profile(&self) -> Profile {
        self.slave.profile()
    }

    /// The drive, to look at.
    pub const fn drive(&self) -> &StDrive<M> {
        &self.drive
    }

    /// The drive, to change the world around it.
    pub const fn drive_mut(&mut self) -> &mut StDrive<M> {
        &mut self.drive
    }

    /// Takes the power of slave and drive away and gives it back; see [`StMotor::power_cycle`].
    pub fn power_cycle(&mut self) {
        self.slave = Slave::new(self.slave.profile(), self.drive.last());
        self.drive.power_cycle();
    }
}
