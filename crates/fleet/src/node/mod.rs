//! The side of a node: a share whose programs come over Zenoh, too.

mod motor_queries;
mod node_state;
mod peer_watch;
mod publisher;
mod request_order;
mod send_buffer;
mod session;
mod session_router;
mod sessions;

use std::path::PathBuf;
use std::sync::{Arc, OnceLock};
use std::thread;
use std::time::{Duration, Instant};

use motorlink_telemetry::share::address::Local;
use parking_lot::{Mutex, RwLock};
use tokio::runtime::Runtime;
use zenoh::Wait;
use zenoh::liveliness::LivelinessToken;

use crate::clock::Clock;
use crate::computer;
use crate::key::{self, Name};
use crate::network::{Network, NetworkError};
use crate::ros2::{Ros2, Settings, StartError};
use node_state::Common;

/// The longest time until others see a node.
const SEEN: Duration = Duration::from_secs(2);
/// The pause until it is asked again.
const PAUSE: Duration = Duration::from_millis(50);

/// What a node is.
pub struct Options {
    /// Its name.
    pub name: Name,
    /// The socket of its share.
    pub share: PathBuf,
    /// The program and its version.
    pub program: String,
    /// The network.
    pub network: Network,
    /// Its clock.
    pub clock: Arc<dyn Clock>,
    /// How often the main values of each motor are published.
    pub period: Duration,
    /// What it does for ROS 2 machines.
    pub ros2: Option<Settings>,
}

/// A node that runs. When it is dropped, all its sessions end, and others remember that it went away
/// without an [`end`](Self::end).
pub struct Node {
    common: Arc<Common>,
    addresses: Vec<String>,
    ros2: Option<Ros2>,
    /// That it is there.
    _alive: LivelinessToken,
    runtime: Option<Runtime>,
}

/// Why a node is not there.
#[derive(Debug, thiserror::Error)]
pub enum NodeError {
    /// The network.
    #[error(transparent)]
    Network(#[from] NetworkError),
    /// Two nodes with one name would answer for each other.
    #[error("another node of this network has the name {0}")]
    NameTaken(Name),
    /// Its certificate is good, and its name has no rights.
    #[error("the router does not know the node {0}, so no program sees it")]
    Unknown(Name),
    /// The share.
    #[error("the share of the node: {0}")]
    Share(#[from] std::io::Error),
    /// ROS 2.
    #[error(transparent)]
    Ros2(#[from] StartError),
}

impl Node {
    /// Puts a share on the network.
    ///
    /// # Errors
    /// The network, or the name is taken.
    pub fn start(options: Options) -> Result<Self, NodeError> {
        let Options { name, share, program, network, clock, period, ros2 } = options;
        let runtime = tokio::runtime::Builder::new_multi_thread()
            .worker_threads(2)
            .thread_name("node")
            .enable_all()
            .build()?;
        let (zenoh, addresses) = network.open()?;
        let twin = zenoh.liveliness().get(key::alive_of(&name)).wait();
        if twin.map_err(NetworkError::from)?.recv().is_ok() {
            return Err(NodeError::NameTaken(name));
        }
        let boot = Name::run(computer::fingerprint())?;
        let (state, sessions, members) = (RwLock::default(), Mutex::default(), Mutex::default());
        let own = OnceLock::new();
        let common = Arc::new(Common {
            name,
            share: Arc::new(Local(share)),
            program,
            boot,
            own,
            clock,
            zenoh,
            state,
            sessions,
            members,
        });
        peer_watch::follow(&common).map_err(NetworkError::from)?;
        runtime.block_on(publisher::start(&common, period))?;
        runtime.block_on(motor_queries::open(&common))?;
        let alive = session_router::open(&common, &runtime).map_err(NetworkError::from)?;
        // The router of a site denies without a word.
        if network.role().is_some() && !is_seen(&network, &common)? {
            return Err(NodeError::Unknown(common.name.clone()));
        }
        let started = ros2.map(|settings| {
            let Common { name, share, clock, zenoh, .. } = &*common;
            let (name, clock) = (name.as_str(), Arc::clone(clock));
            runtime.block_on(Ros2::start(&settings, name, share, clock, zenoh))
        });
        let node = |ros2| Node { common, addresses, ros2, _alive: alive, runtime: Some(runtime) };
        match started.transpose() {
            Ok(ros2) => Ok(node(ros2)),
            Err(error) => {
                // Others have seen it already.
                node(None).end();
                Err(error.into())
            }
        }
    }

    /// The addresses of this node.
    pub fn addresses(&self) -> &[String] {
        &self.addresses
    }

    /// Leaves the network, and says that its motors have been stopped.
    pub fn end(self) {
        peer_watch::say_end(&self.common);
    }

    /// What ROS 2 machines see of it.
    pub fn ros2(&self) -> Option<&Ros2> {
        self.ros2.as_ref()
    }
}

impl Drop for Node {
    fn drop(&mut self) {
        // The network may be away.
        let _ = self.common.zenoh.close().wait();
        if let Some(runtime) = self.runtime.take() {
            runtime.shutdown_background();
        }
    }
}

/// Whether another session sees the node.
fn is_seen(network: &Network, common: &Common) -> Result<bool, NetworkError> {
    let (other, _) = network.open()?;
    let own = key::alive(&common.name, &common.boot);
    let end = Instant::now() + SEEN;
    loop {
        if other.liveliness().get(&own).wait()?.recv().is_ok() {
            return Ok(true);
        }
        if Instant::now() > end {
            return Ok(false);
        }
        thread::sleep(PAUSE);
    }
}
