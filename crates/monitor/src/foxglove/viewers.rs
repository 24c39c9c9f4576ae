//! All viewers, and what they see: the messages of a recording of the share, made while a viewer is there.

use std::collections::BTreeMap;
use std::sync::{Arc, Weak};

use motorlink_proto::time::Micros;
use motorlink_recording::record::live::{Config, Item, Live};
use motorlink_recording::write::{Entry, Topic};
use parking_lot::Mutex;
use tokio::sync::{Notify, Semaphore};
use tokio::task::AbortHandle;
use tokio::time::sleep;

use super::protocol::{Channel, Level, Text, encode, status};
use super::session::Session;
use crate::drive::Drives;
use crate::server::share_link::{AGAIN, ShareLink};

/// Viewers at the same time.
const VIEWERS: usize = 32;
/// How often fast signals are read for viewers.
const PERIOD: Micros = Micros(20_000);
/// The name of viewers at the share.
const NAME: &str = "viewers";

/// The viewers of a server.
pub struct Viewers {
    link: Arc<ShareLink>,
    program: String,
    session: String,
    pub(super) places: Semaphore,
    present: Mutex<Present>,
}

#[derive(Default)]
struct Present {
    /// The topics that were there since the server began. A channel keeps its number.
    channels: Vec<Topic>,
    viewers: BTreeMap<u64, Arc<Viewer>>,
    last: u64,
    /// Reads the share, while there are viewers.
    feed: Option<AbortHandle>,
    /// Why nothing of a line is there, by its name.
    troubles: BTreeMap<String, String>,
}

/// A viewer that is connected.
#[derive(Default)]
pub struct Viewer {
    /// What waits for it.
    pub(super) session: Mutex<Session>,
    /// There is something to send.
    pub(super) news: Notify,
}

impl Viewer {
    fn tell(&self, text: String) {
        self.session.lock().tell(text);
        self.news.notify_one();
    }
}

/// A viewer is there until this is dropped.
pub struct Joined {
    viewers: Arc<Viewers>,
    number: u64,
    /// The viewer.
    pub viewer: Arc<Viewer>,
}

impl Drop for Joined {
    fn drop(&mut self) {
        let mut present = self.viewers.present.lock();
        present.viewers.remove(&self.number);
        if present.viewers.is_empty()
            && let Some(feed) = present.feed.take()
        {
            feed.abort();
            present.troubles.clear();
        }
    }
}

impl Viewers {
    /// Without viewers. `session` names this run of the server.
    pub fn new(link: Arc<ShareLink>, program: String, session: String) -> Self {
        let (places, present) = (Semaphore::new(VIEWERS), Mutex::default());
        Viewers { link, program, session, places, present }
    }

    /// A viewer comes. It gets the list of channels.
    pub(super) fn join(self: &Arc<Self>) -> Joined {
        let viewer = Arc::new(Viewer::default());
        let mut present = self.present.lock();
        viewer.tell(encode(&Text::ServerInfo {
            name: &self.program,
            capabilities: [],
            session_id: &self.session,
        }));
        let channels = present.channels.iter().zip(0..);
        let channels = channels.map(|(topic, id)| Channel::new(id, topic)).collect();
        viewer.tell(encode(&Text::Advertise { channels }));
        present.troubles.values().for_each(|why| viewer.tell(status(Level::Warning, why)));
        present.last += 1;
        let number = present.last;
        present.viewers.insert(number, Arc::clone(&viewer));
        if present.feed.is_none() {
            present.feed = Some(
                tokio::spawn(feed(Arc::clone(&self.link), Arc::downgrade(self))).abort_handle(),
            );
        }
        Joined { viewers: Arc::clone(self), number, viewer }
    }

    /// How many channels there are.
    pub(super) fn channels(&self) -> usize {
        self.present.lock().channels.len()
    }

    /// Passes on what a feed gives. `numbers` has the channels of its topics.
    fn take(&self, item: Item, numbers: &mut Vec<u32>) {
        let mut present = self.present.lock();
        match item {
            Item::Entry(Entry::Topic(topic)) => numbers.push(present.channel(topic)),
            Item::Entry(Entry::Message { topic, time, data }) => {
                let Some(channel) = numbers.get(topic) else { return };
                let data = data.into();
                for viewer in present.viewers.values() {
                    viewer.session.lock().offer(*channel, time, &data);
                    viewer.news.notify_one();
                }
            }
            // Files have these.
            Item::Entry(Entry::Metadata(..) | Entry::Attached(_)) => {}
            Item::Line { name, trouble: Some(why) } => present.trouble(name, why),
            Item::Line { name, trouble: None } => drop(present.troubles.remove(&name)),
        }
    }
}

impl Present {
    /// The number of the channel of a topic, which may be new.
    fn channel(&mut self, topic: Topic) -> u32 {
        if let Some(known) = self.channels.iter().position(|known| *known == topic) {
            return known as u32;
        }
        let id = self.channels.len() as u32;
        let text = encode(&Text::Advertise { channels: vec![Channel::new(id, &topic)] });
        self.viewers.values().for_each(|viewer| viewer.tell(text.clone()));
        self.channels.push(topic);
        id
    }

    fn trouble(&mut self, line: String, why: String) {
        let text = status(Level::Warning, &why);
        self.viewers.values().for_each(|viewer| viewer.tell(text.clone()));
        self.troubles.insert(line, why);
    }
}

/// Reads the share for viewers, until it is aborted.
async fn feed(link: Arc<ShareLink>, viewers: Weak<Viewers>) {
    loop {
        let drives = loop {
            if let Ok(drives) = link.drives().await {
                break drives;
            }
            sleep(AGAIN).await;
        };
        let live = follow(&link, &viewers, &drives);
        link.other_lines(&drives).await;
        drop(live);
        if let Some(viewers) = viewers.upgrade() {
            viewers.present.lock().troubles.clear();
        }
    }
}

/// Reads these lines until what it gives is dropped.
fn follow(link: &ShareLink, viewers: &Weak<Viewers>, drives: &Drives) -> Option<Live> {
    let (their, mut numbers) = (Weak::clone(viewers), Vec::new());
    let put = move |item| {
        if let Some(viewers) = their.upgrade() {
            viewers.take(item, &mut numbers);
        }
    };
    let config = Config { period: PERIOD, by: NAME.into() };
    match Live::start(&config, link.share(), drives.lines(), put) {
        Ok(live) => Some(live),
        Err(error) => {
            if let Some(viewers) = viewers.upgrade() {
                let why = format!("the system gives no thread: {error}");
                viewers.present.lock().trouble(String::new(), why);
            }
            None
        }
    }
}
