//! RMD motors on a CAN bus.
//!
//! ```no_run
//! use motorlink::rmd::{Bus, Options, SpeedLimit, CentiDegrees};
//!
//! let bus = Bus::open(&"slcan:/dev/ttyACM0".parse()?, Options::default())?;
//! let guard = bus.guard();                 // stops what was set moving
//! let motor = bus.motor(1)?;
//! motor.set_position(CentiDegrees::from_degrees(90.0), Some(SpeedLimit(500)))?;
//! println!("{} °/s", motor.motion_status()?.speed.dps());
//! # drop(guard);
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

mod bus;
mod error;
mod event;
pub(crate) mod follow;
mod full_turn;
mod guard;
mod motor;
mod options;
mod session;

pub use motorlink_proto::rmd::*;
pub use motorlink_proto::units::*;

pub use bus::{Bus, Found};
pub use error::Error;
pub use event::EventBus;
pub use full_turn::FullTurn;
pub use guard::{Guard, OnDrop, Stopped};
pub use motor::MotorHandle;
pub use options::Options;
