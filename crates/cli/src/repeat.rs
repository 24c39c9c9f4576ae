//! Reading again and again, through losses of the line.

use std::time::Duration;

use motorlink::Clock;
use serde_json::Value;

use crate::failure::{Failure, Kind};
use crate::interrupt;
use crate::json::Line;
use crate::output::{Printer, note, print_line};
use crate::span::parse_span;

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
/// is waited for, and `object` says so to programs. `clock` is the port's.
pub fn repeated<T>(
    clock: &Clock,
    repeat: Repeat,
    output: Printer,
    object: &Line,
    mut sample: impl FnMut() -> Result<Vec<T>, Failure>,
    print: impl Fn(&[T], Option<f64>) -> Result<(), Failure>,
) -> Result<(), Failure> {
    let Some(every) = repeat.every else { return print(&sample()?, None) };
    let began = clock.now();
    interrupt::take_over();
    let mut outage = None;
    let mut left = repeat.count.unwrap_or(u64::MAX);
    let elapsed = || Duration::from(clock.now().since(began));
    let event = |name: &str| object.clone().at(Some(elapsed().as_secs_f64())).with("event", name);
    let mut due = Duration::ZERO;
    while left > 0 && !interrupt::interrupted() {
        match sample() {
            Ok(samples) => {
                if let Some(kind) = outage.take() {
                    match output.json {
                        true => print_line(&Value::from(event("back")))?,
                        false if kind == Kind::Silent => note("it answers again"),
                        false => note("the line is back"),
                    }
                }
                print(&samples, Some(elapsed().as_secs_f64()))?;
                left -= 1;
            }
            Err(Failure::Failed(problem)) if matches!(problem.kind, Kind::Link | Kind::Silent) => {
                if outage.is_none() {
                    outage = Some(problem.kind);
                    let (text, retry) = (problem.text(), "trying again until Ctrl-C");
                    match output.json {
                        true => {
                            let event = event("outage").with("error", problem.object());
                            print_line(&Value::from(event))?;
                        }
                        false if problem.kind == Kind::Silent => note(format!("{text}; {retry}")),
                        false => note(format!("the line is lost: {text}; {retry}")),
                    }
                }
            }
            Err(other) => return Err(other),
        }
        // A slow line skips readings rather than falling behind.
        let now = elapsed();
        while due <= now {
            due += every;
        }
        if left > 0 && outage.is_none() {
            interrupt::wait_by(clock, due - now);
        } else if left > 0 {
            // The clock of a port that is lost may be virtual, and its return takes real time.
            interrupt::wait(due - now);
        }
    }
    Ok(())
}
