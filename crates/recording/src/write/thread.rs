//! The thread that writes. Only it waits for the disk.

use std::io;
use std::sync::Arc;
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

use parking_lot::Mutex;

use super::entry::Entry;
use super::queue::{Queue, Taken};
use super::series::{Series, Written};
use crate::error::WriteError;

/// How often everything is written into the file. A killed program loses this time, and the values that
/// nothing has confirmed yet.
pub const FLUSH: Duration = Duration::from_millis(250);

/// The memory for what waits for the disk.
pub const MEMORY: usize = 32 << 20;

/// How far the thread is.
#[derive(Debug, Clone, Default)]
pub struct Progress {
    /// What was written.
    pub written: Written,
    /// The file cannot be written any more.
    pub failed: Option<WriteError>,
    /// The recording has the bytes that it may have.
    pub is_complete: bool,
}

/// A thread that writes a recording.
#[derive(Debug)]
pub struct Writer {
    queue: Queue<Entry>,
    progress: Arc<Mutex<Progress>>,
    thread: Option<JoinHandle<Result<Written, WriteError>>>,
}

impl Writer {
    /// Starts the thread.
    ///
    /// # Errors
    /// The system gives no thread.
    pub fn start(series: Series) -> io::Result<Self> {
        let queue = Queue::new(MEMORY);
        let progress = Progress { written: series.written(), ..Progress::default() };
        let progress = Arc::new(Mutex::new(progress));
        let (theirs, told) = (queue.clone(), Arc::clone(&progress));
        let thread = std::thread::Builder::new().name("motorlink-record".to_owned());
        let thread = thread.spawn(move || write(series, &theirs, &told))?;
        Ok(Writer { queue, progress, thread: Some(thread) })
    }

    /// Where entries are put.
    pub fn queue(&self) -> &Queue<Entry> {
        &self.queue
    }

    /// How far it is.
    pub fn progress(&self) -> Progress {
        self.progress.lock().clone()
    }

    /// Writes the rest and ends the file.
    ///
    /// # Errors
    /// The file cannot be written any more.
    pub fn end(mut self) -> Result<Written, WriteError> {
        self.queue.close();
        let ended = self.thread.take().map(JoinHandle::join);
        ended.and_then(Result::ok).unwrap_or_else(|| Ok(self.progress().written))
    }
}

impl Drop for Writer {
    fn drop(&mut self) {
        self.queue.close();
        if let Some(thread) = self.thread.take() {
            // A drop has no result.
            let _ = thread.join();
        }
    }
}

fn write(
    mut series: Series,
    queue: &Queue<Entry>,
    progress: &Mutex<Progress>,
) -> Result<Written, WriteError> {
    let mut synced = Instant::now();
    let mut due = Instant::now() + FLUSH;
    loop {
        queue.wait(due.saturating_duration_since(Instant::now()));
        // The time that a write takes does not delay the next one.
        due = Instant::now() + FLUSH;
        let Taken { items, is_last } = queue.take();
        let written = write_all(&mut series, items, &mut synced);
        let mut told = progress.lock();
        told.written = series.written();
        told.is_complete = series.is_complete();
        if let Err(error) = written {
            told.failed = Some(error.clone());
            queue.close();
            drop(told);
            // If it was the next file that could not be made, this one is whole. The first error counts.
            let _ = series.finish();
            return Err(error);
        }
        drop(told);
        if is_last {
            return series.finish();
        }
    }
}

fn write_all(
    series: &mut Series,
    entries: impl IntoIterator<Item = Entry>,
    synced: &mut Instant,
) -> Result<(), WriteError> {
    for entry in entries {
        series.take(entry)?;
    }
    series.flush()?;
    if series.sync_every().is_some_and(|every| synced.elapsed() >= every) {
        series.sync()?;
        *synced = Instant::now();
    }
    Ok(())
}
