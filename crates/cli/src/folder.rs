//! A folder for the socket of a share without `--at`.

use std::fs::{DirBuilder, remove_dir_all};
use std::io;
use std::os::unix::fs::DirBuilderExt;
use std::path::PathBuf;
use std::process::id;

/// A folder of this user alone. It is removed at the end.
pub struct Folder(PathBuf);

impl Folder {
    pub fn new() -> io::Result<Self> {
        // A program that was killed leaves its folder.
        let mut count = 0;
        loop {
            let path = std::env::temp_dir().join(format!("motorlink-{}-{count}", id()));
            match DirBuilder::new().mode(0o700).create(&path) {
                Err(error) if error.kind() == io::ErrorKind::AlreadyExists => count += 1,
                created => return created.map(|()| Folder(path)),
            }
        }
    }

    /// The path of the socket.
    pub fn socket(&self) -> PathBuf {
        self.0.join("share")
    }
}

impl Drop for Folder {
    fn drop(&mut self) {
        let _ = remove_dir_all(&self.0);
    }
}
