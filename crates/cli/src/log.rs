//! `--log LEVEL`: what the crates do, on stderr, a line for each step.

use std::io::{self, Write};

use tracing_subscriber::filter::{LevelFilter, Targets};
use tracing_subscriber::prelude::*;

use crate::output;

/// The variable that is as --log, where that is not given.
const VARIABLE: &str = "MOTORLINK_LOG";

/// What --log takes.
pub const LEVELS: [(&str, LevelFilter); 5] = [
    ("off", LevelFilter::OFF),
    ("error", LevelFilter::ERROR),
    ("warn", LevelFilter::WARN),
    ("info", LevelFilter::INFO),
    ("debug", LevelFilter::DEBUG),
];

/// From now on prints what happens, up to this level; of other libraries errors and warnings only. It
/// never waits for the reader of stderr: a line must not delay a stop.
///
/// Without `level` the variable says it. One with another value must not keep a stop from being sent.
pub fn start(level: Option<LevelFilter>) {
    let value = std::env::var(VARIABLE).unwrap_or_default();
    let of_variable = LEVELS.iter().find(|(word, _)| *word == value).map(|(_, level)| *level);
    if level.is_none() && of_variable.is_none() && !value.is_empty() {
        output::note(format!("{VARIABLE} is off, error, warn, info or debug: nothing is logged"));
    }
    let Some(level) = level.or(of_variable).filter(|level| *level > LevelFilter::OFF) else {
        return;
    };
    output::never_wait_for_messages();
    let lines = tracing_subscriber::fmt::layer().with_ansi(false).with_writer(|| Messages);
    let others = level.min(LevelFilter::WARN);
    let targets = Targets::new().with_target("motorlink", level).with_default(others);
    // A program that runs several commands has it already.
    let _ = tracing_subscriber::registry().with(lines).with(targets).try_init();
}

/// The messages of this program. Each write is a line.
struct Messages;

impl Write for Messages {
    fn write(&mut self, line: &[u8]) -> io::Result<usize> {
        output::log(&String::from_utf8_lossy(line).trim_end());
        Ok(line.len())
    }

    fn flush(&mut self) -> io::Result<()> {
        Ok(())
    }
}
