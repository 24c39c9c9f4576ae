//! What is behind a port: the line itself, or a program that holds it.

use std::os::fd::BorrowedFd;

use motorlink_link::Clock;
use motorlink_link::port::{Ending, Evented, HeldLine, Holder, Link, PortError, PortName};

/// An open port.
pub(crate) enum Way<L> {
    /// Bytes or frames.
    Line(L),
    /// Requests.
    Holder(Box<dyn Holder>),
}

/// What a program that holds the port is told of this client, also after the port was opened again.
#[derive(Debug, Clone, Copy, Default)]
pub(crate) struct Declared {
    pub(crate) only_own: bool,
    pub(crate) ending: Ending,
}

impl<L> Way<L> {
    /// Opens a port: with `open`, unless another program holds it.
    pub(crate) fn open(
        port: &PortName,
        open: impl FnOnce(&PortName) -> Result<L, PortError>,
    ) -> Result<Self, PortError> {
        match port.as_held() {
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

impl Declared {
    /// Tells it, and which motors this client has moved through an earlier connection.
    pub(crate) fn tell<L>(self, way: &mut Way<L>, moved: impl Iterator<Item = u8>) {
        if let Way::Holder(holder) = way {
            holder.only_own(self.only_own);
            holder.end_with(self.ending);
            holder.claim(moved.collect());
        }
    }
}
