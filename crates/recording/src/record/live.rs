//! What a recording of a share would have, for viewers, while it is made.

use std::io;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{Receiver, Sender, channel};
use std::thread::{Builder, JoinHandle};
use std::time::{Duration, Instant};

use motorlink::rmd::MotorSet;
use motorlink_proto::time::Micros;
use motorlink_telemetry::search;
use motorlink_telemetry::share::address::Address;
use motorlink_telemetry::share::drive_protocol::DriveProtocol;
use motorlink_telemetry::share::stream::Stream;

use super::choice::{self, Group};
use super::content::{Content, Line};
use super::followed::{self, Followed};
use super::open::{Port, unsearched};
use super::recorder::{RATES, TURN};
use super::topics::Topics;
use super::wall::{DayInUse, wall_now};
use crate::error::RecordError;
use crate::schema::name;
use crate::write::Entry;

/// The pause before motors of a line are searched again.
const AGAIN: Duration = Duration::from_secs(2);

/// What is made.
#[derive(Debug, Clone)]
pub struct Config {
    /// How often fast signals are read.
    pub period: Micros,
    /// The name of this program at the share.
    pub by: Arc<str>,
}

/// What a viewer gets.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Item {
    /// A topic or a message, as in a recording.
    Entry(Entry),
    /// Whether there is something of a line.
    Line {
        /// Its name.
        name: String,
        /// Why there is nothing yet. It is tried again and again.
        trouble: Option<String>,
    },
}

/// Messages of all lines of a share are made until this is dropped.
#[derive(Debug)]
pub struct Live {
    ends: Arc<AtomicBool>,
    threads: Vec<JoinHandle<()>>,
}

/// A line that the share reads.
struct Found {
    line: Line,
    groups: Vec<Group>,
    stream: Stream,
}

impl Live {
    /// Searches the motors of these lines of a share, and makes messages of what the share reads. `put` gets them in a thread. A line whose motors do not answer does not hold up others.
    ///
    /// # Errors
    /// The system gives no thread.
    pub fn start(
        config: &Config,
        share: &Arc<dyn Address>,
        lines: impl IntoIterator<Item = (String, DriveProtocol)>,
        put: impl FnMut(Item) + Send + 'static,
    ) -> io::Result<Self> {
        let (day, ends) = (DayInUse::new(), Arc::new(AtomicBool::new(false)));
        let mut live = Live { ends: Arc::clone(&ends), threads: Vec::new() };
        let (sender, found) = channel();
        for (name, speaks) in lines {
            let port = share.port(&name);
            let seeker = Seeker {
                name: name.clone(),
                port,
                speaks,
                config: config.clone(),
                ends: Arc::clone(&ends),
                found: sender.clone(),
            };
            live.threads.push(Builder::new().name(name).spawn(move || seeker.run())?);
        }
        let thread = Builder::new().name("motorlink-live".to_owned());
        live.threads.push(thread.spawn(move || {
            let _day = day;
            run(&ends, &found, put);
        })?);
        Ok(live)
    }
}

impl Drop for Live {
    fn drop(&mut self) {
        self.ends.store(true, Ordering::SeqCst);
        // Nobody waits for the end of a search.
        self.threads.iter().for_each(|thread| thread.thread().unpark());
    }
}

/// Searches the motors of a line until some answer.
struct Seeker {
    name: String,
    port: String,
    speaks: DriveProtocol,
    config: Config,
    ends: Arc<AtomicBool>,
    found: Sender<(String, Result<Found, String>)>,
}

impl Seeker {
    fn run(self) {
        let mut told = None;
        while !self.ends.load(Ordering::SeqCst) {
            match self.seek() {
                Ok(found) => {
                    // The viewers have gone.
                    let _ = self.found.send((self.name, Ok(found)));
                    return;
                }
                Err(why) if told.as_ref() != Some(&why) => {
                    told = Some(why.clone());
                    let _ = self.found.send((self.name.clone(), Err(why)));
                }
                Err(_) => {}
            }
            std::thread::park_timeout(AGAIN);
        }
    }

    fn seek(&self) -> Result<Found, String> {
        let profile = self.speaks.profile().unwrap_or_default();
        let port = Port {
            name: self.port.parse().map_err(|error| format!("{error}"))?,
            profile,
            timeout: None,
            motors: Vec::new(),
            ids: MotorSet::EMPTY,
            full_scale: None,
        };
        let label = name::labels(std::slice::from_ref(&self.port)).remove(0);
        let protocol = self.speaks.protocol();
        let opened = unsearched(label, &port, protocol).map_err(|error| error.to_string())?;
        let (mut line, runner) = (opened.line, opened.runner);
        let missing = |why| format!("no motor of {} answers: {why}", line.label);
        line.motors =
            search::motors(runner.remote(), &self.config.by, protocol).map_err(missing)?;
        runner.end();
        let groups = choice::choose(&line.motors, &[], self.config.period);
        let share = opened.share.ok_or("this is no line of a share")?;
        let target = followed::target(share, &line, &groups, &self.config.by);
        let stream = Stream::open(target, || wall_now().0);
        let failed = |why| RecordError::Share { port: line.port.clone(), why }.to_string();
        Ok(Found { stream: stream.map_err(failed)?, line, groups })
    }
}

fn run(
    ends: &AtomicBool,
    found: &Receiver<(String, Result<Found, String>)>,
    mut put: impl FnMut(Item) + Send,
) {
    let (mut topics, mut lines) = (Topics::default(), Vec::new());
    let mut asked = Instant::now();
    while !ends.load(Ordering::SeqCst) {
        for (name, found) in found.try_iter() {
            let trouble = match found {
                Ok(Found { line, groups, stream }) => {
                    let content = Content::new(line, groups, &mut topics);
                    lines.push(Followed::new(content, stream, lines.is_empty()));
                    None
                }
                Err(why) => Some(why),
            };
            put(Item::Line { name, trouble });
        }
        topics.take().for_each(|topic| put(Item::Entry(topic)));
        if asked.elapsed() >= RATES {
            asked = Instant::now();
            lines.iter_mut().for_each(|line| line.ask_rates(wall_now()));
        }
        let now = wall_now();
        lines.iter_mut().for_each(|line| line.take(now, &mut |entry| put(Item::Entry(entry))));
        std::thread::park_timeout(TURN);
    }
}
