//! What nodes publish: the last values of all motors, without a session at any node.

mod snapshot;

use std::collections::{BTreeMap, BTreeSet};
use std::sync::Arc;
use std::time::Duration;

use motorlink_telemetry::share::data::Data;
use motorlink_telemetry::share::message::Group;
use parking_lot::Mutex;
use zenoh::pubsub::Subscriber;
use zenoh::sample::{Sample, SampleKind};
use zenoh::{Session as Zenoh, Wait};

use crate::clock::{Boot, Clock};
use crate::directory::{self, Run};
use crate::key::{self, Name};
use crate::network::{Network, NetworkError};
use crate::remote;
use snapshot::Snapshot;
pub use snapshot::{Drive, Node};

/// How long nodes may take to say their columns.
const ANSWER: Duration = Duration::from_secs(2);
/// The least time between two questions for columns, in seconds.
const AGAIN: f64 = 1.0;

/// Takes what a node has published.
type Hear = fn(&Arc<Shared>, &Sample);

/// The nodes of a network, until this is dropped.
pub struct View {
    shared: Arc<Shared>,
    /// The nodes that were there at the begin, and did not answer.
    silent: Vec<Run>,
    _subscribers: Vec<Subscriber<()>>,
}

struct Shared {
    zenoh: Arc<Zenoh>,
    picture: Mutex<Snapshot>,
    /// When columns were asked for last.
    asked: Mutex<f64>,
}

impl View {
    /// Looks at a network. The nodes that are there are known then, their values soon.
    ///
    /// # Errors
    /// The network.
    pub fn open(network: &Network) -> Result<Self, NetworkError> {
        let zenoh = remote::zenoh_of(network)?;
        let (picture, asked) = (Mutex::default(), Mutex::new(f64::NEG_INFINITY));
        let shared = Arc::new(Shared { zenoh: Arc::clone(&zenoh), picture, asked });
        let mut subscribers = Vec::new();
        let heard: [(String, Hear); 3] = [
            (key::state(&Name::any()), Shared::state),
            (key::of_all_motors(&Name::any(), key::COLUMNS), Shared::columns),
            (key::of_all_motors(&Name::any(), key::SAMPLES), Shared::samples),
        ];
        for (key, hear) in heard {
            let shared = Arc::clone(&shared);
            let heard = move |sample: Sample| hear(&shared, &sample);
            let subscriber = zenoh.declare_subscriber(key).callback(heard).wait();
            subscribers.push(subscriber?);
        }
        let follower = Arc::clone(&shared);
        let seen = move |sample: Sample| follower.saw(&sample);
        let seen = zenoh.liveliness().declare_subscriber(key::all_alive()).callback(seen).wait();
        subscribers.push(seen?);
        let now = Boot.now();
        let mut silent = Vec::new();
        let nodes = directory::nodes(network)?.nodes;
        nodes.keys().for_each(|run| shared.picture.lock().came(run.clone()));
        for (run, info) in nodes {
            match info {
                Some(info) => shared.picture.lock().state(run.0, info, now),
                None => silent.push(run),
            }
        }
        shared.ask_columns();
        Ok(View { shared, silent, _subscribers: subscribers })
    }

    /// The nodes that have said something.
    pub fn nodes(&self) -> BTreeMap<Name, Node> {
        self.shared.picture.lock().nodes()
    }

    /// The nodes that are there, and have said nothing yet.
    pub fn silent(&self) -> Vec<&Name> {
        let picture = self.shared.picture.lock();
        let is_silent = |run: &&Run| picture.runs().all(|it| it != *run);
        self.silent.iter().filter(is_silent).map(|(node, _)| node).collect()
    }

    /// The nodes that went away without an end and that were not seen here, and for how long, in seconds.
    pub fn away(&self) -> BTreeMap<Run, f64> {
        let nodes = self.nodes();
        let runs: BTreeSet<Run> = self.shared.picture.lock().runs().cloned().collect();
        directory::away(nodes.values().map(|node| &node.info), |run| runs.contains(run))
    }

    /// A name that several nodes have. The values of their motors are not known.
    pub fn twins(&self) -> Option<Name> {
        self.shared.picture.lock().twins()
    }

    /// The motors that have answered.
    pub fn drives(&self) -> Vec<Drive> {
        self.shared.picture.lock().drives()
    }

    /// The clock of [`Drive::at`] and [`Node::at`].
    pub fn now() -> f64 {
        Boot.now()
    }
}

impl Shared {
    fn state(self: &Arc<Self>, sample: &Sample) {
        let info = serde_json::from_slice(&sample.payload().to_bytes()).ok();
        if let (Some(node), Some(info)) = (key::node_of(sample.key_expr().as_str()), info) {
            self.picture.lock().state(node, info, Boot.now());
        }
    }

    /// A node came or went.
    fn saw(&self, sample: &Sample) {
        let Some(run) = key::run_of(sample.key_expr().as_str()) else { return };
        match sample.kind() {
            SampleKind::Put => self.picture.lock().came(run),
            SampleKind::Delete => self.picture.lock().went(&run),
        }
    }

    fn columns(self: &Arc<Self>, sample: &Sample) {
        let group: Option<Group> = serde_json::from_slice(&sample.payload().to_bytes()).ok();
        if let (Some(node), Some(group)) = (key::node_of(sample.key_expr().as_str()), group) {
            self.picture.lock().columns(node, group);
        }
    }

    fn samples(self: &Arc<Self>, sample: &Sample) {
        let Some((node, line, motor)) = key::motor_of(sample.key_expr().as_str()) else { return };
        let Ok(data) = Data::decode(&sample.payload().to_bytes()) else { return };
        if !self.picture.lock().samples(node, line, motor, &data, Boot.now()) {
            self.ask_columns();
        }
    }

    /// Asks all nodes for the columns of their samples, unless that was done just before.
    fn ask_columns(self: &Arc<Self>) {
        let mut asked = self.asked.lock();
        let now = Boot.now();
        if now < *asked + AGAIN {
            return;
        }
        *asked = now;
        let shared = Arc::clone(self);
        let columns = key::of_all_motors(&Name::any(), key::COLUMNS);
        let question = directory::ask_all(&self.zenoh, columns, ANSWER);
        let question = question.callback(move |reply| {
            if let Ok(sample) = reply.into_result() {
                shared.columns(&sample);
            }
        });
        // Samples that come later ask again.
        let _ = question.wait();
    }
}
