//! The messages between a share, which holds the ports, and the programs that use its drives.
//!
//! The page docs/SHARE-PROTOCOL.md describes them. [`message`] has the texts (JSON), [`data`] the samples
//! (binary columns), [`frame`] puts both on a stream of bytes. [`hub`] is the share without a socket,
//! [`server`] connects programs to it through a Unix socket. [`client_codec`] is a program without a socket,
//! [`stream`] one that follows the motors of a line, [`port`] a line of a share as a port, [`address`] the
//! way to a share. With the feature `tokio` `client` is a program that does not block, `motor_exchange` its
//! requests to a motor, and `drive_values` and `drive_settings` read drives with them.
//! [`command_kind`] reads the bytes of a command. [`port_config`] opens the ports
//! of lines, [`scan`] asks what answers on others. [`event_text`] makes sentences of the events of an
//! engine. [`wire`] keeps the frames of a line.

pub mod address;
#[cfg(feature = "tokio")]
pub mod client;
pub mod client_codec;
pub mod clock;
pub mod command_kind;
pub mod data;
pub mod drive_protocol;
#[cfg(feature = "tokio")]
pub mod drive_settings;
#[cfg(feature = "tokio")]
pub mod drive_values;
pub mod event_text;
pub mod frame;
pub mod hub;
pub mod message;
#[cfg(feature = "tokio")]
pub mod motor_exchange;
pub mod port;
pub mod port_config;
pub mod scan;
pub mod server;
pub mod stream;
pub mod wire;

/// The version of the messages.
pub const VERSION: u32 = 1;
