//! Recordings of drives: MCAP files that robotics tools open.
//!
//! | to | use |
//! |---|---|
//! | know what a file contains, encode and decode its messages | [`schema`] |
#![forbid(unsafe_code)]

pub mod schema;
