//! The tables of the protocols for other people's tools.
//!
//! | for | use |
//! |---|---|
//! | cantools, SavvyCAN and other programs that read DBC files | [`dbc`] |
//! | your own generator | [`json`] |
//! | people | [`markdown`] |
//!
//! Everything comes from the tables of `motorlink-proto`.
#![forbid(unsafe_code)]
#![deny(missing_docs)]

pub mod dbc;
pub mod json;
pub mod markdown;
mod rmd;
