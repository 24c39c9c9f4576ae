//! The other nodes of the network. Each node remembers those that went away without an end, so that a
//! program that comes later knows whom it does not reach.

use std::sync::Arc;
use std::time::Duration;

use tracing::info;
use zenoh::Wait;
use zenoh::qos::{CongestionControl, Priority};
use zenoh::sample::{Sample, SampleKind};

use super::node_state::Common;
use crate::key::{self, Name};

/// How long the network may take to take the last words.
const LAST: Duration = Duration::from_secs(1);

/// Watches them from now on.
pub(super) fn follow(common: &Arc<Common>) -> zenoh::Result<()> {
    let (zenoh, follower) = (&common.zenoh, Arc::clone(common));
    let ended = move |sample: Sample| {
        if let Some(run) = key::run_of(sample.key_expr().as_str()) {
            follower.members.lock().ended(run);
        }
    };
    let any = key::ended(&Name::any(), &Name::any());
    zenoh.declare_subscriber(any).callback(ended).background().wait()?;
    let follower = Arc::clone(common);
    let seen = move |sample: Sample| {
        let run = key::run_of(sample.key_expr().as_str());
        let Some(run) = run.filter(|(_, boot)| *boot != follower.boot) else { return };
        info!(node = %run.0, is_here = sample.kind() == SampleKind::Put, "another node");
        match sample.kind() {
            SampleKind::Put => follower.members.lock().came(run),
            SampleKind::Delete => follower.members.lock().went(run, follower.clock.now()),
        }
    };
    let alive = zenoh.liveliness().declare_subscriber(key::all_alive());
    alive.history(true).callback(seen).background().wait()
}

/// Says that this node ends. It has been sent when this returns, if the network is there.
pub(super) fn say_end(common: &Common) {
    let said = common
        .zenoh
        .put(key::ended(&common.name, &common.boot), "")
        .congestion_control(CongestionControl::Drop)
        .priority(Priority::RealTime)
        .wait();
    if said.is_ok() {
        // The answer comes behind it.
        let own = common.zenoh.liveliness().get(key::alive_of(&common.name)).timeout(LAST).wait();
        let _ = own.map(|answers| answers.recv());
    }
}
