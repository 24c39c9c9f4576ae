//! Signals of motor drives at their rates, commands in between, stops before all.
//!
//! | to | use |
//! |---|---|
//! | read signals of a line again and again, and command its motors meanwhile | [`acquisition::Acquisition`], in a thread [`runner::Runner`] |
//! | name a signal | [`signal::Signal::named`] |
//! | receive values and events | [`subscription::Subscription`] |
//! | make rows of values of the same instant | [`rows::Rows`] |
//! | see which exchanges read signals | [`plan`] |
//! | find the motors of a line | [`search`] |
//! | say the state and the faults of a motor | [`overview`] |
//! | exchange messages with other programs that use the same lines | [`share`] |
//! | schedule exchanges of your own, sans I/O | [`schedule::Schedule`] |
//!
//! ```no_run
//! use motorlink_proto::rmd::MotorId;
//! use motorlink_proto::time::Micros;
//! use motorlink_telemetry::acquisition::Acquisition;
//! use motorlink_telemetry::line::RmdLine;
//! use motorlink_telemetry::plan::Wants;
//! use motorlink_telemetry::runner::Runner;
//! use motorlink_telemetry::signal::{Motor, Signal};
//! use motorlink_telemetry::subscription::{Full, Record};
//!
//! # fn main() -> Result<(), Box<dyn std::error::Error>> {
//! let line = RmdLine::open(&"socketcan:can0".parse()?, Default::default())?;
//! let runner = Runner::start("can0", Acquisition::new(Box::new(line)))?;
//! let motor = Motor::Rmd(MotorId::new(1).ok_or("an ID is 1 to 32")?);
//! let speed = Signal::named(motor, "speed_dps")?;
//! let wants = Wants::from([(speed, Micros::from_millis(10))]);
//! let (_, subscription) = runner.remote().subscribe(wants, 1000, Full::DropOldest)?;
//! while let Some(record) = subscription.wait(std::time::Duration::from_secs(1)) {
//!     if let Record::Values(values) = record {
//!         println!("{:?} µs {:?}", values.time().0, values.get(speed));
//!     }
//! }
//! # Ok(())
//! # }
//! ```
#![forbid(unsafe_code)]

pub mod acquisition;
pub mod event;
pub mod label;
pub mod line;
pub mod overview;
pub mod plan;
pub mod rows;
pub mod runner;
pub mod sample;
pub mod schedule;
pub mod search;
pub mod share;
pub mod signal;
pub mod subscription;
