//! The bus of RMD motors at a share, as frames.

use std::cell::Cell;
use std::os::fd::BorrowedFd;
use std::time::{Duration, Instant};

use litemap::LiteMap as Map;
use motorlink::port::{CanLink, Evented, Link, PortError};
use motorlink_proto::can::CanFrame;
use motorlink_proto::rmd::{
    Command, MotorId, MotorSet, Payload, SetTorque, SetTorque4, TORQUE4_ID,
};

use super::connection::Connection;
use super::line_address::LineAddress;
use crate::share::client_codec::{Ended, Refusal};
use crate::share::message::{Answer, Ask};

/// Turns the frames of a host into commands, and their answers into replies.
pub(super) struct ShareBus {
    port: LineAddress,
    connection: Connection,
    /// The last request to each motor.
    pending: Map<MotorId, Pending>,
    /// Motors whose next request is a confirmation.
    confirms: Cell<MotorSet>,
}

/// A request to a motor.
struct Pending {
    command: u32,
    /// The confirmation before it, until it is answered.
    confirmation: Option<u32>,
}

impl ShareBus {
    pub(super) fn open(place: &LineAddress) -> Result<Self, PortError> {
        Ok(ShareBus {
            port: place.clone(),
            connection: Connection::open(place)?,
            pending: Map::new(),
            confirms: Cell::new(MotorSet::EMPTY),
        })
    }

    /// Sends a request. The answer to the one before it is not awaited any more.
    fn request(&mut self, id: MotorId, bytes: [u8; 8]) -> Result<(), PortError> {
        self.pending.remove(&id);
        let (line, motor) = (self.port.line.clone(), id.number());
        let confirms = self.confirms.get();
        self.confirms.set(confirms.without(id.into()));
        let confirmation = match confirms.contains(id) {
            true => Some(self.connection.ask(Ask::Confirm { line, motor })?),
            false => None,
        };
        let command = self.connection.command(motor, bytes.to_vec())?;
        self.pending.insert(id, Pending { command, confirmation });
        Ok(())
    }

    /// The reply in the answer to a request.
    fn ended(&mut self, Ended { id, result }: Ended) -> Result<Option<CanFrame>, PortError> {
        let is_meant =
            |pending: &Pending| pending.command == id || pending.confirmation == Some(id);
        let motor = self.pending.iter().find(|(_, pending)| is_meant(pending));
        let Some(motor) = motor.map(|(motor, _)| *motor) else { return Ok(None) };
        match result {
            Ok(Answer::Command { bytes }) => {
                self.pending.remove(&motor);
                let bytes = <[u8; 8]>::try_from(bytes).ok();
                Ok(bytes.map(|bytes| CanFrame::new(motor.can_id(), bytes)))
            }
            Ok(_) => Ok(None),
            Err(refusal) => {
                self.pending.remove(&motor);
                Err(self.port.not_done(motor.number(), refusal))
            }
        }
    }
}

impl Link for ShareBus {
    fn within(&self) -> Option<&dyn Link> {
        Some(&self.connection)
    }

    fn confirm_next(&self, motor: u8) {
        let motor = MotorId::new(motor).map_or(MotorSet::EMPTY, MotorSet::from);
        self.confirms.set(self.confirms.get().union(motor));
    }
}

impl CanLink for ShareBus {
    fn send(&mut self, frame: &CanFrame) -> Result<(), PortError> {
        match (frame.eight_bytes(), MotorId::from_can_id(frame.id())) {
            // Each motor executes and answers it like the command for one motor.
            (Some((TORQUE4_ID, data)), _) => {
                let torques = SetTorque4::decode(data);
                MotorSet::TORQUE4.into_iter().try_for_each(|id| {
                    let Some(iq) = torques.of(id) else { return Ok(()) };
                    self.request(id, SetTorque { iq }.encode())
                })
            }
            (Some((_, data)), Some(id)) => self.request(id, *data),
            _ => {
                let message = format!("a share does not send the frame {:#x}", frame.id());
                let refusal = Refusal::usage(message);
                Err(self.port.not_done(0, refusal))
            }
        }
    }

    fn receive(&mut self, timeout: Option<Duration>) -> Result<Option<CanFrame>, PortError> {
        let deadline = timeout.and_then(|timeout| Instant::now().checked_add(timeout));
        loop {
            let left = deadline.map(|at| at.saturating_duration_since(Instant::now()));
            let Some(ended) = self.connection.receive(left)? else { return Ok(None) };
            if let Some(frame) = self.ended(ended)? {
                return Ok(Some(frame));
            }
        }
    }
}

impl Evented for ShareBus {
    fn descriptor(&self) -> Option<BorrowedFd<'_>> {
        Some(self.connection.descriptor())
    }

    fn flush(&mut self) -> Result<bool, PortError> {
        Ok(false)
    }
}
