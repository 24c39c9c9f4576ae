//! Lines that carry bytes or CAN frames: opened by name, served to others, lost and opened again.
//!
//! [`port`] opens serial lines and CAN buses; a [`Scheme`](port::Scheme) is one kind of them.
//! [`serve`] is the other side of a line, for drives; [`list`] says what this machine has; [`fault`]
//! makes a line misbehave; [`reopening`] keeps one that may go away. No protocol of a drive is
//! known here.
#![forbid(unsafe_code)]

mod clock;
pub mod fault;
pub mod list;
pub mod port;
pub mod reopening;
pub mod serve;
mod text;

pub use clock::Clock;
pub use motorlink_proto::{can, time};
pub use motorlink_slcan as slcan;
pub use text::{is_printable, printable, printable_lines};
