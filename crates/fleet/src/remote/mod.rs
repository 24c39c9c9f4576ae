//! The side of a program: a share at a node, as a socket.
//!
//! A tunnel stands between the program's socket and the network. It takes the requests of the program,
//! says how old they may become, sends them until the node has them, and brings what the share says.

mod node_queries;
mod outgoing;
mod tunnel;

use std::collections::BTreeMap;
use std::io;
use std::os::unix::net::UnixStream;
use std::sync::{Arc, LazyLock, Weak};
use std::time::{Duration, Instant};

use motorlink_telemetry::share::address::{Address, Unreachable};
use parking_lot::Mutex;
use tokio::runtime::Runtime;
use zenoh::Session as Zenoh;

use crate::computer;
use crate::key::Name;
use crate::network::{Network, NetworkError};
use tunnel::{SessionParams, Tunnel};

/// Without another one: how long the motors of a program may turn without a sign of life.
pub const DEADLINE: Duration = Duration::from_secs(1);
/// How long a program waits for a node that does not answer.
pub(crate) const PATIENCE: Duration = Duration::from_secs(3);
/// The same of a program that only reads, and wants what waits at the node. The node waits a little longer.
const LONG_PATIENCE: Duration = Duration::from_secs(55);
/// The longest time until all nodes know that this program has left.
const LEAVING: Duration = Duration::from_millis(500);

/// The share of a node.
#[derive(Debug, Clone, PartialEq)]
pub struct Remote {
    /// The node.
    pub node: Name,
    /// Its run; `None`: the only one that is there.
    pub boot: Option<Name>,
    /// The way to it.
    pub network: Network,
    /// The name of the user, for keys and the log of the node.
    pub who: Name,
    /// Its motors stop if the node gets no sign of life for this time.
    pub deadline: Duration,
    /// Its motors stop if they get no new command for this time.
    pub motion: Option<Duration>,
    /// Whether it takes motors from other programs.
    pub takes: bool,
    /// Whether it comes to stop motors. A node that is full takes it nevertheless.
    pub stops: bool,
}

impl Remote {
    /// A node of a network, with what is usual.
    pub fn new(node: Name, network: Network) -> Self {
        Remote {
            node,
            boot: None,
            who: own_name(&network),
            network,
            deadline: DEADLINE,
            motion: None,
            takes: false,
            stops: false,
        }
    }

    fn begin(&self, patience: Duration) -> Result<UnixStream, Unreachable> {
        let zenoh = zenoh_of(&self.network).map_err(|error| {
            Unreachable::Missing(format!("no node {} can be reached: {error}", self.node))
        })?;
        runtime()?.block_on(self.open(zenoh, patience))
    }

    /// Connects to the node, in the runtime of this process. It is given up when it is silent for
    /// `patience`.
    pub(crate) async fn open(
        &self,
        zenoh: Arc<Zenoh>,
        patience: Duration,
    ) -> Result<UnixStream, Unreachable> {
        let (own, other) = pair()?;
        let Remote { node, boot, who, deadline, motion, network, stops, .. } = self.clone();
        let whom = SessionParams { node, boot, who, deadline, motion, stops, patience };
        match Tunnel::open(whom, zenoh, own).await {
            Ok(()) => Ok(other),
            Err(Unreachable::Missing(why)) => {
                Err(Unreachable::Missing(format!("{why} at {network}")))
            }
            Err(failed) => Err(failed),
        }
    }

    /// The options that differ from the default, as in the name of a port.
    pub fn options(&self) -> Vec<String> {
        let mut options = Vec::new();
        if self.network != Network::of_programs() {
            options.push(format!("via={}", self.network));
        }
        if self.who != own_name(&self.network) {
            options.push(format!("as={}", self.who));
        }
        if self.deadline != DEADLINE {
            options.push(format!("deadline={}ms", self.deadline.as_millis()));
        }
        if let Some(motion) = self.motion {
            options.push(format!("motion={}ms", motion.as_millis()));
        }
        if self.takes {
            options.push("take".to_owned());
        }
        options
    }
}

impl Address for Remote {
    fn port(&self, line: &str) -> String {
        let options = self.options();
        let mark = if options.is_empty() { "" } else { "?" };
        format!("zenoh:{}/{line}{mark}{}", self.node, options.join("&"))
    }

    fn connect(&self) -> Result<UnixStream, Unreachable> {
        self.begin(PATIENCE)
    }

    fn follow(&self) -> Result<UnixStream, Unreachable> {
        self.begin(LONG_PATIENCE)
    }

    fn ended(&self, why: Option<&str>) -> String {
        let node = &self.node;
        match why {
            Some(why) => format!("node {node}: {why}"),
            None => format!("node {node}: the connection has ended"),
        }
    }

    fn takes(&self) -> bool {
        self.takes
    }
}

/// Who uses this program: the name in the certificate of the network, or the user and the computer.
pub fn own_name(network: &Network) -> Name {
    if let Some(name) = network.name() {
        return name;
    }
    let user = std::env::var("USER").unwrap_or_else(|_| "somebody".to_owned());
    Name::near(&format!("{user}-{}", computer::name()))
}

/// Waits for a moment until the nodes know that the programs of this process have left. Call it before
/// the process ends, or their motors stop some time later.
pub fn finish() {
    let end = Instant::now() + LEAVING;
    while tunnel::open_tunnels() > 0 && Instant::now() < end {
        std::thread::sleep(Duration::from_millis(2));
    }
}

/// Two ends of a socket. The first one does not wait.
pub(crate) fn pair() -> Result<(UnixStream, UnixStream), Unreachable> {
    let pair = UnixStream::pair().and_then(|(own, other)| {
        own.set_nonblocking(true)?;
        Ok((own, other))
    });
    pair.map_err(|error| Unreachable::Failed(error.to_string()))
}

/// One for all tunnels.
pub(crate) fn runtime() -> Result<&'static Runtime, Unreachable> {
    static RUNTIME: LazyLock<io::Result<Runtime>> = LazyLock::new(|| {
        tokio::runtime::Builder::new_multi_thread()
            .worker_threads(2)
            .thread_name("fleet")
            .enable_all()
            .build()
    });
    RUNTIME.as_ref().map_err(|error| Unreachable::Failed(error.to_string()))
}

/// One session for each network of this process.
pub(crate) fn zenoh_of(network: &Network) -> Result<Arc<Zenoh>, NetworkError> {
    static OPEN: Mutex<BTreeMap<Network, Weak<Zenoh>>> = Mutex::new(BTreeMap::new());
    let mut open = OPEN.lock();
    if let Some(zenoh) = open.get(network).and_then(Weak::upgrade).filter(|it| !it.is_closed()) {
        return Ok(zenoh);
    }
    let (zenoh, _) = network.open()?;
    let zenoh = Arc::new(zenoh);
    open.insert(network.clone(), Arc::downgrade(&zenoh));
    Ok(zenoh)
}
