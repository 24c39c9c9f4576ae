//! Drives at the far end of a line.

use motorlink_link::serve::{Station, StationLink};
use motorlink_proto::can::CanFrame;
use motorlink_proto::time::Instant;

use super::drives::Stage;

/// A link to the ST drive of a stage.
pub(super) type SimBytes = StationLink<StStage, u8>;
/// A link to the RMD motors of a stage.
pub(super) type SimCan = StationLink<RmdStage, CanFrame>;

/// An ST drive at the far end of a line.
pub(super) struct StStage(pub(super) Stage);

impl Station<u8> for StStage {
    fn receive(&mut self, now: Instant, bytes: &[u8], reply: &mut Vec<u8>) {
        if let Some(station) = &mut self.0.at(now).drives.st {
            station.receive(now, bytes, |bytes| reply.extend_from_slice(bytes));
        }
    }

    fn poll(&mut self, now: Instant, reply: &mut Vec<u8>) {
        if let Some(station) = &mut self.0.at(now).drives.st {
            station.poll(now, |bytes| reply.extend_from_slice(bytes));
        }
    }

    fn deadline(&self) -> Option<Instant> {
        self.0.last().drives.st.as_ref().and_then(|station| station.deadline())
    }
}

/// RMD motors on a bus.
pub(super) struct RmdStage(pub(super) Stage);

impl Station<CanFrame> for RmdStage {
    fn receive(&mut self, now: Instant, received: &[CanFrame], replies: &mut Vec<CanFrame>) {
        if let Some(bus) = &mut self.0.at(now).drives.rmd {
            for frame in received {
                bus.receive(now, frame, |reply| replies.push(reply));
            }
        }
    }
}
