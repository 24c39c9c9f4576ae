//! Clients that are recorded while their owner uses them.
//!
//! The engine of such a line only says what to send. A thread sends it with the client, in turns with the
//! owner. So what the owner does, a stop too, waits for one exchange at most.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread::JoinHandle;
use std::time::Duration;

use motorlink::port::PortError;
use motorlink::{Clock, rmd, st};
use motorlink_proto::st::Profile;
use motorlink_telemetry::acquisition::Acquisition;
use motorlink_telemetry::line::owner::{RETRY, RmdOwner};
use motorlink_telemetry::line::{RmdLine, StLine, StOver, StRelay};
use motorlink_telemetry::runner::Remote;
use motorlink_telemetry::share::drive_protocol::DriveProtocol;
use motorlink_telemetry::signal::Motor;

use super::frames::{Outlet, Plug};

/// How often the thread looks whether the recording has ended.
const LOOK: Duration = Duration::from_millis(50);

/// Calls a function with a client, if the client is open. Says whether it is.
pub type With<C> = Arc<dyn Fn(&mut dyn FnMut(&C)) -> bool + Send + Sync>;

/// An open client to record.
#[derive(Clone)]
pub struct Client {
    /// The name of its port.
    pub port: String,
    /// Its clock.
    pub clock: Clock,
    /// Where its frames are seen.
    pub outlet: Outlet,
    /// The motors. Empty: those that answer.
    pub motors: Vec<Motor>,
    /// The client.
    pub kind: Kind,
}

/// The protocol of a [`Client`].
#[derive(Clone)]
pub enum Kind {
    /// Of an ST drive.
    St {
        /// Its profile.
        profile: Profile,
        /// Data segments that its owner does not use meanwhile.
        segments: Vec<u8>,
        /// The client.
        with: With<st::Client>,
    },
    /// Of RMD motors.
    Rmd {
        /// The client.
        with: With<rmd::Client>,
    },
}

impl std::fmt::Debug for Client {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Client").field("port", &self.port).finish_non_exhaustive()
    }
}

/// A client in use by a recording, until this is dropped. After that nothing is sent any more.
#[derive(Debug)]
pub(super) struct Lent {
    _plug: Plug,
    ends: Arc<AtomicBool>,
    thread: Option<JoinHandle<()>>,
}

/// What carries out the exchanges of an engine.
pub(super) struct Carrier {
    work: Box<dyn FnMut() -> Turn + Send>,
    wait: Box<dyn Fn() + Send>,
}

/// What a turn of a carrier has done.
#[derive(PartialEq)]
enum Turn {
    /// Nothing was pending.
    Idle,
    /// Exchanges are over.
    Moved,
    /// The owner has closed the client.
    Closed,
}

impl Client {
    /// What its drives speak.
    pub(super) fn speaks(&self) -> DriveProtocol {
        match &self.kind {
            Kind::St { profile, .. } => DriveProtocol::St(*profile),
            Kind::Rmd { .. } => DriveProtocol::Rmd,
        }
    }

    /// An engine, and what carries out its exchanges.
    pub(super) fn engine(&self) -> (Acquisition, Carrier) {
        let (port, clock) = (Arc::<str>::from(&*self.port), self.clock.clone());
        match &self.kind {
            Kind::St { profile, segments, with } => {
                let relay = StRelay::default();
                let line = StLine::relayed(relay.clone(), Arc::clone(&port), clock, *profile);
                let line = line.using_segments(segments);
                (Acquisition::new(Box::new(line)), Carrier::st(relay, port, Arc::clone(with)))
            }
            Kind::Rmd { with } => {
                let owner = Arc::new(RmdOwner::new(clock.clone()));
                let line = RmdLine::relayed(owner.relay().clone(), Arc::clone(&port), clock);
                (Acquisition::new(Box::new(line)), Carrier::rmd(owner, port, Arc::clone(with)))
            }
        }
    }
}

impl Carrier {
    fn st(relay: StRelay, port: Arc<str>, with: With<st::Client>) -> Self {
        let waiting = relay.clone();
        let work = move || {
            let Some(((), step)) = relay.pending().pop() else { return Turn::Idle };
            let mut over = None;
            if with(&mut |client| over = Some(step.carry_out(client))) {
                over.into_iter().for_each(|over| relay.ended((), over));
                return Turn::Moved;
            }
            let closed = PortError::Closed(port.to_string());
            relay.ended((), StOver { result: Err(closed.into()), exchanged: None });
            relay.close();
            Turn::Closed
        };
        Carrier { work: Box::new(work), wait: Box::new(move || waiting.wait(LOOK)) }
    }

    fn rmd(owner: Arc<RmdOwner>, port: Arc<str>, with: With<rmd::Client>) -> Self {
        let waiting = Arc::clone(&owner);
        let work = move || {
            if owner.ready().next().is_none() {
                return Turn::Idle;
            }
            let mut cycle = Ok(());
            if with(&mut |client| cycle = owner.carry_out(client, |_| {})) {
                if let Err(error) = cycle {
                    owner.fail_pending(&error);
                }
                return Turn::Moved;
            }
            owner.fail_pending(&PortError::Closed(port.to_string()).into());
            owner.relay().close();
            Turn::Closed
        };
        let wait = move || match waiting.relay().pending().is_empty() {
            true => waiting.relay().wait(LOOK),
            // A motor is in quarantine.
            false => std::thread::sleep(RETRY.into()),
        };
        Carrier { work: Box::new(work), wait: Box::new(wait) }
    }

    /// Carries out exchanges in a thread. The engine is woken after each.
    pub(super) fn start(
        self,
        client: &Client,
        plug: Plug,
        remote: Remote,
    ) -> std::io::Result<Lent> {
        let Carrier { mut work, wait } = self;
        let ends = Arc::new(AtomicBool::new(false));
        let theirs = Arc::clone(&ends);
        let thread = std::thread::Builder::new().name(client.port.clone());
        let thread = thread.spawn(move || {
            while !theirs.load(Ordering::SeqCst) {
                let turn = work();
                if turn == Turn::Idle {
                    wait();
                    continue;
                }
                if remote.post(|_| {}).is_err() || turn == Turn::Closed {
                    return;
                }
            }
        })?;
        Ok(Lent { _plug: plug, ends, thread: Some(thread) })
    }
}

impl Drop for Lent {
    fn drop(&mut self) {
        self.ends.store(true, Ordering::SeqCst);
        if let Some(thread) = self.thread.take() {
            // A drop has no result.
            let _ = thread.join();
        }
    }
}
