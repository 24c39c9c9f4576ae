//! What is behind a port: the line itself, or a program that holds it.

use std::ops::{Deref, DerefMut};
use std::os::fd::BorrowedFd;

use motorlink_link::Clock;
use motorlink_link::port::{Carries, Ending, Evented, HeldLine, Holder, Link, PortError, PortName};
use motorlink_link::reopening::Reopening;

/// An open port.
pub(crate) enum Way<L> {
    /// Bytes or frames.
    Line(L),
    /// Requests.
    Holder(Box<dyn Holder>),
}

/// A port that may go away, with what its holder has to know of this client.
pub(crate) struct Port<L> {
    reopening: Reopening<Way<L>>,
    only_own: bool,
    ending: Ending,
}

impl<L> Way<L> {
    /// Opens a port that carries this: with `open`, unless another program holds it.
    pub(crate) fn open(
        port: &PortName,
        carries: Carries,
        open: impl FnOnce(&PortName) -> Result<L, PortError>,
    ) -> Result<Self, PortError> {
        match port.held(carries)? {
            Some(held) => held.open().map(Way::Holder),
            None => open(port).map(Way::Line),
        }
    }

    /// What the program says that holds the port.
    pub(crate) fn held(&self) -> Option<HeldLine> {
        match self {
            Way::Line(_) => None,
            Way::Holder(holder) => Some(holder.line()),
        }
    }

    pub(crate) fn map<M>(self, form: impl FnOnce(L) -> M) -> Way<M> {
        match self {
            Way::Line(line) => Way::Line(form(line)),
            Way::Holder(holder) => Way::Holder(holder),
        }
    }
}

impl<L: Link> Way<L> {
    pub(crate) fn clock(&self) -> Option<Clock> {
        self.as_link()?.clock()
    }

    /// As [`Link::is_fresh`]: each reply of a holder is that of its request.
    pub(crate) fn is_fresh(&self) -> bool {
        self.as_link().is_none_or(Link::is_fresh)
    }

    pub(crate) fn trouble(&self) -> Option<&'static str> {
        self.as_link()?.trouble()
    }

    fn as_link(&self) -> Option<&L> {
        match self {
            Way::Line(line) => Some(line),
            Way::Holder(_) => None,
        }
    }
}

impl<L: Evented> Way<L> {
    pub(crate) fn descriptor(&self) -> Option<BorrowedFd<'_>> {
        match self {
            Way::Line(line) => line.descriptor(),
            Way::Holder(holder) => Some(holder.descriptor()),
        }
    }

    pub(crate) fn flush(&mut self) -> Result<bool, PortError> {
        match self {
            Way::Line(line) => line.flush(),
            Way::Holder(_) => Ok(false),
        }
    }
}

impl<L> Port<L> {
    pub(crate) fn new(reopening: Reopening<Way<L>>) -> Self
    where
        L: Link,
    {
        let reopening = reopening.by(Way::clock);
        Port { reopening, only_own: false, ending: Ending::default() }
    }

    /// The open port, and whether this call opened it. Then its holder is told which motors this client has
    /// moved.
    pub(crate) fn ready(
        &mut self,
        moved: impl Iterator<Item = u8>,
    ) -> Result<(&mut Way<L>, bool), PortError> {
        let (way, reopened) = self.reopening.link()?;
        if let (Way::Holder(holder), true) = (&mut *way, reopened) {
            holder.only_own(self.only_own);
            holder.end_with(self.ending);
            holder.claim(moved.collect());
        }
        Ok((way, reopened))
    }

    /// See [`Client::end_with`](crate::st::Client::end_with).
    pub(crate) fn end_with(&mut self, ending: Ending) {
        self.ending = ending;
        if let Some(holder) = self.holder() {
            holder.end_with(ending);
        }
    }

    /// From now on, whether requests are only for motors of this client, if another program holds the port.
    pub(crate) fn only_own(&mut self, is_set: bool) {
        self.only_own = is_set;
        if let Some(holder) = self.holder() {
            holder.only_own(is_set);
        }
    }

    /// The program that holds the port, while it is open.
    pub(crate) fn holder(&mut self) -> Option<&mut dyn Holder> {
        match self.reopening.open_link_mut()? {
            Way::Line(_) => None,
            Way::Holder(holder) => Some(holder.as_mut()),
        }
    }

    /// The same port, with another type of line.
    pub(crate) fn map<M: 'static>(self, form: fn(L) -> M) -> Port<M>
    where
        L: 'static,
    {
        let Port { reopening, only_own, ending } = self;
        Port { reopening: reopening.map(move |way: Way<L>| way.map(form)), only_own, ending }
    }
}

impl<L> Deref for Port<L> {
    type Target = Reopening<Way<L>>;

    fn deref(&self) -> &Self::Target {
        &self.reopening
    }
}

impl<L> DerefMut for Port<L> {
    fn deref_mut(&mut self) -> &mut Self::Target {
        &mut self.reopening
    }
}
