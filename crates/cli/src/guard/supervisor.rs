//! What systemd is told: that the guard is ready, alive, and about to end.

use std::time::{Duration, Instant};

use sd_notify::NotifyState;

/// systemd, if it started this process and asked to be told.
pub struct Supervisor {
    /// How often it wants to hear that the guard is alive, and when it next does.
    alive: Option<(Duration, Instant)>,
}

impl Supervisor {
    /// Says that clients can come.
    pub fn ready() -> Self {
        notify(&[NotifyState::Ready]);
        // Half of what is asked for, as sd_watchdog_enabled(3) advises.
        let alive = sd_notify::watchdog_enabled().map(|period| (period / 2, Instant::now()));
        Supervisor { alive }
    }

    /// Says that the guard turns, when that is due.
    pub fn alive(&mut self) {
        if let Some((period, due)) = &mut self.alive
            && Instant::now() >= *due
        {
            *due = Instant::now() + *period;
            notify(&[NotifyState::Watchdog]);
        }
    }

    /// Shows what happened last.
    pub fn status(&self, text: &str) {
        notify(&[NotifyState::Status(text)]);
    }

    /// Says that the guard stops the motors and ends.
    pub fn stopping(&self) {
        notify(&[NotifyState::Stopping]);
    }
}

/// It must not matter whether anybody listens.
fn notify(state: &[NotifyState<'_>]) {
    let _ = sd_notify::notify(state);
}
