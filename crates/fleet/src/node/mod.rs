//! The side of a node: a share whose programs come over Zenoh, too.

mod door;
mod gate;
mod outbox;
mod publish;
mod session;

use std::collections::BTreeMap;
use std::path::PathBuf;
use std::sync::{Arc, Mutex, PoisonError, RwLock};
use std::time::Duration;

use motorlink_telemetry::share::message::{Group, Line};
use tokio::runtime::Runtime;
use zenoh::bytes::Encoding;
use zenoh::liveliness::LivelinessToken;
use zenoh::query::Query;
use zenoh::{Session as Zenoh, Wait};

use crate::clock::Clock;
use crate::key::{self, Name};
use crate::message::Answer;
use crate::network::{Network, NetworkError};
use crate::weight::Lines;
use door::Sessions;

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
    /// How often the main values of each motor are published; `None`: not at all.
    pub period: Option<Duration>,
}

/// A node that runs. When it is dropped, all its sessions end.
pub struct Node {
    common: Arc<Common>,
    addresses: Vec<String>,
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
    /// The share.
    #[error("the share of the node: {0}")]
    Share(#[from] std::io::Error),
}

/// What all tasks of a node have.
struct Common {
    name: Name,
    share: PathBuf,
    program: String,
    boot: String,
    clock: Arc<dyn Clock>,
    zenoh: Zenoh,
    state: RwLock<State>,
    sessions: Mutex<Sessions>,
}

/// What the node knows of its share.
#[derive(Default)]
struct State {
    lines: Arc<Lines>,
    known: Vec<Line>,
    latched_by: Option<String>,
    /// The columns of the samples that are published, by key.
    columns: BTreeMap<String, Group>,
}

impl Node {
    /// Puts a share on the network.
    ///
    /// # Errors
    /// The network, or the name is taken.
    pub fn start(options: Options) -> Result<Self, NodeError> {
        let Options { name, share, program, network, clock, period } = options;
        let runtime = tokio::runtime::Builder::new_multi_thread()
            .worker_threads(2)
            .thread_name("node")
            .enable_all()
            .build()?;
        let (zenoh, addresses) = network.open()?;
        if zenoh.liveliness().get(key::alive(&name)).wait().map_err(failed)?.recv().is_ok() {
            return Err(NodeError::NameTaken(name));
        }
        let boot = format!("{:016x}", getrandom::u64().map_err(std::io::Error::other)?);
        let (state, sessions) = (RwLock::default(), Mutex::default());
        let common = Arc::new(Common { name, share, program, boot, clock, zenoh, state, sessions });
        runtime.block_on(publish::start(&common, period))?;
        let alive = door::open(&common, &runtime).map_err(failed)?;
        Ok(Node { common, addresses, _alive: alive, runtime: Some(runtime) })
    }

    /// The addresses of this node.
    pub fn addresses(&self) -> &[String] {
        &self.addresses
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

impl Common {
    fn lines(&self) -> Arc<Lines> {
        Arc::clone(&self.state.read().unwrap_or_else(PoisonError::into_inner).lines)
    }
}

fn failed(error: zenoh::Error) -> NetworkError {
    NetworkError::Failed(error.to_string())
}

/// Answers a query. The program asks again if the answer does not come.
fn answer(query: &Query, answer: &Answer) {
    let text = serde_json::to_vec(answer).unwrap_or_default();
    let json = Encoding::APPLICATION_JSON;
    let _ = query.reply(query.key_expr().clone(), text).encoding(json).express(true).wait();
}

/// Answers a query with a part of the share's stream.
fn answer_with(query: &Query, stream: Vec<u8>, head: &Answer) {
    let head = serde_json::to_vec(head).unwrap_or_default();
    let _ = query.reply(query.key_expr().clone(), stream).attachment(head).express(true).wait();
}
