//! One program of the tests that need none of their own: each more has to be linked.

mod drive_lines;
mod drive_reads;
mod drive_runs;
mod drive_writes;
mod leaving;
mod link;
mod recordings;
mod run_losses;
mod types;
mod world;
