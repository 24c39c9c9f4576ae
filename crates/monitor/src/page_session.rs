//! A page: what it may ask for, and the motors that depend on it.
//!
//! A page has up to two sessions at the share. The first one sees. The second one is opened by the first
//! command that may move a motor. The share stops what a session turned when it ends, so the dead-man
//! closes the second session, and the server has no list of motors of its own.

use std::sync::Arc;
use std::time::{Duration, SystemTime, UNIX_EPOCH};

use motorlink::Clock;
use motorlink::port::PortName;
use motorlink_proto::time::Micros;
use motorlink_telemetry::share::client::{Listener, OWN_IDS, Program, Refusal, UNAWAITED};
use motorlink_telemetry::share::frame::{Frame, FrameKind};
use motorlink_telemetry::share::message::{self as share, Event, EventKind, MotorName, Reason};
use parking_lot::Mutex;
use serde::Deserialize;
use tokio::sync::{Mutex as AsyncMutex, Notify, OwnedSemaphorePermit, Semaphore, mpsc};
use tokio::task::JoinSet;

use crate::dead_man::{DeadMan, Lapse, Ticket};
use crate::drive::MotionPermit;
use crate::message::{Answer, Ask, FromPage, Request, Role, RunResult, Text};
use crate::recordings::Recordings;
use crate::server::share_link::{ShareLink, lost, stop_all};

/// Requests of a page about drives that are under way.
const REQUESTS: usize = 64;

/// A page that is connected.
pub struct Page {
    name: String,
    may: Permissions,
    clock: Clock,
    link: Arc<ShareLink>,
    control: Mutex<Control>,
    /// The share stops the motors that the page turns if it gets no sign of life for this time, in seconds:
    /// this server hangs or is stopped, or it would have stopped them itself.
    silence: f64,
    /// The deadline of the dead-man may be another one.
    changed: Notify,
    /// One session is opened at a time.
    opening: AsyncMutex<()>,
    /// The session that sees, while the share is there.
    view: Mutex<Option<Program>>,
    recordings: Arc<Recordings>,
    requests: Arc<Semaphore>,
    out: mpsc::Sender<String>,
}

/// What a page may do.
#[derive(Debug, Clone, Copy)]
pub struct Permissions {
    /// Whose page it is.
    pub role: Role,
    /// Whether operators open lines at addresses in a network.
    pub opens_addresses: bool,
}

/// What moves motors.
struct Control {
    man: DeadMan,
    /// The session that turned motors. The share stops them when it ends.
    drive: Option<Program>,
    /// When that was opened, by the wall clock in seconds.
    opened: f64,
}

/// Why a page has to be closed, in words.
pub type Broken = String;

impl Page {
    /// A page of this name. `out` takes the texts for it.
    pub fn new(
        name: String,
        may: Permissions,
        deadline: Micros,
        link: Arc<ShareLink>,
        recordings: Arc<Recordings>,
        out: mpsc::Sender<String>,
    ) -> Self {
        let man = DeadMan::new(deadline, Arc::clone(link.stops()));
        Page {
            silence: 2.0 * Duration::from(deadline).as_secs_f64(),
            name,
            may,
            clock: Clock::running(),
            link,
            control: Mutex::new(Control { man, drive: None, opened: 0.0 }),
            changed: Notify::new(),
            opening: AsyncMutex::new(()),
            view: Mutex::new(None),
            recordings,
            requests: Arc::new(Semaphore::new(REQUESTS)),
            out,
        }
    }

    /// The next beat, which is sent now.
    pub fn beat(&self) -> Text {
        Text::Beat(self.control.lock().man.beat(self.clock.now(), wall()))
    }

    /// The session that sees; `None`: the share is lost.
    pub fn set_view(&self, view: Option<Program>) {
        *self.view.lock() = view;
    }

    /// Stops the motors of the page when it gives no sign of life. Runs until it is dropped.
    pub async fn watch(&self) {
        loop {
            let now = self.clock.now();
            let due = {
                let mut control = self.control.lock();
                if let Some(lapse) = control.man.poll(now) {
                    self.lapse(&mut control, lapse);
                }
                control.man.due()
            };
            match due {
                None => self.changed.notified().await,
                Some(due) => {
                    tokio::select! {
                        () = tokio::time::sleep(Duration::from(due.since(now))) => {}
                        () = self.changed.notified() => {}
                    }
                }
            }
        }
    }

    /// The motors that this page turned stop.
    pub fn end(&self, lapse: Lapse) {
        let mut control = self.control.lock();
        if let Some(lapse) = control.man.end(lapse) {
            self.lapse(&mut control, lapse);
        }
    }

    fn lapse(&self, control: &mut Control, lapse: Lapse) {
        if let Some(drive) = control.drive.take() {
            drive.close_because(Refusal::new(Reason::Lapsed, lapse.to_string()));
        }
        // If it takes no texts, it learns from the next beat that it holds no motors.
        let _ = self.out.try_send(encode(&Text::Lapsed { message: lapse.to_string() }));
    }

    /// Takes a text of the page. What takes longer goes on in `tasks`.
    ///
    /// # Errors
    /// The page has to be closed.
    pub async fn receive(
        self: &Arc<Self>,
        text: &str,
        tasks: &mut JoinSet<()>,
    ) -> Result<(), Broken> {
        match read(text) {
            Ok(FromPage::Alive(sign)) => {
                let now = self.clock.now();
                let mut control = self.control.lock();
                if let Some(lapse) = control.man.hear(&sign, now) {
                    self.lapse(&mut control, lapse);
                }
                // The share learns that the page lives only while this server runs.
                if let Some(drive) = control.drive.as_ref().filter(|_| control.man.is_alive(now)) {
                    drive.offer(&share::Request::new(UNAWAITED, share::Ask::Alive));
                }
                Ok(())
            }
            Ok(FromPage::Request(request)) => {
                self.carry_out(request, tasks).await;
                Ok(())
            }
            Ok(FromPage::Share(request)) => {
                let id = request.id;
                if let Err(refusal) = self.pass(request).await {
                    self.refuse(id, refusal).await;
                }
                Ok(())
            }
            Err((Some(id), why)) => {
                self.refuse(id, Refusal::usage(why)).await;
                Ok(())
            }
            Err((None, why)) => Err(why),
        }
    }

    /// Passes a request on to the share, which answers it.
    async fn pass(&self, request: share::Request) -> Result<(), Refusal> {
        use share::Ask;
        match &request.ask {
            Ask::Lines
            | Ask::Signals { .. }
            | Ask::Subscribe { .. }
            | Ask::Unsubscribe { .. }
            | Ask::Rates { .. }
            | Ask::Ports
            | Ask::Frames { .. } => {}
            Ask::Stop { motor } => self.control.lock().man.stop(motor.as_ref()),
            Ask::Latch => {
                self.check_operator()?;
                self.link.latching();
            }
            Ask::Release | Ask::Close { .. } => self.check_operator()?,
            Ask::Scan { port, .. } | Ask::Open { port, .. } => {
                self.check_operator()?;
                self.check_port(port)?;
            }
            Ask::Hello { .. }
            | Ask::Command { .. }
            | Ask::Confirm { .. }
            | Ask::Ending { .. }
            | Ask::Deadline { .. }
            | Ask::Alive
            | Ask::Take { .. }
            | Ask::Claim { .. }
            | Ask::Leave { .. } => {
                return Err(Refusal::new(Reason::Forbidden, "a page may not send this request"));
            }
        }
        self.view()?.pass(&request).await.map_err(|error| lost(&error.to_string()))
    }

    async fn carry_out(self: &Arc<Self>, Request { id, ask }: Request, tasks: &mut JoinSet<()>) {
        let page = Arc::clone(self);
        match ask {
            Ask::LetGo => {
                self.end(Lapse::LetGo);
                self.answer(id, Ok(Answer::LetGo)).await;
            }
            Ask::StopAll => {
                self.control.lock().man.stop(None);
                self.link.latching();
                let view = self.view();
                tasks.spawn(async move {
                    let stopped = match view {
                        Ok(view) => stop_all(&view).await,
                        Err(lost) => Err(lost),
                    };
                    let stopped = match stopped {
                        // The server keeps the stop until the share is back.
                        Err(refusal) if refusal.reason == Reason::Line => {
                            page.link.stop_all().await
                        }
                        stopped => stopped,
                    };
                    page.answer(id, stopped.map(|motors| Answer::StopAll { motors })).await;
                });
            }
            Ask::Record { .. } | Ask::EndRecording | Ask::Recordings | Ask::Recording { .. } => {
                let permit = match self.check(&ask).and_then(|()| self.place()) {
                    Ok(permit) => permit,
                    Err(refusal) => return self.refuse(id, refusal).await,
                };
                tasks.spawn(async move {
                    let result = page.recordings.answer(ask, &page.name, page.view()).await;
                    drop(permit);
                    page.answer(id, result).await;
                });
            }
            ask => {
                let ready = self.check(&ask).and_then(|()| Ok((self.place()?, self.view()?)));
                let (permit, view) = match ready {
                    Ok(ready) => ready,
                    Err(refusal) => return self.refuse(id, refusal).await,
                };
                let ticket = self.control.lock().man.ticket(ask.motor().cloned());
                let line = ask.line().map(str::to_owned);
                tasks.spawn(async move {
                    let motion = CommandPermit { page: Arc::clone(&page), ticket };
                    let result = match page.link.drives_of(line.as_deref()).await {
                        Ok(drives) => drives.answer(ask, &view, &motion).await,
                        Err(refusal) => Err(refusal),
                    };
                    drop(permit);
                    page.answer(id, result).await;
                });
            }
        }
    }

    /// Takes a message of the share: if somebody else stops a motor, commands from before do not move it.
    /// The session that sees is read only while the browser reads, the other one always: what happened
    /// since that is open counts when it tells of it.
    pub fn notice_stop_in_view(&self, frame: &Frame) {
        self.notice_stop(frame, |control, event| {
            control.drive.is_none() || event.wall <= control.opened
        });
    }

    fn notice_stop(&self, frame: &Frame, counts: impl Fn(&Control, &Event) -> bool) {
        if frame.kind == FrameKind::Text
            && let Ok(share::Text::Event(event)) = share::decode(&frame.payload)
            && event.event == EventKind::Stopping
            && event.by.as_ref() != Some(&self.name)
        {
            let mut control = self.control.lock();
            if counts(&control, &event) {
                let motor = event.line.zip(event.motor);
                let motor = motor.map(|(line, motor)| MotorName { line, motor });
                control.man.stopped(motor.as_ref());
            }
        }
    }

    /// A place among the requests that are under way.
    fn place(&self) -> Result<OwnedSemaphorePermit, Refusal> {
        let busy = format!("{REQUESTS} requests are under way, which is the limit");
        let permit = Arc::clone(&self.requests).try_acquire_owned();
        permit.map_err(|_| Refusal::new(Reason::Busy, busy))
    }

    /// Whether this page may ask for that.
    fn check(&self, ask: &Ask) -> Result<(), Refusal> {
        match ask {
            Ask::StopAll
            | Ask::LetGo
            | Ask::Motors { .. }
            | Ask::Describe { .. }
            | Ask::Read { .. }
            | Ask::Limits
            | Ask::Dump { .. }
            | Ask::Diff { .. }
            | Ask::Recordings
            | Ask::Recording { .. } => Ok(()),
            Ask::Write { .. }
            | Ask::Act { .. }
            | Ask::Run { .. }
            | Ask::Limit { .. }
            | Ask::Restore { .. }
            | Ask::Record { .. }
            | Ask::EndRecording => self.check_operator(),
        }
    }

    fn check_operator(&self) -> Result<(), Refusal> {
        match self.may.role {
            Role::Operator => Ok(()),
            Role::Viewer => Err(Refusal::new(
                Reason::Forbidden,
                "a viewer may see everything and stop, nothing else",
            )),
        }
    }

    /// Whether this page may open this port. The share refuses names that are not ports.
    fn check_port(&self, port: &str) -> Result<(), Refusal> {
        let is_address = port.parse::<PortName>().is_ok_and(|port| port.is_address());
        match is_address && !self.may.opens_addresses {
            true => Err(Refusal::new(
                Reason::Forbidden,
                "this monitor is open to the network, so its pages connect to no network address; start it \
                 with --open-addresses, or give it the port with -p",
            )),
            false => Ok(()),
        }
    }

    async fn answer(&self, id: u32, result: Result<Answer, Refusal>) {
        match result {
            // Nobody reads any more.
            Ok(answer) => drop(self.out.send(encode(&Text::Answer { id, answer })).await),
            Err(refusal) => self.refuse(id, refusal).await,
        }
    }

    async fn refuse(&self, id: u32, refusal: Refusal) {
        let _ = self.out.send(encode(&share::Text::Refusal { id, refusal })).await;
    }

    fn view(&self) -> Result<Program, Refusal> {
        let view = self.view.lock().clone();
        view.ok_or_else(|| lost("the server connects again"))
    }

    /// The session that turns motors, if there is one. Motion depends on the page from now on.
    fn permit(&self, ticket: &Ticket, hold: bool) -> Result<Option<Program>, Refusal> {
        let mut control = self.control.lock();
        control.man.permit(ticket, hold, self.clock.now())?;
        self.changed.notify_one();
        Ok(control.drive.clone())
    }

    /// Opens the session that turns motors.
    async fn open(self: &Arc<Self>, ticket: &Ticket, hold: bool) -> Result<Program, Refusal> {
        let name = format!("{} (control)", self.name);
        let connected = self.link.connect(&name).await;
        let (drive, listener, _) = connected.map_err(|error| lost(&error.to_string()))?;
        let silence = Some(self.silence);
        let deadline = share::Ask::Deadline { silence, motion: None };
        let told = drive.pass(&share::Request::new(UNAWAITED, deadline)).await;
        told.map_err(|error| lost(&error.to_string()))?;
        // The page may have lapsed meanwhile.
        self.permit(ticket, hold)?;
        {
            let mut control = self.control.lock();
            (control.drive, control.opened) = (Some(drive.clone()), wall());
        }
        tokio::spawn(follow(Arc::clone(self), drive.clone(), listener));
        Ok(drive)
    }
}

/// Reads what the share sends to the session that turns motors.
async fn follow(page: Arc<Page>, drive: Program, mut listener: Listener) {
    while let Ok(frame) = listener.next().await {
        page.notice_stop(&frame, |_, _| true);
    }
    let mut control = page.control.lock();
    if control.drive.as_ref().is_some_and(|current| current.is(&drive))
        && let Some(lapse) = control.man.end(Lapse::Share)
    {
        page.lapse(&mut control, lapse);
    }
}

/// The permission of one command.
struct CommandPermit {
    page: Arc<Page>,
    ticket: Ticket,
}

impl MotionPermit for CommandPermit {
    async fn program(&self, hold: bool) -> Result<Program, Refusal> {
        let _opening = self.page.opening.lock().await;
        match self.page.permit(&self.ticket, hold)? {
            Some(drive) => Ok(drive),
            None => self.page.open(&self.ticket, hold).await,
        }
    }

    fn report(&self) -> impl FnOnce(RunResult) + Send + 'static {
        let page = Arc::clone(&self.page);
        move |ran| {
            // A page that takes no texts waits for it.
            tokio::spawn(async move {
                let _ = page.out.send(encode(&Text::Ran(ran))).await;
            });
        }
    }
}

/// Reads a text of a page. An error has the id of the request, if it has one.
fn read(text: &str) -> Result<FromPage, (Option<u32>, String)> {
    #[derive(Deserialize)]
    struct Head {
        #[serde(default)]
        id: Option<u32>,
        #[serde(default)]
        ask: serde_json::Value,
    }
    let head: Head = serde_json::from_str(text)
        .map_err(|error| (None, format!("no message of a page: {error}")))?;
    let Some(id) = head.id else {
        let sign = serde_json::from_str(text).map(FromPage::Alive);
        return sign.map_err(|error| (None, format!("no message of a page: {error}")));
    };
    if id >= OWN_IDS {
        return Err((Some(id), format!("the id of a request is below {OWN_IDS}")));
    }
    let own = match serde_json::from_str(text) {
        Ok(request) => return Ok(FromPage::Request(request)),
        Err(error) => error.to_string(),
    };
    let shares = match serde_json::from_str(text) {
        Ok(request) => return Ok(FromPage::Share(request)),
        Err(error) => error.to_string(),
    };
    const UNKNOWN: &str = "unknown variant";
    let why = match (own.starts_with(UNKNOWN), shares.starts_with(UNKNOWN)) {
        (true, true) => format!("no request {}", head.ask),
        (true, false) => shares,
        (false, _) => own,
    };
    Err((Some(id), why))
}

/// The wall clock, in seconds since 1970.
fn wall() -> f64 {
    SystemTime::now().duration_since(UNIX_EPOCH).unwrap_or_default().as_secs_f64()
}

/// A text for a page.
pub fn encode(text: &impl serde::Serialize) -> String {
    // The messages have string keys and no maps, which is all that could fail.
    serde_json::to_string(text).unwrap_or_default()
}
