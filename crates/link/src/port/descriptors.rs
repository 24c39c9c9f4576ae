//! The descriptors of open links, for children of a fork.

use std::os::fd::{AsRawFd, BorrowedFd, RawFd};
use std::sync::OnceLock;
use std::sync::atomic::{AtomicI32, Ordering};

const NONE: RawFd = -1;

static FIRST: Block = Block::new();

/// A list that only grows. Reading it takes no lock: in the child of a fork, the thread that held
/// the lock may not exist.
struct Block {
    places: [AtomicI32; 64],
    next: OnceLock<Box<Block>>,
}

impl Block {
    const fn new() -> Self {
        Block { places: [const { AtomicI32::new(NONE) }; 64], next: OnceLock::new() }
    }

    fn list(&'static self, fd: RawFd) -> &'static AtomicI32 {
        let takes = |place: &&AtomicI32| {
            place.compare_exchange(NONE, fd, Ordering::SeqCst, Ordering::SeqCst).is_ok()
        };
        let place = self.places.iter().find(takes);
        place.unwrap_or_else(|| self.next.get_or_init(|| Box::new(Block::new())).list(fd))
    }
}

/// An entry for an open descriptor. Drop it before the descriptor is closed.
#[derive(Debug)]
pub(super) struct Listed(&'static AtomicI32);

impl Listed {
    pub(super) fn new(fd: BorrowedFd<'_>) -> Self {
        Listed(FIRST.list(fd.as_raw_fd()))
    }
}

impl Drop for Listed {
    fn drop(&mut self) {
        self.0.store(NONE, Ordering::SeqCst);
    }
}

/// The descriptors of the open links of this process: serial lines, TCP connections and CAN
/// sockets.
///
/// A forked child inherits them. It keeps its parent's lines open and locked, even after the parent
/// has ended. A child that continues must replace each one, by `dup2` of `/dev/null`. Closing is
/// not enough, because links own their descriptor numbers.
///
/// Takes no lock, so that it can be called in the child of a program with threads.
pub fn open_descriptors() -> impl Iterator<Item = RawFd> {
    let blocks = std::iter::successors(Some(&FIRST), |block| block.next.get().map(Box::as_ref));
    let numbers = blocks.flat_map(|block| &block.places).map(|fd| fd.load(Ordering::SeqCst));
    numbers.filter(|fd| *fd != NONE)
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeSet;
    use std::os::fd::{AsFd, AsRawFd};
    use std::os::unix::net::UnixStream;

    use super::super::fd::FdLink;
    use super::*;

    #[test]
    fn links_are_listed_while_they_are_open() {
        let count = FIRST.places.len() + 1;
        let pairs: Vec<_> = (0..count).map(|_| UnixStream::pair().unwrap()).collect();
        let numbers: BTreeSet<_> = pairs.iter().map(|(near, _)| near.as_raw_fd()).collect();
        let listed = || open_descriptors().collect::<BTreeSet<_>>();
        let mut links = Vec::new();
        let mut far = Vec::new();
        for (near, other) in pairs {
            links.push(FdLink::new(near, "pair").unwrap());
            far.push(other);
        }
        assert!(numbers.is_subset(&listed()));
        let kept = links.split_off(count / 2);
        drop(links);
        let numbers: BTreeSet<_> = kept.iter().map(|link| link.as_fd().as_raw_fd()).collect();
        assert!(numbers.is_subset(&listed()));
        assert!(far.iter().all(|other| !listed().contains(&other.as_raw_fd())));
        drop(kept);
        assert!(numbers.is_disjoint(&listed()));
    }
}
