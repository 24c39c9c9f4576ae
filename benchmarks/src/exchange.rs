//! An ST exchange in user space: master and slave, without a line between them.

use motorlink_kernels::exchange;
use motorlink_kernels::kernel::Counter;
use motorlink_kernels::result::Result;

use crate::report::{Goal, Section};

/// Maximum number of instructions of an exchange.
const MOST: f64 = 1_000.0;
pub fn measure() -> Result<(Vec<Section>, Vec<Goal>)> {
    let counter = Counter::find();
    let mut rows = Vec::new();
    let mut counts = Vec::new();
    for kernel in exchange::kernels() {
        let name = kernel.name.clone();
        let cost = kernel.cost(counter.as_ref())?;
        rows.push([name].into_iter().chain(cost.show()).collect());
        counts.push(cost.instructions);
    }
    let goal = Goal {
        what: "instructions of a GET_REG exchange, master and slave".to_owned(),
        wanted: format!("< {MOST}"),
        reached: counts[0].map(|count| (format!("{count:.0}"), count < MOST)),
    };
    let section = Section {
        title: "A GET_REG exchange, master and slave",
        note: "\
- One operation: SPEED_MEAS from request to value, in user space, without I/O.
- *memory*: the drive only stores registers.
- *simulation*: the drive is simulated. Its motors turn for 0.1 ms between exchanges."
            .to_owned(),
        columns: vec!["drive", "ns, least", "median", "instructions"],
        rows,
    };
    Ok((vec![section], vec![goal]))
}
