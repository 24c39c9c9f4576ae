//! The tasks of a node for ROS 2, and what they share.

use std::collections::BTreeSet;
use std::sync::Arc;
use std::time::Duration;

use motorlink_recording::schema::{Message, Time};
use motorlink_telemetry::overview::Overview;
use motorlink_telemetry::share::client::{Listener, Program};
use motorlink_telemetry::share::data::Data;
use motorlink_telemetry::share::frame::{Frame, FrameKind};
use motorlink_telemetry::share::message::{
    Answer, Ask, DropRule, Event, EventKind, SignalName, Text, decode,
};
use motorlink_telemetry::share::motor_exchange::Target;
use motorlink_telemetry::signal::Signal;
use parking_lot::Mutex;
use tokio::runtime::Handle;
use tokio::sync::{Notify, watch};
use tokio::time::{MissedTickBehavior, interval, sleep};
use zenoh::qos::CongestionControl;
use zenoh::sample::Sample;
use zenoh::{Session as Zenoh, Wait};

use super::command_arbiter::{Order, Output};
use super::joint::Joint;
use super::machine::Machine;
use super::motion_executor::{Failed, MotionExecutor};
use super::motor_client::MotorClient;
use super::rmw_zenoh::{Attachment, Endpoint};
use crate::clock::Clock;

/// How often diagnostics are published.
const DIAGNOSTICS: Duration = Duration::from_secs(1);
/// The longest time without a look at the commands.
const IDLE: Duration = Duration::from_secs(60);
/// Rows of a motor that wait.
const QUEUE: u32 = 100;

/// What all tasks have.
pub struct Shared {
    pub(super) node: String,
    pub(super) program: Program,
    pub(super) clock: Arc<dyn Clock>,
    zenoh: Zenoh,
    machine: Mutex<Machine>,
    /// The commands have changed.
    wake: Notify,
    runtime: Handle,
    /// The motors of the joints that commands can have, and the last command of each.
    motors: Vec<(MotorClient, watch::Sender<Option<Order>>)>,
}

impl Shared {
    /// Takes commands of the joints of a machine from now on.
    pub fn new(
        node: String,
        program: Program,
        clock: Arc<dyn Clock>,
        zenoh: Zenoh,
        machine: Machine,
    ) -> Arc<Self> {
        let mut orders = Vec::new();
        let motor = |joint: &Joint| {
            let target = Target::of(&joint.line, joint.motor, joint.speaks);
            let (sender, receiver) = watch::channel(None);
            orders.push(receiver);
            (MotorClient { program: program.clone(), target }, sender)
        };
        let motors = machine.commands.joints().map(motor).collect();
        let (machine, wake, runtime) = (Mutex::new(machine), Notify::new(), Handle::current());
        let shared = Shared { node, program, clock, zenoh, machine, wake, runtime, motors };
        let shared = Arc::new(shared);
        for ((number, (motor, _)), orders) in shared.motors.iter().enumerate().zip(orders) {
            let mover = MotionExecutor::new(motor.clone(), Arc::clone(&shared.clock));
            let (asked, failing) = (Arc::clone(&shared), Arc::clone(&shared));
            let goes_on = move |order: Order| {
                asked.with(|machine, _| machine.commands.goes_on(number, order.motion))
            };
            let failed = move |order: Order, Failed { why, stops }| {
                failing.with(|machine, now| {
                    machine.commands.failed(now, number, order.motion, why, stops);
                });
            };
            tokio::spawn(mover.follow(orders, goes_on, failed));
        }
        shared
    }

    /// Does something with the machine, and what follows from it. Gives what that gives.
    pub fn with<T>(self: &Arc<Self>, act: impl FnOnce(&mut Machine, f64) -> T) -> T {
        let mut machine = self.machine.lock();
        let result = act(&mut machine, self.clock.now());
        while let Some(output) = machine.commands.next() {
            match output {
                Output::Send(order) => {
                    self.motors[order.joint].1.send_replace(Some(order));
                }
                Output::Stop(joint) => self.stop(joint),
            }
        }
        self.wake.notify_one();
        result
    }

    fn stop(self: &Arc<Self>, joint: usize) {
        let shared = Arc::clone(self);
        self.runtime.spawn(async move {
            let failure = shared.motors[joint].0.stop().await;
            shared.with(|machine, now| machine.commands.stopped(now, joint, failure));
        });
    }

    /// Takes a sample of commands.
    pub fn receive(self: &Arc<Self>, sample: &Sample) {
        let attachment = sample.attachment().map(|it| it.to_bytes());
        let payload = sample.payload().to_bytes();
        self.with(|machine, now| {
            let Machine { commands, readings, .. } = machine;
            commands.receive(now, attachment.as_deref(), &payload, readings);
        });
    }

    /// Stops the motors for which no command comes.
    pub async fn stop_in_time(self: Arc<Self>) {
        loop {
            let wake = self.machine.lock().commands.wake();
            let left = wake.map_or(IDLE.as_secs_f64(), |at| at - self.clock.now());
            match Duration::try_from_secs_f64(left) {
                Ok(left) if !left.is_zero() => tokio::select! {
                    () = sleep(left) => {}
                    () = self.wake.notified() => continue,
                },
                _ => {}
            }
            self.with(|machine, now| machine.commands.tick(now));
        }
    }

    /// Takes what the share says.
    pub async fn listen(self: Arc<Self>, mut listener: Listener) {
        while let Ok(Frame { kind, payload }) = listener.next().await {
            match kind {
                FrameKind::Text => match decode(&payload) {
                    Ok(Text::Group(group)) => {
                        self.with(|machine, _| machine.readings.describe(group));
                    }
                    Ok(Text::Event(Event {
                        line: Some(line),
                        motor: Some(motor),
                        since,
                        event,
                        by,
                        ..
                    })) => {
                        self.with(|machine, now| {
                            if let Some(since) = since {
                                machine.readings.doubt(&line, motor, since);
                            }
                            if let (EventKind::Stopping, Some(by)) =
                                (event, by.filter(|it| it != NAME))
                            {
                                machine.stopped_by(now, &line, motor, &by);
                            }
                        });
                    }
                    _ => {}
                },
                FrameKind::Data => {
                    if let Ok(data) = Data::decode(&payload) {
                        self.with(|machine, now| machine.take(now, &data));
                    }
                }
            }
        }
    }

    /// Publishes the state of the joints again and again.
    pub async fn tell_states(self: Arc<Self>, topic: Endpoint, period: Duration) {
        let mut publisher = Publisher::new(&self.zenoh, topic);
        let mut last = Time::default();
        let mut ticks = interval(period);
        ticks.set_missed_tick_behavior(MissedTickBehavior::Delay);
        loop {
            ticks.tick().await;
            let state = self.with(|machine, now| machine.joint_state(now));
            // Programs complain about a state that comes twice.
            if let Some(state) = state.filter(|it| it.stamp != last) {
                last = state.stamp;
                publisher.put(&state, self.clock.wall());
            }
        }
    }

    /// Publishes diagnostics, and learns which motors answer.
    pub async fn tell_diagnostics(self: Arc<Self>, topic: Endpoint, period: Duration) {
        let mut publisher = Publisher::new(&self.zenoh, topic);
        let mut ticks = interval(DIAGNOSTICS);
        ticks.set_missed_tick_behavior(MissedTickBehavior::Delay);
        let mut subscribed = BTreeSet::new();
        loop {
            ticks.tick().await;
            // The share ends with the node.
            let Ok(Answer::Lines { lines, latched_by }) = self.program.ask(Ask::Lines).await else {
                return;
            };
            let joints = self.with(|machine, _| {
                machine.learn(lines, latched_by);
                machine.joints.clone()
            });
            for joint in joints {
                if subscribed.insert((joint.line.clone(), joint.motor.number())) {
                    self.subscribe(&joint, period).await;
                }
            }
            let wall = self.clock.wall();
            let diagnostics = self.with(|machine, now| machine.diagnostics(&self.node, now, wall));
            publisher.put(&diagnostics, wall);
        }
    }

    /// Subscribes to the main values of the motor of a joint.
    async fn subscribe(&self, joint: &Joint, period: Duration) {
        let motor = joint.motor;
        let main = Overview::of(motor);
        let sources = main.fast().chain(main.angle);
        let signals = sources.map(|source| SignalName::of(&joint.line, Signal { motor, source }));
        let signals = signals.collect();
        let (queue, drop, period) = (QUEUE, DropRule::Oldest, period.as_secs_f64());
        // Diagnostics say that there are no values.
        let _ =
            self.program.ask(Ask::Subscribe { signals, period, queue, drop, rows: false }).await;
    }
}

/// The name of this program at its share.
pub(super) const NAME: &str = "ros2";

/// A topic that is published.
struct Publisher<'a> {
    zenoh: &'a Zenoh,
    topic: Endpoint,
    sequence: i64,
}

impl<'a> Publisher<'a> {
    fn new(zenoh: &'a Zenoh, topic: Endpoint) -> Self {
        Publisher { zenoh, topic, sequence: 0 }
    }

    /// Publishes a message. If the network does not take it, nothing waits.
    fn put(&mut self, message: &impl Message, wall: f64) {
        self.sequence += 1;
        let sequence = self.sequence;
        let attachment = Attachment { sequence, sent_ns: (wall * 1e9) as i64, gid: self.topic.gid };
        let _ = self
            .zenoh
            .put(&self.topic.key, message.encode())
            .attachment(attachment.encode())
            .congestion_control(CongestionControl::Drop)
            .wait();
    }
}
