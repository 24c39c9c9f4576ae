//! The latch of a share. It holds for all programs of the share, that of an engine here does not.

use std::io;
use std::sync::Arc;
use std::sync::mpsc::{Receiver, RecvTimeoutError, Sender, channel};
use std::time::Duration;

use motorlink::port::PortName;
use motorlink_telemetry::share::address::Address;
use motorlink_telemetry::share::message::{Answer, Ask};
use motorlink_telemetry::share::port::place_of;

use super::model::Latch;
use super::work::{Done, Work};
use crate::share::Connection;

/// Time between two looks at the latch.
const LOOK: Duration = Duration::from_millis(500);

/// A share that has some of the ports.
pub struct Share {
    at: Arc<dyn Address>,
    pub ports: Vec<usize>,
    commands: Sender<bool>,
}

impl Share {
    /// The shares of ports, each with a thread that looks at its latch.
    pub fn of(names: &[String], work: &Work) -> Vec<Share> {
        let mut shares: Vec<Share> = Vec::new();
        for (port, name) in names.iter().enumerate() {
            let name: Option<PortName> = name.parse().ok();
            let Some((at, _)) = name.and_then(|name| place_of(&name)) else { continue };
            // Shares differ in the names of their ports.
            match shares.iter_mut().find(|share| share.at.port("") == at.port("")) {
                Some(share) => share.ports.push(port),
                None => {
                    let (commands, received) = channel();
                    let number = shares.len();
                    let watcher = Watcher {
                        at: Arc::clone(&at),
                        by: Arc::clone(&work.by),
                        connection: None,
                        holds: false,
                    };
                    work.spawn(move |sender| {
                        watcher.run(&received, |latch| {
                            sender.send(Done::Latch(number, latch)).is_ok()
                        });
                    });
                    shares.push(Share { at, ports: vec![port], commands });
                }
            }
        }
        shares
    }

    /// Sets or releases the latch, also that of another program.
    pub fn latch(&self, is_set: bool) {
        // The thread ends with the view.
        let _ = self.commands.send(is_set);
    }
}

/// The thread of a share.
struct Watcher {
    at: Arc<dyn Address>,
    by: Arc<str>,
    connection: Option<Connection>,
    /// Whether this program set the latch and has not released it. A new share gets it again.
    holds: bool,
}

impl Watcher {
    fn run(mut self, commands: &Receiver<bool>, report: impl Fn(Latch) -> bool) {
        let mut pending = None;
        loop {
            let latch = self.look(&mut pending).map_err(|error| error.to_string());
            if latch.is_err() {
                self.connection = None;
            }
            if !report(latch) {
                return;
            }
            match commands.recv_timeout(LOOK) {
                Ok(is_set) => {
                    self.holds = is_set;
                    pending = Some(is_set);
                }
                Err(RecvTimeoutError::Timeout) => {}
                Err(RecvTimeoutError::Disconnected) => return,
            }
        }
    }

    /// Carries out a pending command and reads the latch.
    fn look(&mut self, pending: &mut Option<bool>) -> io::Result<Option<Arc<str>>> {
        let connection = match &mut self.connection {
            Some(connection) => connection,
            none => {
                if self.holds {
                    *pending = Some(true);
                }
                none.insert(Connection::open(&*self.at, &self.by)?)
            }
        };
        match *pending {
            Some(true) => drop(connection.ask(Ask::Latch)?),
            Some(false) => drop(connection.ask(Ask::Release)?),
            None => {}
        }
        *pending = None;
        match connection.ask(Ask::Lines)? {
            Answer::Lines { latched_by, .. } => Ok(latched_by.map(Arc::from)),
            _ => Err(io::Error::other("the share gives another answer")),
        }
    }
}
