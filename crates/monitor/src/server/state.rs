//! What all requests share.

use std::collections::BTreeMap;
use std::io;
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};
use std::time::Duration;

use parking_lot::Mutex;
use tokio::sync::Semaphore;

use super::auth::{Auth, random_word};
use super::share_link::ShareLink;
use crate::foxglove::Viewers;
use crate::page_session::Page;
use crate::recordings::Recordings;

/// Pages at the same time.
const PAGES: usize = 32;

/// What pages may do, and what they are told.
pub struct Settings {
    /// Whether the share is another process, which lives on if this one is killed.
    pub separate_share: bool,
    /// Whether pages may open lines at addresses in a network.
    pub opens_addresses: bool,
    /// How long a page may give no sign of life until its motors stop.
    pub deadline: Duration,
    /// The name and version of this program.
    pub program: String,
}

/// A server with its pages.
pub struct State {
    pub auth: Auth,
    pub link: Arc<ShareLink>,
    pub settings: Settings,
    pub recordings: Arc<Recordings>,
    pub run: String,
    /// Programs that show the same data.
    pub viewers: Arc<Viewers>,
    /// Those that are connected, by name.
    pub pages: Mutex<BTreeMap<String, Arc<Page>>>,
    last_page: AtomicU64,
    pub places: Semaphore,
}

impl State {
    /// A server without pages.
    ///
    /// # Errors
    /// The system has no random numbers.
    pub fn new(
        auth: Auth,
        link: ShareLink,
        recordings: Recordings,
        settings: Settings,
    ) -> io::Result<Self> {
        let (link, run) = (Arc::new(link), random_word()?);
        let viewers = Viewers::new(Arc::clone(&link), settings.program.clone(), run.clone());
        Ok(State {
            auth,
            link,
            settings,
            recordings: Arc::new(recordings),
            run,
            viewers: Arc::new(viewers),
            pages: Mutex::default(),
            last_page: AtomicU64::new(0),
            places: Semaphore::new(PAGES),
        })
    }

    /// The number of the next page.
    pub fn next_page(&self) -> u64 {
        self.last_page.fetch_add(1, Ordering::Relaxed) + 1
    }
}
