//! Notifies systemd that the guard is ready, alive, or about to end. A thread of its own sends the
//! messages, so that the guard never waits for systemd.

use std::sync::mpsc::{SyncSender, sync_channel};
use std::time::{Duration, Instant};

use sd_notify::NotifyState;

/// Messages that may wait.
const WAITING: usize = 8;

/// systemd, if it started this process and set NOTIFY_SOCKET.
pub struct Supervisor {
    news: SyncSender<News>,
    /// How often it wants to hear that the guard is alive, and when it next does.
    alive: Option<(Duration, Instant)>,
}

enum News {
    Ready,
    Alive,
    Status(String),
    Stopping,
}

impl Supervisor {
    /// Says that clients can come.
    pub fn ready() -> Self {
        let (news, told) = sync_channel(WAITING);
        std::thread::spawn(move || told.into_iter().for_each(|one| notify(&one)));
        // Half of what is asked for, as sd_watchdog_enabled(3) advises.
        let alive = sd_notify::watchdog_enabled().map(|period| (period / 2, Instant::now()));
        let supervisor = Supervisor { news, alive };
        supervisor.tell(News::Ready);
        supervisor
    }

    /// Says that the guard turns, when that is due.
    pub fn alive(&mut self) {
        if let Some((period, due)) = &mut self.alive
            && Instant::now() >= *due
        {
            *due = Instant::now() + *period;
            self.tell(News::Alive);
        }
    }

    /// Shows what happened last.
    pub fn status(&self, text: &str) {
        self.tell(News::Status(text.to_owned()));
    }

    /// Says that the guard stops the motors and ends.
    pub fn stopping(&self) {
        self.tell(News::Stopping);
    }

    /// It must not matter whether anybody listens.
    fn tell(&self, news: News) {
        let _ = self.news.try_send(news);
    }
}

fn notify(news: &News) {
    let state = match news {
        News::Ready => NotifyState::Ready,
        News::Alive => NotifyState::Watchdog,
        News::Status(text) => NotifyState::Status(text),
        News::Stopping => NotifyState::Stopping,
    };
    let _ = sd_notify::notify(&[state]);
}
