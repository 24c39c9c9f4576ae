//! What waits for an engine, in threads, so that the view never waits.

use std::sync::Arc;
use std::sync::mpsc::{Receiver, SyncSender, sync_channel};
use std::time::Duration;

use motorlink::time::Micros;
use motorlink_telemetry::acquisition::{ConsumerId, Rate};
use motorlink_telemetry::plan::Wants;
use motorlink_telemetry::runner::Remote;
use motorlink_telemetry::signal::Motor;
use motorlink_telemetry::subscription::{Full, Subscription};

use super::ports::stop_of;
use super::settings::{Access, Item};
use super::values::{Main, details};

/// Results that wait for the view.
const RESULTS: usize = 1024;
/// How often rates are read.
const RATES: Duration = Duration::from_secs(1);
/// How often slow signals and those of the details are read, at most.
const SLOW: Duration = Duration::from_millis(500);
/// Records that wait for the view.
const CAPACITY: usize = 4096;

/// What a thread has done.
pub enum Done {
    Rates(usize, Vec<Rate>),
    /// The stop of a row.
    Stopped(usize, Result<(), String>),
    /// The signals of the details of a row.
    Details(usize, ConsumerId, Subscription),
    /// A value of a row.
    Read(usize, Item, Result<String, String>),
    /// All values that were wanted are read.
    AllRead,
    Written(usize, Item, Result<String, String>),
}

/// Starts threads and collects what they have done.
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

    /// Runs in a thread. What it sends is not received after the end.
    fn spawn(&self, task: impl FnOnce(&SyncSender<Done>) + Send + 'static) {
        let sender = self.sender.clone();
        std::thread::spawn(move || task(&sender));
    }

    /// Latches a port, then stops motors, given with their rows, each in a thread of its own.
    pub fn stop_all(&self, remote: &Remote, motors: Vec<(usize, Motor)>) {
        let (remote, by) = (remote.clone(), Arc::clone(&self.by));
        self.spawn(move |sender| {
            // An engine that has ended fails the stops, too.
            let _ = remote.latch(&by);
            for (row, motor) in motors {
                let (remote, by, sender) = (remote.clone(), Arc::clone(&by), sender.clone());
                std::thread::spawn(move || stop(&remote, &by, row, motor, &sender));
            }
        });
    }

    /// Stops a motor.
    pub fn stop(&self, remote: &Remote, row: usize, motor: Motor) {
        let (remote, by) = (remote.clone(), Arc::clone(&self.by));
        self.spawn(move |sender| stop(&remote, &by, row, motor, sender));
    }

    /// Allows motion again.
    pub fn release(&self, remote: &Remote) {
        let (remote, by) = (remote.clone(), Arc::clone(&self.by));
        self.spawn(move |_| {
            // An engine that has ended has no latch.
            let _ = remote.release(&by);
        });
    }

    /// Reads the rates of a port again and again, until the view ends.
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

    /// Reads all signals of the details of a motor.
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

    /// Reads the signals of the details no longer.
    pub fn unwatch(&self, remote: &Remote, id: ConsumerId) {
        let remote = remote.clone();
        self.spawn(move |_| {
            // An engine that has ended sends nothing more.
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

fn stop(remote: &Remote, by: &Arc<str>, row: usize, motor: Motor, sender: &SyncSender<Done>) {
    let result = remote.stop(by, stop_of(motor));
    let _ = sender.send(Done::Stopped(row, result.map(drop).map_err(|why| why.to_string())));
}

/// The signals of the rows of a port, with their events.
pub fn subscribe(
    remote: &Remote,
    motors: &[Motor],
    period: Duration,
) -> Result<Subscription, motorlink_telemetry::runner::Ended> {
    let (fast, slow) = (Micros::from(period), Micros::from(period.max(SLOW)));
    let mut wants = Wants::new();
    for &motor in motors {
        let main = Main::of(motor);
        let of = |source| motorlink_telemetry::signal::Signal { motor, source };
        wants.extend(main.fast().map(|source| (of(source), fast)));
        wants.extend(main.slow().map(|source| (of(source), slow)));
    }
    Ok(remote.subscribe(wants, CAPACITY, Full::DropOldest)?.1)
}
