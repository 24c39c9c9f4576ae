//! What takes longer than the hub may wait: ports that are listed, scanned, opened and closed, in
//! threads.

use std::io;
use std::sync::Arc;
use std::thread::JoinHandle;

use litemap::LiteMap as Map;
use motorlink::port::{Carries, Place, PortName};
use motorlink_link::list;

use super::session_id::SessionId;
use crate::line::{LineError, Stopped};
use crate::share::message::{FoundPort, Protocol};
use crate::share::port_config::Opened;
use crate::share::scan::Found;

/// Jobs at the same time, besides ports that are closed: that stops motors, and is always possible.
const MOST_JOBS: usize = 8;
/// Scans at the same time.
const MOST_SCANS: usize = 4;

/// A job.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub(super) struct JobId(u64);

/// The jobs that are under way.
#[derive(Default)]
pub(super) struct Jobs {
    last: u64,
    under_way: Map<JobId, Job>,
}

/// Who asked for a job.
pub(super) struct Asker {
    pub(super) session: SessionId,
    /// The request.
    pub(super) id: u32,
    pub(super) by: Arc<str>,
}

pub(super) struct Job {
    pub(super) asker: Asker,
    /// What the job occupies, and what it does there.
    place: Option<(Place, PortOperation)>,
    thread: JoinHandle<JobResult>,
}

/// What a job does with a port.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum PortOperation {
    Scans,
    Opens,
    Closes,
}

/// What a job came to.
pub(super) enum JobResult {
    Listed(Vec<(FoundPort, Option<Place>)>),
    Scanned(Scanned),
    Opened(Box<Result<Opened, LineError>>),
    Closed(Closed),
}

/// A line that was closed.
pub(super) struct Closed {
    pub(super) name: String,
    pub(super) port: PortName,
    pub(super) place: Place,
    pub(super) stopped: Vec<Stopped>,
}

/// A port that was scanned.
pub(super) struct Scanned {
    /// At the rate of the scan.
    pub(super) port: PortName,
    pub(super) rate: Option<u32>,
    pub(super) rates: Vec<u32>,
    pub(super) found: Result<Found, LineError>,
}

/// Says that the thread of a job ends, also if it panics.
struct DropGuard<F: FnMut()>(F);

impl<F: FnMut()> Drop for DropGuard<F> {
    fn drop(&mut self) {
        (self.0)();
    }
}

impl Jobs {
    /// Waits for the lines that are being closed, and gives their motors.
    pub(super) fn end(self) -> Vec<(String, Vec<Stopped>)> {
        let jobs = self.under_way.into_iter();
        jobs.filter(|(_, job)| job.does(PortOperation::Closes))
            .filter_map(|(_, job)| match job.thread.join() {
                Ok(JobResult::Closed(Closed { name, stopped, .. })) => Some((name, stopped)),
                _ => None,
            })
            .collect()
    }

    /// Whether there is room for one that does this; `None`: it lists ports.
    pub(super) fn has_room(&self, does: Option<PortOperation>) -> bool {
        let closing = self.count(PortOperation::Closes);
        let has_room = self.under_way.len() - closing < MOST_JOBS;
        match does {
            Some(PortOperation::Closes) => true,
            Some(PortOperation::Scans) => has_room && self.count(PortOperation::Scans) < MOST_SCANS,
            Some(PortOperation::Opens) | None => has_room,
        }
    }

    /// Begins a job. `ended` is called in its thread, after which it is [taken](Self::take).
    pub(super) fn begin(
        &mut self,
        asker: Asker,
        place: Option<(Place, PortOperation)>,
        work: impl FnOnce() -> JobResult + Send + 'static,
        ended: impl Fn(JobId) + Send + 'static,
    ) -> io::Result<()> {
        self.last += 1;
        let job = JobId(self.last);
        let thread = std::thread::Builder::new().name("port".to_owned());
        let thread = thread.spawn(move || {
            let _at_end = DropGuard(|| ended(job));
            work()
        })?;
        self.under_way.insert(job, Job { asker, place, thread });
        Ok(())
    }

    /// A job that has ended.
    pub(super) fn take(&mut self, job: JobId) -> Option<Job> {
        self.under_way.remove(&job)
    }

    /// The job that occupies a place.
    pub(super) fn at(&self, place: &Place) -> Option<&Job> {
        let is_there = |job: &&Job| job.place.as_ref().is_some_and(|(other, _)| other.is(place));
        self.under_way.values().find(is_there)
    }

    /// The ports that are opened or closed.
    pub(super) fn changing(&self) -> impl Iterator<Item = (&Place, &Job)> {
        let jobs = self.under_way.values().filter(|job| !job.does(PortOperation::Scans));
        jobs.filter_map(|job| Some((&job.place.as_ref()?.0, job)))
    }

    /// How many do this.
    pub(super) fn count(&self, what: PortOperation) -> usize {
        self.under_way.values().filter(|job| job.does(what)).count()
    }
}

impl Job {
    /// What it came to; `None` if it panicked.
    pub(super) fn end(self) -> (Asker, Option<JobResult>) {
        (self.asker, self.thread.join().ok())
    }

    /// What it does with its port, in a word.
    pub(super) fn verb(&self) -> &'static str {
        match self.place {
            Some((_, PortOperation::Scans)) => "scans",
            Some((_, PortOperation::Opens)) => "opens",
            Some((_, PortOperation::Closes)) => "closes",
            None => "uses",
        }
    }

    pub(super) fn does(&self, what: PortOperation) -> bool {
        self.place.as_ref().is_some_and(|(_, does)| *does == what)
    }
}

/// The ports of this computer, and what each occupies.
pub(super) fn found_ports() -> Vec<(FoundPort, Option<Place>)> {
    let found = list::ports().into_iter().map(|port| {
        let place = port.name.parse::<PortName>().ok().map(|name| name.place());
        let protocol = match port.carries {
            Carries::Frames => Protocol::Rmd,
            Carries::Bytes | Carries::Both => Protocol::St,
        };
        let found = FoundPort {
            port: port.name,
            protocol,
            description: port.description,
            stable_path: port.stable_path.map(|path| path.display().to_string()),
            problem: port.problem,
            line: None,
        };
        (found, place)
    });
    found.collect()
}
