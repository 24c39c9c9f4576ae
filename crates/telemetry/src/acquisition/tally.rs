//! What the exchanges of a line came to, for other threads.

use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};

use serde::{Deserialize, Serialize};

use crate::line::LineError;

/// The counts of a line since it was opened. Clones are the same counts.
#[derive(Debug, Clone, Default)]
pub struct Tally(Arc<Counted>);

#[derive(Debug, Default)]
struct Counted {
    exchanges: AtomicU64,
    refused: AtomicU64,
    silent: AtomicU64,
    failed: AtomicU64,
    lost: AtomicU64,
}

/// What the exchanges of a line came to since it was opened.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[cfg_attr(feature = "typescript", derive(ts_rs::TS), ts(rename = "LineCounts"))]
pub struct Counts {
    /// Exchanges that are over.
    #[cfg_attr(feature = "typescript", ts(type = "number"))]
    pub exchanges: u64,
    /// Those in which a drive refused, or answered in a way that was not expected.
    #[cfg_attr(feature = "typescript", ts(type = "number"))]
    pub refused: u64,
    /// Those without a reply.
    #[cfg_attr(feature = "typescript", ts(type = "number"))]
    pub silent: u64,
    /// Those that failed otherwise: damaged replies, echoes, a port that failed.
    #[cfg_attr(feature = "typescript", ts(type = "number"))]
    pub failed: u64,
    /// How often the port was lost.
    #[cfg_attr(feature = "typescript", ts(type = "number"))]
    pub lost: u64,
}

impl Tally {
    /// The counts so far.
    pub fn counts(&self) -> Counts {
        let of = |count: &AtomicU64| count.load(Ordering::Relaxed);
        let Counted { exchanges, refused, silent, failed, lost } = &*self.0;
        Counts {
            exchanges: of(exchanges),
            refused: of(refused),
            silent: of(silent),
            failed: of(failed),
            lost: of(lost),
        }
    }

    /// An exchange is over.
    pub(super) fn ended<R>(&self, result: &Result<R, LineError>) {
        add(&self.0.exchanges);
        match result {
            Ok(_) => {}
            Err(error) if error.is_silence() => add(&self.0.silent),
            Err(error) if error.is_answer() && !error.is_unconfirmed() => add(&self.0.refused),
            Err(_) => add(&self.0.failed),
        }
    }

    /// The port was lost.
    pub(super) fn lost(&self) {
        add(&self.0.lost);
    }
}

fn add(count: &AtomicU64) {
    count.fetch_add(1, Ordering::Relaxed);
}
