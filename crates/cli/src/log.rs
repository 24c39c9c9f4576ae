//! `--log LEVEL`: what the crates do, on stderr, a line for each step.

use std::io::{self, Write};

use tracing_subscriber::filter::{LevelFilter, Targets};
use tracing_subscriber::prelude::*;

use crate::output;

/// What --log takes.
pub const LEVELS: [(&str, LevelFilter); 3] =
    [("warn", LevelFilter::WARN), ("info", LevelFilter::INFO), ("debug", LevelFilter::DEBUG)];

/// From now on prints what happens, up to this level; of other libraries errors and warnings only. It
/// never waits for the reader of stderr: a line must not delay a stop.
pub fn start(level: LevelFilter) {
    output::never_wait_for_messages();
    let lines = tracing_subscriber::fmt::layer().with_ansi(false).with_writer(|| Messages);
    let others = level.min(LevelFilter::WARN);
    let targets = Targets::new().with_target("motorlink", level).with_default(others);
    tracing_subscriber::registry().with(lines).with(targets).init();
}

/// The messages of this program. Each write is a line.
struct Messages;

impl Write for Messages {
    fn write(&mut self, line: &[u8]) -> io::Result<usize> {
        output::print_message(&String::from_utf8_lossy(line).trim_end());
        Ok(line.len())
    }

    fn flush(&mut self) -> io::Result<()> {
        Ok(())
    }
}
