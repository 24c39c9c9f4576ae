//! Executes the events of a scenario.

use motorlink_proto::can::CanFrame;
use motorlink_proto::rmd::{ClearErrors, Command as _, Payload, Status};
use motorlink_proto::st::{ErrorCode, Frame, HEADER_ACK, HEADER_NACK, Parse};
use motorlink_proto::time::Instant;

use super::event::Action;
use crate::cast::Target;
use crate::command::Command;
use crate::drives::Drives;

impl Drives {
    /// Executes an event. Returns how the drive refused it, `None` if it did not.
    ///
    /// # Errors
    /// An impossible command to the surroundings.
    pub(super) fn act(
        &mut self,
        now: Instant,
        target: Target,
        action: &Action,
    ) -> Result<Option<String>, String> {
        match action {
            Action::World(command) => self.change(now, target, command).map(|()| None),
            Action::Bytes(bytes) => Ok(self.send_bytes(now, bytes)),
            Action::Frame(frame) => Ok(self.send_frame(now, frame)),
        }
    }

    /// Executes a command on a motor's surroundings.
    pub(super) fn change(
        &mut self,
        now: Instant,
        target: Target,
        command: &Command,
    ) -> Result<(), String> {
        match target {
            Target::St(_) => self.change_st(now, command),
            Target::Rmd(_) => self.change_rmd(now, command),
        }
    }

    fn send_bytes(&mut self, now: Instant, bytes: &[u8]) -> Option<String> {
        let mut reply = Vec::new();
        self.st.as_mut()?.receive(now, bytes, |bytes| reply.extend_from_slice(bytes));
        match Frame::parse(&reply) {
            Parse::Frame(Frame { header: HEADER_ACK, .. }, _) => None,
            Parse::Frame(Frame { header: HEADER_NACK, payload: [code, ..] }, _) => {
                Some(ErrorCode::from(*code).to_string())
            }
            _ => Some(SILENT.to_owned()),
        }
    }

    fn send_frame(&mut self, now: Instant, frame: &CanFrame) -> Option<String> {
        let mut reply = None;
        self.rmd.as_mut()?.receive(now, frame, |frame| reply = Some(frame));
        let Some((_, data)) = reply.as_ref().and_then(CanFrame::eight_bytes) else {
            return Some(SILENT.to_owned());
        };
        let clears = frame.data().first() == Some(&ClearErrors::CODE.number());
        let remain = clears && !Status::decode(data).errors.is_empty();
        remain.then(|| ERRORS.to_owned())
    }
}

/// Refusal: no reply.
pub(super) const SILENT: &str = "silent";
/// Refusal of `clear-errors` by an RMD motor: errors remain.
pub(super) const ERRORS: &str = "errors";
