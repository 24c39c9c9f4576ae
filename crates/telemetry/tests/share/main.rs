//! A share: its messages, its programs, what it owes them, and its lines as ports.

#[path = "../asking/mod.rs"]
mod asking;
mod asks;
#[path = "../drives/mod.rs"]
mod drives;
mod frames;
mod leases;
mod lines;
mod messages;
mod owed;
mod port;
mod server;
#[path = "../shared/mod.rs"]
mod shared;
mod stopping;
mod stops;
mod stream;
