//! Shares whose ST line has faults.

use std::time::Duration;

use crate::shared::{PATIENT, Share};
use motorlink::port::{EventBytes, FaultBytes};
use motorlink_link::fault::Faults;

/// A share whose ST drive receives nothing, and whose RMD motors answer soon or never.
pub fn deaf(name: &str) -> Share {
    let faults: Faults = "drop=1".parse().unwrap();
    let faults = faults.on_serial().unwrap();
    let around = move |link| Box::new(FaultBytes::new(link, &faults)) as Box<_>;
    Share::with(name, Duration::from_millis(100), around)
}

/// Around a line: it repeats this part of what it carries. Each connection has faults of its own.
pub fn repeats(
    part: f64,
) -> impl FnMut(Box<dyn EventBytes>) -> Box<dyn EventBytes> + Send + 'static {
    let faults: Faults = format!("dup={part}").parse().unwrap();
    let mut faults = faults.on_serial().unwrap();
    move |link| {
        faults.seed += 1;
        Box::new(FaultBytes::new(link, &faults))
    }
}

/// A share with such an ST line.
pub fn repeating(name: &str, part: f64) -> Share {
    Share::with(name, PATIENT, repeats(part))
}
