//! A port that is reopened after a failure: explicit state, capped back-off, one clock.

use std::sync::{Arc, Mutex, PoisonError};
use std::time::{Duration, Instant};

use motorlink_proto::time::Instant as Moment;
use tracing::{debug, info};

use crate::clock::Clock;
use crate::port::PortError;

/// Opens the port. May be called repeatedly.
pub type Opener<L> = Box<dyn FnMut() -> Result<L, PortError> + Send>;

/// The state of a port.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum LinkState {
    /// Open.
    Open,
    /// Closed. The next call opens it, unless `retry_in` has not passed.
    Closed {
        /// The rest of the back-off.
        retry_in: Duration,
    },
}

/// Shows the [`LinkState`] while the port itself is in use or being opened.
#[derive(Clone)]
pub struct LinkSign(Arc<Mutex<Shown>>);

#[derive(Clone, Copy)]
enum Shown {
    Open,
    ClosedUntil(Instant),
}

impl LinkSign {
    /// The current state of the port.
    pub fn state(&self) -> LinkState {
        match *self.0.lock().unwrap_or_else(PoisonError::into_inner) {
            Shown::Open => LinkState::Open,
            Shown::ClosedUntil(retry) => {
                let retry_in = retry.saturating_duration_since(Instant::now());
                LinkState::Closed { retry_in }
            }
        }
    }

    fn show(&self, shown: Shown) {
        *self.0.lock().unwrap_or_else(PoisonError::into_inner) = shown;
    }
}

/// Retry interval of a port that did not accept all data.
pub const FULL: Duration = Duration::from_millis(1);

/// Back-off: the waits between attempts to reopen a port.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct BackOff {
    /// Wait after the first failed attempt. It doubles after each further one. Also the shortest time
    /// between two successful attempts.
    pub first: Duration,
    /// Maximum wait.
    pub cap: Duration,
}

impl Default for BackOff {
    /// 50 ms, doubling up to 2 s.
    fn default() -> Self {
        BackOff { first: Duration::from_millis(50), cap: Duration::from_secs(2) }
    }
}

/// A link that can be reopened.
pub struct Reopening<L> {
    /// The name of the port in messages.
    pub name: Arc<str>,
    link: Option<L>,
    open: Option<Opener<L>>,
    back_off: BackOff,
    wait: Duration,
    not_before: Instant,
    /// When the port was opened again.
    reopened: Option<Instant>,
    /// Why it is closed.
    trouble: String,
    clock: Clock,
    sign: LinkSign,
}

impl<L> Reopening<L> {
    /// Opens the port. The first attempt must succeed.
    pub fn open(name: &str, mut open: Opener<L>, back_off: BackOff) -> Result<Self, PortError> {
        let link = open()?;
        debug!(port = name.trim_end_matches(':'), "opened");
        Ok(Reopening { open: Some(open), back_off, ..Self::over(name, link) })
    }

    /// A link that is not reopened after it closes.
    pub fn over(name: &str, link: L) -> Self {
        let now = Instant::now();
        Reopening {
            // Removes the colon of `sim:`, because messages add their own.
            name: name.trim_end_matches(':').into(),
            link: Some(link),
            open: None,
            back_off: BackOff::default(),
            wait: Duration::ZERO,
            not_before: now,
            reopened: None,
            trouble: String::new(),
            clock: Clock::default(),
            sign: LinkSign(Arc::new(Mutex::new(Shown::Open))),
        }
    }

    /// Uses the clock of the link, if it has one. Reopened links share it.
    pub fn by(mut self, clock: impl FnOnce(&L) -> Option<Clock>) -> Self {
        if let Some(clock) = self.link.as_ref().and_then(clock) {
            self.clock = clock;
        }
        self
    }

    /// The clock of the port.
    pub fn clock(&self) -> Clock {
        self.clock.clone()
    }

    /// The time for the sans-IO state machines.
    pub fn now(&self) -> Moment {
        self.clock.now()
    }

    /// A view of the port's state.
    pub fn sign(&self) -> LinkSign {
        self.sign.clone()
    }

    /// The link, if it is open.
    pub fn open_link(&self) -> Option<&L> {
        self.link.as_ref()
    }

    /// The link, if it is open, mutable.
    pub fn open_link_mut(&mut self) -> Option<&mut L> {
        self.link.as_mut()
    }

    /// Closes the link. The next call may open it at once, unless it was opened again just before: a
    /// busy device server accepts each connection and closes it.
    pub fn close(&mut self) {
        if self.link.take().is_some() {
            info!(port = %self.name, "closed: it failed, or the far end hung up");
            self.trouble = PortError::Closed(self.name.to_string()).to_string();
        }
        let now = Instant::now();
        let earliest = self.reopened.map_or(now, |reopened| reopened + self.back_off.first);
        self.closed_until(now.max(earliest));
    }

    /// The next call may open a closed port at once, whatever failed before: for stops.
    pub fn retry_now(&mut self) {
        if self.link.is_none() {
            self.wait = Duration::ZERO;
            self.closed_until(Instant::now());
        }
    }

    fn postpone(&mut self, error: &PortError) {
        self.trouble = error.to_string();
        self.wait = (self.wait * 2).clamp(self.back_off.first, self.back_off.cap);
        info!(port = %self.name, again_in = ?self.wait, %error, "not opened");
        self.closed_until(Instant::now() + self.wait);
    }

    fn closed_until(&mut self, retry: Instant) {
        self.not_before = retry;
        self.sign.show(Shown::ClosedUntil(retry));
    }

    /// The open link, and whether this call opened it.
    pub fn link(&mut self) -> Result<(&mut L, bool), PortError> {
        let mut reopened = false;
        if self.link.is_none() {
            let closed = || PortError::Closed(self.name.to_string());
            let open = self.open.as_mut().ok_or_else(closed)?;
            if Instant::now() < self.not_before {
                return Err(PortError::Away(self.trouble.clone()));
            }
            match open() {
                Ok(link) => {
                    info!(port = %self.name, "opened again");
                    self.link = Some(link);
                    self.reopened = Some(Instant::now());
                    self.sign.show(Shown::Open);
                }
                Err(error) => {
                    self.postpone(&error);
                    return Err(error);
                }
            }
            self.wait = Duration::ZERO;
            reopened = true;
        }
        let name = &self.name;
        let link = self.link.as_mut();
        Ok((link.ok_or_else(|| PortError::Closed(name.to_string()))?, reopened))
    }
}

impl<L: 'static> Reopening<L> {
    /// The same port, with another type of link.
    pub fn map<M: 'static>(self, form: impl Fn(L) -> M + Copy + Send + 'static) -> Reopening<M> {
        let Reopening {
            name,
            link,
            open,
            back_off,
            wait,
            not_before,
            reopened,
            trouble,
            clock,
            sign,
        } = self;
        let link = link.map(form);
        let open = open.map(|mut open| -> Opener<M> { Box::new(move || open().map(form)) });
        Reopening { name, link, open, back_off, wait, not_before, reopened, trouble, clock, sign }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[derive(Debug)]
    struct Wire;

    #[test]
    fn until_the_next_attempt_the_last_error_is_returned() {
        let mut attempts = 0;
        let open: Opener<Wire> = Box::new(move || {
            attempts += 1;
            let port = "can0".to_owned();
            if attempts == 1 { Ok(Wire) } else { Err(PortError::NoSuchInterface(port)) }
        });
        let hour = Duration::from_secs(3600);
        let mut port = Reopening::open("socketcan:can0", open, BackOff { first: hour, cap: hour })
            .expect("the first attempt succeeds");
        port.close();
        let mut told = || port.link().expect_err("it is away").to_string();
        let attempt = told();
        assert!(attempt.starts_with("there is no CAN interface `can0`"), "{attempt}");
        assert_eq!(told(), attempt);
    }

    #[test]
    fn a_port_that_closes_as_soon_as_it_is_open_is_not_opened_again_and_again() {
        let attempts = Arc::new(Mutex::new(0));
        let counted = Arc::clone(&attempts);
        let open: Opener<Wire> = Box::new(move || {
            *counted.lock().unwrap() += 1;
            Ok(Wire)
        });
        let hour = Duration::from_secs(3600);
        let mut port = Reopening::open("tcp:drive", open, BackOff { first: hour, cap: hour })
            .expect("the first attempt succeeds");
        port.close();
        // A link that has worked is replaced at once.
        assert!(port.link().expect("it is back").1);
        port.close();
        for _ in 0..3 {
            let away = port.link().expect_err("it was just opened").to_string();
            assert!(away.contains("the far end hung up"), "{away}");
            // What fails to use it closes it once more.
            port.close();
        }
        assert!(
            matches!(port.sign().state(), LinkState::Closed { retry_in } if !retry_in.is_zero())
        );
        assert_eq!(*attempts.lock().unwrap(), 2);
    }
}
