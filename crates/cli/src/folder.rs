//! A folder of this user alone, which is removed at the end.

use std::fs::Permissions;
use std::io;
use std::os::unix::fs::PermissionsExt;

use tempfile::{Builder, TempDir};

pub fn new() -> io::Result<TempDir> {
    Builder::new().prefix("motorlink-").permissions(Permissions::from_mode(0o700)).tempdir()
}
