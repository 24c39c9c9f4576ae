//! Exchanges per second through real lines, against a raw loop that moves the same bytes.

mod raw;
mod sitting;
mod transport;

use std::env::current_exe;
use std::io::{Read, stdin};
use std::process::{Command, Stdio};
use std::thread;

use rustix::termios::ttyname;

use crate::report::{Goal, Section};
use motorlink_kernels::result::Result;
use raw::{Far, Functions};
use sitting::{Rates, sit, yielding};
use transport::Transport;

/// Number of measuring processes. The addresses of code and stacks change the result by a tenth.
const SITTINGS: usize = 20;
/// Pairs of rounds per process.
const ROUNDS: usize = 80;
/// Exchanges in a round.
const EXCHANGES: u32 = 50;
/// Required fraction of the raw loop's rate.
const LEAST: f64 = 0.90;

pub fn measure() -> Result<(Vec<Section>, Vec<Goal>)> {
    let mut rows = Vec::new();
    let mut goals = Vec::new();
    for transport in Transport::ALL {
        let rounds = rounds(transport)?;
        let spread = |figure: fn(&Rates) -> f64| Spread::of(rounds.iter().map(figure).collect());
        let (client, raw) = (spread(|rates| rates.client), spread(|rates| rates.raw));
        let ratio = spread(|rates| rates.client / rates.raw);
        let inlined = spread(|rates| rates.client / rates.inlined);
        rows.push(vec![
            transport.name().to_owned(),
            format!("{:.0}", client.median),
            format!("{:.0}", raw.median),
            format!("{:.3}", ratio.median),
            format!("{:.3}", ratio.least),
            format!("{:.3}", ratio.most),
            format!("{:.3}", inlined.median),
        ]);
        if transport.is_required() {
            goals.push(Goal {
                what: format!("ratio to the raw loop, {}", transport.name()),
                wanted: format!(">= {LEAST:.2}"),
                reached: Some((format!("{:.3}", ratio.median), ratio.median >= LEAST)),
            });
        }
    }
    let section = Section {
        title: "Exchanges per second through a line",
        note: format!(
            "\
- *client*: the blocking client reads SPEED_MEAS (GET_REG) from a simulated drive in another thread.
- *raw*: a loop without a protocol moves the same bytes with the same system calls. Each call is a
  function, as in libc.
- {ROUNDS} rounds of {EXCHANGES} exchanges of each in turn, all on one core, in each of {SITTINGS}
  processes.
- Rates are medians. The ratio is that of neighbouring rounds.
- *inlined*: the median ratio to a loop with inlined calls, for information. This loop has no return
  after a switch between threads. The processor would mispredict such a return."
        ),
        columns: vec!["line", "client/s", "raw/s", "ratio, median", "least", "most", "inlined"],
        rows,
    };
    Ok((vec![section], goals))
}

/// The rounds of all processes.
fn rounds(transport: Transport) -> Result<Vec<Rates>> {
    let mut rounds = Vec::with_capacity(SITTINGS * ROUNDS);
    for _ in 0..SITTINGS {
        let sitting = Command::new(current_exe()?)
            .args(["sitting", transport.name()])
            .stdin(Stdio::null())
            .stderr(Stdio::inherit())
            .output()?;
        if !sitting.status.success() {
            return Err(format!("measuring the {} failed", transport.name()).into());
        }
        let lines = String::from_utf8(sitting.stdout)?;
        for line in lines.lines() {
            rounds.push(line.parse()?);
        }
    }
    Ok(rounds)
}

/// The rounds of this process: prints a line for each pair of rounds.
pub fn sitting(name: &str) -> Result<()> {
    let transport = Transport::ALL.into_iter().find(|transport| transport.name() == name);
    let transport = transport.ok_or_else(|| format!("no line is called {name}"))?;
    for rates in sit(transport, ROUNDS, EXCHANGES)? {
        println!("{rates}");
    }
    Ok(())
}

/// Replies at the far ends of `count` ptys until the end of standard input. Prints their paths.
pub fn respond(count: u32) -> Result<()> {
    let mut near = Vec::new();
    for _ in 0..count {
        let line = Transport::Pty.open()?;
        println!("{}", ttyname(&line.near, Vec::new())?.to_str()?);
        let far = Far::new(line.far)?;
        // The program that opens the device may close it again.
        near.push(line.near);
        thread::spawn(|| yielding(|| far.serve::<Functions>()));
    }
    stdin().read_to_end(&mut Vec::new())?;
    Ok(())
}

/// Median, minimum and maximum of the results.
#[derive(Debug, PartialEq)]
pub struct Spread {
    least: f64,
    pub median: f64,
    pub most: f64,
}

impl Spread {
    pub fn of(mut values: Vec<f64>) -> Self {
        values.sort_by(f64::total_cmp);
        let at = |place: usize| values.get(place).copied().unwrap_or(f64::NAN);
        let last = values.len().saturating_sub(1);
        let median = f64::midpoint(at(last / 2), at(last.div_ceil(2)));
        Spread { least: at(0), median, most: at(last) }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_median_is_in_the_middle_of_odd_and_even_numbers_of_values() {
        let odd = Spread::of(vec![3.0, 1.0, 2.0]);
        assert_eq!(odd, Spread { least: 1.0, median: 2.0, most: 3.0 });
        let even = Spread::of(vec![4.0, 1.0, 2.0, 3.0]);
        assert_eq!(even, Spread { least: 1.0, median: 2.5, most: 4.0 });
    }
}
