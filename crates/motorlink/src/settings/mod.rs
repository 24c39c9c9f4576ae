//! Settings of motors as text: written to a file, compared with a motor, restored. For both protocols.
//!
//! ```no_run
//! use motorlink::settings::{self, Comparison, Permissions, SettingsFile, Tunable};
//! use motorlink::st::{Client, Options};
//!
//! let client = Client::open(&"/dev/ttyACM0".parse()?, Options::default())?;
//! let motor = client.motor(1)?;
//! let text = settings::dump(&motor)?.text();
//!
//! let file = SettingsFile::parse(&text, &motor)?;
//! let comparison = Comparison::read(&motor, &file)?;
//! for difference in comparison.differences() {
//!     println!("{}: {} becomes {}", difference.setting.name, difference.now, difference.file);
//! }
//! comparison.restore(&motor, Permissions::default(), || false)?;
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

mod compare;
mod dump;
mod file;
mod restore;
mod rmd;
mod st;

use motorlink_proto::units::Scale;

pub use compare::{Comparison, Difference, Unread};
pub use dump::{Dump, dump};
pub use file::{FileError, Problem, SettingsFile};
pub use restore::{Cause, Permissions, RestoreError, Undone};
pub use rmd::RmdBlock;

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

/// A motor with settings.
pub trait Tunable {
    /// Names a block of this protocol.
    type Id: Copy + PartialEq;
    /// The error of an exchange.
    type Error;

    /// The kind of the motor.
    fn kind(&self) -> Kind;

    /// What is known of the drive, a line each.
    ///
    /// # Errors
    /// Those of an exchange.
    fn identity(&self) -> Result<Vec<String>, Self::Error>;

    /// The blocks of its protocol, in the order of a file. The motor may not have all of them.
    fn blocks(&self) -> Vec<Block<Self::Id>>;

    /// Reads a block, in digits.
    ///
    /// # Errors
    /// Those of an exchange.
    fn read(&self, block: Self::Id) -> Result<Vec<i64>, Self::Error>;

    /// Checks a write of a block against the limits of the client. Sends nothing.
    ///
    /// # Errors
    /// A limit forbids it.
    fn check(&self, block: Self::Id, digits: &[i64]) -> Result<(), Self::Error>;

    /// Writes a block.
    ///
    /// # Errors
    /// Those of an exchange.
    fn write(&self, block: Self::Id, digits: &[i64]) -> Result<(), Self::Error>;

    /// Makes a block permanent. It has these digits already.
    ///
    /// # Errors
    /// Those of an exchange.
    fn keep(&self, block: Self::Id, digits: &[i64]) -> Result<(), Self::Error>;

    /// The digits that a motor reads back after these were written.
    fn expected(&self, block: Self::Id, digits: Vec<i64>) -> Vec<i64>;

    /// What the motor does, unless it is at rest.
    ///
    /// # Errors
    /// Those of an exchange.
    fn motion(&self) -> Result<Option<String>, Self::Error>;

    /// Checks that replies and requests match.
    ///
    /// # Errors
    /// What was read or acknowledged since the last confirmation cannot be trusted.
    fn confirm(&self) -> Result<(), Self::Error>;

    /// Whether the motor has refused a block, which was not changed.
    fn is_refusal(error: &Self::Error) -> bool;

    /// Whether an error is that of the line: the request may have been carried out.
    fn is_line_failure(error: &Self::Error) -> bool;
}

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
