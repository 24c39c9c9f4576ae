//! A line that misbehaves as it is told, to rehearse what a program does about it.
//!
//! [`Faults`] says what goes wrong, in a text that a command line takes too; a [`Lane`] does it to
//! one direction of a line, on whatever clock its caller keeps. The same faults and the same calls
//! give the same damage. [`FaultBytes`](crate::port::FaultBytes) and
//! [`FaultCan`](crate::port::FaultCan) put lanes around a port.
//!
//! ```
//! use motorlink_link::fault::{Faults, Lane, Way};
//! use motorlink_link::time::{Micros, Instant};
//!
//! let faults: Faults = "drop=1,delay=5ms,only=received".parse()?;
//! let mut sent = Lane::new(&faults, Way::Sent, Micros(87), ());
//! sent.push(Instant(0), [0x22, 0x01]);
//! assert_eq!(sent.due(), Some(Instant(87)));      // only what is received suffers
//! assert_eq!(sent.pop(Instant(87)), Some(0x22));
//! # Ok::<(), motorlink_link::fault::FaultError>(())
//! ```

mod lane;
mod spec;
mod unit;

pub use fastrand::Rng;
pub use lane::Lane;
pub use spec::{FaultError, Faults, Flood, Span, Spell, Way};
pub use unit::{Struck, Unit};
