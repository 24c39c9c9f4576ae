//! Records drives: [`Recorder`] in threads, [`track`] without one. [`live`] makes the same messages for
//! viewers.

mod abort;
pub mod choice;
pub mod client;
mod condition;
mod content;
mod followed;
pub mod frames;
mod joint;
pub mod live;
mod losses;
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
