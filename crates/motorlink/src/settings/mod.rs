//! Settings of motors as text: written to a file, compared with a motor, restored. For both protocols.
//!
//! ```no_run
//! use motorlink::settings::{Comparison, Dump, Permissions, SettingsFile, Tunable};
//! use motorlink::st::{Client, Options};
//!
//! let client = Client::open(&"/dev/ttyACM0".parse()?, Options::default())?;
//! let motor = client.motor(1)?;
//! let text = Dump::reading(motor.tuning()).run(&motor)?.text();
//!
//! let file = SettingsFile::parse(&text, &motor.tuning())?;
//! let comparison = Comparison::reading(motor.tuning(), &file).run(&motor)?;
//! for difference in comparison.differences() {
//!     println!("{}: {} becomes {}", difference.setting.name, difference.now, difference.file);
//! }
//! comparison.restoring(Permissions::default(), || false).run(&motor)?;
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

mod compare;
mod dump;
mod file;
mod procedure;
mod restore;
mod rmd;
mod st;

pub use motorlink_proto::st::NotASetting;
use motorlink_proto::units::Scale;

pub use compare::{Comparison, Difference, Unread};
pub use dump::{Dump, fact, identify};
pub use file::{FileError, Problem, SettingsFile};
pub use procedure::{Next, Procedure, Step};
pub use restore::{Cause, Permissions, RestoreError, Undone};
pub use rmd::{RmdBlock, RmdTuning};
pub use st::StTuning;

/// One value of a motor.
#[derive(Debug, Clone, PartialEq)]
pub struct Setting {
    /// Its name in files.
    pub name: String,
    /// Its unit and range.
    pub scale: Scale,
    /// Its meaning; may be empty.
    pub doc: &'static str,
}

/// Settings that one request reads, and one request writes.
#[derive(Debug, Clone, PartialEq)]
pub struct Block<Id> {
    /// What the requests are for.
    pub id: Id,
    /// The values, in the order of the request.
    pub settings: Vec<Setting>,
    /// How they are written.
    pub writing: Writing,
    /// The heading in a file. Blocks with the same heading follow each other.
    pub heading: &'static str,
}

/// How a block is written.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Writing {
    /// Until the motor loses its supply.
    Volatile,
    /// As [`Volatile`](Self::Volatile). A second request makes it permanent, and wears the ROM of the motor.
    /// The permanent value cannot be read.
    Kept,
    /// For good. Each write wears the ROM of the motor.
    Permanent,
    /// Never. A file with another value is for another kind of motor.
    Fixed,
}

/// The kind of a motor, and its number.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Kind {
    /// The table of the file: `st` or `rmd`.
    pub protocol: &'static str,
    /// The profile of ST's protocol.
    pub profile: Option<&'static str>,
    /// Its number or ID.
    pub motor: u8,
}

/// What is asked of a motor with one request.
#[derive(Debug, Clone, PartialEq)]
pub enum Ask<Id> {
    /// A line of what is known of the drive, counted from 0.
    Identity(u8),
    /// The digits of a block.
    Read(Id),
    /// Writes a block.
    Write(Id, Vec<i64>),
    /// Makes a block permanent. It has these digits already.
    Keep(Id, Vec<i64>),
    /// What the motor does.
    Motion,
}

/// What a reply has for an [`Ask`].
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub struct Answer {
    /// The digits of a block that was read.
    pub digits: Vec<i64>,
    /// The line of an identity. What the motor does, unless it is at rest.
    pub text: Option<String>,
}

/// The settings of a kind of motor: what reads and writes them. It sends nothing.
pub trait Tuning {
    /// Names a block of this protocol.
    type Id: Copy + PartialEq + Send + Sync;
    /// A request of this protocol.
    type Request;

    /// The kind of the motor.
    fn kind(&self) -> Kind;

    /// How many lines of what is known of the drive can be asked for.
    fn identity(&self) -> u8;

    /// The blocks of its protocol, in the order of a file. The motor may not have all of them.
    fn blocks(&self) -> Vec<Block<Self::Id>>;

    /// Why a name is not that of a setting, if it is that of another register.
    fn not_a_setting(&self, name: &str) -> Option<NotASetting>;

    /// The request that asks this.
    fn request(&self, ask: &Ask<Self::Id>) -> Self::Request;

    /// What a reply to that request has; `None` if the reply belongs to another.
    fn answer(&self, ask: &Ask<Self::Id>, reply: &[u8]) -> Option<Answer>;

    /// The digits that a motor reads back after these were written.
    fn expected(&self, block: Self::Id, digits: Vec<i64>) -> Vec<i64>;
}

/// The error of a step.
pub trait StepError {
    /// Whether the motor has refused a block, which was not changed.
    fn is_refusal(&self) -> bool;

    /// Whether it is that of the line: the request may have been carried out.
    fn is_line_failure(&self) -> bool;

    /// Whether the caller wants an end, as after Ctrl-C. The request may have been carried out.
    fn is_interruption(&self) -> bool;
}

/// A motor with settings, whose exchanges wait.
pub trait Tunable {
    /// Its settings.
    type Tuning: Tuning + Send + Sync;
    /// The error of an exchange.
    type Error: StepError + Send;

    /// Its settings.
    fn tuning(&self) -> Self::Tuning;

    /// One exchange.
    ///
    /// # Errors
    /// Those of an exchange.
    fn ask(&self, ask: &Ask<Id<Self>>) -> Result<Answer, Self::Error>;

    /// Checks a request against the limits of the client. Sends nothing.
    ///
    /// # Errors
    /// A limit forbids it.
    fn check(&self, ask: &Ask<Id<Self>>) -> Result<(), Self::Error>;

    /// Checks that replies and requests match.
    ///
    /// # Errors
    /// What was read or acknowledged since the last confirmation cannot be trusted.
    fn confirm(&self) -> Result<(), Self::Error>;
}

/// The name of a block of a motor.
pub type Id<M> = <<M as Tunable>::Tuning as Tuning>::Id;

impl Setting {
    /// A value with as many decimals as its digits have, without the unit.
    pub fn number(&self, digits: i64) -> String {
        format!("{:.*}", usize::from(self.scale.decimals), self.scale.value(digits))
    }

    /// The same with its unit.
    pub fn shown(&self, digits: i64) -> String {
        format!("{} {}", self.number(digits), self.scale.symbol).trim_end().to_owned()
    }
}

/// Names for a message.
fn list<'a>(names: impl IntoIterator<Item = &'a String>) -> String {
    let names: Vec<&str> = names.into_iter().map(String::as_str).collect();
    names.join(", ")
}
