//! The monitor: drives in a browser. A web server between pages and a share.
//!
//! - [`message`] has the texts between a page and the server, besides those of the share.
//! - [`program`] is a program at a share, without blocking.
#![forbid(unsafe_code)]

pub mod message;
pub mod program;
