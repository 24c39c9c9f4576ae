//! Reading again and again, through losses of the line.

use std::time::Duration;

use motorlink::Clock;

use crate::failure::Failure;
use crate::interrupt;
use crate::output::{note, parse_span};

/// How often to read.
#[derive(clap::Args, Clone, Copy)]
pub struct Repeat {
    /// Read again and again at this interval, such as 100ms, until Ctrl-C
    #[arg(long, value_name = "TIME", value_parser = parse_span)]
    pub every: Option<Duration>,
    /// Stop after this many readings
    #[arg(long, value_name = "N", requires = "every")]
    pub count: Option<u64>,
}

/// Prints samples once, or again and again with the seconds since the first: then a line that fails
/// is waited for. `clock` is the port's.
pub fn repeated<T>(
    clock: &Clock,
    repeat: Repeat,
    mut sample: impl FnMut() -> Result<Vec<T>, Failure>,
    print: impl Fn(&[T], Option<f64>) -> Result<(), Failure>,
) -> Result<(), Failure> {
    let Some(every) = repeat.every else { return print(&sample()?, None) };
    let began = clock.now();
    interrupt::take_over();
    let mut trouble = None;
    let mut left = repeat.count.unwrap_or(u64::MAX);
    let elapsed = || Duration::from(clock.now().since(began));
    let mut due = Duration::ZERO;
    while left > 0 && !interrupt::interrupted() {
        match sample() {
            Ok(samples) => {
                if let Some(over) = trouble.take() {
                    note(over);
                }
                print(&samples, Some(elapsed().as_secs_f64()))?;
                left -= 1;
            }
            Err(Failure::Line(message)) if trouble.is_none() => {
                note(format!("the line is lost: {message}; trying again until Ctrl-C"));
                trouble = Some("the line is back");
            }
            Err(Failure::Silent(message)) if trouble.is_none() => {
                note(format!("{message}; trying again until Ctrl-C"));
                trouble = Some("it answers again");
            }
            Err(Failure::Line(_) | Failure::Silent(_)) => {}
            Err(other) => return Err(other),
        }
        // A slow line skips readings rather than falling behind.
        let now = elapsed();
        while due <= now {
            due += every;
        }
        if left > 0 && trouble.is_none() {
            interrupt::wait_by(clock, due - now);
        } else if left > 0 {
            // The clock of a port that is lost may be virtual, and its return takes real time.
            interrupt::wait(due - now);
        }
    }
    Ok(())
}
