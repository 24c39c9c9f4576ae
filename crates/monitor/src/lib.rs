//! The monitor: drives in a browser. A web server between pages and a share, where it is a program like
//! any other.
//!
//! - [`message`] has the texts between a page and the server, besides those of the share.
//! - [`drive`] carries out what pages ask of drives.
//! - [`foxglove`] is for other viewers of the same data.
//! - [`dead_man`] decides whether a page is alive.
//! - [`recordings`] makes recordings, lists them, and reads them for plots.
//! - [`server`] serves the page, and connects pages to the share.
#![forbid(unsafe_code)]

pub mod dead_man;
pub mod drive;
pub mod foxglove;
pub mod message;
mod page_session;
pub mod recordings;
pub mod server;
mod websocket_limits;
