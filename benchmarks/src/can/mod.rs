//! Cycles over four motors on a simulated 1 Mbit/s bus, on virtual time.

mod bits;
mod cycle;
mod wire;

use motorlink_proto::time::Micros;

use crate::report::{Goal, Section};
use cycle::{Cycle, Outcome};
use motorlink_kernels::result::Result;

const CYCLES: u32 = 2_000;
/// Typical turnaround of real motors.
const TURNAROUND: Micros = Micros(250);
/// Required share of the wire's ceiling, with motors that answer at once.
const LEAST: f64 = 0.98;

pub fn measure() -> Result<(Vec<Section>, Vec<Goal>)> {
    let mut rows = Vec::new();
    let mut goals = Vec::new();
    for cycle in Cycle::ALL {
        let at_once = cycle.run(CYCLES, Micros(0))?;
        let later = cycle.run(CYCLES, TURNAROUND)?;
        rows.push(vec![
            cycle.name().to_owned(),
            format!("{:.0}", at_once.bits_per_cycle()),
            format!("{:.0}", at_once.ceiling()),
            format!("{:.0}", at_once.rate()),
            percent(at_once.share()),
            format!("{:.0}", later.rate()),
            percent(later.share()),
        ]);
        if cycle.is_required() {
            goals.push(goal(cycle, &at_once));
        }
    }
    let section = Section {
        title: "Cycles on a 1 Mbit/s CAN bus",
        note: format!(
            "\
- {CYCLES} cycles of the sans-IO host and simulated motors, on virtual time.
- Bits include stuffing and interframe space.
- The share is the part of the time in which frames were on the wire.
- *at once*: motors reply immediately. *later*: motors reply after {} us.",
            TURNAROUND.as_micros()
        ),
        columns: vec!["cycle", "bits", "ceiling/s", "at once, /s", "share", "later, /s", "share"],
        rows,
    };
    Ok((vec![section], goals))
}

fn goal(cycle: Cycle, outcome: &Outcome) -> Goal {
    Goal {
        what: format!("share of the CAN wire's ceiling, {}", cycle.name()),
        wanted: format!(">= {}", percent(LEAST)),
        reached: Some((percent(outcome.share()), outcome.share() >= LEAST)),
    }
}

fn percent(share: f64) -> String {
    format!("{:.1} %", 100.0 * share)
}
