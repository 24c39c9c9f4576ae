//! The tables of the protocols for other people's tools.
//!
//! | for | use |
//! |---|---|
//! | cantools, SavvyCAN and other programs that read DBC files | [`dbc`] |
//! | your own generator | [`json`] |
//! | people | [`markdown`] |
//! | Wireshark | [`wireshark`] |
//!
//! Everything comes from the tables of `motorlink-proto`.
#![forbid(unsafe_code)]
#![deny(missing_docs)]

pub mod dbc;
pub mod json;
mod lua;
pub mod markdown;
mod rmd;
pub mod st_messages;
pub mod wireshark;
