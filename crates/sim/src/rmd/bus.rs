//! Motors on one bus.

use motorlink_proto::can::CanFrame;
use motorlink_proto::rmd::MotorId;
use motorlink_proto::time::Instant;

use super::{RmdConfig, RmdNode};

/// A CAN bus with RMD motors, stored in an array or a vector. A motor sends only replies, so there
/// is no polling: each call first simulates the elapsed time.
#[derive(Debug, Clone)]
pub struct RmdBus<N> {
    nodes: N,
}

impl RmdBus<[RmdNode; 4]> {
    /// The motors of [`RmdConfig::demo`].
    pub fn demo(now: Instant) -> Self {
        let nodes = RmdConfig::demo().map(|config| {
            RmdNode::new(now, config, config.factory_rom()).expect("IDs 1 to 4 exist")
        });
        RmdBus { nodes }
    }
}

impl<N: AsRef<[RmdNode]> + AsMut<[RmdNode]>> RmdBus<N> {
    /// A bus with these motors; `None` if two have the same ID.
    pub fn new(mut nodes: N) -> Option<Self> {
        nodes.as_mut().sort_unstable_by_key(RmdNode::id);
        let distinct = nodes.as_ref().is_sorted_by(|one, next| one.id() < next.id());
        distinct.then(|| RmdBus { nodes })
    }

    /// Takes a frame from the bus at `now` and passes the replies to `reply`. The lowest ID is
    /// first, as ordered by arbitration.
    pub fn receive(&mut self, now: Instant, frame: &CanFrame, mut reply: impl FnMut(CanFrame)) {
        self.advance_to(now);
        for node in self.nodes.as_mut() {
            if let Some(frame) = node.receive(now, frame) {
                reply(frame);
            }
        }
    }

    /// Simulates until `now`.
    pub fn advance_to(&mut self, now: Instant) {
        self.nodes.as_mut().iter_mut().for_each(|node| node.advance_to(now));
    }

    /// The motors, lowest ID first.
    pub const fn nodes(&self) -> &N {
        &self.nodes
    }

    /// A motor by its ID, with its drive and ROM.
    pub fn node(&self, id: MotorId) -> Option<&RmdNode> {
        self.nodes.as_ref().iter().find(|node| node.id() == id)
    }

    /// A motor by its ID, to change its environment or to cycle its power.
    pub fn node_mut(&mut self, id: MotorId) -> Option<&mut RmdNode> {
        self.nodes.as_mut().iter_mut().find(|node| node.id() == id)
    }
}
