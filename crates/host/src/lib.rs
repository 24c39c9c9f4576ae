//! Motor drives from a program: ports, and the clients that talk through them.
//!
//! [`port`] opens serial lines and CAN buses by name; [`serve`] is the other side of them, for
//! simulated drives; [`list`] says what this machine has; [`slcan`] is the language of serial CAN
//! adapters; [`relay`] stands between a program and its motors; [`fault`] makes a line misbehave.
#![forbid(unsafe_code)]

mod clock;
pub mod fault;
mod line;
pub mod list;
pub mod port;
pub mod relay;
pub mod rmd;
pub mod serve;
#[cfg(feature = "sim")]
pub mod sim;
pub mod stmcp;
mod text;
mod turn;

pub use clock::Clock;
pub use line::{BackOff, LinkState, Opener};
pub use motorlink_proto::{can, time};
pub use motorlink_slcan as slcan;
pub use turn::LOOK;
