//! Records drives: [`Recorder`] in threads, [`track`] without one.

mod abort;
pub mod choice;
pub mod client;
mod condition;
mod content;
mod followed;
pub mod frames;
mod joint;
mod open;
mod recorder;
mod settings;
mod topics;
pub mod track;
pub mod wall;

pub use abort::Abort;
pub use open::Port;
pub use recorder::{Config, Progress, Recorder};
pub use topics::Topics;
pub use track::Line;
