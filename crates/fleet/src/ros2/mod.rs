//! A node for ROS 2 machines whose middleware is `rmw_zenoh`, without any ROS here: it publishes joint states
//! and diagnostics, obeys joint commands, and has two services.

mod bridge;
mod command_arbiter;
mod joint;
mod machine;
mod motion_executor;
mod motor_client;
mod rmw_zenoh;
mod service;
mod staleness;
mod state_messages;
mod trigger_type;
mod value_cache;

use std::io;
use std::sync::Arc;
use std::time::Duration;

use motorlink_telemetry::share::address::Address;
use motorlink_telemetry::share::client::Program;
use tokio::time::timeout;
use zenoh::liveliness::LivelinessToken;
use zenoh::{Session as Zenoh, Wait};

use crate::clock::Clock;
use bridge::{NAME, Shared};
use command_arbiter::{CommandArbiter, Rules};
use machine::Machine;
use rmw_zenoh::{DIAGNOSTIC_ARRAY, Endpoint, EndpointKind, Graph, JOINT_STATE, TRIGGER};
use service::Service;
use value_cache::ValueCache;

pub use joint::Settings;

/// The longest time until the share says which lines it has.
const LINES: Duration = Duration::from_secs(5);
/// Values that are older than this are none, in seconds; those of a slow rate, after some periods.
const FRESH: f64 = 0.5;
const FRESH_PERIODS: f64 = 5.0;
/// Samples that wait at a subscriber of a topic, and commands that wait here.
const DEPTH: u32 = 10;
const COMMAND_DEPTH: u32 = 1;

/// A node as ROS 2 machines see it. When it is dropped, they see it no longer.
pub struct Ros2 {
    /// The domain.
    pub domain: u32,
    /// The topics that it publishes.
    pub publishes: Vec<String>,
    /// The topics that it obeys: none without joints that have a command.
    pub obeys: Vec<String>,
    /// The services.
    pub services: Vec<String>,
    /// The joints of the file.
    pub joints: Vec<String>,
    _tokens: Vec<LivelinessToken>,
}

/// Why a node does not speak to ROS 2 machines.
#[derive(Debug, thiserror::Error)]
pub enum StartError {
    /// A joint of the file is not possible.
    #[error("{0}")]
    Joint(String),
    /// The share or the network.
    #[error("ROS 2: {0}")]
    Failed(#[from] io::Error),
}

impl Ros2 {
    /// Begins, as a program at the share of the node.
    ///
    /// # Errors
    /// The share, the network, or a joint whose motor the lines do not have.
    pub async fn start(
        settings: &Settings,
        node: &str,
        share: &Arc<dyn Address>,
        clock: Arc<dyn Clock>,
        zenoh: &Zenoh,
    ) -> Result<Self, StartError> {
        let (program, mut listener, _) = Program::connect(share, NAME).await?;
        let (lines, _) = timeout(LINES, program.lines(&mut listener))
            .await
            .map_err(|_| io::Error::from(io::ErrorKind::TimedOut))??;
        let joints = settings.joint.iter().map(|joint| joint.find(&lines));
        let joints = joints.collect::<Result<Vec<_>, _>>().map_err(StartError::Joint)?;
        let has_commands = joints.iter().any(|joint| joint.command.is_some());
        let names = joints.iter().map(|joint| joint.name.clone()).collect();
        let fresh = FRESH.max(FRESH_PERIODS / settings.rate_hz);
        let rules = Rules {
            time_to_live: settings.time_to_live_seconds,
            start_within: settings.start_within_rad,
            fresh,
        };
        let machine = Machine {
            takes_all: joints.is_empty(),
            commands: CommandArbiter::new(&joints, rules),
            joints,
            fresh,
            readings: ValueCache::default(),
            lines,
            latched_by: None,
        };
        let shared = Shared::new(node.to_owned(), program, clock, zenoh.clone(), machine);
        tokio::spawn(Arc::clone(&shared).listen(listener));
        tokio::spawn(Arc::clone(&shared).stop_in_time());

        let legal = rmw_zenoh::legal(node);
        let base = settings.namespace.clone().unwrap_or_else(|| legal.clone());
        let graph = Graph::new(settings.domain, zenoh.zid().to_string(), legal);
        let mut numbers = 1..;
        let mut endpoint = |kind, name: String, ty, depth| {
            let number = numbers.next().unwrap_or_default();
            graph.endpoint(number, kind, &name, ty, depth)
        };
        let (kind, name) = (EndpointKind::Publisher, format!("/{base}/joint_states"));
        let states = endpoint(kind, name, JOINT_STATE, DEPTH);
        let diagnostics = endpoint(kind, "/diagnostics".to_owned(), DIAGNOSTIC_ARRAY, DEPTH);
        let period = Duration::from_secs_f64(settings.rate_hz.recip());
        tokio::spawn(Arc::clone(&shared).tell_states(states.clone(), period));
        tokio::spawn(Arc::clone(&shared).tell_diagnostics(diagnostics.clone(), period));
        let publishes = vec![states, diagnostics];

        let mut obeys = Vec::new();
        if has_commands {
            let (kind, name) = (EndpointKind::Subscription, format!("/{base}/joint_commands"));
            let commands = endpoint(kind, name, JOINT_STATE, COMMAND_DEPTH);
            let shared = Arc::clone(&shared);
            let taken = move |sample| shared.receive(&sample);
            let declared = zenoh.declare_subscriber(&commands.key).callback(taken).background();
            declared.wait().map_err(io::Error::other)?;
            obeys.push(commands);
        }
        let mut services = Vec::new();
        for service in Service::ALL {
            let name = format!("/{base}/{}", service.name());
            let endpoint = endpoint(EndpointKind::Service, name, TRIGGER, DEPTH);
            service.open(&shared, zenoh, &endpoint).map_err(io::Error::other)?;
            services.push(endpoint);
        }
        let endpoints = publishes.iter().chain(&obeys).chain(&services);
        let tokens = std::iter::once(graph.token()).chain(endpoints.map(|it| it.token.clone()));
        let tokens = tokens.map(|token| zenoh.liveliness().declare_token(token).wait());
        let tokens = tokens.collect::<Result<_, _>>().map_err(io::Error::other)?;
        let named = |endpoints: Vec<Endpoint>| endpoints.into_iter().map(|it| it.name).collect();
        Ok(Ros2 {
            domain: settings.domain,
            publishes: named(publishes),
            obeys: named(obeys),
            services: named(services),
            joints: names,
            _tokens: tokens,
        })
    }
}
