//! The sessions of a node, and what their tasks receive.

use std::collections::{BTreeMap, VecDeque};

use tokio::sync::mpsc::Sender;
use zenoh::query::Query;

use crate::key::{Name, Scope};
use crate::message::Ask;

/// A program asks more often than this, in seconds, or it is away.
const SILENT: f64 = 3.0;

/// The sessions of a node.
#[derive(Default)]
pub(super) struct Sessions {
    pub(super) open: BTreeMap<Name, Open>,
    pub(super) over: VecDeque<(Name, String)>,
}

pub(super) struct Open {
    pub(super) who: Name,
    pub(super) asked: Sender<Asked>,
    /// When it asked last.
    pub(super) heard: f64,
}

impl Sessions {
    /// A program has asked.
    pub(super) fn heard(&mut self, session: &Name, now: f64) {
        if let Some(open) = self.open.get_mut(session) {
            open.heard = now;
        }
    }

    /// Ends sessions that have been silent for some seconds: others need their places.
    pub(super) fn forget_silent(&mut self, now: f64) {
        self.open.retain(|_, open| now < open.heard + SILENT);
    }
}

/// What the task of a session receives.
pub(super) enum Asked {
    /// A query of the program.
    Query(Box<Asking>),
    /// The program or its network has gone.
    Gone,
}

/// A query of a program.
pub(super) struct Asking {
    pub(super) query: Query,
    pub(super) ask: Ask,
    /// What its key allows.
    pub(super) scope: Scope,
}
