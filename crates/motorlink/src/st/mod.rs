//! ST's Motor Control Protocol over a serial line.
//!
//! ```no_run
//! use motorlink::st::{Client, Options, Ramp, register};
//!
//! let client = Client::open(&"/dev/ttyACM0".parse()?, Options::default())?;
//! let stop = client.stop_on_drop();       // stops what was started when it goes out of scope
//! let motor = client.motor(1)?;
//! motor.start()?;
//! motor.set_ramp(Ramp { speed_rpm: 1500, duration_ms: 1000 })?;
//! println!("{} rpm", motor.get(register::SPEED_MEAS)?);
//! # drop(stop);
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

mod arrival;
mod client;
mod driven;
mod error;
mod event;
pub(crate) mod follow;
mod held;
mod motor;
mod options;
mod scan;
mod session;
mod stop_on_drop;

pub use motorlink_proto::st::{
    ARRIVAL_TOLERANCE_RAD, AbortReason, ArrivalSampler, ArrivalWatch, Command, Confirmation,
    ControlMode, Counters, CurrentReference, Effect, ErrorCode, Failure, Feature, Features, Flags,
    Frame, FrameCode, FullScale, InvalidFullScale, LimitError, Limits, MAX_FRAME, MasterConfig,
    MotorNumber, NoSuchProfile, NotArrived, NotStarted, PositionMove, Profile, REVUP_PHASES, Ramp,
    Recovery, RegisterId, Request, RevupPhase, SEGMENT_REGISTERS, SEGMENTS, Slave, Starting,
    Status, SyncState, TorqueRamp, Unverified, VERIFY_ATTEMPTS, VerifiedWrite, register,
};

pub use arrival::ArrivalOptions;
pub use client::Seen;
pub use client::{BoardInfo, Client, FirmwareVersion};
pub use error::{Error, Target, Unverifiable};
pub use event::{EventClient, Progress};
pub use motor::Motor;
pub use motorlink_proto::st::{
    Implausible, Reading, UnknownRegister, ValueError, find_register, parse_value,
};
pub use options::Options;
pub use scan::{BAUD_RATES, SCAN_TIMEOUT, ScanResult, scan};
pub use session::Exchanged;
pub use stop_on_drop::{StopOnDrop, Stopped};
