//! The WebSocket of a page: texts of the page, and what the share and the server send to it.

use std::sync::Arc;
use std::time::Duration;

use axum::extract::ws::{Message, WebSocket};
use futures_util::SinkExt;
use futures_util::stream::{SplitStream, StreamExt};
use motorlink_proto::time::Micros;
use motorlink_telemetry::share::client::{Listener, Program};
use motorlink_telemetry::share::frame::{Frame, FrameKind};
use motorlink_telemetry::share::message as share;
use tokio::sync::{mpsc, watch};
use tokio::task::{AbortHandle, JoinSet};
use tokio::time::{Instant, MissedTickBehavior, interval, sleep, timeout};
use tokio_util::task::AbortOnDropHandle;
use tracing::info;

use super::share_link::{AGAIN, ShareLink};
use super::state::{Settings, State};
use crate::dead_man::Lapse;
use crate::message::{Recorded, Role, Text, Welcome};
use crate::page_session::{Broken, Page, Permissions, encode};
use crate::websocket_limits::{Budget, PATIENCE, Sink, close};

/// The longest text of a page.
pub const LONGEST_TEXT: usize = 1 << 16;
/// Time between beats.
const BEAT: Duration = Duration::from_millis(50);
/// Texts of the server that wait for a page.
const WAITING: usize = 256;

/// Ends a page, however its task ends.
struct Present<'s> {
    state: &'s State,
    page: Arc<Page>,
    name: String,
    tasks: Vec<AbortHandle>,
}

impl Drop for Present<'_> {
    fn drop(&mut self) {
        self.page.end(Lapse::LetGo);
        self.tasks.iter().for_each(AbortHandle::abort);
        self.state.pages.lock().remove(&self.name);
        info!(page = self.name, "left");
    }
}

/// Serves a page until it ends.
pub async fn serve(state: Arc<State>, socket: WebSocket, role: Role) {
    let (mut sink, stream) = socket.split();
    let Ok(_place) = state.places.try_acquire() else {
        let why = "the server has as many pages as it can have".to_owned();
        return close(&mut sink, closing(why)).await;
    };
    let own_name = format!("page {}", state.next_page());
    let (view, name, lost) = match state.link.connect(&own_name).await {
        Ok((program, listener, name)) => (Some((program, listener)), name, None),
        Err(error) => (None, own_name.clone(), Some(error.to_string())),
    };
    info!(page = name, ?role, "joined");
    let (out, outgoing) = mpsc::channel(WAITING);
    let Settings { separate_share, opens_addresses, deadline, program } = &state.settings;
    let may = Permissions { role, opens_addresses: *opens_addresses };
    let (link, recordings) = (Arc::clone(&state.link), Arc::clone(&state.recordings));
    let page =
        Arc::new(Page::new(name.clone(), may, Micros::from(*deadline), link, recordings, out));
    state.pages.lock().insert(name.clone(), Arc::clone(&page));
    let watched = Arc::clone(&page);
    let watch = tokio::spawn(async move { watched.watch().await }).abort_handle();
    let _present =
        Present { state: &state, page: Arc::clone(&page), name: name.clone(), tasks: vec![watch] };
    let mut first = vec![encode(&Text::Welcome(Welcome {
        server: program.clone(),
        name,
        role,
        deadline: deadline.as_secs_f64() * 1e3,
        separate_share: *separate_share,
        run: state.run.clone(),
    }))];
    if lost.is_some() {
        first.push(encode(&Text::Share { lost }));
    }
    let (program, listener) = view.unzip();
    page.set_view(program);
    let view = View::new(Arc::clone(&state.link), own_name, listener);
    let why = tokio::select! {
        // The page has gone, or does not read.
        () = write(&page, &mut sink, first, outgoing, state.recordings.watch(), view) => return,
        why = read(&page, stream) => why,
    };
    if let Err(why) = why {
        close(&mut sink, closing(why)).await;
    }
}

/// The last text to a page.
fn closing(message: String) -> String {
    encode(&share::Text::Closing { message })
}

/// Takes what the page sends, until it ends.
async fn read(page: &Arc<Page>, mut stream: SplitStream<WebSocket>) -> Result<(), Broken> {
    let mut tasks = JoinSet::new();
    let mut budget = Budget::new();
    loop {
        let message = tokio::select! {
            biased;
            message = stream.next() => message,
            Some(ended) = tasks.join_next() => match ended {
                Err(error) if error.is_panic() => return Err("the server has a fault".to_owned()),
                _ => continue,
            },
        };
        budget.spend()?;
        match message {
            Some(Ok(Message::Text(text))) => page.receive(&text, &mut tasks).await?,
            Some(Ok(Message::Binary(_))) => return Err("a page sends texts only".to_owned()),
            Some(Ok(Message::Ping(_) | Message::Pong(_))) => {}
            Some(Ok(Message::Close(_))) | None => return Ok(()),
            Some(Err(error)) => return Err(error.to_string()),
        }
    }
}

/// Sends to the page, until it has gone or does not read.
async fn write(
    page: &Page,
    sink: &mut Sink,
    mut first: Vec<String>,
    mut outgoing: mpsc::Receiver<String>,
    mut recorded: watch::Receiver<Option<Recorded>>,
    mut view: View,
) {
    let mut beats = interval(BEAT);
    beats.set_missed_tick_behavior(MissedTickBehavior::Delay);
    first.extend(
        recorded.borrow_and_update().clone().map(|it| encode(&Text::Recorded(Box::new(it)))),
    );
    let mut first = first.into_iter();
    loop {
        let message = match first.next() {
            Some(text) => Message::Text(text.into()),
            None => tokio::select! {
                biased;
                _ = beats.tick() => Message::Text(encode(&page.beat()).into()),
                Some(text) = outgoing.recv() => Message::Text(text.into()),
                Ok(()) = recorded.changed() => {
                    let Some(changed) = recorded.borrow_and_update().clone() else { continue };
                    Message::Text(encode(&Text::Recorded(Box::new(changed))).into())
                }
                message = view.next(page) => message,
            },
        };
        let sent = async {
            sink.feed(message).await?;
            // A beat does not wait until nothing more has come.
            let beat = Instant::now() + BEAT;
            while Instant::now() < beat
                && let Some(message) = view.received(page)
            {
                sink.feed(message).await?;
            }
            sink.flush().await
        };
        // While this waits, nothing is read from the share: its queues lose what is too old.
        if !timeout(PATIENCE, sent).await.is_ok_and(|sent| sent.is_ok()) {
            return;
        }
    }
}

/// The session that sees.
struct View {
    link: Arc<ShareLink>,
    name: String,
    state: LinkState,
}

enum LinkState {
    Up(Listener),
    Down(Reconnecting),
}

/// Connects again and again, until it is dropped. It is a task of its own: while a page does not read,
/// nobody would poll a future, and it may hold what a stop waits for.
type Reconnecting = AbortOnDropHandle<(Program, Listener)>;

fn reconnecting(link: Arc<ShareLink>, name: String) -> Reconnecting {
    AbortOnDropHandle::new(tokio::spawn(async move {
        loop {
            if let Ok((program, listener, _)) = link.connect(&name).await {
                return (program, listener);
            }
            sleep(AGAIN).await;
        }
    }))
}

impl View {
    /// `listener` is `None` if the share is lost.
    fn new(link: Arc<ShareLink>, name: String, listener: Option<Listener>) -> Self {
        let state = match listener {
            Some(listener) => LinkState::Up(listener),
            None => LinkState::Down(reconnecting(Arc::clone(&link), name.clone())),
        };
        View { link, name, state }
    }

    /// A message for the page that has been received already.
    fn received(&mut self, page: &Page) -> Option<Message> {
        match &mut self.state {
            // What is wrong is found again by the next read.
            LinkState::Up(listener) => Some(message(page, listener.received().ok()??)),
            LinkState::Down(_) => None,
        }
    }

    /// The next message for the page. It can be dropped while it waits.
    async fn next(&mut self, page: &Page) -> Message {
        let lost = match &mut self.state {
            LinkState::Up(listener) => match listener.next().await {
                Ok(frame) => return message(page, frame),
                Err(error) => Some(error.to_string()),
            },
            LinkState::Down(coming) => match coming.await {
                Ok((program, listener)) => {
                    page.set_view(Some(program));
                    self.state = LinkState::Up(listener);
                    None
                }
                Err(error) => Some(error.to_string()),
            },
        };
        if lost.is_some() {
            page.set_view(None);
            self.state = LinkState::Down(reconnecting(Arc::clone(&self.link), self.name.clone()));
        }
        Message::Text(encode(&Text::Share { lost }).into())
    }
}

/// A message of the share for a page.
fn message(page: &Page, frame: Frame) -> Message {
    page.notice_stop_in_view(&frame);
    let Frame { kind, payload } = frame;
    match kind {
        FrameKind::Data => Message::Binary(payload.into()),
        FrameKind::Text => Message::Text(String::from_utf8_lossy(&payload).into_owned().into()),
    }
}
