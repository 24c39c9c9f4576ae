//! What members of a site may do.

use std::path::{Path, PathBuf};

/// What a member may do.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum Role {
    /// It holds drives.
    Node,
    /// A person or a program that commands motors.
    Operator,
    /// A person or a program that sees values and events.
    Viewer,
}

impl Role {
    /// All of them.
    pub const ALL: [Self; 3] = [Role::Node, Role::Operator, Role::Viewer];

    /// The role in one word.
    pub const fn word(self) -> &'static str {
        match self {
            Role::Node => "node",
            Role::Operator => "operator",
            Role::Viewer => "viewer",
        }
    }

    pub(super) fn folder(self, site: &Path) -> PathBuf {
        site.join(format!("{}s", self.word()))
    }
}
