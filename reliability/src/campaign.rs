//! Runs trials, on one thread per processor.

use std::panic::catch_unwind;
use std::sync::Mutex;
use std::sync::atomic::{AtomicUsize, Ordering};

use motorlink_link::fault::FaultError;

use crate::plan::{Speaks, Trial, seeded};
use crate::tally::{Tally, Violation};
use crate::{rmd, st};

/// Number of exchanges before a violation in its trace.
const BEFORE: u64 = 3;

/// Why a campaign has no result.
#[derive(Debug)]
pub enum Failed {
    /// An invalid trial.
    Plan(FaultError),
    /// A violated guarantee.
    Violated { faults: String, seed: u64, violation: Violation },
}

/// Runs each trial in `seeds` parts, each with its own seed. Returns one tally per trial.
pub fn run(trials: &[Trial], seeds: u64) -> Result<Vec<Tally>, Failed> {
    let parts: Vec<(usize, u64)> =
        (0..trials.len()).flat_map(|n| (1..=seeds).map(move |seed| (n, seed))).collect();
    let done = each(&parts, |&(n, seed)| part(&trials[n], seed, trials[n].exchanges / seeds));
    let mut tallies = vec![Tally::default(); trials.len()];
    for ((n, _), result) in parts.iter().zip(done) {
        tallies[*n].add(&result?);
    }
    Ok(tallies)
}

/// Runs `work` for every part in parallel. Returns the results in order.
pub fn each<T: Sync, R: Send>(parts: &[T], work: impl Fn(&T) -> R + Sync) -> Vec<R> {
    let next = AtomicUsize::new(0);
    let results = Mutex::new(Vec::new());
    let threads = std::thread::available_parallelism().map_or(1, usize::from);
    std::thread::scope(|scope| {
        for _ in 0..threads {
            scope.spawn(|| {
                loop {
                    let taken = next.fetch_add(1, Ordering::Relaxed);
                    let Some(part) = parts.get(taken) else { break };
                    let result = work(part);
                    results.lock().expect("no thread panicked").push((taken, result));
                }
            });
        }
    });
    let mut results = results.into_inner().expect("no thread panicked");
    results.sort_by_key(|(n, _)| *n);
    results.into_iter().map(|(_, result)| result).collect()
}

fn part(trial: &Trial, seed: u64, exchanges: u64) -> Result<Tally, Failed> {
    let faults = seeded(trial.faults, seed).map_err(Failed::Plan)?;
    let run = |traced| match trial.speaks {
        Speaks::St(setup) => st::run(setup, &faults, trial.beyond, exchanges, traced),
        Speaks::Rmd(life) => rmd::run(life, &faults, trial.beyond, exchanges, traced),
    };
    let panicked = |_| {
        let what = "it panicked".to_owned();
        Err(Violation { exchange: 0, what, trace: Vec::new() })
    };
    let result = catch_unwind(|| run(u64::MAX)).unwrap_or_else(panicked);
    result.map_err(|violation| {
        // Runs the same part again, with a trace.
        let traced = violation.exchange.saturating_sub(BEFORE);
        let violation =
            catch_unwind(|| run(traced)).unwrap_or_else(panicked).err().unwrap_or(violation);
        Failed::Violated { faults: faults.to_string(), seed, violation }
    })
}
