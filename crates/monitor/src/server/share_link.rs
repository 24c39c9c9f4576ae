//! The connection of the server itself to the share: it stops all motors when no page can.

use std::io;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

use motorlink_telemetry::share::address::Address;
use motorlink_telemetry::share::client::{Listener, Program, Refusal};
use motorlink_telemetry::share::frame::FrameKind;
use motorlink_telemetry::share::message::{
    Answer, Ask, EventKind, Line, Reason, Request, StoppedMotor, Text, decode,
};
use parking_lot::Mutex;
use tokio::sync::{Mutex as AsyncMutex, watch};
use tokio::time::{Instant, sleep, timeout};
use tracing::debug;

use crate::dead_man::Stops;
use crate::drive::Drives;

/// The name of the server at the share.
const NAME: &str = "monitor";
/// The longest time for the hello of a share.
const HELLO: Duration = Duration::from_secs(5);
/// The longest time until the server knows a line that was opened.
const OPENED: Duration = Duration::from_secs(1);
/// The pause between two attempts to connect.
pub const AGAIN: Duration = Duration::from_millis(250);
/// How long a stop waits for a share that is lost.
const PENDING: Duration = Duration::from_secs(10);

/// A share that may end and be started again.
pub struct ShareLink {
    share: Arc<dyn Address>,
    /// The stops of all pages.
    stops: Arc<Mutex<Stops>>,
    /// What the next share gets first.
    pending: Mutex<Pending>,
    /// Whether motion is refused until somebody releases it, as far as this program knows.
    is_latched: AtomicBool,
    /// One connection at a time sends it. The others wait: none can move a motor before it.
    sending: AsyncMutex<()>,
    /// How long a stop waits for a share that is lost.
    stop_waits: Duration,
    /// `None` until the first attempt to connect has ended.
    joined: watch::Sender<Option<Result<Joined, String>>>,
}

/// What a share gets before anything else.
#[derive(Debug, Default, Clone, Copy, PartialEq, Eq)]
struct Pending {
    /// Since when a stop of all motors waits that no share got.
    stop: Option<Instant>,
    /// The share before this one was latched when it ended: its motors may not have confirmed their stop.
    latch: bool,
}

/// What there is while the share is there.
#[derive(Clone)]
struct Joined {
    program: Program,
    drives: Drives,
}

impl ShareLink {
    /// To a share. [`keep`](Self::keep) connects to it.
    pub fn new(share: Arc<dyn Address>) -> Self {
        ShareLink {
            share,
            stops: Arc::default(),
            pending: Mutex::default(),
            is_latched: AtomicBool::new(false),
            sending: AsyncMutex::default(),
            stop_waits: PENDING,
            joined: watch::Sender::new(None),
        }
    }

    /// With another time for which a stop waits for a share that is lost.
    pub fn with_stops_waiting(self, stop_waits: Duration) -> Self {
        ShareLink { stop_waits, ..self }
    }

    /// The stops of all pages.
    pub fn stops(&self) -> &Arc<Mutex<Stops>> {
        &self.stops
    }

    /// Where the share is.
    pub fn share(&self) -> &Arc<dyn Address> {
        &self.share
    }

    /// A page latches the share: a share that is started later is latched, too.
    pub fn latching(&self) {
        self.is_latched.store(true, Ordering::SeqCst);
    }

    /// Connects a program of this name, after a stop or a latch that the share did not get. Gives the name
    /// that events have, too.
    ///
    /// # Errors
    /// No share is there, or it refuses.
    pub async fn connect(&self, name: &str) -> io::Result<(Program, Listener, String)> {
        self.send_pending().await?;
        self.open(name).await
    }

    async fn open(&self, name: &str) -> io::Result<(Program, Listener, String)> {
        let connected = timeout(HELLO, Program::connect(&self.share, name)).await;
        connected.map_err(|_| io::Error::from(io::ErrorKind::TimedOut))?
    }

    /// Latches the share and stops all motors, if the share before it was latched or if that was asked for
    /// while the share was lost.
    async fn send_pending(&self) -> io::Result<()> {
        let _sending = self.sending.lock().await;
        let wanted = *self.pending.lock();
        let stop = wanted.stop.filter(|asked| asked.elapsed() < self.stop_waits);
        if stop.is_none() && !wanted.latch {
            return Ok(());
        }
        let (program, mut listener, _) = self.open(NAME).await?;
        program.pass(&Request::new(1, Ask::Latch)).await?;
        program.pass(&Request::new(2, Ask::Stop { motor: None })).await?;
        // The share takes the requests of a program in their order: it has them when it answers.
        lines(&program, &mut listener).await?;
        let mut pending = self.pending.lock();
        pending.stop.take_if(|latest| wanted.stop == Some(*latest));
        pending.latch = false;
        Ok(())
    }

    /// Connects again and again.
    pub async fn keep(&self) {
        let mut known: Option<Drives> = None;
        loop {
            let why = match self.join().await {
                Ok((program, lines, mut listener)) => {
                    let new = Drives::new(lines);
                    // The limits that pages have set stay.
                    let mut drives = match known.filter(|known| known.lines() == new.lines()) {
                        Some(before) => {
                            before.reconnected();
                            before
                        }
                        None => new,
                    };
                    let lost = loop {
                        let joined = Joined { program: program.clone(), drives: drives.clone() };
                        self.joined.send_replace(Some(Ok(joined)));
                        // A stop may have been asked for just before. If this fails, the share is lost again.
                        let _ = self.send_pending().await;
                        match self.next_lines(&program, &mut listener).await {
                            Ok(next) => drives = drives.with_lines(next),
                            Err(error) => break error,
                        }
                    };
                    known = Some(drives);
                    self.pending.lock().latch |= self.is_latched.load(Ordering::SeqCst);
                    lost
                }
                Err(error) => error,
            };
            debug!(%why, "no connection to the share");
            self.joined.send_replace(Some(Err(why.to_string())));
            sleep(AGAIN).await;
        }
    }

    async fn join(&self) -> io::Result<(Program, Vec<Line>, Listener)> {
        let (program, mut listener, _) = self.connect(NAME).await?;
        let (lines, is_latched) = lines(&program, &mut listener).await?;
        self.is_latched.store(is_latched, Ordering::SeqCst);
        Ok((program, lines, listener))
    }

    /// Waits until lines are opened or closed, and gives all lines. Remembers the latch meanwhile.
    async fn next_lines(
        &self,
        program: &Program,
        listener: &mut Listener,
    ) -> io::Result<Vec<Line>> {
        loop {
            let frame = listener.next().await?;
            if frame.kind != FrameKind::Text {
                continue;
            }
            let Ok(Text::Event(event)) = decode(&frame.payload) else { continue };
            match event.event {
                EventKind::Latched => self.is_latched.store(true, Ordering::SeqCst),
                EventKind::Released => self.is_latched.store(false, Ordering::SeqCst),
                // An event that comes before the answer happened before it.
                EventKind::Opened | EventKind::Closed => {
                    return Ok(lines(program, listener).await?.0);
                }
                _ => {}
            }
        }
    }

    /// The drives of the share.
    ///
    /// # Errors
    /// It is lost.
    pub async fn drives(&self) -> Result<Drives, Refusal> {
        Ok(self.get().await?.drives)
    }

    /// As [`drives`](Self::drives). If the line is not known it may just have been opened: it is waited
    /// for.
    ///
    /// # Errors
    /// It is lost.
    pub async fn drives_of(&self, line: Option<&str>) -> Result<Drives, Refusal> {
        let drives = self.drives().await?;
        let Some(line) = line.filter(|line| !drives.has(line)) else { return Ok(drives) };
        let mut changes = self.joined.subscribe();
        let is_there = |joined: &Option<Result<Joined, String>>| match joined {
            Some(Ok(joined)) => joined.drives.has(line),
            _ => false,
        };
        // Otherwise it is a line that is not there.
        let _ = timeout(OPENED, changes.wait_for(is_there)).await;
        self.drives().await
    }

    /// Waits until the share has other lines than these.
    pub async fn other_lines(&self, drives: &Drives) {
        let mut changes = self.joined.subscribe();
        let known = drives.lines();
        let is_other = |joined: &Option<Result<Joined, String>>| match joined {
            Some(Ok(joined)) => joined.drives.lines() != known,
            _ => false,
        };
        // This side keeps the sender.
        let _ = changes.wait_for(is_other).await;
    }

    /// Latches the share, then stops all motors. If the share is lost, that is done when it is back within
    /// 10 s.
    ///
    /// # Errors
    /// It is lost.
    pub async fn stop_all(&self) -> Result<Vec<StoppedMotor>, Refusal> {
        self.stops.lock().count(None);
        self.latching();
        let asked = Instant::now();
        // Before the look at the connection: one that is made at this moment sends it.
        self.pending.lock().stop = Some(asked);
        let program = self.get().await.map_err(until_back)?.program;
        self.pending.lock().stop.take_if(|latest| *latest == asked);
        match stop_all(&program).await {
            Err(refusal) if refusal.reason == Reason::Line => {
                // A frozen share may have had it for long.
                self.pending.lock().stop = Some(Instant::now());
                Err(until_back(lost("the connection has ended")))
            }
            stopped => stopped,
        }
    }

    /// What there is of the share, after the first attempt to connect.
    async fn get(&self) -> Result<Joined, Refusal> {
        let mut changes = self.joined.subscribe();
        let joined = changes.wait_for(Option::is_some).await;
        // This side keeps the sender.
        let joined = joined.ok().and_then(|joined| joined.clone());
        joined.unwrap_or_else(|| Err("the server ends".to_owned())).map_err(|why| lost(&why))
    }
}

/// Asks for the lines, and whether motion is refused.
async fn lines(program: &Program, listener: &mut Listener) -> io::Result<(Vec<Line>, bool)> {
    let told = timeout(HELLO, program.lines(listener)).await;
    let (lines, latched_by) = told.map_err(|_| io::Error::from(io::ErrorKind::TimedOut))??;
    Ok((lines, latched_by.is_some()))
}

/// Latches the share, then stops all motors.
///
/// # Errors
/// The share has ended.
pub async fn stop_all(program: &Program) -> Result<Vec<StoppedMotor>, Refusal> {
    // The stop does not wait for the answer to the latch.
    let (_, stopped) =
        tokio::join!(program.ask(Ask::Latch), program.ask(Ask::Stop { motor: None }));
    match stopped? {
        Answer::Stop { motors } => Ok(motors),
        _ => Err(lost("it gives another answer")),
    }
}

/// That the share is lost, and what becomes of a stop.
fn until_back(Refusal { message, .. }: Refusal) -> Refusal {
    let again = format!("If it is back within {} s, the stop is sent", PENDING.as_secs());
    Refusal::new(Reason::Line, format!("{message}. {again}"))
}

/// Nothing can be asked of the share.
pub fn lost(why: &str) -> Refusal {
    Refusal::new(Reason::Line, format!("the share is lost: {why}"))
}
