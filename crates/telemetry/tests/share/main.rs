//! Tests of a share: its messages and programs, its stops, and its lines as ports.

#[path = "../asking/mod.rs"]
mod asking;
mod closing;
#[path = "../drives/mod.rs"]
mod drives;
#[path = "../engine/mod.rs"]
mod engine;
mod faulty;
mod frames;
mod leases;
mod life;
mod lines;
mod messages;
mod model;
mod pending_stops;
mod port;
mod programs;
mod scripted;
mod server;
#[path = "../shared/mod.rs"]
mod shared;
mod stopping;
mod stops;
mod stream;
mod virtual_share;
