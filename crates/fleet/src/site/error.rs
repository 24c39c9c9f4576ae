//! Why a site cannot be made.

use std::path::PathBuf;

use super::role::Role;
use crate::key::Name;

/// Why a site cannot be made.
#[derive(Debug, thiserror::Error)]
pub enum SiteError {
    /// A name has two roles.
    #[error("{name} is a {} already, so it cannot be a {}, too: each name has one role", has.word(), wanted.word())]
    TwoRoles {
        /// The name.
        name: Name,
        /// The role that it has.
        has: Role,
        /// The other one.
        wanted: Role,
    },
    /// The name of the router.
    #[error("`router` is the name of the router: choose another one")]
    NameOfRouter,
    /// The first time, somebody must say where the router is.
    #[error("{0} has no router yet: say where nodes and programs reach it")]
    NoRouter(PathBuf),
    /// The router was made for other addresses.
    #[error("the router of this site is reached at {0}: other addresses need a new site")]
    OtherRouter(String),
    /// A file of the site is not what it should be.
    #[error("{0}")]
    Strange(String),
    /// The file system.
    #[error("{}: {source}", path.display())]
    Io {
        /// The file or folder.
        path: PathBuf,
        /// Why.
        source: std::io::Error,
    },
    /// A certificate cannot be made.
    #[error("a certificate cannot be made: {0}")]
    Certificate(#[from] rcgen::Error),
}
