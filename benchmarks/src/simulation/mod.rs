//! Simulated drives: speed relative to real time and to other simulators.

mod peers;

use motorlink_kernels::drives;
use motorlink_kernels::kernel::{Counter, Kernel};
use motorlink_kernels::result::Result;
use rustix::time::{ClockId, clock_gettime};

use crate::line::Spread;
use crate::report::{Goal, Section};

use peers::{Peer, Peers};

/// Number of turns of the drives and the other simulators.
const ROUNDS: usize = 7;
/// Periods of our drives per turn.
const PERIODS: u32 = 100_000;
/// Required number of drives that one core can simulate in real time.
const REAL_TIME: f64 = 500.0;
/// Required speed ratio of a whole drive to the others.
const FASTER: f64 = 100.0;

/// The configuration of the other simulators.
const OTHERS: &str = "\
The other simulators run as fast as they can (benchmarks/peers.py). They plot nothing, compute no
reward that is not required, and have one voltage in each period.

- gym-electric-motor is its Cont-CC-PMSM-v0 without the checks of gymnasium. It uses its default and
  fastest solver, with one Euler step in each period. Its own controllers need a package that draws
  diagrams, so PI regulators of ours in plain floats control it.
- motulator is its Drive with stiff mechanics and its CurrentVectorControl. It always integrates
  with SciPy. RK23 is used here, because its default RK45 is slower. *midpoint* replaces the solver
  with one midpoint step of ours. This shows the cost of the rest.
- Our plant also has friction with stiction, cogging, iron loss, heat, supply and dead time, current
  sensors with noise, and an encoder. Our drive also has its whole firmware.";

pub fn measure() -> Result<(Vec<Section>, Vec<Goal>)> {
    let counter = Counter::find();
    let (own, mut goals) = own(counter.as_ref())?;
    let (others, comparisons) = beside_others()?;
    goals.extend(comparisons);
    Ok((vec![own, others], goals))
}

fn own(counter: Option<&Counter>) -> Result<(Section, Vec<Goal>)> {
    let (mut rows, mut goals) = (Vec::new(), Vec::new());
    for rig in &drives::RIGS {
        let mut kernel = rig.kernel();
        let factor = median((0..ROUNDS).map(|_| drives::PERIOD_S * rate(&mut kernel)));
        let cost = kernel.cost(counter)?.show();
        let row = [rig.name.to_owned(), format!("{factor:.0}")].into_iter().chain(cost);
        rows.push(row.collect());
        if rig.is_required {
            goals.push(Goal {
                what: format!("times real time on one core, {}", rig.name),
                wanted: format!(">= {REAL_TIME}"),
                reached: Some((format!("{factor:.0}"), factor >= REAL_TIME)),
            });
        }
    }
    let section = Section {
        title: "A simulated drive",
        note: format!(
            "\
- One operation: a PWM period of 50 us of one motor, with plant, power stage, sensing and the
  software of the drive. The regulators of an ST drive run in each period.
- *times real time*: virtual seconds in one second of one core, median of {ROUNDS} turns of {PERIODS}
  periods.
- The other columns are time and instructions of one period."
        ),
        columns: vec!["drive", "times real time", "ns, least", "median", "instructions"],
        rows,
    };
    Ok((section, goals))
}

fn beside_others() -> Result<(Section, Vec<Goal>)> {
    let mut rows = Vec::new();
    let mut slowest = peers::PACKAGES.map(|package| (package, None::<f64>));
    let started = Peers::start()?;
    let found = started.as_ref().map_or_else(
        || "nothing, because the packages are not installed".to_owned(),
        Peers::versions,
    );
    if let Some(mut peers) = started {
        for peer in &peers::PEERS {
            let (theirs, ours, ratio) = take_turns(peer, &mut peers)?;
            rows.push(vec![
                format!("{}: {}", peer.package, peer.what),
                format!("{theirs:.0}"),
                peer.ours.name.to_owned(),
                format!("{ours:.0}"),
                format!("{ratio:.0}"),
            ]);
            for (_, least) in slowest.iter_mut().filter(|(package, _)| *package == peer.package) {
                *least = Some(least.map_or(ratio, |least| least.min(ratio)));
            }
        }
    }
    let goals = slowest.map(|(package, ratio)| Goal {
        what: format!("steps a second over {package}'s, the least ratio"),
        wanted: format!(">= {FASTER}"),
        reached: ratio.map(|ratio| (format!("{ratio:.0}"), ratio >= FASTER)),
    });
    let section = Section {
        title: "Comparison with other simulators",
        note: format!(
            "\
- *steps/s*: steps of 50 us in one second of one core. *ours* is the simulation of this project.
- The simulators run in turn, {ROUNDS} times. Rates are medians. The ratio is the median of neighbouring
  turns.
- The motor, its speed and its current are the same for all.
- Compared with: {found}.\n\n{OTHERS}"
        ),
        columns: vec!["simulator", "steps/s", "ours", "steps/s", "ratio"],
        rows,
    };
    Ok((section, goals.into()))
}

/// Medians of their steps per second and of ours, and the ratio.
fn take_turns(peer: &Peer, peers: &mut Peers) -> Result<(f64, f64, f64)> {
    let mut kernel = peer.ours.kernel();
    let mut turns = Vec::new();
    for _ in 0..ROUNDS {
        turns.push((peers.rate(peer)?, rate(&mut kernel)));
    }
    Ok((
        median(turns.iter().map(|(theirs, _)| *theirs)),
        median(turns.iter().map(|(_, ours)| *ours)),
        median(turns.iter().map(|(theirs, ours)| ours / theirs)),
    ))
}

/// Repetitions per second of this thread's processor time.
fn rate(kernel: &mut Kernel) -> f64 {
    let began = processor_seconds();
    kernel.repeat(PERIODS);
    f64::from(PERIODS) / (processor_seconds() - began)
}

fn processor_seconds() -> f64 {
    let time = clock_gettime(ClockId::ThreadCPUTime);
    time.tv_sec as f64 + time.tv_nsec as f64 * 1e-9
}

fn median(values: impl Iterator<Item = f64>) -> f64 {
    Spread::of(values.collect()).median
}
