//! A port that may go away and come back: explicit state, back-off with a cap, one clock.

use std::sync::{Arc, Mutex, PoisonError};
use std::time::{Duration, Instant};

use motorlink_proto::time::Instant as Moment;

use crate::clock::Clock;
use crate::port::PortError;

/// Opens the port, again and again if it must.
pub type Opener<L> = Box<dyn FnMut() -> Result<L, PortError> + Send>;

/// What a port is at the moment.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum LinkState {
    /// Open.
    Open,
    /// Closed; the next call opens it, unless it comes before `retry_in` has passed.
    Closed {
        /// What is left of the back-off.
        retry_in: Duration,
    },
}

/// A [`LinkState`] to look at while the port itself is in use, or being opened.
#[derive(Clone)]
pub struct LinkSign(Arc<Mutex<Shown>>);

#[derive(Clone, Copy)]
enum Shown {
    Open,
    ClosedUntil(Instant),
}

impl LinkSign {
    /// What the port is now.
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

/// How soon a port that does not take everything at once is offered the rest.
pub const FULL: Duration = Duration::from_millis(1);

/// How long to wait between attempts to open a port that went away.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct BackOff {
    /// Wait after the first failed attempt; it doubles with each further one.
    pub first: Duration,
    /// The longest wait.
    pub cap: Duration,
}

impl Default for BackOff {
    /// 50 ms, doubling up to 2 s.
    fn default() -> Self {
        BackOff { first: Duration::from_millis(50), cap: Duration::from_secs(2) }
    }
}

/// A link with the means to open it anew.
pub struct Reopening<L> {
    /// What messages call the port.
    pub name: Arc<str>,
    link: Option<L>,
    open: Option<Opener<L>>,
    back_off: BackOff,
    wait: Duration,
    not_before: Instant,
    /// What the last attempt said.
    trouble: String,
    clock: Clock,
    sign: LinkSign,
}

impl<L> Reopening<L> {
    /// Opens the port; the first attempt has to succeed.
    pub fn open(name: &str, mut open: Opener<L>, back_off: BackOff) -> Result<Self, PortError> {
        let link = open()?;
        Ok(Reopening { open: Some(open), back_off, ..Self::over(name, link) })
    }

    /// A link that is not opened again when it closes.
    pub fn over(name: &str, link: L) -> Self {
        let now = Instant::now();
        Reopening {
            // `sim:` before a colon reads badly.
            name: name.trim_end_matches(':').into(),
            link: Some(link),
            open: None,
            back_off: BackOff::default(),
            wait: Duration::ZERO,
            not_before: now,
            trouble: String::new(),
            clock: Clock::default(),
            sign: LinkSign(Arc::new(Mutex::new(Shown::Open))),
        }
    }

    /// Goes by the clock of the link, if it has one, which those that take its place share.
    pub fn by(mut self, clock: impl FnOnce(&L) -> Option<Clock>) -> Self {
        if let Some(clock) = self.link.as_ref().and_then(clock) {
            self.clock = clock;
        }
        self
    }

    /// The clock that the port goes by.
    pub fn clock(&self) -> Clock {
        self.clock.clone()
    }

    /// The time for the sans-IO machines.
    pub fn now(&self) -> Moment {
        self.clock.now()
    }

    /// Shows whether the port is open, from now on.
    pub fn sign(&self) -> LinkSign {
        self.sign.clone()
    }

    /// The link if it is open.
    pub fn open_link(&self) -> Option<&L> {
        self.link.as_ref()
    }

    /// The link if it is open, to use.
    pub fn open_link_mut(&mut self) -> Option<&mut L> {
        self.link.as_mut()
    }

    /// The open link, and whether this call had to open it.
    pub fn link(&mut self) -> Result<(&mut L, bool), PortError> {
        let mut reopened = false;
        if self.link.is_none() {
            let closed = || PortError::Closed { port: self.name.to_string() };
            let open = self.open.as_mut().ok_or_else(closed)?;
            if Instant::now() < self.not_before {
                let (port, why) = (self.name.to_string(), self.trouble.clone());
                return Err(PortError::Away { port, why });
            }
            match open() {
                Ok(link) => {
                    self.link = Some(link);
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
        Ok((link.ok_or_else(|| PortError::Closed { port: name.to_string() })?, reopened))
    }

    /// Closes the link; the next call may open it at once.
    pub fn close(&mut self) {
        self.link = None;
        self.closed_until(Instant::now());
    }

    fn postpone(&mut self, error: &PortError) {
        self.trouble = error.to_string();
        self.wait = (self.wait * 2).clamp(self.back_off.first, self.back_off.cap);
        self.closed_until(Instant::now() + self.wait);
    }

    fn closed_until(&mut self, retry: Instant) {
        self.not_before = retry;
        self.sign.show(Shown::ClosedUntil(retry));
    }
}

impl<L: 'static> Reopening<L> {
    /// The same port with its links in another form.
    pub fn map<M: 'static>(self, form: fn(L) -> M) -> Reopening<M> {
        let Reopening { name, link, open, back_off, wait, not_before, trouble, clock, sign } = self;
        let link = link.map(form);
        let open = open.map(|mut open| -> Opener<M> { Box::new(move || open().map(form)) });
        Reopening { name, link, open, back_off, wait, not_before, trouble, clock, sign }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn until_the_next_attempt_the_last_one_is_told() {
        let mut attempts = 0;
        let open: Opener<()> = Box::new(move || {
            attempts += 1;
            let port = "can0".to_owned();
            if attempts == 1 { Ok(()) } else { Err(PortError::NoSuchInterface { port }) }
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
}
