//! What waits for the disk, in bounded memory. Adding to it never waits.

use std::collections::VecDeque;
use std::sync::Arc;
use std::time::Duration;

use parking_lot::{Condvar, Mutex};

/// What takes memory.
pub trait Weighed {
    /// The bytes that it takes, about.
    fn bytes(&self) -> usize;
}

/// Items for another thread, up to a number of bytes. Clones share them.
#[derive(Debug)]
pub struct Queue<T>(Arc<Shared<T>>);

#[derive(Debug)]
struct Shared<T> {
    held: Mutex<Held<T>>,
    came: Condvar,
    most_bytes: usize,
}

#[derive(Debug)]
struct Held<T> {
    items: VecDeque<T>,
    bytes: usize,
    lost: u64,
    is_closed: bool,
}

/// What was in the queue.
#[derive(Debug)]
pub struct Taken<T> {
    /// The items.
    pub items: VecDeque<T>,
    /// Nothing more comes.
    pub is_last: bool,
}

impl<T> Clone for Queue<T> {
    fn clone(&self) -> Self {
        Queue(Arc::clone(&self.0))
    }
}

impl<T: Weighed> Queue<T> {
    /// An empty queue for this number of bytes.
    pub fn new(most_bytes: usize) -> Self {
        let held = Held { items: VecDeque::new(), bytes: 0, lost: 0, is_closed: false };
        let (held, came) = (Mutex::new(held), Condvar::new());
        Queue(Arc::new(Shared { held, came, most_bytes }))
    }

    /// Adds an item; `false`: it is dropped. If the queue is full, it is counted as lost.
    pub fn push(&self, item: T) -> bool {
        let mut held = self.0.held.lock();
        let bytes = held.bytes + item.bytes();
        if held.is_closed {
            return false;
        }
        if bytes > self.0.most_bytes {
            held.lost += 1;
            return false;
        }
        held.bytes = bytes;
        held.items.push_back(item);
        true
    }

    /// Whether at least half of the memory is free.
    pub fn has_room(&self) -> bool {
        self.0.held.lock().bytes <= self.0.most_bytes / 2
    }

    /// Items that were dropped in all because the queue was full.
    pub fn lost(&self) -> u64 {
        self.0.held.lock().lost
    }

    /// Nothing more comes.
    pub fn close(&self) {
        self.0.held.lock().is_closed = true;
        self.0.came.notify_all();
    }

    /// What is there.
    pub fn take(&self) -> Taken<T> {
        let mut held = self.0.held.lock();
        held.bytes = 0;
        Taken { items: std::mem::take(&mut held.items), is_last: held.is_closed }
    }

    /// Waits for this time, or until nothing more comes.
    pub fn wait(&self, time: Duration) {
        let mut held = self.0.held.lock();
        self.0.came.wait_while_for(&mut held, |held| !held.is_closed, time);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    impl Weighed for &str {
        fn bytes(&self) -> usize {
            self.len()
        }
    }

    #[test]
    fn a_full_queue_drops_what_comes_and_counts_it() {
        let queue = Queue::new(5);
        let taken = ["ab", "cd", "ef", "g", "hi"].map(|item| queue.push(item));
        assert_eq!((taken, queue.lost()), ([true, true, false, true, false], 2));
        assert_eq!(queue.take().items, ["ab", "cd", "g"]);
        assert!(queue.push("again"));
        queue.close();
        assert!(!queue.push("late"));
        let taken = queue.take();
        assert_eq!((taken.items.len(), taken.is_last, queue.lost()), (1, true, 2));
    }
}
