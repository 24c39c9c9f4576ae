//! The services of a node: `std_srvs/srv/Trigger`.

use std::collections::BTreeSet;
use std::sync::Arc;

use motorlink_recording::schema::Message as _;
use motorlink_telemetry::share::drive_protocol::DriveProtocol;
use motorlink_telemetry::share::motor_exchange::Target;
use zenoh::query::Query;
use zenoh::{Session as Zenoh, Wait};

use super::bridge::Shared;
use super::motor_client::{self, MotorClient};
use super::rmw_zenoh::{Attachment, Endpoint};
use super::trigger_type::TriggerResponse;

/// What a service does.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Service {
    /// Stops all motors of the node.
    StopAll,
    /// Acknowledges the faults of all motors that have answered.
    ClearFaults,
}

impl Service {
    /// All of them.
    pub const ALL: [Self; 2] = [Service::StopAll, Service::ClearFaults];

    /// The end of its name.
    pub const fn name(self) -> &'static str {
        match self {
            Service::StopAll => "stop_all",
            Service::ClearFaults => "clear_faults",
        }
    }

    /// Answers requests from now on.
    ///
    /// # Errors
    /// The network.
    pub fn open(
        self,
        shared: &Arc<Shared>,
        zenoh: &Zenoh,
        endpoint: &Endpoint,
    ) -> zenoh::Result<()> {
        let shared = Arc::clone(shared);
        let runtime = tokio::runtime::Handle::current();
        let answers = move |query: Query| {
            let shared = Arc::clone(&shared);
            runtime.spawn(async move {
                let response = self.answer(&shared).await;
                // The response has the number and the sender of its request.
                let sent_ns = (shared.clock.wall() * 1e9) as i64;
                let request = query.attachment().map(|it| it.to_bytes());
                let request = request.and_then(|it| Attachment::decode(&it)).unwrap_or_default();
                let attachment = Attachment { sent_ns, ..request }.encode();
                let reply = query.reply(query.key_expr().clone(), response.encode());
                // Who has asked may be gone.
                let _ = reply.attachment(attachment).wait();
            });
        };
        zenoh.declare_queryable(&endpoint.key).complete(true).callback(answers).background().wait()
    }

    async fn answer(self, shared: &Arc<Shared>) -> TriggerResponse {
        let failures = match self {
            Service::StopAll => stop_all(shared).await,
            Service::ClearFaults => clear_faults(shared).await,
        };
        let success = failures.is_empty();
        let message = if success { "all motors confirmed".to_owned() } else { failures.join("; ") };
        TriggerResponse { success, message }
    }
}

async fn stop_all(shared: &Arc<Shared>) -> Vec<String> {
    // CommandArbiter that come now must not turn them again.
    shared.with(|machine, now| machine.commands.block_all(now, "stop_all was called"));
    match motor_client::stop_all(&shared.program).await {
        Ok(motors) => motors
            .into_iter()
            .filter(|motor| !motor.absent)
            .filter_map(|it| {
                Some(format!("{}, motor {}: {}", it.motor.line, it.motor.motor, it.failure?))
            })
            .collect(),
        Err(refusal) => vec![refusal.message],
    }
}

async fn clear_faults(shared: &Arc<Shared>) -> Vec<String> {
    let motors = shared.with(|machine, _| {
        let of_lines = machine.lines.iter().flat_map(|line| {
            let speaks = DriveProtocol::of(line);
            let motors =
                line.heard.iter().filter_map(move |it| Some((speaks?, speaks?.motor(*it)?)));
            motors.map(|(speaks, motor)| (line.line.clone(), speaks, motor))
        });
        let of_joints =
            machine.joints.iter().map(|joint| (joint.line.clone(), joint.speaks, joint.motor));
        of_lines.chain(of_joints).collect::<Vec<_>>()
    });
    let (mut known, mut failures) = (BTreeSet::new(), Vec::new());
    for (line, speaks, motor) in motors {
        if !known.insert((line.clone(), motor.number())) {
            continue;
        }
        let place = format!("{line}, motor {}", motor.number());
        let target = Target::of(&line, motor, speaks);
        let motor = MotorClient { program: shared.program.clone(), target };
        match motor.clear_faults().await {
            Ok(None) => {}
            Ok(Some(left)) => failures.push(format!("{place}: {left}")),
            Err(refusal) => failures.push(format!("{place}: {}", refusal.message)),
        }
    }
    failures
}
