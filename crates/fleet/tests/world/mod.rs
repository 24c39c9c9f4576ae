//! Nodes with simulated drives, and a network between them that can be cut.
#![allow(dead_code, reason = "each test uses a part")]

use std::io::{ErrorKind, Read, Write};
use std::net::{Shutdown, TcpListener, TcpStream};
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::sync::mpsc::{Receiver, channel};
use std::sync::{Arc, Condvar, Mutex};
use std::time::{Duration, Instant};

use motorlink_fleet::clock::{Boot, Clock};
use motorlink_fleet::network::Network;
use motorlink_fleet::node::{Node, NodeError, Options};

use crate::shared::{PATIENT, Share};

/// A node of simulated drives: the lines st0 and rmd0.
pub struct World {
    pub share: Share,
    pub address: String,
    pub name: String,
    node: Option<Node>,
}

impl World {
    pub fn new(name: &str) -> Self {
        Self::with(name, Duration::from_secs(5), Arc::new(Boot))
    }

    pub fn with(name: &str, lease: Duration, clock: Arc<dyn Clock>) -> Self {
        TURN.with(|_| {});
        let share = Share::leasing(&format!("fleet-{name}"), PATIENT, Some(lease), |link| link);
        let address = format!("127.0.0.1:{}", free_port());
        let listen = vec![format!("tcp/{address}")];
        let network = Network::Route { listen, connect: Vec::new() };
        let node = start(name, &share, network, clock).unwrap();
        World { share, address, name: name.to_owned(), node: Some(node) }
    }

    /// A node of its own drives, at the network of this address.
    pub fn joined(name: &str, address: &str) -> Self {
        let lease = Some(Duration::from_secs(5));
        let share = Share::leasing(&format!("fleet-{name}"), PATIENT, lease, |link| link);
        let network = Network::Connect(vec![format!("tcp/{address}")]);
        let node = start(name, &share, network, Arc::new(Boot)).unwrap();
        World { share, address: address.to_owned(), name: name.to_owned(), node: Some(node) }
    }

    /// Another node at the same network.
    pub fn beside(&self, name: &str) -> Result<Node, NodeError> {
        let network = Network::Connect(vec![format!("tcp/{}", self.address)]);
        start(name, &self.share, network, Arc::new(Boot))
    }

    /// A node of its own drives with the same name, which gets to this one only through an address.
    pub fn namesake(&self, address: &str) -> Self {
        let share = Share::leasing(&format!("fleet-{}-2", self.name), PATIENT, None, |link| link);
        let own = format!("127.0.0.1:{}", free_port());
        let listen = vec![format!("tcp/{own}")];
        let network = Network::Route { listen, connect: vec![format!("tcp/{address}")] };
        let node = start(&self.name, &share, network, Arc::new(Boot)).unwrap();
        World { share, address: own, name: self.name.clone(), node: Some(node) }
    }

    /// The name of a line's port, over this address.
    pub fn port(&self, line: &str, address: &str, options: &str) -> String {
        motorlink_fleet::port_scheme::register();
        format!("zenoh:{}/{line}?via=tcp/{address}{options}", self.name)
    }

    /// The node vanishes, as if it was killed.
    pub fn end_node(&mut self) {
        self.node = None;
    }

    /// The node ends by itself.
    pub fn leave(&mut self) {
        self.node.take().unwrap().end();
    }
}

fn start(
    name: &str,
    share: &Share,
    network: Network,
    clock: Arc<dyn Clock>,
) -> Result<Node, NodeError> {
    Node::start(Options {
        name: name.parse().unwrap(),
        share: share.path.clone(),
        program: "test".to_owned(),
        network,
        clock,
        period: Duration::from_millis(50),
        ros2: None,
    })
}

thread_local! {
    /// A test with nodes takes its turn with others until its thread ends: each node and client has to
    /// answer within seconds, and to begin needs half a second of the processor.
    static TURN: Turn = Turn::take();
}

struct Turn;

static TURNS: (Mutex<usize>, Condvar) = (Mutex::new(0), Condvar::new());

impl Turn {
    fn take() -> Self {
        let most = 2 * std::thread::available_parallelism().map_or(1, usize::from);
        let (taken, freed) = &TURNS;
        *freed.wait_while(taken.lock().unwrap(), |taken| *taken >= most).unwrap() += 1;
        Turn
    }
}

impl Drop for Turn {
    fn drop(&mut self) {
        *TURNS.0.lock().unwrap() -= 1;
        TURNS.1.notify_one();
    }
}

pub fn free_port() -> u16 {
    TcpListener::bind("127.0.0.1:0").unwrap().local_addr().unwrap().port()
}

/// A clock that jumps.
#[derive(Default)]
pub struct Jumping {
    /// By how many seconds it is ahead, and the wall clock.
    ahead: Mutex<(f64, f64)>,
}

impl Jumping {
    pub fn jump(&self, now: f64, wall: f64) {
        let mut ahead = self.ahead.lock().unwrap();
        *ahead = (ahead.0 + now, ahead.1 + wall);
    }
}

impl Clock for Jumping {
    fn now(&self) -> f64 {
        Boot.now() + self.ahead.lock().unwrap().0
    }

    fn wall(&self) -> f64 {
        Boot.wall() + self.ahead.lock().unwrap().1
    }
}

/// TCP connections to an address. While they are cut they stay open, and nothing passes.
pub struct Cable {
    pub address: String,
    state: Arc<State>,
    streams: Arc<Mutex<Vec<TcpStream>>>,
}

#[derive(Default)]
struct State {
    is_cut: AtomicBool,
    ends: AtomicBool,
    /// How long bytes are under way, ms.
    lag: AtomicU64,
}

impl Cable {
    pub fn to(target: &str) -> Self {
        Self::at("127.0.0.1:0", target)
    }

    /// As [`to`](Self::to), at an address.
    pub fn at(address: &str, target: &str) -> Self {
        let listener = TcpListener::bind(address).unwrap();
        listener.set_nonblocking(true).unwrap();
        let address = listener.local_addr().unwrap().to_string();
        let (state, streams) = (Arc::<State>::default(), Arc::new(Mutex::new(Vec::new())));
        let cable = Cable { address, state, streams };
        let (target, state) = (target.to_owned(), Arc::clone(&cable.state));
        let streams = Arc::clone(&cable.streams);
        std::thread::spawn(move || {
            while !state.ends.load(Ordering::SeqCst) {
                let Ok((near, _)) = listener.accept() else {
                    std::thread::sleep(Duration::from_millis(2));
                    continue;
                };
                let Ok(far) = TcpStream::connect(&target) else { continue };
                let pairs = [
                    (near.try_clone().unwrap(), far.try_clone().unwrap()),
                    (far.try_clone().unwrap(), near.try_clone().unwrap()),
                ];
                streams.lock().unwrap().extend([near, far]);
                for (from, to) in pairs {
                    let state = Arc::clone(&state);
                    std::thread::spawn(move || pass(from, to, &state));
                }
            }
        });
        cable
    }

    pub fn cut(&self) {
        self.state.is_cut.store(true, Ordering::SeqCst);
    }

    /// Bytes are under way for this time from now on.
    pub fn slow(&self, lag: Duration) {
        self.state.lag.store(lag.as_millis() as u64, Ordering::SeqCst);
    }

    pub fn mend(&self) {
        self.state.is_cut.store(false, Ordering::SeqCst);
    }
}

impl Drop for Cable {
    fn drop(&mut self) {
        self.state.ends.store(true, Ordering::SeqCst);
        for stream in self.streams.lock().unwrap().iter() {
            let _ = stream.shutdown(Shutdown::Both);
        }
    }
}

fn pass(mut from: TcpStream, to: TcpStream, state: &Arc<State>) {
    from.set_nonblocking(false).unwrap();
    from.set_read_timeout(Some(Duration::from_millis(20))).unwrap();
    let (sender, under_way) = channel();
    let arrives = Arc::clone(state);
    let arriving = std::thread::spawn(move || arrive(to, &under_way, &arrives));
    let mut bytes = [0; 1 << 16];
    while !state.ends.load(Ordering::SeqCst) {
        match from.read(&mut bytes) {
            Ok(0) => break,
            Ok(size) if sender.send((Instant::now(), bytes[..size].to_vec())).is_err() => break,
            Ok(_) => {}
            Err(error) if matches!(error.kind(), ErrorKind::WouldBlock | ErrorKind::TimedOut) => {}
            Err(_) => break,
        }
    }
    drop(sender);
    arriving.join().unwrap();
}

fn arrive(mut to: TcpStream, under_way: &Receiver<(Instant, Vec<u8>)>, state: &State) {
    for (sent, bytes) in under_way {
        let waits = || {
            let lag = Duration::from_millis(state.lag.load(Ordering::SeqCst));
            state.is_cut.load(Ordering::SeqCst) || sent.elapsed() < lag
        };
        while waits() && !state.ends.load(Ordering::SeqCst) {
            std::thread::sleep(Duration::from_millis(1));
        }
        if to.write_all(&bytes).is_err() {
            break;
        }
    }
    let _ = to.shutdown(Shutdown::Both);
}

pub fn eventually(what: &str, mut is_so: impl FnMut() -> bool) {
    let end = Instant::now() + crate::shared::LIMIT;
    while !is_so() {
        assert!(Instant::now() < end, "{what}");
        std::thread::sleep(Duration::from_millis(5));
    }
}
