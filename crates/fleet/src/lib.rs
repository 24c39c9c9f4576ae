//! Drives at other computers, over [Zenoh](https://zenoh.io).
//!
//! A node is a share (`motorlink_telemetry::share`) that programs of other computers use, too. [`node`] is
//! its side, [`remote`] the side of a program, [`directory`] lists nodes, [`port_scheme`] the name `zenoh:NODE/LINE`
//! of a line, [`whole`] makes one share of all nodes, [`view`] sees what they publish, [`site`] writes the
//! certificates and rights of a network with a router. Both sides
//! exchange the messages of a share; [`message`] has what goes around them, [`key`] the keys, [`clock`] the
//! time that they agree on. docs/FLEET-PROTOCOL.md describes it for other programs.
//!
//! Whatever must happen in time is decided at the node by its own clock: a command that is too old is not
//! sent, and a motor of a program that gives no sign of life is stopped.
//!
//! Each request of a program is a numbered query, sent until the node has it. What the share says is pulled,
//! and numbered, too. So a lost message costs time and no data. No stop depends on the liveliness tokens of
//! Zenoh: they notice a cut network after seconds, and only end a session earlier.
#![forbid(unsafe_code)]

mod certificate_info;
pub mod clock;
pub mod computer;
pub mod directory;
pub mod key;
mod membership;
pub mod message;
pub mod network;
pub mod node;
pub mod port_scheme;
pub mod remote;
mod request_permission;
pub mod ros2;
pub mod site;
pub mod view;
pub mod whole;
mod zenoh_file;

/// The version of keys and messages.
pub const VERSION: u32 = 1;
