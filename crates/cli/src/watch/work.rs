//! Threads that wait for an engine, so that the view does not wait.

use std::sync::Arc;
use std::sync::mpsc::{Receiver, SyncSender, sync_channel};
use std::time::Duration;

use motorlink::time::Micros;
use motorlink_telemetry::acquisition::{ConsumerId, Rate};
use motorlink_telemetry::line::Request;
use motorlink_telemetry::overview::Overview;
use motorlink_telemetry::plan::Wants;
use motorlink_telemetry::runner::Remote;
use motorlink_telemetry::search::motors;
use motorlink_telemetry::share::message::Protocol;
use motorlink_telemetry::signal::Motor;
use motorlink_telemetry::subscription::{Full, Subscription};

use super::model::Latch;
use super::settings::{Access, Item};
use super::values::details;

/// Capacity of the queue of results.
const RESULTS: usize = 1024;
/// Time between two reads of the rates.
const RATES: Duration = Duration::from_secs(1);
/// Least period of slow signals and of the details.
const SLOW: Duration = Duration::from_millis(500);
/// Capacity of a subscription, in records.
const CAPACITY: usize = 4096;

/// The result of a thread.
pub enum Done {
    Rates(usize, Vec<Rate>),
    Stopped(Stopping, Result<(), String>),
    /// The drive has no motor of this number.
    NoMotor(Stopping),
    /// Motors that a search found at a port, and their subscription.
    Found(usize, Result<(Vec<Motor>, Subscription), String>),
    /// The latch of a share.
    Latch(usize, Latch),
    /// The subscription to the details of a row.
    Details(usize, ConsumerId, Subscription),
    /// A value of a row.
    Read(usize, Item, Result<String, String>),
    /// All requested registers were read.
    AllRead,
    Written(usize, Item, Result<String, String>),
}

/// A stop of a row.
#[derive(Clone, Copy)]
pub struct Stopping {
    pub row: usize,
    pub motor: Motor,
    /// The number of the stop, counted for each row.
    pub number: u64,
}

/// Starts threads and collects their results.
pub struct Work {
    sender: SyncSender<Done>,
    pub done: Receiver<Done>,
    pub by: Arc<str>,
}

impl Work {
    pub fn new(by: Arc<str>) -> Self {
        let (sender, done) = sync_channel(RESULTS);
        Work { sender, done, by }
    }

    /// Runs a task in a thread. After the end of the view its results are not received.
    pub fn spawn(&self, task: impl FnOnce(&SyncSender<Done>) + Send + 'static) {
        let sender = self.sender.clone();
        std::thread::spawn(move || task(&sender));
    }

    /// Latches a port, then stops motors, each in a thread of its own.
    pub fn stop_all(&self, remote: &Remote, stops: Vec<Stopping>) {
        let (remote, by) = (remote.clone(), Arc::clone(&self.by));
        self.spawn(move |sender| {
            // If the engine has ended, the stops fail, too.
            let _ = remote.latch(&by);
            for it in stops {
                let (remote, by, sender) = (remote.clone(), Arc::clone(&by), sender.clone());
                std::thread::spawn(move || stop(&remote, &by, it, &sender));
            }
        });
    }

    /// Stops a motor.
    pub fn stop(&self, remote: &Remote, it: Stopping) {
        let (remote, by) = (remote.clone(), Arc::clone(&self.by));
        self.spawn(move |sender| stop(&remote, &by, it, sender));
    }

    /// Searches for unknown motors of a port, and subscribes to their signals.
    pub fn find(
        &self,
        remote: &Remote,
        port: usize,
        protocol: Protocol,
        known: Vec<Motor>,
        period: Duration,
    ) {
        let (remote, by) = (remote.clone(), Arc::clone(&self.by));
        self.spawn(move |sender| {
            let found = motors(&remote, &by, protocol).map_err(|why| why.to_string());
            let found = found.and_then(|mut found| {
                found.retain(|motor| !known.contains(motor));
                let records = subscribe(&remote, &found, period).map_err(|why| why.to_string())?;
                Ok((found, records))
            });
            let _ = sender.send(Done::Found(port, found));
        });
    }

    /// Releases the latch of a port.
    pub fn release(&self, remote: &Remote) {
        let (remote, by) = (remote.clone(), Arc::clone(&self.by));
        self.spawn(move |_| {
            // An engine that has ended has no latch.
            let _ = remote.release(&by);
        });
    }

    /// Reads the rates of a port repeatedly until the view ends.
    pub fn rates(&self, remote: &Remote, port: usize) {
        let remote = remote.clone();
        self.spawn(move |sender| {
            while let Ok(rates) = remote.rates() {
                if sender.send(Done::Rates(port, rates)).is_err() {
                    return;
                }
                std::thread::sleep(RATES);
            }
        });
    }

    /// Subscribes to all signals of a motor.
    pub fn watch_details(&self, remote: &Remote, row: usize, motor: Motor, period: Duration) {
        let remote = remote.clone();
        let period = Micros::from(period.max(SLOW));
        self.spawn(move |sender| {
            let wants = details(motor).into_iter().map(|signal| (signal, period)).collect();
            if let Ok((id, records)) = remote.subscribe(wants, CAPACITY, Full::DropOldest) {
                let _ = sender.send(Done::Details(row, id, records));
            }
        });
    }

    /// Ends a subscription.
    pub fn unwatch(&self, remote: &Remote, id: ConsumerId) {
        let remote = remote.clone();
        self.spawn(move |_| {
            // If the engine has ended, the subscription has ended, too.
            let _ = remote.unsubscribe(id);
        });
    }

    /// Reads values of a row.
    pub fn read(&self, access: Access, row: usize, items: Vec<Item>) {
        self.spawn(move |sender| {
            for item in items {
                let value = access.read(item);
                if sender.send(Done::Read(row, item, value)).is_err() {
                    return;
                }
            }
            let _ = sender.send(Done::AllRead);
        });
    }

    /// Writes a value of a row.
    pub fn write(&self, access: Access, row: usize, item: Item, text: String) {
        self.spawn(move |sender| {
            let _ = sender.send(Done::Written(row, item, access.write(item, &text)));
        });
    }
}

fn stop(remote: &Remote, by: &Arc<str>, it: Stopping, sender: &SyncSender<Done>) {
    let done = match remote.stop(by, Request::stop(it.motor)) {
        Err(why) if why.is_of_no_motor() => Done::NoMotor(it),
        result => Done::Stopped(it, result.map(drop).map_err(|why| why.to_string())),
    };
    let _ = sender.send(done);
}

/// Subscribes to the signals of rows, and to the events of their port.
pub fn subscribe(
    remote: &Remote,
    motors: &[Motor],
    period: Duration,
) -> Result<Subscription, motorlink_telemetry::runner::Ended> {
    let (fast, slow) = (Micros::from(period), Micros::from(period.max(SLOW)));
    let mut wants = Wants::new();
    for &motor in motors {
        let main = Overview::of(motor);
        let of = |source| motorlink_telemetry::signal::Signal { motor, source };
        wants.extend(main.fast().map(|source| (of(source), fast)));
        wants.extend(main.slow().map(|source| (of(source), slow)));
    }
    Ok(remote.subscribe(wants, CAPACITY, Full::DropOldest)?.1)
}
