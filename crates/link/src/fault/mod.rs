//! Faults on a line, to test how a program handles them.
//!
//! [`Faults`] describes the faults; it is also parsed from text, for the command line. A [`Lane`]
//! applies them to one direction of a line, with the caller's clock. The same faults and the same
//! calls give the same damage. [`FaultBytes`](crate::port::FaultBytes) and
//! [`FaultCan`](crate::port::FaultCan) wrap a port in lanes.
//!
//! ```
//! use motorlink_link::fault::{Faults, Lane, Direction};
//! use motorlink_link::time::{Micros, Instant};
//!
//! let faults: Faults = "drop=1,delay=5ms,only=received".parse()?;
//! let mut sent = Lane::new(&faults, Direction::Sent, Micros(87), ());
//! sent.push(Instant(0), [0x22, 0x01]);
//! assert_eq!(sent.due(), Some(Instant(87)));      // only received units are delayed
//! assert_eq!(sent.pop(Instant(87)), Some(0x22));
//! # Ok::<(), motorlink_link::fault::FaultError>(())
//! ```

mod lane;
mod spec;
mod unit;

pub use fastrand::Rng;
pub use lane::Lane;
pub use spec::{FaultError, Faults, Flood, Span, Spell};
pub use unit::{Struck, Unit};

pub use crate::direction::Direction;
