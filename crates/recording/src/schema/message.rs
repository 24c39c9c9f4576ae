//! The messages whose types are the same in every recording.

use serde::de::DeserializeOwned;
use serde::{Deserialize, Deserializer, Serialize};

use super::cdr::{self, Malformed, Text, text};

/// A message with a type of its own.
pub trait Message: Serialize + DeserializeOwned {
    /// The name of the type: package, `msg`, name.
    const TYPE: &'static str;
    /// The fields in the language of `.msg` files, with the types that they use.
    fn definition() -> String;
    /// The message as CDR.
    fn encode(&self) -> Vec<u8> {
        cdr::encode(self)
    }

    /// The message that this CDR is.
    ///
    /// # Errors
    /// It is a message of another type.
    fn decode(bytes: &[u8]) -> Result<Self, Malformed> {
        cdr::decode(bytes).map(|(message, _)| message)
    }
}

const NANOS: u64 = 1_000_000_000;

/// Gives the values of an enum the names that they have in definitions.
macro_rules! named {
    ($kind:ident as $integer:literal: $($variant:ident = $name:literal),+) => {
        impl $kind {
            /// All values.
            pub const ALL: &[Self] = &[$(Self::$variant),+];

            /// The name in the definition of the type.
            pub const fn name(self) -> &'static str {
                match self {
                    $(Self::$variant => $name),+
                }
            }

            /// The values as constants of a definition.
            pub(in crate::schema) fn constants() -> String {
                let constant = |it: &Self| format!("{} {}={}\n", $integer, it.name(), *it as u8);
                Self::ALL.iter().map(constant).collect()
            }
        }

        impl From<$kind> for u8 {
            fn from(kind: $kind) -> u8 {
                kind as u8
            }
        }
    };
}
pub(super) use named;

/// `builtin_interfaces/msg/Time`: ns since 1970.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Default, Serialize, Deserialize)]
#[serde(from = "(i32, u32)", into = "(i32, u32)")]
pub struct Time(pub u64);

impl From<Time> for (i32, u32) {
    fn from(Time(nanos): Time) -> Self {
        (i32::try_from(nanos / NANOS).unwrap_or(i32::MAX), (nanos % NANOS) as u32)
    }
}

impl From<(i32, u32)> for Time {
    fn from((seconds, nanos): (i32, u32)) -> Self {
        Time(u64::try_from(seconds).unwrap_or(0) * NANOS + u64::from(nanos))
    }
}

impl Time {
    /// The fields in the language of `.msg` files.
    pub(super) const DEPENDENCY: (&'static str, &'static str) =
        ("builtin_interfaces/Time", "int32 sec\nuint32 nanosec\n");

    /// The time of the day in the form of RFC 3339, to the millisecond: `2026-11-23T14:05:09.250Z`.
    pub fn text(self) -> String {
        let (seconds, millis) = (self.0 / NANOS, self.0 % NANOS / 1_000_000);
        let (days, of_day) = (seconds / 86_400, seconds % 86_400);
        // Days of eras of 400 years, which begin on March 1st.
        let days = days + 719_468;
        let (era, of_era) = (days / 146_097, days % 146_097);
        let year_of_era = (of_era - of_era / 1_460 + of_era / 36_524 - of_era / 146_096) / 365;
        let of_year = of_era - (365 * year_of_era + year_of_era / 4 - year_of_era / 100);
        let from_march = (5 * of_year + 2) / 153;
        let day = of_year - (153 * from_march + 2) / 5 + 1;
        let month = if from_march < 10 { from_march + 3 } else { from_march - 9 };
        let year = year_of_era + era * 400 + u64::from(month <= 2);
        let (hour, minute, second) = (of_day / 3_600, of_day / 60 % 60, of_day % 60);
        format!("{year:04}-{month:02}-{day:02}T{hour:02}:{minute:02}:{second:02}.{millis:03}Z")
    }
}

/// `std_msgs/msg/Header`, without a frame of reference: motors have none.
const HEADER: (&str, &str) =
    ("std_msgs/Header", "builtin_interfaces/Time stamp\nstring frame_id\n");

/// A header, of which only the time is kept.
mod header {
    use serde::{Deserialize, Deserializer, Serialize, Serializer};

    use super::{Text, Time};

    pub fn serialize<S: Serializer>(stamp: &Time, to: S) -> Result<S::Ok, S::Error> {
        (stamp, "").serialize(to)
    }

    pub fn deserialize<'de, D: Deserializer<'de>>(from: D) -> Result<Time, D::Error> {
        <(Time, Text)>::deserialize(from).map(|(stamp, _)| stamp)
    }
}

fn texts<'de, D: Deserializer<'de>>(from: D) -> Result<Vec<String>, D::Error> {
    Ok(Vec::<Text>::deserialize(from)?.into_iter().map(|text| text.0).collect())
}

fn pairs<'de, D: Deserializer<'de>>(from: D) -> Result<Vec<(String, String)>, D::Error> {
    let pairs = Vec::<(Text, Text)>::deserialize(from)?;
    Ok(pairs.into_iter().map(|(key, value)| (key.0, value.0)).collect())
}

/// A definition with those of the types that it uses, each behind a line of 80 `=`.
pub(super) fn with_dependencies(fields: &str, dependencies: &[(&str, &str)]) -> String {
    let rule = "=".repeat(80);
    let used = dependencies.iter().map(|(name, text)| format!("{rule}\nMSG: {name}\n{text}"));
    std::iter::once(fields.to_owned()).chain(used).collect()
}

/// `sensor_msgs/msg/JointState`: where motors are and how they move.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
pub struct JointState {
    /// When the values were read.
    #[serde(with = "header")]
    pub stamp: Time,
    /// The motors.
    #[serde(deserialize_with = "texts")]
    pub name: Vec<String>,
    /// rad. Empty if it is not recorded.
    pub position: Vec<f64>,
    /// rad/s. Empty if it is not recorded.
    pub velocity: Vec<f64>,
    /// A of the current that makes torque. Empty if it is not recorded.
    pub effort: Vec<f64>,
}

impl Message for JointState {
    const TYPE: &'static str = "sensor_msgs/msg/JointState";

    fn definition() -> String {
        let fields = "std_msgs/Header header\nstring[] name\nfloat64[] position\n\
                      float64[] velocity\nfloat64[] effort\n";
        with_dependencies(fields, &[HEADER, Time::DEPENDENCY])
    }
}

/// `diagnostic_msgs/msg/DiagnosticArray`: the condition of motors.
#[derive(Debug, Clone, PartialEq, Eq, Default, Serialize, Deserialize)]
pub struct DiagnosticArray {
    /// When this was so.
    #[serde(with = "header")]
    pub stamp: Time,
    /// One for each motor.
    pub status: Vec<DiagnosticStatus>,
}

/// `diagnostic_msgs/msg/DiagnosticStatus`.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct DiagnosticStatus {
    /// How good it is.
    pub level: Level,
    /// Label and motor: `st0/motor1`.
    #[serde(deserialize_with = "text")]
    pub name: String,
    /// State and faults.
    #[serde(deserialize_with = "text")]
    pub message: String,
    /// The port.
    #[serde(deserialize_with = "text")]
    pub hardware_id: String,
    /// More, by name.
    #[serde(deserialize_with = "pairs")]
    pub values: Vec<(String, String)>,
}

/// The level of a [`DiagnosticStatus`].
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(from = "u8", into = "u8")]
#[repr(u8)]
pub enum Level {
    /// Nothing is wrong.
    Ok = 0,
    /// Something needs attention.
    Warn = 1,
    /// The motor has a fault.
    Error = 2,
    /// The motor does not answer, or its values are old.
    Stale = 3,
}

named!(Level as "byte": Ok = "OK", Warn = "WARN", Error = "ERROR", Stale = "STALE");

impl From<u8> for Level {
    fn from(level: u8) -> Self {
        match level {
            0 => Level::Ok,
            1 => Level::Warn,
            3 => Level::Stale,
            _ => Level::Error,
        }
    }
}

impl Message for DiagnosticArray {
    const TYPE: &'static str = "diagnostic_msgs/msg/DiagnosticArray";

    fn definition() -> String {
        let fields = "std_msgs/Header header\ndiagnostic_msgs/DiagnosticStatus[] status\n";
        let status = format!(
            "{}byte level\nstring name\nstring message\nstring hardware_id\n\
             diagnostic_msgs/KeyValue[] values\n",
            Level::constants(),
        );
        let value = ("diagnostic_msgs/KeyValue", "string key\nstring value\n");
        let status = ("diagnostic_msgs/DiagnosticStatus", status.as_str());
        with_dependencies(fields, &[HEADER, Time::DEPENDENCY, status, value])
    }
}

/// `rcl_interfaces/msg/Log`: something that happened.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct Log {
    /// When it happened.
    pub stamp: Time,
    /// How bad it is.
    pub severity: Severity,
    /// Whom it concerns: `st0/motor1`, or the label of a port.
    #[serde(deserialize_with = "text")]
    pub name: String,
    /// The sentence.
    #[serde(deserialize_with = "text")]
    pub message: String,
    /// Who commanded it; may be empty.
    #[serde(deserialize_with = "text")]
    pub by: String,
    /// The kind, one word for programs: `stopped`.
    #[serde(with = "function")]
    pub kind: String,
}

/// The kind, and the line of a program that a log of ROS names: there is none.
mod function {
    use serde::{Deserialize, Deserializer, Serialize, Serializer};

    use super::Text;

    pub fn serialize<S: Serializer>(kind: &str, to: S) -> Result<S::Ok, S::Error> {
        (kind, 0u32).serialize(to)
    }

    pub fn deserialize<'de, D: Deserializer<'de>>(from: D) -> Result<String, D::Error> {
        <(Text, u32)>::deserialize(from).map(|(kind, _)| kind.0)
    }
}

/// The severity of a [`Log`].
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(from = "u8", into = "u8")]
#[repr(u8)]
pub enum Severity {
    /// For looking for causes.
    Debug = 10,
    /// In the course of things.
    Info = 20,
    /// Values are missing, or something was refused.
    Warn = 30,
    /// A motor may not do what was commanded.
    Error = 40,
    /// The program cannot continue.
    Fatal = 50,
}

named!(Severity as "byte": Debug = "DEBUG", Info = "INFO", Warn = "WARN", Error = "ERROR",
       Fatal = "FATAL");

impl From<u8> for Severity {
    fn from(level: u8) -> Self {
        match level {
            0..=10 => Severity::Debug,
            11..=20 => Severity::Info,
            21..=30 => Severity::Warn,
            31..=40 => Severity::Error,
            _ => Severity::Fatal,
        }
    }
}

impl Message for Log {
    const TYPE: &'static str = "rcl_interfaces/msg/Log";

    fn definition() -> String {
        let fields = format!(
            "{}builtin_interfaces/Time stamp\nuint8 level\nstring name\nstring msg\nstring file\n\
             string function\nuint32 line\n",
            Severity::constants(),
        );
        with_dependencies(&fields, &[Time::DEPENDENCY])
    }
}

#[cfg(test)]
pub(super) mod tests {
    use super::*;

    pub fn returns<M: Message + PartialEq + std::fmt::Debug>(message: M) {
        let bytes = message.encode();
        assert_eq!(M::decode(&bytes).as_ref(), Ok(&message));
        for end in 0..bytes.len() {
            assert!(M::decode(&bytes[..end]).is_err(), "{end} of {} bytes", bytes.len());
        }
        // What others send.
        for at in 0..bytes.len() {
            for value in [0, 1, 0x7F, 0xFF] {
                let mut damaged = bytes.clone();
                damaged[at] = value;
                let _ = M::decode(&damaged);
            }
        }
    }

    #[test]
    fn every_message_is_decoded_to_what_was_encoded_and_no_part_of_it_is() {
        let stamp = Time(1_764_000_000_123_456_789);
        returns(JointState {
            stamp,
            name: vec!["st0_motor1".to_owned(), "can0_motor12".to_owned()],
            position: vec![1.5, -2.0],
            velocity: vec![],
            effort: vec![f64::MIN_POSITIVE, 1e9],
        });
        let status = DiagnosticStatus {
            level: Level::Stale,
            name: "st0/motor1".to_owned(),
            message: "FAULT_OVER: over voltage".to_owned(),
            hardware_id: "/dev/ttyACM0".to_owned(),
            values: vec![("state".to_owned(), "FAULT_OVER".to_owned())],
        };
        returns(DiagnosticArray { stamp, status: vec![status] });
        returns(Log {
            stamp,
            severity: Severity::Warn,
            name: "st0".to_owned(),
            message: "the port is open again".to_owned(),
            by: "web".to_owned(),
            kind: "back".to_owned(),
        });
    }

    #[test]
    fn a_time_is_written_as_in_rfc_3339() {
        let text = |seconds: u64| Time(seconds * NANOS + 250_999_999).text();
        assert_eq!(text(0), "1970-01-01T00:00:00.250Z");
        assert_eq!(text(951_782_399), "2000-02-28T23:59:59.250Z");
        assert_eq!(text(951_782_400), "2000-02-29T00:00:00.250Z");
        assert_eq!(text(1_795_442_709), "2026-11-23T14:05:09.250Z");
    }

    #[test]
    fn a_definition_has_the_types_that_it_uses_behind_lines_of_80_characters() {
        let text = JointState::definition();
        let rule = "=".repeat(80);
        let parts: Vec<&str> = text.split(&format!("{rule}\n")).collect();
        assert_eq!(parts.len(), 3);
        assert_eq!(
            parts[1],
            "MSG: std_msgs/Header\nbuiltin_interfaces/Time stamp\nstring frame_id\n"
        );
        assert_eq!(parts[2], "MSG: builtin_interfaces/Time\nint32 sec\nuint32 nanosec\n");
    }
}
