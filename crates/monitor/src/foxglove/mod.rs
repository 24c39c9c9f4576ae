//! The same live data for other viewers: Foxglove's WebSocket protocol, for reading alone.
//!
//! Topics and messages are those of recordings. `viewers` follows the share while a viewer is there,
//! `session` is a viewer without a socket, `protocol` has the messages, `socket` a connection.

mod protocol;
mod session;
mod socket;
mod viewers;

pub use protocol::SUBPROTOCOLS;
pub use session::LONGEST_TEXT;
pub use socket::{PACKED, serve};
pub use viewers::Viewers;
