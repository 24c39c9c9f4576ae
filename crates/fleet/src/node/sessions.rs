//! The sessions of a node, and what their tasks receive.

use std::collections::{BTreeMap, VecDeque};

use tokio::sync::mpsc::Sender;
use zenoh::query::Query;

use crate::key::{Name, Scope};
use crate::message::Ask;

/// The sessions of a node.
#[derive(Default)]
pub(super) struct Sessions {
    pub(super) open: BTreeMap<String, Open>,
    pub(super) over: VecDeque<(String, String)>,
}

pub(super) struct Open {
    pub(super) who: Name,
    pub(super) asked: Sender<Asked>,
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
