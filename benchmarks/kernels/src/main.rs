//! Compares the instructions of the kernels with benchmarks/kernels/cost.txt for `make cost`, and prints
//! what simulated drives do for `make determinism`.

mod cost;
mod fingerprint;

use std::env::args;

use motorlink_kernels::named;
use motorlink_kernels::result::Result;

fn main() -> Result<()> {
    let words: Vec<String> = args().skip(1).collect();
    match words.iter().map(String::as_str).collect::<Vec<_>>()[..] {
        [] => cost::check(false),
        ["--update"] => cost::check(true),
        ["fingerprint"] => {
            fingerprint::print();
            Ok(())
        }
        // Under the counter.
        ["kernel", name, count] => {
            named(name)
                .ok_or_else(|| format!("no kernel is called {name}"))?
                .repeat(count.parse()?);
            Ok(())
        }
        _ => Err("usage: motorlink-kernels [--update|fingerprint]".into()),
    }
}
