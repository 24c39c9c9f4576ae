//! RMD motors on a CAN bus.
//!
//! ```no_run
//! use motorlink::rmd::{Client, Options, SpeedLimit, CentiDegrees};
//!
//! let client = Client::open(&"slcan:/dev/ttyACM0".parse()?, Options::default())?;
//! let stop = client.stop_on_drop();       // stops what was set moving
//! let motor = client.motor(1)?;
//! motor.set_position(CentiDegrees::from_degrees(90.0), Some(SpeedLimit(500)))?;
//! println!("{} °/s", motor.motion_status()?.speed.dps());
//! # drop(stop);
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

mod arrival;
mod asked;
mod client;
mod driven;
mod error;
mod event;
pub(crate) mod follow;
mod full_turn;
mod held;
mod motor;
mod options;
mod session;
mod stop_on_drop;
mod stopping;

pub use motorlink_proto::rmd::*;
pub use motorlink_proto::units::*;

pub use arrival::ArrivalOptions;
pub use asked::Asked;
pub use client::{Client, SCAN_WIDTH, ScanResult};
pub use error::Error;
pub use event::EventClient;
pub use full_turn::FullTurn;
pub use motor::Motor;
pub use options::Options;
pub use stop_on_drop::{StopOnDrop, Stopped};
pub use stopping::{StopAction, Stopping};
