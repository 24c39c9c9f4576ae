//! The drives of a scenario, on their line and their bus.

use motorlink_proto::rmd::{CanFrame, ClearErrors, Command as _, Payload, Status1};
use motorlink_proto::stmcp::{ErrorCode, Frame, HEADER_ACK, HEADER_NACK, Parse};
use motorlink_proto::time::Instant;
use motorlink_sim::rmd::RmdConfig;

use super::script::Cast;
use super::signals::{rmd_values, st_values};
use super::{Action, Target};
use crate::sim::bench::{Bus, Station};
use crate::sim::world;
use crate::sim::{Command, ConfigError};

/// What answers, and moves.
#[derive(Debug)]
pub(super) struct Drives {
    st: Option<Station>,
    rmd: Option<Bus>,
}

impl Drives {
    /// Powers the drives on at time 0.
    pub(super) fn new(cast: &Cast) -> Result<Self, ConfigError> {
        let station = || cast.config.station(Instant(0));
        let bus = || cast.config.bus(Instant(0), RmdConfig::factory_rom);
        let (st, rmd) = (cast.st.then(station).transpose()?, cast.rmd.then(bus).transpose()?);
        Ok(Drives { st, rmd })
    }

    pub(super) fn advance_to(&mut self, now: Instant) {
        if let Some(station) = &mut self.st {
            station.advance_to(now);
        }
        if let Some(bus) = &mut self.rmd {
            bus.advance_to(now);
        }
    }

    /// Values of all signals, in the order of the motors and of the tables.
    pub(super) fn values(&self) -> impl Iterator<Item = f64> {
        let st = self.st.iter().flat_map(|station| station.drive().motors());
        let rmd = self.rmd.iter().flat_map(|bus| bus.nodes());
        st.flat_map(st_values).chain(rmd.flat_map(rmd_values))
    }

    /// Does what an event says. Gives how a drive refused it, if it did.
    ///
    /// # Errors
    /// A command to the world that has no sense.
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

    /// Changes the world around a motor.
    pub(super) fn change(
        &mut self,
        now: Instant,
        target: Target,
        command: &Command,
    ) -> Result<(), String> {
        match (target, &mut self.st, &mut self.rmd) {
            (Target::St(_), Some(station), _) => world::st(station, now, command),
            (Target::Rmd(_), _, Some(bus)) => world::rmd(bus, now, command),
            _ => Err(format!("there is no {target}")),
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
        let Some((_, data)) = reply.as_ref().and_then(CanFrame::usable) else {
            return Some(SILENT.to_owned());
        };
        let clears = frame.data().first() == Some(&ClearErrors::CODE.number());
        let remain = clears && !Status1::decode(data).errors.is_empty();
        remain.then(|| ERRORS.to_owned())
    }
}

/// How a drive refuses that says nothing.
pub(super) const SILENT: &str = "silent";
/// How an RMD motor refuses that keeps errors which it was to clear.
pub(super) const ERRORS: &str = "errors";
