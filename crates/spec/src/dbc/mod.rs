//! DBC files of the RMD protocol.
//!
//! A motor's request and its reply have the same identifier, and a DBC file can describe an
//! identifier only once. So there is a file for each [`Direction`]. In both, a message is multiplexed
//! on DATA\[0\], the code of the command.
//!
//! The text is ASCII: programs read DBC files as Windows-1252 or as UTF-8.

mod signals;
mod text;

use std::fmt::{self, Display};

use motorlink_proto::rmd::{
    COMMANDS, Direction, MotorId, MotorSet, Payload, SetTorque4, TORQUE4_ID, Version,
};

use crate::rmd::{name, opposite, plural};
use signals::{Multiplexed, Signal, of_commands, of_field};
use text::{ascii, quoted};

/// The version of the protocol.
const VERSION: &str = Version::V1_62.name();
/// The multiplexer: DATA\[0\].
const COMMAND: &str = "command";
/// The node that sends requests.
const HOST: &str = "Host";
/// A receiver that is not a node of the file.
const NO_NODE: &str = "Vector__XXX";
/// The message to motors 1 to 4.
const TORQUE4: &str = "SetTorque4";

/// The DBC file of one direction: a message for each motor, and in requests the message to motors 1
/// to 4 if one of them is in `motors`.
///
/// ```
/// use motorlink_proto::rmd::{Direction, MotorId, MotorSet};
/// use motorlink_spec::dbc::dbc;
///
/// let motor = MotorSet::from(MotorId::new(1).unwrap());
/// let text = dbc(motor, Direction::DriveToHost);
/// assert!(text.contains("BO_ 321 Motor1_Reply: 8 Motor1"));
/// ```
pub fn dbc(motors: MotorSet, direction: Direction) -> String {
    let mut messages: Vec<Message> = motors.map(|motor| of_motor(motor, direction)).collect();
    if direction == Direction::HostToDrive && !motors.intersection(MotorSet::TORQUE4).is_empty() {
        messages.push(torque4(motors));
    }
    let file = File { motors, direction, messages };
    ascii(&file.to_string())
}

struct File {
    motors: MotorSet,
    direction: Direction,
    messages: Vec<Message>,
}

struct Message {
    id: u16,
    name: String,
    sender: String,
    comment: String,
    multiplexer: Option<Signal>,
    /// Each with its receiver.
    signals: Vec<(Multiplexed, String)>,
}

fn node(motor: MotorId) -> String {
    format!("Motor{motor}")
}

fn of_motor(motor: MotorId, direction: Direction) -> Message {
    let motor_node = node(motor);
    let (sender, receiver, name, of) = match direction {
        Direction::HostToDrive => (HOST.to_owned(), motor_node, "Request", "to"),
        Direction::DriveToHost => (motor_node, HOST.to_owned(), "Reply", "of"),
    };
    let (frames, others) = (plural(direction), plural(opposite(direction)));
    let comment = format!(
        "RMD {VERSION}: {frames} {of} motor {motor}. The {others} have the same identifier; this \
         message does not describe them"
    );
    let signals = of_commands(direction).into_iter();
    Message {
        id: motor.can_id(),
        name: format!("{}_{name}", node(motor)),
        sender,
        comment,
        multiplexer: Some(multiplexer()),
        signals: signals.map(|signal| (signal, receiver.clone())).collect(),
    }
}

/// The code of the command, with a word for each.
fn multiplexer() -> Signal {
    let each = COMMANDS.iter();
    let meanings = each.map(|row| {
        let (code, does, paragraph) = (row.code.number(), row.code.doc(), row.paragraph);
        format!("{code:#04X} {}: {does} (3, {paragraph})", row.stem)
    });
    Signal {
        name: COMMAND.to_owned(),
        start: 0,
        bits: 8,
        signed: false,
        digit: 1.0,
        least: 0.0,
        most: u8::MAX.into(),
        unit: "",
        words: COMMANDS.iter().map(|row| (row.code.number().into(), row.stem.to_owned())).collect(),
        comment: format!("The command. {}", meanings.collect::<Vec<_>>().join("; ")),
    }
}

fn torque4(motors: MotorSet) -> Message {
    let each = SetTorque4::FIELDS.iter().zip(MotorSet::TORQUE4);
    let signals = each.flat_map(|(field, motor)| {
        let receiver = if motors.contains(motor) { node(motor) } else { NO_NODE.to_owned() };
        let signals = of_field(field, field.name, field.doc.to_owned());
        signals
            .into_iter()
            .map(move |signal| (Multiplexed { signal, codes: Vec::new() }, receiver.clone()))
    });
    Message {
        id: TORQUE4_ID,
        name: TORQUE4.to_owned(),
        sender: HOST.to_owned(),
        comment: format!(
            "RMD {VERSION}: torque currents for motors 1 to 4 (4, Multiple motor torque closed loop \
             control commands). Each motor answers as to set_torque"
        ),
        multiplexer: None,
        signals: signals.collect(),
    }
}

impl Display for File {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let frames = plural(self.direction);
        writeln!(
            f,
            "VERSION \"motorlink RMD {VERSION} {frames}\"\n\nNS_ :\n\tCM_\n\tVAL_\n\tSG_MUL_VAL_\n\nBS_:\n"
        )?;
        write!(f, "BU_: {HOST}")?;
        self.motors.into_iter().try_for_each(|motor| write!(f, " {}", node(motor)))?;
        writeln!(f)?;
        self.messages.iter().try_for_each(|message| message.definition(f))?;
        writeln!(f)?;
        let name = name(opposite(self.direction));
        writeln!(
            f,
            "CM_ {};",
            quoted(&format!(
                "RMD motor control protocol over CAN, {VERSION}: {frames} only. Request and reply of a \
                 motor have the same identifier and the same codes, so they need two files: \
                 motorlink spec dbc --direction {name} writes the other one"
            ))
        )?;
        self.messages.iter().try_for_each(|message| message.comments(f))?;
        self.messages.iter().try_for_each(|message| message.words(f))?;
        self.messages.iter().try_for_each(|message| message.ranges(f))
    }
}

impl Message {
    fn signals(&self) -> impl Iterator<Item = &Signal> {
        self.multiplexer.iter().chain(self.signals.iter().map(|(signal, _)| &signal.signal))
    }

    fn definition(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        writeln!(f, "\nBO_ {} {}: 8 {}", self.id, self.name, self.sender)?;
        if let Some(multiplexer) = &self.multiplexer {
            // Every signal has the same receiver.
            let receiver = self.signals.first().map_or(NO_NODE, |(_, receiver)| receiver);
            multiplexer.definition(f, " M", receiver)?;
        }
        self.signals.iter().try_for_each(|(Multiplexed { signal, codes }, receiver)| {
            let mark = codes.first().map_or_else(String::new, |code| format!(" m{code}"));
            signal.definition(f, &mark, receiver)
        })
    }

    fn comments(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        writeln!(f, "CM_ BO_ {} {};", self.id, quoted(&self.comment))?;
        self.signals().try_for_each(|signal| {
            writeln!(f, "CM_ SG_ {} {} {};", self.id, signal.name, quoted(&signal.comment))
        })
    }

    fn words(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.signals().filter(|signal| !signal.words.is_empty()).try_for_each(|signal| {
            write!(f, "VAL_ {} {}", self.id, signal.name)?;
            signal.words.iter().try_for_each(|(n, word)| write!(f, " {n} {}", quoted(word)))?;
            writeln!(f, " ;")
        })
    }

    /// The codes that each signal belongs to. Some programs read all of them here, if one signal has
    /// several.
    fn ranges(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let multiplexed = self.signals.iter().filter(|(signal, _)| !signal.codes.is_empty());
        for (Multiplexed { signal, codes }, _) in multiplexed {
            let mut ranges: Vec<(u8, u8)> = Vec::new();
            for &code in codes {
                match ranges.last_mut() {
                    Some((_, last)) if last.checked_add(1) == Some(code) => *last = code,
                    _ => ranges.push((code, code)),
                }
            }
            let ranges: Vec<String> =
                ranges.iter().map(|(first, last)| format!("{first}-{last}")).collect();
            let (id, name) = (self.id, &signal.name);
            writeln!(f, "SG_MUL_VAL_ {id} {name} {COMMAND} {};", ranges.join(", "))?;
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_file_is_ascii_and_has_each_line_once() {
        for direction in [Direction::HostToDrive, Direction::DriveToHost] {
            let text = dbc(MotorSet::ALL, direction);
            assert!(text.is_ascii());
            let mut lines: Vec<&str> =
                text.lines().filter(|line| !line.is_empty() && !line.starts_with(' ')).collect();
            let count = lines.len();
            lines.sort_unstable();
            lines.dedup();
            assert_eq!(lines.len(), count);
        }
    }

    #[test]
    fn names_fit_tools_that_take_32_letters() {
        for direction in [Direction::HostToDrive, Direction::DriveToHost] {
            for message in MotorSet::ALL.map(|motor| of_motor(motor, direction)) {
                let names = message.signals().map(|signal| &signal.name).chain([&message.name]);
                names.for_each(|name| assert!(name.len() <= 32, "{name}"));
            }
        }
    }

    #[test]
    fn only_requests_have_the_message_to_four_motors() {
        let with = |ids: &[u8], direction| {
            let motors = ids.iter().filter_map(|id| MotorId::new(*id)).collect();
            dbc(motors, direction).contains("BO_ 640 SetTorque4: 8 Host")
        };
        assert!(with(&[4, 9], Direction::HostToDrive));
        assert!(!with(&[4, 9], Direction::DriveToHost));
        assert!(!with(&[5], Direction::HostToDrive));
        let four = dbc(MotorId::new(2).into_iter().collect(), Direction::HostToDrive);
        assert!(four.contains(" SG_ iq_1 : 0|16@1- (0.016,0) [-32|32] \"A\" Vector__XXX"));
        assert!(four.contains(" SG_ iq_2 : 16|16@1- (0.016,0) [-32|32] \"A\" Motor2"));
    }
}
