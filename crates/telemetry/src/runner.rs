//! The engine of a line in a thread of its own, for programs without an event loop. On virtual time its
//! owner advances it instead.

use std::collections::HashMap;
use std::fmt;
use std::io::{self, Read, Write};
use std::os::fd::AsFd;
use std::os::unix::net::UnixStream;
use std::sync::Arc;
use std::sync::mpsc::{self, Receiver, Sender, TryRecvError};
use std::thread::JoinHandle;
use std::time::Duration;

use motorlink::Clock;
use motorlink_proto::time::Micros;
use parking_lot::Mutex;
use rustix::event::{PollFd, PollFlags, Timespec, poll};
use rustix::io::Errno;
use tracing::info_span;

use crate::acquisition::{Acquisition, ConsumerId, Rate};
use crate::event::CommandError;
use crate::line::{Reply, Request, Stopped};
use crate::plan::Wants;
use crate::schedule::{CommandId, Quiet};
use crate::subscription::{Full, Subscription};

/// The result of a command or a stop.
pub type CommandResult = Result<Reply, CommandError>;

type Task = Box<dyn FnOnce(&mut Engine) + Send>;
type Ending = Box<dyn FnOnce(CommandResult) + Send>;

/// How long an engine that its owner advances waits for its line, if it has nothing else to do.
const STEP: Micros = Micros(100);

/// An engine with the commands whose end is awaited.
struct Engine {
    acquisition: Acquisition,
    waiting: HashMap<CommandId, Ending>,
}

/// An engine that runs. When it is dropped, the motors that were started through it are stopped.
#[derive(Debug)]
pub struct Runner {
    remote: Remote,
    thread: Option<JoinHandle<Vec<Stopped>>>,
}

/// Uses the engine of a [`Runner`] from any thread. It fails once the runner is gone.
#[derive(Debug, Clone)]
pub struct Remote {
    /// Commands may wait for the engine: it opens a port, or this process does not run.
    clock: Clock,
    place: Execution,
}

/// Where an engine runs.
#[derive(Debug, Clone)]
enum Execution {
    Thread {
        tasks: Sender<Task>,
        wake: Arc<UnixStream>,
    },
    /// `None` after its end.
    Here(Arc<Mutex<Option<Engine>>>),
}

/// The engine has ended.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
#[error("the engine of this line has ended")]
pub struct Ended;

impl Runner {
    /// Starts the thread. The name is that of the line.
    ///
    /// # Errors
    /// The system gives no thread or no descriptor.
    pub fn start(name: &str, acquisition: Acquisition) -> io::Result<Self> {
        let (wake, woken) = UnixStream::pair()?;
        wake.set_nonblocking(true)?;
        woken.set_nonblocking(true)?;
        let (tasks, inbox) = mpsc::channel();
        let engine = Engine { acquisition, waiting: HashMap::new() };
        let thread = std::thread::Builder::new().name(name.to_owned());
        let line = info_span!("line", name);
        let thread = thread.spawn(move || line.in_scope(|| engine.run(&inbox, woken)))?;
        let place = Execution::Thread { tasks, wake: Arc::new(wake) };
        Ok(Runner { remote: Remote { clock: Clock::running(), place }, thread: Some(thread) })
    }

    /// Without a thread: the engine does something only in [`Remote::advance`], and while somebody waits for
    /// a result. What it should call back is called at once or then.
    pub fn here(acquisition: Acquisition) -> Self {
        let clock = acquisition.clock().clone();
        let engine = Engine { acquisition, waiting: HashMap::new() };
        let place = Execution::Here(Arc::new(Mutex::new(Some(engine))));
        Runner { remote: Remote { clock, place }, thread: None }
    }

    /// Uses the engine from other threads.
    pub fn remote(&self) -> &Remote {
        &self.remote
    }

    /// Stops the motors that were started through the engine, and ends it.
    pub fn end(mut self) -> Vec<Stopped> {
        self.close()
    }

    fn close(&mut self) -> Vec<Stopped> {
        let stopped = self.remote.close();
        let ended = self.thread.take().map(JoinHandle::join);
        ended.and_then(Result::ok).unwrap_or(stopped)
    }
}

impl Drop for Runner {
    fn drop(&mut self) {
        self.close();
    }
}

impl Remote {
    /// Ends the engine, however many remotes there are: what is waited for fails at once. The motors that
    /// were started through it are stopped.
    pub fn end(&self) {
        self.close();
    }

    /// Gives the motors that an engine without a thread has stopped.
    fn close(&self) -> Vec<Stopped> {
        match &self.place {
            Execution::Thread { wake, .. } => {
                // It fails if the engine has ended.
                let _ = wake.shutdown(std::net::Shutdown::Both);
                Vec::new()
            }
            Execution::Here(engine) => {
                let engine = engine.lock().take();
                engine.map_or_else(Vec::new, Engine::stop)
            }
        }
    }

    /// Advances an engine without a thread. Gives when that should be done again, if nothing is received
    /// before.
    pub fn advance(&self) -> Option<Duration> {
        match &self.place {
            Execution::Thread { .. } => None,
            Execution::Here(engine) => engine.lock().as_mut().and_then(Engine::advance),
        }
    }

    /// Waits for the next of these; `None` if no more come.
    pub(crate) fn next<T>(&self, results: &Receiver<T>) -> Option<T> {
        while let Execution::Here(_) = &self.place {
            match results.try_recv() {
                Ok(result) => return Some(result),
                Err(TryRecvError::Disconnected) => return None,
                Err(TryRecvError::Empty) => {}
            }
            if self.advance() != Some(Duration::ZERO) {
                self.clock.wait(self.clock.now() + STEP);
            }
        }
        results.recv().ok()
    }

    /// Runs a function on the engine, between two steps of it, and gives its result.
    ///
    /// # Errors
    /// The engine has ended.
    pub fn with<R: Send + 'static>(
        &self,
        task: impl FnOnce(&mut Acquisition) -> R + Send + 'static,
    ) -> Result<R, Ended> {
        let (sender, receiver) = mpsc::channel();
        self.post(move |engine| {
            // Whoever asked may have gone.
            let _ = sender.send(task(engine));
        })?;
        self.next(&receiver).ok_or(Ended)
    }

    /// Runs a function on the engine, between two steps of it, and does not wait for it.
    ///
    /// # Errors
    /// The engine has ended.
    pub fn post(&self, task: impl FnOnce(&mut Acquisition) + Send + 'static) -> Result<(), Ended> {
        self.send(|engine| task(&mut engine.acquisition))
    }

    /// Sends these signals, and all events, to a new subscription.
    ///
    /// # Errors
    /// The engine has ended.
    pub fn subscribe(
        &self,
        wants: Wants,
        capacity: usize,
        full: Full,
    ) -> Result<(ConsumerId, Subscription), Ended> {
        let subscription = Subscription::new(capacity, full);
        let theirs = subscription.clone();
        let id = self.with(move |engine| engine.subscribe(theirs, wants))?;
        Ok((id, subscription))
    }

    /// Ends a subscription.
    ///
    /// # Errors
    /// The engine has ended.
    pub fn unsubscribe(&self, id: ConsumerId) -> Result<(), Ended> {
        self.with(move |engine| engine.unsubscribe(id))
    }

    /// The rates of all signals that are read.
    ///
    /// # Errors
    /// The engine has ended.
    pub fn rates(&self) -> Result<Vec<Rate>, Ended> {
        self.with(|engine| engine.rates().collect())
    }

    /// Refuses all motion from now on, whoever asks, until it is released.
    ///
    /// # Errors
    /// The engine has ended.
    pub fn latch(&self, by: &Arc<str>) -> Result<(), Ended> {
        let (sender, receiver) = mpsc::channel();
        self.latch_then(by, move || {
            let _ = sender.send(());
        })?;
        self.next(&receiver).ok_or(Ended)
    }

    /// As [`latch`](Self::latch), without waiting: `done` is called in the engine's thread.
    ///
    /// # Errors
    /// The engine has ended.
    pub fn latch_then(
        &self,
        by: &Arc<str>,
        done: impl FnOnce() + Send + 'static,
    ) -> Result<(), Ended> {
        let by = Arc::clone(by);
        self.send(move |Engine { acquisition, waiting }| {
            acquisition.latch(&by, &mut |id, result| tell(waiting, id, result));
            done();
        })
    }

    /// Allows motion again.
    ///
    /// # Errors
    /// The engine has ended.
    pub fn release(&self, by: &Arc<str>) -> Result<(), Ended> {
        let by = Arc::clone(by);
        self.with(move |engine| engine.release(&by))
    }

    /// Sends a command and waits for its result.
    ///
    /// # Errors
    /// See [`CommandError`].
    pub fn command(&self, by: &Arc<str>, request: Request, time_to_live: Micros) -> CommandResult {
        let wait = |ended| self.command_then(by, request, time_to_live, ended);
        self.wait(wait).unwrap_or(Err(CommandError::Ended))
    }

    /// As [`command`](Self::command), without waiting: `ended` receives the result in the engine's thread.
    ///
    /// # Errors
    /// The engine has ended. If it ends later, `ended` receives that it has.
    pub fn command_then(
        &self,
        by: &Arc<str>,
        request: Request,
        time_to_live: Micros,
        ended: impl FnOnce(CommandResult) + Send + 'static,
    ) -> Result<(), Ended> {
        let by = Arc::clone(by);
        let (clock, asked) = (self.clock.clone(), self.clock.now());
        self.send(move |engine| {
            let waited = clock.now().since(asked);
            let queued = match time_to_live.0.checked_sub(waited.0) {
                Some(left) => engine.acquisition.command(&by, request, Micros(left)),
                None => Err(CommandError::Expired),
            };
            match queued {
                Ok(id) => drop(engine.waiting.insert(id, Box::new(ended))),
                Err(error) => ended(Err(error)),
            }
        })
    }

    /// Stops a motor and waits until it confirms it, or until the stop has failed for good.
    ///
    /// # Errors
    /// See [`CommandError`]. The motor may still be turning.
    pub fn stop(&self, by: &Arc<str>, request: Request) -> CommandResult {
        self.wait(|ended| self.stop_then(by, request, None, ended))
            .unwrap_or(Err(CommandError::Ended))
    }

    /// As [`stop`](Self::stop), or as a quiet one ([`Acquisition::stop`]), without waiting: `ended`
    /// receives the result in the engine's thread.
    ///
    /// # Errors
    /// The engine has ended. If it ends later, `ended` receives that it has.
    pub fn stop_then(
        &self,
        by: &Arc<str>,
        request: Request,
        quiet: Option<Quiet>,
        ended: impl FnOnce(CommandResult) + Send + 'static,
    ) -> Result<(), Ended> {
        let by = Arc::clone(by);
        self.send(move |engine| {
            let Engine { acquisition, waiting } = engine;
            let overtaken = &mut |id, result| tell(waiting, id, result);
            let id = acquisition.stop(&by, request, quiet, overtaken);
            engine.waiting.insert(id, Box::new(ended));
        })
    }

    fn wait(
        &self,
        begin: impl FnOnce(Ending) -> Result<(), Ended>,
    ) -> Result<CommandResult, Ended> {
        let (sender, receiver) = mpsc::channel();
        // Whoever asked may have gone.
        begin(Box::new(move |result| drop(sender.send(result))))?;
        self.next(&receiver).ok_or(Ended)
    }

    fn send(&self, task: impl FnOnce(&mut Engine) + Send + 'static) -> Result<(), Ended> {
        let (tasks, wake) = match &self.place {
            Execution::Thread { tasks, wake } => (tasks, wake),
            Execution::Here(engine) => return engine.lock().as_mut().map(task).ok_or(Ended),
        };
        tasks.send(Box::new(task)).map_err(|_| Ended)?;
        match (&**wake).write(&[0]) {
            Ok(_) => Ok(()),
            // It is awake if it has not read the last bytes.
            Err(error) if error.kind() == io::ErrorKind::WouldBlock => Ok(()),
            Err(_) => Err(Ended),
        }
    }
}

fn tell(waiting: &mut HashMap<CommandId, Ending>, id: CommandId, result: CommandResult) {
    if let Some(ended) = waiting.remove(&id) {
        ended(result);
    }
}

impl fmt::Debug for Engine {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Engine").finish_non_exhaustive()
    }
}

impl Engine {
    fn run(mut self, inbox: &Receiver<Task>, mut woken: UnixStream) -> Vec<Stopped> {
        loop {
            loop {
                match inbox.try_recv() {
                    Ok(task) => task(&mut self),
                    Err(TryRecvError::Empty) => break,
                    Err(TryRecvError::Disconnected) => return self.end(inbox),
                }
            }
            let wait = self.advance();
            match self.await_next(&woken, wait) {
                Ok(is_woken) if !(is_woken && is_closed(&mut woken)) => {}
                _ => return self.end(inbox),
            }
        }
    }

    fn advance(&mut self) -> Option<Duration> {
        let Engine { acquisition, waiting } = self;
        acquisition.advance(&mut |id, result| tell(waiting, id, result))
    }

    fn end(mut self, inbox: &Receiver<Task>) -> Vec<Stopped> {
        // Nothing that is asked for here is sent any more.
        while let Ok(task) = inbox.try_recv() {
            task(&mut self);
        }
        self.stop()
    }

    /// Stops the motors, and tells those who wait.
    fn stop(self) -> Vec<Stopped> {
        let Engine { acquisition, waiting } = self;
        let stopped = acquisition.end();
        waiting.into_values().for_each(|ended| ended(Err(CommandError::Ended)));
        stopped
    }

    /// Waits until there is something to do; whether somebody woke the engine.
    fn await_next(&self, woken: &UnixStream, wait: Option<Duration>) -> Result<bool, Errno> {
        let line = self.acquisition.descriptor();
        let mut fds: Vec<PollFd<'_>> = line
            .into_iter()
            .chain([woken.as_fd()])
            .map(|fd| PollFd::from_borrowed_fd(fd, PollFlags::IN))
            .collect();
        let wait = wait.and_then(|wait| Timespec::try_from(wait).ok());
        match poll(&mut fds, wait.as_ref()) {
            Ok(_) => Ok(fds.last().is_some_and(|fd| !fd.revents().is_empty())),
            Err(Errno::INTR) => Ok(false),
            Err(error) => Err(error),
        }
    }
}

/// Reads what woke the engine; whether the runner is gone.
fn is_closed(woken: &mut UnixStream) -> bool {
    let mut bytes = [0; 64];
    loop {
        match woken.read(&mut bytes) {
            Ok(0) => return true,
            Ok(count) if count < bytes.len() => return false,
            Ok(_) => {}
            Err(error) => return error.kind() != io::ErrorKind::WouldBlock,
        }
    }
}
